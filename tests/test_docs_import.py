"""What docs/import.md shows is true: its commands run, its recipes are sound."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

import lab
from identification.response import FrequencyResponse
from lab.cli import main
from lab.files.document import read_document
from lab.files.exporting_points import load_points
from lab.files.recipe import parse_recipe
from lab.files.recording_responses import save_responses
from tests.lab import universal
from tests.tutorial import blocks

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "docs" / "import.md").read_text("utf-8")


@pytest.fixture
def rig(tmp_path, monkeypatch):
    """A working folder with the universal file of a simulated test, in g and N, and the rig behind it."""
    rig = lab.Rig.load(ROOT / "models" / "chain3_uncoupled.xml")
    rig = rig.connected(inputs=["force1", "force2"], outputs=["acc2.x", "acc3.x"])
    recording = lab.simulate(rig, lab.EXCITATIONS["pulse"](amplitude=1.0), sample_rate=20.0, duration=10.0)
    sets = []
    for record in recording.records:
        t = np.arange(record.n_samples) / 20.0
        for node, force in zip((1, 2), record.inputs, strict=True):
            sets.append(universal.function(force, t, node=node, direction=1, type=13, label="N", binary="<"))
        for node, reading in zip((2, 3), record.outputs / 9.80665, strict=True):
            sets.append(universal.function(reading, t, node=node, direction=1, label="g", binary=">"))
    (tmp_path / "my_test.uff").write_bytes(b"".join(sets))
    save_responses(analysed(rig), tmp_path / "frf.h5")
    lab.export_file(tmp_path / "frf.h5", tmp_path / "my_frf.uff", what="data")
    for name, line in (("my_recipe.toml", 'column = "force 1+X"'), ("my_dofs.toml", 'name = "force 1+X"')):
        (tmp_path / name).write_text(next(block for block in blocks(PAGE, "toml") if line in block))
    monkeypatch.chdir(tmp_path)
    return rig


def analysed(rig):
    """Frequency responses as an analyser measures them, with noise of 0.1 % of their RMS."""
    f, system, rng = 0.002 * np.arange(20, 400), rig.state_space(), np.random.default_rng(1)
    s = 2j * np.pi * f[:, None, None] * np.eye(system.n_states)
    H = (
        system.C @ np.linalg.solve(s - system.A, np.broadcast_to(system.B, (f.size, *system.B.shape)))
        + system.D
    )
    noise = rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape)
    H = H + 1e-3 * np.sqrt(np.mean(np.abs(H) ** 2) / 2) * noise
    return FrequencyResponse(f, H, 0.0, rig.inputs, rig.outputs)


@pytest.mark.slow
def test_the_commands_run_and_find_modes_and_matrices(rig, capsys):
    commands = [line for block in blocks(PAGE, "sh") for line in block.splitlines()]
    assert len(commands) == 11
    for command in commands:
        typed, _, remark = command.partition("#")
        with pytest.raises(SystemExit) as ended:
            main(shlex.split(typed)[1:])
        assert ended.value.code == (2 if "exit status 2" in remark else 0), capsys.readouterr().err
    start = Path("start.toml").read_text("utf-8")
    assert "acceleration 2+X" in start
    truth = rig.modes()
    matrices = read_document("out/with_dofs_modes/result.json", form="modal-result", version=1)[
        "second_order"
    ]
    order = [matrices["dofs"].index(dof) for dof in ("x1", "x2", "x3")]
    # Each entry follows from the squares of poles that are known to 1e-5.
    np.testing.assert_allclose(
        np.array(matrices["stiffness"])[np.ix_(order, order)], rig.second_order().stiffness, rtol=1e-4
    )
    found = read_document("out/my_test/result.json", form="modal-result", version=1)["modes"]
    known = read_document("known_modes.json", form="modal-result", version=1)["modes"]
    # Simulated to a relative 1e-9 or so, through which ERA sees the poles to 1e-6; the universal file keeps six digits.
    for k in range(3):
        assert found[k]["frequency_hz"] == pytest.approx(truth.frequency_hz[k], rel=1e-5)
        assert known[k]["frequency_hz"] == pytest.approx(truth.frequency_hz[k], rel=2e-5)
        assert known[k]["damping_ratio"] == pytest.approx(truth.damping_ratio[k], rel=2e-4)
        shape = np.array([complex(*value) for value in known[k]["shape"].values()])
        ratio = truth.shapes[1, k] / truth.shapes[0, k]
        assert shape[1] / shape[0] == pytest.approx(ratio, rel=1e-4)
    analysed = read_document("out/my_frf_modes/result.json", form="modal-result", version=1)["modes"]
    assert [mode["frequency_hz"] for mode in analysed] == pytest.approx(truth.frequency_hz.tolist(), rel=1e-3)
    (program,) = blocks(PAGE, "python")
    names = {}
    exec(program, names)
    # Noise of a thousandth of the responses, on some hundred lines: parts in ten thousand of these wide resonances.
    assert names["modes"].frequency_hz == pytest.approx(truth.frequency_hz, rel=1e-3)
    a, b = lab.load_recording("my_test.h5"), lab.load_recording("from_table.h5")
    for one, two in zip(a.records, b.records, strict=True):
        np.testing.assert_array_equal(one.outputs, two.outputs)
        np.testing.assert_array_equal(one.inputs, two.inputs)


def test_the_recipes_are_sound(tmp_path):
    tables = blocks(PAGE, "toml")
    assert len(tables) == 5
    for table in tables:
        if "[channels]" in table:
            (tmp_path / "points.toml").write_text(table)
            assert load_points(tmp_path / "points.toml").geometry.lines == ((1, 2),)
        else:
            parse_recipe(table)


def test_links_lead_somewhere():
    for target in re.findall(r"\]\(([^)#]+)\)", PAGE):
        assert (ROOT / "docs" / target).exists(), target
