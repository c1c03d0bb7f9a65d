"""The order at which modes are read: on diagrams made up for the purpose, and on a chain whose order is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.testing import assert_allclose

from identification.modes import Modes
from identification.recording import Channel
from identification.settled import brief_warnings, settle
from identification.ssi import ssi_cov
from identification.stability import Stabilization, stabilize
from tests.ambient import ambient
from tests.systems import chain7

OUTPUTS = (Channel("a", "m"), Channel("b", "m"))


def diagram(lines):
    """A stabilization of modes (frequency, shape, first order, orders in between) with one more pole below each first order."""
    poles = sorted(
        (order, f, k if order >= first else -1, shape)
        for k, (f, shape, first, orders) in enumerate(lines)
        for order in (first - 2, *orders)
    )
    order, frequency, cluster, shapes = (np.array(column) for column in zip(*poles, strict=True))
    modes = Modes(
        np.array([line[0] for line in lines]),
        np.full(len(lines), 0.01),
        np.array([line[1] for line in lines]).T / np.sqrt(2),
        OUTPUTS,
    )
    label = tuple("stable" if k >= 0 else "lowest order" for k in cluster)
    damping, scatter = np.full(order.size, 0.01), np.zeros(len(lines))
    # A pole of another order reads another fourth digit, so that the order it came from shows.
    frequency = frequency * (1 + 1e-4 * order)
    return Stabilization(
        order, frequency, damping, shapes.T / np.sqrt(2), label, cluster, modes, scatter, scatter
    )


def test_all_modes_come_from_the_lowest_order_that_has_them():
    lines = [(1.0, (1, 1), 4, range(4, 32, 2)), (2.0, (1, -1), 8, range(8, 32, 2))]
    found = settle(diagram(lines))
    # The second mode has settled at 8, where its pole resembles that of order 6: there both are.
    assert found.order == 6
    assert [order for order, _ in found.places] == [6, 6]
    assert_allclose(found.modes.frequency_hz, [1.0006, 2.0012], rtol=1e-12)


def test_a_brief_cluster_does_not_raise_the_order():
    lines = [(1.0, (1, 1), 4, range(4, 32, 2)), (2.0, (1, -1), 24, range(24, 32, 2))]
    found = settle(diagram(lines))
    assert found.order == 2
    assert [order for order, _ in found.places] == [2, 24]
    assert "1 of 2" in found.notes[0]
    assert found.brief == (False, True)


def test_a_brief_cluster_like_a_lasting_mode_is_part_of_it():
    lines = [(1.0, (1, 1), 4, range(4, 32, 2)), (1.008, (1, 1), 24, range(24, 32, 2))]
    found = settle(diagram(lines))
    assert_allclose(found.modes.frequency_hz, [1.0], rtol=1e-3)
    assert "1.008 Hz is taken for part" in found.notes[1]
    # Another shape makes it another mode, and so does a frequency further off.
    for other in ((1.008, (1, -1)), (1.02, (1, 1))):
        assert len(settle(diagram([lines[0], (*other, 24, range(24, 32, 2))])).modes) == 2


def test_a_brief_mode_without_damping_to_speak_of_is_doubted():
    modes = Modes(
        np.array([1.0, 2.0, 3.0]),
        np.array([0.01, 0.01, 0.01]),
        np.eye(2)[:, [0, 1, 0]],
        OUTPUTS,
        frequency_std=np.full(3, 0.01),
        damping_std=np.array([0.02, 0.004, 0.02]),
    )
    (warning,) = brief_warnings(modes, (False, True, True))
    assert "3 Hz" in warning
    assert brief_warnings(replace(modes, frequency_std=None, damping_std=None), (True,) * 3) == ()


def test_one_pole_does_not_serve_two_modes():
    # The second cluster is within the tolerance of the first one's poles, but these are nearer to the first.
    lines = [(1.0, (1, 1), 4, range(4, 32, 2)), (1.008, (1, 1), 14, range(14, 32, 2))]
    found = settle(diagram(lines))
    assert found.order == 12


def test_the_modes_are_those_of_the_true_order():
    realization = ssi_cov(ambient(20_000, 3))
    found = settle(stabilize(realization))
    assert found.order == 14
    own = realization.at(14).modes().normalized()
    assert_allclose(found.modes.frequency_hz, own.frequency_hz, rtol=1e-12)  # the same poles
    assert_allclose(found.modes.shapes, own.shapes, atol=1e-9)
    # A record of 540 s leaves 0.3 % at worst, one standard deviation; three of them.
    assert_allclose(found.modes.frequency_hz, chain7().modes().frequency_hz, rtol=1e-2)
