"""Statistics of studies: held against plain loops over made-up runs, and against probability theory."""

import json
import math

import h5py
import numpy as np
import pytest

from lab.studies import journal, table
from lab.studies.axes import Axis
from lab.studies.plan import Study
from lab.studies.statistics import share_interval, statistics
from lab.studies.table import columns_of, write_table

N_POINTS, REPEATS = 3, 7


def made_up(rng):
    """Outcomes of all runs in the order in which they might finish; some failed, some found less."""
    for number in rng.permutation(N_POINTS * REPEATS):
        outcome = {"run": int(number), "seed": int(rng.integers(2**63)), "seconds": float(rng.random())}
        if number % 5 == 4:
            yield {**outcome, "error": "TooShortError: too short"}
            continue
        found = [None if rng.random() < 0.2 else float(x) for x in rng.standard_normal(2)]
        std = [None if x is None else float(rng.random()) for x in found]
        yield {
            **outcome,
            "score": {
                "frequency_error": found,
                "frequency_std": std,
                "named_rightly": bool(rng.random() < 0.5),
                "verdict": "explained",
                "parameter_deviation": [] if number % 2 else [float(rng.standard_normal())],
                "mass_error": None,
                "collected": {"a": float(rng.random()), "b": None},
            },
        }


@pytest.fixture(scope="module")
def filed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("filed")
    study = Study(
        "made up", {"model": "chain3_uncoupled.xml"}, folder, (Axis(("a.b",), ((1, 2, 3),)),), REPEATS
    )
    outcomes = list(made_up(np.random.default_rng(3)))
    book = folder / journal.NAME
    book.write_text("{}\n" + "".join(json.dumps(each) + "\n" for each in outcomes), encoding="utf-8")
    columns = columns_of(book)
    write_table(folder / "study.h5", study, book, columns)
    with h5py.File(folder / "study.h5") as file:
        yield file, outcomes, {each.name: each for each in statistics(file)}, columns


def test_the_table_holds_what_the_journal_says(filed):
    file, outcomes, _, columns = filed
    runs = file["runs"]
    for outcome in outcomes:
        k, score = outcome["run"], outcome.get("score", {})
        assert (runs["seed"][k], runs["seconds"][k]) == (outcome["seed"], outcome["seconds"])
        assert (runs["point"][k], runs["repeat"][k]) == (k % N_POINTS, k // N_POINTS)
        assert runs["error"].asstr()[k] == outcome.get("error", "")
        assert runs["verdict"].asstr()[k] == score.get("verdict", "")
        wanted = [math.nan if x is None else x for x in score.get("frequency_error", [None, None])]
        np.testing.assert_array_equal(runs["frequency_error"][k], wanted)
        np.testing.assert_array_equal(runs["collected/a"][k], score.get("collected", {}).get("a", math.nan))
    assert columns.n_failed == sum("error" in each for each in outcomes) == 4
    assert columns.errors == {"TooShortError: too short": 4}
    assert "collected/a" in columns.present
    assert "collected/b" not in columns.present
    assert list(file["points/a.b"]) == [1, 2, 3]


def per_run(outcomes, point, quantity):
    """What each run of a point has, by a loop."""
    scores = [each["score"] for each in outcomes if each["run"] % N_POINTS == point and "score" in each]
    return [q for q in map(quantity, scores) if q is not None]


def covered(score):
    pairs = [
        (e, s) for e, s in zip(score["frequency_error"], score["frequency_std"], strict=True) if e is not None
    ]
    return sum(abs(e) < 2 * s for e, s in pairs) / len(pairs) if pairs else None


def squared(score):
    values = [e**2 for e in score["frequency_error"] if e is not None]
    return sum(values) / len(values) if values else None


QUANTITIES = {
    "named_rightly": lambda score: float(score["named_rightly"]),
    "frequency_covered": covered,
    "frequency_error": squared,
    "parameter_covered": lambda score: float(abs(d[0]) < 2) if (d := score["parameter_deviation"]) else None,
    "collected/a": lambda score: score["collected"]["a"],
}


@pytest.mark.parametrize("name", QUANTITIES)
def test_statistics_are_those_of_a_plain_loop(filed, name):
    _, outcomes, found, _ = filed
    for point in range(N_POINTS):
        x = np.array(per_run(outcomes, point, QUANTITIES[name]))
        mean, half = np.mean(x), 2 * np.std(x, ddof=1) / math.sqrt(len(x))
        root = np.sqrt if found[name].kind == "rms" else np.asarray
        # Sums of a few numbers in another order differ by rounding alone.
        assert found[name].n[point] == len(x)
        np.testing.assert_allclose(found[name].value[point], root(mean), rtol=1e-13)
        if found[name].kind in ("rms", "mean"):
            ends = [
                root(max(mean - half, 0)) if found[name].kind == "rms" else mean - half,
                root(mean + half),
            ]
            np.testing.assert_allclose([found[name].low[point], found[name].high[point]], ends, rtol=1e-12)


def test_what_no_run_has_is_no_statistic(filed):
    assert not {"mass_error", "collected/b", "verdict"} & set(filed[2])


@pytest.mark.parametrize("p", [0.05, 0.5, 0.95])
def test_share_intervals_hold_the_probability(p):
    n = 100
    k = np.arange(n + 1)
    logs = [math.lgamma(n + 1) - math.lgamma(j + 1) - math.lgamma(n - j + 1) for j in k]
    probability = np.exp(np.array(logs) + k * math.log(p) + (n - k) * math.log(1 - p))
    low, high = share_interval(k / n, np.full(n + 1, n))
    # Exact coverage of the interval; the steps of a binomial of 100 trials let it stray by about 2 % from nominal.
    assert abs(probability[(low <= p) & (p <= high)].sum() - 0.9545) < 0.025


def test_share_intervals_solve_their_equation():
    share, n = np.array([0.0, 0.2, 1.0]), np.array([5.0, 10.0, 3.0])
    for end in share_interval(share, n):
        # The ends are where the share is two standard deviations away.
        np.testing.assert_allclose((share - end) ** 2, 4 * end * (1 - end) / n, atol=1e-14)


def test_blocks_do_not_show(filed, monkeypatch, tmp_path):
    file, outcomes, found, columns = filed
    monkeypatch.setattr(table, "BLOCK", 4)
    monkeypatch.setattr(table, "MAX_BUFFERED", 6)
    study = Study(
        "made up", {"model": "chain3_uncoupled.xml"}, tmp_path, (Axis(("a.b",), ((1, 2, 3),)),), REPEATS
    )
    book = tmp_path / journal.NAME
    book.write_text("{}\n" + "".join(json.dumps(each) + "\n" for each in outcomes), encoding="utf-8")
    write_table(tmp_path / "study.h5", study, book, columns)
    with h5py.File(tmp_path / "study.h5") as other:
        for name in ("seed", "seconds", "error", "frequency_error", "verdict", "collected/a"):
            np.testing.assert_array_equal(other["runs"][name][:], file["runs"][name][:])
        for each in statistics(other):
            # Sums block by block are in another order.
            np.testing.assert_allclose(each.value, found[each.name].value, rtol=1e-13)
