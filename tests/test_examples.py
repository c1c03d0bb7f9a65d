"""The examples run as they are, and come to the truth that was simulated."""

import runpy
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import lab
from lab.files.document import read_document

EXAMPLES = Path(__file__).parent.parent / "examples"
TRIED = ("simulate", "identify", "diagnose", "place", "study", "convert")


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    """A working folder in which simulate.py has run, and the names that this left."""
    folder = tmp_path_factory.mktemp("examples")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        return folder, runpy.run_path(str(EXAMPLES / "simulate.py"), run_name="__main__")


@pytest.fixture
def run(simulated, monkeypatch):
    """Runs an example in that folder and gives the names that it leaves."""
    monkeypatch.chdir(simulated[0])
    return lambda name: runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")


def test_simulate_and_identify(run, simulated):
    truth = simulated[1]["rig"]
    found = run("identify")["found"]
    # Error bars are honest: four standard deviations, one chance in ten thousand for each of the numbers.
    error = found.modes.frequency_hz - truth.modes().frequency_hz
    assert np.all(np.abs(error) < 4 * found.modes.frequency_std)
    known = truth.second_order()
    order = [known.dofs.index(dof) for dof in found.second_order.dofs]
    error = found.second_order.stiffness - known.stiffness[np.ix_(order, order)]
    assert np.all(np.abs(error) < 4 * found.second_order.stiffness_std)


@pytest.mark.slow
def test_convert(run, simulated):
    result = run("convert")["result"]
    truth = simulated[1]["rig"].modes()
    error = result.modes.frequency_hz - truth.frequency_hz
    assert np.all(np.abs(error) < 4 * result.modes.frequency_std)
    again = lab.read_foreign("modes.uff").modes
    # A universal file keeps six digits.
    np.testing.assert_allclose(again.frequency_hz, result.modes.frequency_hz, rtol=1e-5)
    assert read_document("out/my_test/result.json", form="modal-result", version=1)["method"] == "okid_era"


@pytest.mark.slow
def test_diagnose(run):
    diagnosis = run("diagnose")["diagnosis"]
    (finding,) = diagnosis.findings
    assert (diagnosis.verdict, finding.effect.cause) == ("explained", "cubic_stiffness")
    k3 = finding.parameters["k3"]
    assert abs(k3.value - 3.0) < 4 * k3.std  # as above
    assert lab.Rig.load("extended.xml").springs


def test_place(run):
    best = run("place")["best"]
    assert best.proven
    assert (len(best.sensors), len(best.actuators)) == (5, 4)
    rig = lab.load_model("truss").connected(inputs=best.actuators, outputs=best.sensors)
    read, driven = ({channel.dof for channel in side} for side in (rig.outputs, rig.inputs))
    # What M, C and K ask for: a sensor or an actuator everywhere, and both in one place.
    assert read | driven == set(rig.dofs)
    assert len(read & driven) == 1


@pytest.mark.slow
def test_study(run, monkeypatch):
    # Threads instead of processes, which take ten seconds to come up.
    with ThreadPoolExecutor(2) as pool:
        monkeypatch.setattr(lab, "study", partial(lab.study, executor=pool))
        outcome = run("study")["outcome"]
    error = outcome["stiffness_error"].value
    # The same noise ten times as strong, and errors to first order in it: the next order is as small as they are.
    assert error[1] / error[0] == pytest.approx(10, rel=0.1)
    assert error[2] / error[1] == pytest.approx(10, rel=0.5)


def test_every_example_is_tried_and_short():
    own = {path.stem for path in EXAMPLES.glob("*.py")} - {"lumo_tower"}  # needs data from elsewhere
    assert own == set(TRIED)
    for name in TRIED:
        assert len((EXAMPLES / f"{name}.py").read_text("utf-8").splitlines()) <= 30
