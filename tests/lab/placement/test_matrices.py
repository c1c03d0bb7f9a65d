"""Target "matrices": information from one pass is that of each layout alone; the truss and its rivals."""

from itertools import combinations

import numpy as np
import pytest

from identification.information import cramer_rao_bound, fisher_information, planned
from identification.layout_information import layout_information
from identification.structures import free_matrices
from lab.errors import LabError
from lab.placement.contest import MEASURES, figure
from lab.placement.place import place
from lab.placement.plan import Plan, driving
from lab.rig import Rig
from lab.scenario import load_scenario

BAND = (1.0, 5.0)


@pytest.fixture(scope="module")
def truss():
    rig = Rig.load("models/truss.xml")
    return rig.connected(outputs=rig.responding)


@pytest.fixture(scope="module")
def paper():
    """The layout of De Angelis et al. (2002), section 5.4: sensors, then actuators."""
    channels = load_scenario("truss_random").channels
    return tuple(channels.outputs), tuple(channels.inputs)


def pick(channels, names):
    return [[channel.name for channel in channels].index(name) for name in names]


@pytest.mark.parametrize("kind", ["random", "pulse"])
def test_one_pass_holds_the_information_of_a_layout_alone(truss, paper, kind):
    plan = Plan(driving(kind, 100.0, band=BAND), 50.0, 4.0)
    signals = plan.signals(truss)
    everything = planned([u for _, u in signals], truss.inputs, truss.outputs, sample_rate=50.0)
    unknown = free_matrices(truss.dofs)
    known = layout_information(truss.second_order(), everything, unknown)
    sensors, actuators = pick(truss.outputs, paper[0]), pick(truss.inputs, paper[1])
    std = np.full((len(signals), len(truss.outputs)), 0.02)
    alone = planned(
        [u[actuators] for _, u in signals],
        [truss.inputs[i] for i in actuators],
        [truss.outputs[i] for i in sensors],
        sample_rate=50.0,
    )
    if kind == "pulse":  # a record in which nothing acts has no place in a recording
        alone = planned(
            [u[actuators] for _, u in signals if np.any(u[actuators])],
            alone.inputs,
            alone.outputs,
            sample_rate=50.0,
        )
    expected = fisher_information(truss.second_order(), alone, noise_std=0.02, parameterization=unknown)
    found = known.of_outputs(actuators, std)[sensors].sum(axis=0)
    scale = np.sqrt(np.diag(expected))
    # The same sums in another order.
    np.testing.assert_allclose(found / scale / scale[:, None], expected / scale / scale[:, None], atol=1e-12)


@pytest.mark.parametrize("criterion", MEASURES)
def test_figures_are_those_of_the_covariance(criterion):
    rows = np.random.default_rng(1).standard_normal((30, 6))
    covariance = np.linalg.inv(rows.T @ rows)
    values = np.linalg.eigvalsh(covariance)
    expected = {
        "a": np.sqrt(np.mean(np.diag(covariance))),
        "d": np.exp(np.mean(np.log(values)) / 2),
        "e": np.sqrt(values[-1]),
    }
    assert figure(rows.T @ rows, criterion) == pytest.approx(expected[criterion], rel=1e-12)
    assert figure(np.diag([1.0, 0.0]), criterion) == np.inf
    assert figure(np.ones((2, 2)), criterion) == np.inf


@pytest.fixture(scope="module")
def ranked(truss, paper):
    scenario = load_scenario("truss_random")
    plan = Plan(scenario.drive(), scenario.test.sample_rate, scenario.test.duration, noise_percent=5.0)
    return place(
        truss, 5, n_actuators=4, target="matrices", quantity="acceleration", plan=plan, planned=paper
    ), plan


def test_every_rival_of_the_papers_layout_is_ranked(truss, ranked):
    placement, _ = ranked
    dofs = set(truss.dofs)
    possible = sum(
        set(sensed) | set(driven) == dofs and bool(set(sensed) & set(driven))
        for sensed in combinations(truss.dofs, 5)
        for driven in combinations(truss.dofs, 4)
    )
    assert placement.proven
    assert (placement.n_layouts, placement.n_possible) == (56 * 70, possible)
    assert placement.figures.size == possible
    assert np.all(np.diff(placement.figures) >= 0)


def test_named_layouts_have_the_bound_of_a_virtual_test_of_their_own(truss, ranked, paper):
    placement, plan = ranked
    ((_, u),) = plan.signals(truss)
    structure = truss.second_order()
    rows = {row.name: row for row in placement.ranking}
    assert (rows["planned"].sensors, rows["planned"].actuators) == paper
    assert rows["best"].rank == 1
    assert rows["worst"].rank == placement.n_possible
    for name in ("best", "planned", "worst"):
        row = rows[name]
        rig = truss.connected(inputs=row.actuators, outputs=row.sensors)
        test = planned([u[pick(truss.inputs, row.actuators)]], rig.inputs, rig.outputs, sample_rate=50.0)
        # Rig.state_space goes through another linearization than M, C, K: an independent route to the signal's RMS.
        signal = rig.state_space().sampled(test.dt).simulate(test.records[0].inputs[:, :])
        std = 0.05 * np.sqrt(np.mean(signal**2, axis=1))
        found = cramer_rao_bound(
            structure, test, noise_std=std, parameterization=free_matrices(rig.dofs)
        ).second_order
        upper = np.triu_indices(8)
        shares = [
            getattr(found, f"{matrix}_std")[upper] / np.max(np.abs(getattr(found, matrix)))
            for matrix in ("mass", "damping", "stiffness")
        ]
        # The worst layout's information is inverted at a condition of up to 1e9.
        assert row.figure == pytest.approx(np.sqrt(np.mean(np.square(shares))), rel=1e-6)
        assert np.isin(True, np.isclose(placement.figures, row.figure, rtol=1e-9))


def test_signals_are_compared_at_the_same_largest_force_and_levels_scale(ranked):
    placement, _ = ranked
    found = {drive.excitation: drive for drive in placement.drives}
    base = found["random as planned, times 1"]
    # The planned test again: one record, whose noise is its own.
    assert base.figure == pytest.approx(placement.figure, rel=1e-6)
    assert found["random as planned, times 10"].figure == pytest.approx(base.figure / 10, rel=1e-6)
    for kind in ("random", "burst_random", "multisine", "sweep", "pulse"):
        assert found[kind].peak == pytest.approx(base.peak, rel=1e-12)


def test_search_finds_the_proven_best_where_it_may_not_compare_all(truss, ranked):
    placement, plan = ranked
    found = place(truss, 5, n_actuators=4, target="matrices", quantity="acceleration", plan=plan, limit=0)
    assert not found.proven
    assert any("not proven" in warning for warning in found.warnings)
    # Exchanges from four starts need not end at the best, but end among the best few.
    assert np.sum(placement.figures < found.figure * (1 - 1e-9)) < 5
    # More sensors tell more, so the bound is below the best of all; three more of eight are worth less than half.
    assert 0.5 * placement.figures[0] < found.floor < placement.figures[0]


def test_fixed_and_forbidden_channels_are_kept_and_left_out(truss, ranked):
    _, plan = ranked
    found = place(
        truss,
        5,
        n_actuators=4,
        target="matrices",
        plan=plan,
        fixed=["acc1.x", "force_v2"],
        forbid=["pos_*", "force_u1"],
    )
    assert "acc1.x" in found.sensors
    assert "force_v2" in found.actuators
    assert "force_u1" not in found.actuators
    assert not [name for name in found.sensors if name.startswith("pos")]


def test_too_few_channels_are_refused(truss, ranked):
    with pytest.raises(LabError, match="expected at least 9 channels in all"):
        place(truss, 4, n_actuators=4, target="matrices", plan=ranked[1])


def test_noise_by_unit_makes_strong_signals_better(truss, ranked):
    plan = Plan(driving("random", 1.0, band=BAND), 50.0, 4.0, noise={"m/s^2": 0.01})
    strong = plan.driven(driving("random", 10.0, band=BAND))
    weak, better = (
        place(truss, 5, n_actuators=4, target="matrices", quantity="acceleration", plan=p)
        for p in (plan, strong)
    )
    # The structure is linear: ten times the force is a tenth of the scatter, and the ranking stays.
    assert better.figure == pytest.approx(weak.figure / 10, rel=1e-9)
    assert better.sensors == weak.sensors
