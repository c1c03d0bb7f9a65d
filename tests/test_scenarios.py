"""Every scenario of the catalogue runs and meets its own criteria."""

import json
import time

import pytest

from lab import catalogue
from lab.files.diagnosis import load_diagnosis
from lab.files.recording import load
from lab.run import run
from lab.scenario import load_scenario

SCENARIOS = catalogue.files("scenarios")


def diagnosis_file(folder):
    return folder / "out/diagnosis/diagnosis.json"


@pytest.mark.slow
@pytest.mark.parametrize("path", SCENARIOS.values(), ids=SCENARIOS.keys())
def test_scenario(path, tmp_path):
    started = time.process_time()
    result = run(path, tmp_path / "out")
    # Ten times what the slowest takes on two cores would still be a sign that something is wrong.
    assert time.process_time() - started < 60
    assert result.criteria
    assert not [criterion for criterion in result.criteria if not criterion.passed]
    document = json.loads((tmp_path / "out/result.json").read_text("utf-8"))
    assert [mode["frequency_hz"] for mode in document["modes"]] == list(result.modes.frequency_hz)
    assert load(tmp_path / "out/recording.h5").outputs == result.modes.outputs
    asked = load_scenario(path)
    assert (tmp_path / "out/diagnosis").exists() == (asked.diagnosis is not None)
    if asked.diagnosis is not None:
        named = {(c["cause"], c["location"]) for c in load_diagnosis(diagnosis_file(tmp_path))["findings"]}
        assert named == {(effect.cause, effect.location) for effect in asked.hidden()}


def test_the_founding_scenarios_are_there():
    founding = {"chain3_pulse", "chain3_coupled_pulse", "truss_random", "chain7_ambient", "chain7_short"}
    assert founding <= set(SCENARIOS)
