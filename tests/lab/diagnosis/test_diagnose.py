"""A hidden effect is found: MuJoCo makes the data, the fast twin explains them, and neither knows the other's numerics."""

from dataclasses import replace

import numpy as np
import pytest

from lab.diagnosis.diagnose import diagnose
from lab.diagnosis.outcome import CONSISTENT, EXPLAINED
from lab.effects import EFFECTS
from lab.errors import LabError
from lab.excitation import FreeDecay, Random
from lab.instruments import instrument
from lab.rig import Rig
from lab.simulate import simulate

NOISE = 1.0


@pytest.fixture(scope="module")
def rig():
    rig = Rig.load("models/chain3_coupled.xml")
    return rig.connected(inputs=["force1", "force2"], outputs=["acc1.x", "acc2.x", "acc3.x"])


def measured(rig, seed=1):
    return simulate(
        instrument(rig, noise_percent=NOISE), Random(rms=1.0), sample_rate=5.0, duration=400.0, seed=seed
    )


def test_a_true_model_is_consistent(rig):
    diagnosis = diagnose(measured(rig), rig)
    assert diagnosis.verdict == CONSISTENT
    assert diagnosis.findings == ()
    # Nothing is left but the noise that was put in; 2000 samples know its level to a few percent.
    assert diagnosis.errors.calibrated == pytest.approx(NOISE / 100, rel=0.1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cause", "location", "size"),
    [
        ("mass_change", "mass2", {"delta_mass": 0.2}),
        ("cubic_stiffness", "spring2_3", {"k3": 2.0}),
        ("sensor_gain", "acc3.x", {"relative_change": -0.1}),
        ("actuator_delay", "force2", {"delay": 0.2}),
    ],
)
def test_a_hidden_effect_is_named_and_the_extended_model_is_consistent(rig, cause, location, size):
    recording = measured(EFFECTS[cause](location, **size).apply(rig), seed=2)
    diagnosis = diagnose(recording, rig)
    assert diagnosis.verdict == EXPLAINED
    (finding,) = diagnosis.findings
    assert (finding.effect.cause, finding.effect.location) == (cause, location)
    for name, value in size.items():
        found = finding.parameters[name]
        # Four standard deviations: one chance in ten thousand.
        assert abs(found.value - value) < 4 * found.std
    assert diagnosis.errors.extended < 0.5 * diagnosis.errors.nominal
    assert diagnosis.errors.extended == pytest.approx(NOISE / 100, rel=0.15)
    again = diagnose(recording, Rig.from_xml(diagnosis.extended.xml).with_chain(diagnosis.extended.chain))
    assert again.verdict == CONSISTENT


def test_a_withheld_cause_is_not_misnamed_as_explained(rig):
    recording = measured(EFFECTS["sensor_swap"]("acc1.x|acc2.x").apply(rig), seed=3)
    others = {name: kind for name, kind in EFFECTS.items() if name == "line_hum"}
    assert diagnose(recording, rig, effects=others).verdict == "unexplained"


def test_a_change_that_may_not_be_named_is_not_calibrated_away(rig):
    recording = measured(EFFECTS["stiffness_change"]("spring1_2", relative_change=0.3).apply(rig), seed=4)
    diagnosis = diagnose(recording, rig, effects={"line_hum": EFFECTS["line_hum"]})
    assert diagnosis.verdict == "unexplained"
    assert diagnosis.findings == ()
    assert "stiffness change at spring1_2 that is out of the model's tolerance" in diagnosis.warnings[-1]


def test_data_without_forces_are_refused(rig):
    decay = simulate(rig, FreeDecay({"x1": 0.1}), sample_rate=5.0, duration=40.0)
    pushed = replace(decay, records=(replace(decay.records[0], kind="random"),))
    with pytest.raises(LabError, match="no measured input"):
        diagnose(pushed, rig)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cause", "location", "size"),
    [("mass_change", "mass2", {"delta_mass": 0.1}), ("coulomb_friction", "x1", {"force": 5e-4})],
)
def test_a_free_decay_tells_a_cause_from_any_start(rig, cause, location, size):
    bare = rig.connected(inputs=[], outputs=["acc1.x", "acc2.x", "acc3.x"])
    recording = simulate(
        instrument(EFFECTS[cause](location, **size).apply(bare), noise_percent=NOISE),
        FreeDecay({"x1": 0.01, "x3": 0.01}),
        sample_rate=10.0,
        duration=100.0,
        seed=1,
    )
    diagnosis = diagnose(recording, bare)
    assert diagnosis.verdict == EXPLAINED
    (finding,) = diagnosis.findings
    assert (finding.effect.cause, finding.effect.location) == (cause, location)
    for name, value in size.items():
        found = finding.parameters[name]
        # Four standard deviations: one chance in ten thousand.
        assert abs(found.value - value) < 4 * found.std


def test_a_record_that_does_not_begin_at_rest_is_noticed(rig):
    recording = measured(rig)
    late = replace(
        recording,
        records=(
            replace(
                recording.records[0],
                inputs=np.asarray(recording.records[0].inputs)[:, 200:],
                outputs=np.asarray(recording.records[0].outputs)[:, 200:],
            ),
        ),
    )
    diagnosis = diagnose(late, rig)
    assert diagnosis.verdict == CONSISTENT
    # Nothing but noise is left, from the first sample on.
    assert diagnosis.errors.calibrated == pytest.approx(NOISE / 100, rel=0.1)


@pytest.mark.parametrize("share", [0.01, 0.9])
def test_missing_samples_are_left_out(rig, share):
    recording = measured(rig)
    outputs = np.array(recording.records[0].outputs)
    n = int(0.7 * outputs.shape[1])
    outputs[1, 20 : 20 + int(share * n)] = np.nan
    holed = replace(recording, records=(replace(recording.records[0], outputs=outputs),))
    diagnosis = diagnose(holed, rig)
    assert (diagnosis.verdict, diagnosis.findings) == (CONSISTENT, ())
    # A tenth of the samples tell a level to a tenth of it, or better.
    whole = diagnose(recording, rig).noise
    for name, level in diagnosis.noise.items():
        assert level.value == pytest.approx(whole[name].value, rel=0.35)


def test_an_output_that_never_changes_is_left_out(rig):
    recording = measured(rig)
    outputs = np.array(recording.records[0].outputs)
    outputs[1] = 0.0
    diagnosis = diagnose(replace(recording, records=(replace(recording.records[0], outputs=outputs),)), rig)
    assert diagnosis.verdict == CONSISTENT
    name = recording.outputs[1].name
    assert diagnosis.unlearnable[0] == f"output {name} never changes: it was left out; check the channel"
    assert name not in [channel.name for channel in diagnosis.nominal.outputs]
