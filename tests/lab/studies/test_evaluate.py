"""One run of a study is what `lab run` would give, and its score follows from its documents."""

import json
import tomllib
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from lab.diagnosis.outcome import Quantity
from lab.effects import EFFECTS
from lab.files.results import load_result
from lab.run import run
from lab.scenario import load_scenario, make_scenario
from lab.studies.collect import DOCUMENTS, RESULT_KEYS, picked
from lab.studies.evaluate import CollectError, Task, perform
from lab.studies.plan import Run
from lab.studies.score import scored_diagnosis
from tests.lab.studies.small import SCENARIO

TABLE = tomllib.loads(SCENARIO)
BOTH = {**TABLE, "channels": {}, "identification": {"method": "era", "order": 6}, "criteria": {"modes": 3}}


def performed(table=TABLE, collect=(), **setting):
    task = Task(table, "", dict(collect))
    return json.loads(perform(task, [Run(4, setting, 11)])[0])


@pytest.fixture(scope="module")
def both(tmp_path_factory):
    """The score of a run with matrices, and what `lab run` writes about the same test."""
    out = tmp_path_factory.mktemp("both") / "out"
    run(make_scenario({**BOTH, "seed": 11}), out)
    return performed(BOTH, {"f2": "result.modes.1.frequency_hz", "method": "result.method"}), load_result(
        out / "result.json"
    )


def test_a_run_is_that_of_lab_run_to_the_last_bit(both):
    outcome, document = both
    assert (outcome["run"], outcome["seed"]) == (4, 11)
    assert outcome["score"]["collected"] == {"f2": document["modes"][1]["frequency_hz"], "method": "era"}
    pairs = document["comparison"]["pairs"]
    assert outcome["score"]["frequency_error"] == [pair["frequency_error"] for pair in pairs]
    assert outcome["score"]["damping_error"] == [pair["damping_error"] for pair in pairs]
    assert outcome["score"]["stiffness_error"] == document["comparison"]["stiffness_error"]


def test_a_refined_run_is_that_of_lab_run_too(both, tmp_path):
    table = {**BOTH, "identification": {**BOTH["identification"], "refine": True}}
    run(make_scenario({**table, "seed": 11}), tmp_path / "out")
    likelihood = load_result(tmp_path / "out/result.json")["refinement"]["log_likelihood"]
    collect = {"refined": "result.refinement.log_likelihood"}
    assert performed(table, collect)["score"]["collected"] == {"refined": likelihood}
    # No method alone has a refinement.
    assert both[1]["refinement"] is None


def test_the_score_follows_from_the_documents(both):
    score, document = both[0]["score"], both[1]
    truth, modes = document["truth"]["modes"], document["modes"]
    for i, mode in enumerate(truth):
        found = next(p["estimate"] for p in document["comparison"]["pairs"] if p["truth"] == i)
        assert score["frequency_std"][i] == modes[found]["frequency_std"] / mode["frequency_hz"]
        assert score["damping_std"][i] == modes[found]["damping_std"] / mode["damping_ratio"]
    assert (score["modes_found"], score["modes_extra"], score["criteria_met"]) == (1.0, 0, True)
    for ours, theirs in (("mass", "mass"), ("damping_matrix", "damping"), ("stiffness", "stiffness")):
        found, true = document["second_order"], document["truth"]["second_order"]
        assert found["dofs"] == true["dofs"]
        inside = [
            abs(found[theirs][i][j] - true[theirs][i][j]) < 2 * found[f"{theirs}_std"][i][j]
            for i in range(3)
            for j in range(i, 3)
        ]
        assert score[f"{ours}_covered"] == np.mean(inside)


def test_the_keys_of_documents_are_known(both):
    assert set(RESULT_KEYS) | {"format", "version", "title"} == set(both[1])
    assert "verdict" in DOCUMENTS["diagnosis"]


def test_a_failing_run_says_why_and_no_more():
    outcome = performed(**{"identification.order": 60})
    assert outcome["error"].startswith("OrderError: ")
    assert "\n" not in outcome["error"]
    assert "score" not in outcome


def test_batches_do_not_show():
    task = Task(TABLE, "", {})
    runs = [Run(k, {"instruments.noise_percent": 1.0 + k}, k) for k in range(3)]
    together = [json.loads(line)["score"] for line in perform(task, runs)]
    assert together == [json.loads(perform(task, [each])[0])["score"] for each in reversed(runs)][::-1]


def test_what_is_not_there_is_none_and_tables_are_refused():
    documents = {"result": {"modes": [{"frequency_hz": 1.5}], "second_order": None, "stable": True}}
    assert picked(documents, "result.modes.0.frequency_hz") == 1.5
    assert picked(documents, "result.stable") == 1.0
    for path in (
        "result.modes.7.frequency_hz",
        "result.second_order.mass",
        "diagnosis.verdict",
        "result.modes.0.x",
    ):
        assert picked(documents, path) is None
    with pytest.raises(CollectError, match="go on with one of 0 to"):
        performed(collect={"a": "result.modes"})


@pytest.mark.slow
def test_a_diagnosed_run_names_what_was_hidden():
    table = tomllib.loads(load_scenario("chain3_hardening").text)
    table["test"]["duration"] = 100.0
    collect = {
        "gain": "diagnosis.findings.0.log_evidence_gain",
        "found": "diagnosis.findings.0.parameters.k3.value",
    }
    score = performed(table, collect)["score"]
    assert (score["verdict"], score["verdict_right"], score["named_rightly"]) == ("explained", True, True)
    own = score["collected"]
    assert score["parameter_error"] == [(own["found"] - 3.0) / 3.0]
    # Normal errors stay below four standard deviations in all but one of 16 000 tests.
    assert abs(score["parameter_deviation"][0]) < 4
    # The spring is hard to miss, as the scenario itself requires.
    assert own["gain"] > 10


def test_what_a_diagnosis_is_worth():
    hidden = EFFECTS["cubic_stiffness"](location="spring2_3", k3=2.0)
    finding = SimpleNamespace(effect=replace(hidden, k3=2.5), parameters={"k3": Quantity(2.5, 0.2, "N/m^3")})
    found = SimpleNamespace(verdict="explained", findings=(finding,))
    score = scored_diagnosis(found, [hidden], True)
    assert score["named_rightly"]
    assert score["parameter_error"] == [0.25]
    assert score["parameter_deviation"] == [0.5 / 0.2]
    other = SimpleNamespace(effect=replace(hidden, location="spring1_2"), parameters={})
    assert not scored_diagnosis(SimpleNamespace(verdict="", findings=(finding, other)), [hidden], False)[
        "named_rightly"
    ]
    missed = scored_diagnosis(SimpleNamespace(verdict="consistent", findings=()), [hidden], False)
    assert (missed["named_rightly"], missed["parameter_error"], missed["parameter_deviation"]) == (
        False,
        [None],
        [None],
    )
    assert scored_diagnosis(SimpleNamespace(verdict="consistent", findings=()), [], True)["named_rightly"]
