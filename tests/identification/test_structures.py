"""Structures as functions of parameters: patterns, starts, derivatives, and channels that do not fit."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from identification.era import era
from identification.errors import IdentificationError, NotSecondOrderError
from identification.parameterizations import central_differences
from identification.recording import Channel
from identification.spring_network import WORLD, spring_network
from identification.structures import (
    LinearStructure,
    Structure,
    channel_matrices,
    free_matrices,
    passive,
)
from identification.systems import SecondOrder
from tests import systems
from tests.systems import actuators, instrumented, sensors

CHAIN3 = {
    "springs": [("x1", "x2"), ("x1", "x3"), ("x2", "x3"), (WORLD, "x1"), (WORLD, "x2"), (WORLD, "x3")],
    "values": (0.8, 2.0, 1.2, 0.1, 0.2, 0.3, 0.2, 0.3, 0.1, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0),
}
INPUTS = actuators(("x1", "x2"), factor=-2.0)
OUTPUTS = (
    *sensors(("x1",), "displacement"),
    *sensors(("x2", "x3"), "velocity"),
    *sensors(("x3",), "acceleration", factor=3.0),
)


def assert_same(a, b, atol=1e-13):
    for name in ("mass", "damping", "stiffness"):
        np.testing.assert_allclose(getattr(a, name), getattr(b, name), atol=atol)


def test_free_matrices_hold_any_symmetric_structure():
    truth = systems.chain3("coupled")
    family = free_matrices(truth.dofs)
    assert len(family.names) == 18
    assert family.names[:3] == ("M[x1,x1]", "M[x1,x2]", "M[x1,x3]")
    theta = family.start(truth)
    np.testing.assert_allclose(theta[6:12], truth.damping[np.triu_indices(3)], atol=1e-14)
    assert_same(family.matrices(theta).structure, truth)


def test_network_is_the_chain_of_the_paper():
    truth = systems.chain3("coupled")
    family = spring_network(truth.dofs, CHAIN3["springs"])
    assert family.names[0] == "m(x1)"
    assert family.names[3] == "c(x1|x2)"
    assert family.names[-1] == "k(world|x3)"
    assert_same(family.matrices(np.array(CHAIN3["values"])).structure, truth)
    # The pattern holds the truth, so least squares return its elements.
    np.testing.assert_allclose(family.start(truth), CHAIN3["values"], atol=1e-13)


def test_bars_in_the_plane_make_the_truss():
    nodes = {1: (1, 0), 2: (1, 1), 3: (2, 0), 4: (2, 1), 5: (0, 0), 6: (0, 1), 7: (3, 0), 8: (3, 1)}
    bars = [(5, 1), (1, 3), (3, 7), (6, 2), (2, 4), (4, 8), (1, 2), (3, 4)]
    braces = [(5, 2), (6, 1), (1, 4), (2, 3), (3, 8), (4, 7)]
    truth = systems.truss()

    def bar(a, b):
        x, y = np.subtract(nodes[b], nodes[a]) / np.hypot(*np.subtract(nodes[b], nodes[a]))
        ends = {f"u{a}": -x, f"v{a}": -y, f"u{b}": x, f"v{b}": y}
        return {dof: float(c) for dof, c in ends.items() if dof in truth.dofs}

    elements = [bar(a, b) for a, b in bars + braces]
    family = spring_network(truth.dofs, elements, dashpots=[], masses=dict.fromkeys(truth.dofs, 100.0))
    k = np.array([10_000.0] * 8 + [10_000 / np.sqrt(2)] * 6)
    structure = family.matrices(k).structure
    np.testing.assert_allclose(structure.stiffness, truth.stiffness, atol=1e-10)
    np.testing.assert_array_equal(structure.mass, truth.mass)
    assert not structure.damping.any()


def test_start_from_a_state_space_and_in_another_order():
    truth = systems.chain3("coupled")
    family = free_matrices(("x3", "x1", "x2"))
    theta = family.start(truth)
    # Noise-free realization: rounding, times the 1 / (|λ| dt)² of converting accelerations.
    np.testing.assert_allclose(
        family.start(era(systems.paper_chain3("coupled").markov(200), 6)), theta, atol=1e-10
    )
    np.testing.assert_array_equal(family.start(theta), theta)


@given(seed=st.integers(0, 1000))
@settings(max_examples=10)
def test_derivatives_are_those_of_the_state_space(seed):
    rng = np.random.default_rng(seed)
    M, C, K = (x @ x.T + np.eye(3) for x in rng.standard_normal((3, 3, 3)))
    family = free_matrices(("x1", "x2", "x3"))
    theta = family.start(SecondOrder(M, C, K, ("x1", "x2", "x3")))
    tangent = family.tangent(theta, INPUTS, OUTPUTS)
    twin = central_differences(lambda x: family.tangent(x, INPUTS, OUTPUTS).system, theta)
    expected = instrumented(family.matrices(theta).structure, OUTPUTS, INPUTS)
    for name in "ABCD":
        own = getattr(tangent.system, name)
        np.testing.assert_allclose(own, getattr(expected, name), atol=1e-12 * (1 + np.abs(own).max()))
        slope = getattr(tangent, f"{name}_theta")
        # Steps of eps^(1/3) leave an error of eps^(2/3), times what M⁻¹ of condition 30 makes of it.
        np.testing.assert_allclose(
            slope, getattr(twin, f"{name}_theta"), atol=1e-7 * (1 + np.abs(slope).max())
        )


def test_any_function_of_parameters():
    family = free_matrices(("x1", "x2", "x3"))
    scaled = Structure(("log M11",), lambda x: family.matrices(np.concatenate([np.exp(x), np.ones(17)])))
    np.testing.assert_array_equal(scaled.start([0.5]), [0.5])
    structure = scaled.matrices(np.array([0.5])).structure
    assert structure.mass[0, 0] == np.exp(0.5)
    with pytest.raises(IdentificationError, match="expected an array of 1 finite values for log M11"):
        scaled.start(structure)


def test_passive_structures_stay_as_they_are():
    assert_same(passive(systems.chain3("coupled")), systems.chain3("coupled"), atol=1e-12)


def test_passive_takes_energy_sources_away():
    good = systems.chain3("coupled")
    bad = SecondOrder(
        good.mass - np.diag([1, 0, 0]),
        good.damping - 0.6 * np.eye(3),
        good.stiffness - 4 * np.eye(3),
        good.dofs,
    )
    assert np.linalg.eigvalsh(bad.mass)[0] < 0
    cured = passive(bad)
    assert np.linalg.eigvalsh(cured.mass)[0] > 0
    assert np.linalg.eigvalsh(cured.stiffness)[0] > 0
    assert np.linalg.eigvalsh(cured.damping)[0] > -1e-12
    # Energy only leaves: no pole has a positive real part beyond rounding.
    poles, _ = instrumented(cured, sensors(("x1",)), actuators(("x1",))).eigen()
    assert poles.real.max() < 1e-7


def test_what_does_not_fit_is_named():
    dofs = ("x1", "x2")
    with pytest.raises(NotSecondOrderError, match="'x9'; expected world or one of x1, x2"):
        spring_network(dofs, [("x1", "x9")])
    with pytest.raises(NotSecondOrderError, match="masses are given for x1; expected one for each of x1, x2"):
        spring_network(dofs, [("x1", "x2")], masses={"x1": 1.0})
    with pytest.raises(NotSecondOrderError, match="'force_x3' has dof 'x3'"):
        channel_matrices(dofs, actuators(("x3",)), ())
    with pytest.raises(NotSecondOrderError, match="output 'p' measures pressure"):
        channel_matrices(dofs, (), (Channel("p", "Pa", "x1"),))
    with pytest.raises(NotSecondOrderError, match="degrees of freedom x1, x2, x3; expected x1, x2"):
        free_matrices(dofs).start(systems.chain3())
    with pytest.raises(IdentificationError, match=r"mass patterns have shape \(1, 3, 3\)"):
        LinearStructure(("m", "n"), systems.chain3(), *np.zeros((3, 1, 3, 3)))
