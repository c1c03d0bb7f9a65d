"""Stabilization of models made by hand, whose every pole has a known verdict, and of a chain."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from identification.clusters import Poles, Thresholds, difference, keep_long
from identification.errors import IdentificationError
from identification.recording import Channel
from identification.ssi import ssi_cov
from identification.stability import RULES, STABLE, _nearest_below, stabilize
from identification.systems import Realization, StateSpace
from tests.ambient import ambient
from tests.systems import chain7

DT = 0.01
SHAPE = (1.0, 2.0, -1.0)
OTHER = (1.0, -1.0, 1.0)


def model(poles):
    """A sampled model with exactly these modes: (frequency in Hz, damping ratio, shape) each."""
    n = len(poles)
    A, C = np.zeros((2 * n, 2 * n)), np.zeros((3, 2 * n))
    for k, (f, zeta, shape) in enumerate(poles):
        omega = 2 * np.pi * f
        z = np.exp(omega * (-zeta + 1j * np.sqrt(1 - zeta**2)) * DT)
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [[z.real, z.imag], [-z.imag, z.real]]
        C[:, 2 * k], C[:, 2 * k + 1] = np.real(shape), np.imag(shape)
    outputs = tuple(Channel(f"acc{i}", "m/s^2") for i in range(3))
    return StateSpace(A, np.zeros((2 * n, 0)), C, np.zeros((3, 0)), DT, (), outputs)


def realized(*models):
    systems = tuple(model(poles) for poles in models)
    return Realization("made by hand", systems, np.ones(1), systems[-1].n_states, {})


def fillers(i, n=None):
    """As many poles as raise the order of model number i, at least 2.5 % away from those of its neighbours."""
    return [(12 + 1.6 * j + 0.8 * (i % 2), 0.05, SHAPE) for j in range(i if n is None else n)]


@pytest.mark.parametrize(
    ("pole", "rule"),
    [
        ((5.0, -0.001, SHAPE), "negative damping"),
        ((5.0, 0.3, SHAPE), "damping too high"),
        ((5.2, 0.02, SHAPE), "frequency jumps"),
        ((5.0, 0.02, OTHER), "shape jumps"),
        ((5.0, 0.05, SHAPE), "damping jumps"),
    ],
)
def test_each_rule_rejects(pole, rule):
    kept = (9.0, 0.02, OTHER)
    found = stabilize(realized([kept], [kept, (5.0, 0.02, SHAPE)], [kept, pole, *fillers(2, 1)]))
    (label,) = (
        label
        for label, order, f in zip(found.label, found.orders, found.frequency_hz, strict=True)
        if order == 6 and abs(f - pole[0]) < 0.1
    )
    assert label == rule
    assert set(found.label) <= {STABLE, *RULES}


def test_the_lowest_order_has_nothing_to_agree_with():
    found = stabilize(realized([(5.0, 0.02, SHAPE)], [(5.0, 0.02, SHAPE), *fillers(1)]))
    assert found.label[0] == "lowest order"
    assert len(found.modes) == 0


def test_a_complex_shape_passes_unless_forbidden():
    whirl = (5.0, 0.02, np.array([1, 1j, -1]))
    models = realized(*([whirl, *fillers(i)] for i in range(6)))
    assert len(stabilize(models).modes) == 1
    strict = stabilize(models, min_collinearity=0.5)
    assert len(strict.modes) == 0
    assert "complex shape" in strict.label


def test_a_split_pole_continues_once():
    kept = (5.0, 0.02, SHAPE)
    split = (5.02, 0.021, SHAPE)
    models = realized([kept], [kept, *fillers(1)], [kept, split, *fillers(2, 1)], [kept, *fillers(3)])
    found = stabilize(models)
    assert list(found.label).count("double") == 1
    np.testing.assert_allclose(found.modes.frequency_hz, [5.0], rtol=1e-12)


def test_agreement_at_two_orders_is_too_small_a_cluster():
    kept, passing = (5.0, 0.02, SHAPE), (9.0, 0.02, OTHER)
    models = realized(
        *([kept, passing, *fillers(i, i - 1)] if 3 <= i <= 5 else [kept, *fillers(i)] for i in range(10))
    )
    found = stabilize(models)
    np.testing.assert_allclose(found.modes.frequency_hz, [5.0], rtol=1e-12)
    assert list(found.label).count("cluster too small") == 2
    assert np.all((found.cluster >= 0) == (np.array(found.label) == STABLE))


def test_a_heavily_damped_pole_may_move_along_frequency_as_far_as_along_damping():
    # 0.2 of a damping ratio of 0.1 is 2 % of the frequency [rad/s]; a light pole may move by 1 %.
    for damping, n_modes in ((0.1, 1), (0.02, 0)):
        models = realized(*([(5.0 * 1.015 ** (i % 2), damping, SHAPE), *fillers(i)] for i in range(8)))
        assert len(stabilize(models).modes) == n_modes


@pytest.mark.parametrize("shape", [OTHER, tuple(np.add(SHAPE, (0, 1e-3, 0)))])
def test_close_modes_stay_two_modes(shape):
    """Modes 0.03 % apart, as modes 3 and 4 of Juang (1992), 6.1, with different and with nearly equal shapes."""
    pair = [(9.0, 0.0022, SHAPE), (9.003, 0.0022, shape)]
    models = realized(*(pair[: i + 1] + fillers(i) for i in range(10)))
    found = stabilize(models)
    np.testing.assert_allclose(found.modes.frequency_hz, [9.0, 9.003], rtol=1e-9)
    # From order 2 on and from order 6 on, and the first of each has nothing to agree with.
    assert np.bincount(found.cluster[found.cluster >= 0]).tolist() == [9, 8]


def test_a_mode_that_misses_an_order_is_one_mode():
    kept = (5.0, 0.02, SHAPE)
    models = realized(*([*fillers(i, i + 1)] if i == 5 else [kept, *fillers(i)] for i in range(1, 11)))
    found = stabilize(models)
    assert len(found.modes) == 1
    # Of nine orders the first, and the one after the gap, follow nothing.
    assert np.sum(found.cluster == 0) == 7


def test_modes_are_means_with_the_scatter_over_the_orders():
    rng = np.random.default_rng(1)
    f = 5.0 * (1 + 1e-4 * rng.standard_normal(12))
    zeta = 0.02 * (1 + 0.01 * rng.standard_normal(12))
    turned = [np.array(SHAPE) * np.exp(1j * rng.uniform(0, 2 * np.pi)) for _ in range(12)]
    models = realized(*([(f[i], zeta[i], turned[i]), *fillers(i)] for i in range(12)))
    found = stabilize(models)
    modes = found.modes
    np.testing.assert_allclose(modes.frequency_hz, [np.mean(f[1:])], rtol=1e-10)
    np.testing.assert_allclose(found.frequency_scatter, [np.std(f[1:], ddof=1)], rtol=1e-6)
    np.testing.assert_allclose(modes.damping_ratio, [np.mean(zeta[1:])], rtol=1e-8)
    np.testing.assert_allclose(found.damping_scatter, [np.std(zeta[1:], ddof=1)], rtol=1e-6)
    # Phases are aligned before the mean, so that shapes do not cancel; the largest part is one.
    np.testing.assert_allclose(modes.shapes[:, 0], np.array(SHAPE) / 2, atol=1e-9)


@given(order=st.permutations(range(4)), scale=st.floats(1e-6, 1e6))
@settings(max_examples=20)
def test_modes_come_by_frequency_whatever_the_order_of_the_states(order, scale):
    shapes = [SHAPE, OTHER, (1.0, 0.0, 1.0), (0.0, 1.0, 2.0)]
    poles = [
        (f, 0.02, scale * np.array(shape)) for f, shape in zip((4.0, 7.0, 11.0, 16.0), shapes, strict=True)
    ]
    models = realized(*([poles[k] for k in order] + fillers(i) for i in range(6)))
    np.testing.assert_allclose(stabilize(models).modes.frequency_hz, [4.0, 7.0, 11.0, 16.0], rtol=1e-9)


def test_a_single_order_has_no_stable_pole():
    found = stabilize(realized([(5.0, 0.02, SHAPE), (9.0, 0.02, OTHER)]))
    assert found.label == ("lowest order", "lowest order")
    assert len(found.modes) == 0


@pytest.mark.parametrize(
    ("lengths", "kept"),
    [
        ([20, 19, 18, 2, 1, 1], [20, 19, 18]),
        ([20, 19, 17, 15], [20, 19, 17, 15]),  # nothing by chance: the shorter modes stay
        ([2, 2, 1], []),  # two may agree by chance
        ([9], [9]),
        ([], []),
    ],
)
def test_long_clusters_are_kept(lengths, kept):
    cluster = np.repeat(np.arange(len(lengths)), lengths).astype(int)
    number = keep_long(np.append(cluster, -1))
    assert number[-1] == -1
    assert np.bincount(number[number >= 0]).tolist() == kept


@pytest.mark.parametrize("seed", range(3))
def test_a_chain_under_ambient_forces_has_seven_modes(seed):
    truth = chain7().modes()
    found = stabilize(ssi_cov(ambient(20_000, seed)))
    assert len(found.modes) == 7
    # Standard deviations after Au (2014) are 0.1 to 0.2 % and 5 to 18 %; three of them.
    np.testing.assert_allclose(found.modes.frequency_hz, truth.frequency_hz, rtol=1e-2)
    np.testing.assert_allclose(found.modes.damping_ratio, truth.damping_ratio, rtol=0.6)


def test_arrays_cannot_be_changed_and_the_repr_counts():
    found = stabilize(realized([(5.0, 0.02, SHAPE)], [(5.0, 0.02, SHAPE), *fillers(1)]))
    with pytest.raises(ValueError, match="read-only"):
        found.cluster[0] = 3
    assert repr(found) == "Stabilization(3 poles, 0 stable, 0 modes)"


@pytest.mark.parametrize(
    ("thresholds", "says"),
    [
        ({"mac": 0.9}, "min_mac"),
        ({"min_mac": 1.0}, "between 0 and 1"),
        ({"max_damping": 0.0}, "max_damping is 0"),
    ],
)
def test_wrong_thresholds_are_told(thresholds, says):
    with pytest.raises(IdentificationError, match=says):
        stabilize(realized([(5.0, 0.02, SHAPE)]), **thresholds)


@pytest.mark.parametrize("sizes", [(3,), (1, 4), (2, 5, 3, 1, 6)])
def test_the_nearest_pole_of_the_next_lower_order_is_that_of_a_plain_loop(sizes):
    rng = np.random.default_rng(sum(sizes))
    n, limits = sum(sizes), Thresholds()
    shapes = rng.standard_normal((3, n)) + 1j * rng.standard_normal((3, n))
    order = np.repeat(2 * np.arange(1, len(sizes) + 1), sizes)
    poles = Poles.normalized(order, rng.uniform(1, 2, n), rng.uniform(0, 0.1, n), shapes)
    mate, far, double = _nearest_below(poles, limits)
    for k in range(n):
        own, lower = np.flatnonzero(order == order[k]), np.flatnonzero(order == order[k] - 2)
        if not lower.size:
            assert (mate[k], double[k]) == (-1, False)
            continue
        pairs = [
            [difference(poles.take(slice(i, i + 1)), poles.take(slice(j, j + 1)), limits) for j in lower]
            for i in own
        ]
        distance = np.array([[pair.distance[0, 0] for pair in row] for row in pairs])
        i = int(np.flatnonzero(own == k)[0])
        j = int(np.argmin(distance[i]))
        assert mate[k] == lower[j]
        # Rounding of sums of three products.
        np.testing.assert_allclose(
            far[:, k], [each[0, 0] for each in pairs[i][j][:3]], rtol=1e-12, atol=1e-14
        )
        assert double[k] == (np.argmin(distance[:, j]) != i)
