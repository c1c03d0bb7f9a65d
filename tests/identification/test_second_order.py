"""Mass, damping and stiffness: the paper's cases, every layout and measurement, and what cannot be found."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from identification.era import era
from identification.errors import NotSecondOrderError
from identification.recording import Channel
from identification.second_order import scaled_eigenvectors, second_order
from identification.systems import SecondOrder, StateSpace
from tests import systems
from tests.systems import actuators, instrumented, sensors

QUANTITIES = ("displacement", "velocity", "acceleration")


def worst_error(found, truth):
    """Largest entry error over largest entry, the worst of M, C and K."""
    assert found.dofs == truth.dofs
    return max(
        np.abs(getattr(found, name) - getattr(truth, name)).max() / np.abs(getattr(truth, name)).max()
        for name in ("mass", "damping", "stiffness")
    )


def phase_and_sign(psi):
    """Columns up to sign and conjugation: real part of the largest entry positive, imaginary part too."""
    largest = psi[np.argmax(np.abs(psi), axis=0), np.arange(psi.shape[1])]
    psi = psi * np.sign(largest.real)
    return np.where((largest * np.sign(largest.real)).imag < 0, psi.conj(), psi)


# --- The paper's examples
# ------------------------------------------------------------------------------------

PRINTED_PSI = {
    "uncoupled": [
        [-0.159 - 0.159j, 0.109 + 0.109j, 0.334 + 0.334j],
        [-0.276 - 0.276j, -0.135 - 0.135j, -0.031 - 0.031j],
        [-0.185 - 0.185j, 0.274 + 0.274j, -0.114 - 0.114j],
    ],
    # The last entry is printed 0.139 + j 0.0093.
    "coupled": [
        [0.166 + 0.154j, 0.127 + 0.088j, -0.327 - 0.345j],
        [0.266 + 0.284j, -0.161 - 0.120j, 0.018 + 0.045j],
        [0.207 + 0.171j, 0.251 + 0.296j, 0.139 + 0.093j],
    ],
}


@pytest.mark.parametrize("damping", PRINTED_PSI)
def test_printed_eigenvectors_of_the_three_masses(damping):
    structure = systems.chain3(damping)
    found = era(systems.paper_chain3(damping).markov(400)).system
    psi = scaled_eigenvectors(found, dofs=structure.dofs).psi[:, ::2]
    printed = np.array(PRINTED_PSI[damping])
    # Printed to three decimals, the last one off by up to two units (0.088 for 0.0875 j, 0.139 for 0.140).
    np.testing.assert_allclose(phase_and_sign(psi), phase_and_sign(printed), atol=1.6e-3)


def test_misprinted_entry_is_no_eigenvector():
    structure = systems.chain3("coupled")
    psi = scaled_eigenvectors(systems.paper_chain3("coupled"), dofs=structure.dofs).psi[2, 4]
    assert abs(psi.imag) == pytest.approx(0.093, abs=5e-4)


@pytest.mark.parametrize("damping", ["uncoupled", "coupled"])
@pytest.mark.parametrize("n_lags", [100, 400, 1200])
def test_matrices_of_the_three_masses_to_ten_digits(damping, n_lags):
    structure = systems.chain3(damping)
    found = era(systems.paper_chain3(damping).markov(n_lags), n_rows=50).system
    # Rounding, times the 1 / (|λ| dt)² of converting accelerations: 1e-13 seen.
    assert worst_error(second_order(found, dofs=structure.dofs), structure) < 1e-11


PRINTED_MODELS = {
    # De Angelis et al. (2002), Tables 3 and 4: Φ, C and Γᵀ times ten, and |diag 𝒯|.
    "uncoupled": (
        [
            [9.9520, 0.0956, -0.6987, 0.2243, 0.0072, 0.0178],
            [-0.0761, 9.8881, -0.5836, -0.6557, 0.0264, 0.0032],
            [0.6886, 0.5640, 9.9450, -0.0075, -0.4241, -0.0190],
            [-0.2833, 0.7991, 0.0135, 9.8893, 0.1779, -0.0022],
            [0.1586, -0.0056, 0.4669, -0.1255, 9.6269, 0.8757],
            [0.0158, -0.0335, -0.0190, 0.0679, -1.0219, 9.9322],
        ],
        [
            [1.6132, -1.2168, 0.4631, -1.1516, 0.1377, -0.0220],
            [1.4748, 0.6048, 1.8841, 0.2602, 0.2798, -0.0377],
        ],
        [
            [0.4917, 0.0904, 0.2763, 0.0800, -2.5024, -0.4362],
            [-0.4112, 1.2005, 0.2179, -1.2017, 0.1888, 0.3338],
        ],
        [2.966 - 2.322j, 8.996 - 8.164j, 6.449 - 4.789j],
    ),
    "coupled": (
        [
            [9.9461, 0.3794, -0.5714, 0.1773, 0.0032, 0.0157],
            [-0.3310, 9.8771, -0.5938, -0.6294, 0.1211, 0.0084],
            [0.5782, 0.4676, 9.8825, -0.2419, -0.3919, -0.0220],
            [-0.2784, 0.8119, 0.3483, 9.8572, 0.0833, -0.0785],
            [0.1925, -0.1088, 0.5346, 0.0501, 9.5282, 0.9199],
            [0.0117, -0.0764, -0.0880, 0.1883, -0.9465, 9.9287],
        ],
        [
            [1.5236, -1.2545, 0.2148, -0.8687, 0.0960, -0.0348],
            [1.3362, 0.0325, 1.5306, 0.2360, 0.2277, -0.0230],
        ],
        [
            [0.5234, 0.0030, 0.6595, 0.3176, -2.8212, 0.0959],
            [-0.5469, 1.2525, 1.0654, -1.3654, 0.2666, 0.6835],
        ],
        [0.256 + 4.218j, 0.479 - 16.492j, 9.980 - 0.754j],
    ),
}


@pytest.mark.parametrize("damping", PRINTED_MODELS)
def test_printed_models_have_the_printed_scaling(damping):
    A, C, B_transposed, scaling = PRINTED_MODELS[damping]
    exact = systems.paper_chain3(damping)
    printed = StateSpace(
        np.array(A) / 10,
        np.transpose(B_transposed) / 10,
        np.array(C) / 10,
        exact.D,
        exact.dt,
        exact.inputs,
        exact.outputs,
    )
    structure = systems.chain3(damping)
    found = scaled_eigenvectors(printed, dofs=structure.dofs)
    # The phase of an eigenvector of A is free, its length is one; five printed digits leave about 1e-3.
    assert sorted(np.abs(found.scaling[::2])) == pytest.approx(sorted(np.abs(scaling)), rel=1e-3)
    # Half a unit in the last printed place, 5e-6, over the (|λ| dt)² = 3e-3 that turns acceleration to
    # displacement.
    assert worst_error(second_order(printed, dofs=structure.dofs), structure) < 5e-3


def test_printed_eigenvectors_of_the_truss():
    structure = systems.truss()
    psi = 100 * scaled_eigenvectors(systems.paper_truss(), dofs=structure.dofs).psi[:, ::2]
    # De Angelis et al. (2002), Table 9: sizes of the rows u1, v1 in each of the eight modes, signs aside.
    np.testing.assert_allclose(
        np.abs(psi[0].real), [0.122, 0.243, 0.714, 0.621, 0.191, 0.183, 0.579, 0.527], atol=6e-4
    )
    np.testing.assert_allclose(
        np.abs(psi[1].real), [1.050, 0.764, 0.227, 0.197, 0.601, 0.575, 0.067, 0.168], atol=6e-4
    )
    # Proportional damping makes real and imaginary parts equal in size, exactly.
    np.testing.assert_allclose(np.abs(psi.real), np.abs(psi.imag), atol=1e-10)


def test_truss_from_five_sensors_and_four_actuators():
    structure = systems.truss()
    found = era(systems.paper_truss().markov(300)).system
    assert worst_error(second_order(found, dofs=structure.dofs), structure) < 1e-10


def test_truss_layout_as_printed_in_the_text_is_not_identifiable():
    # v4 instead of u4 as the fifth sensor.
    structure = systems.truss()
    system = instrumented(
        structure, sensors(["u1", "v1", "v2", "v3", "v4"]), actuators(["v1", "u2", "u3", "v4"])
    )
    with pytest.raises(
        NotSecondOrderError, match="DOF u4 has neither sensor nor actuator; add one of the two"
    ):
        second_order(system, dofs=structure.dofs)


# --- Layouts and measurements
# --------------------------------------------------------------------------------

STRUCTURE = systems.chain3("coupled")
LAYOUTS = {
    "all sensors, one actuator": (("x1", "x2", "x3"), ("x2",)),
    "all actuators, one sensor": (("x3",), ("x1", "x2", "x3")),
    "mixed": (("x1", "x3"), ("x3", "x2")),
    "two pairs": (("x1", "x2"), ("x3", "x1", "x2")),
    "all pairs": (("x1", "x2", "x3"), ("x1", "x2", "x3")),
}


@pytest.mark.parametrize("sampled", [False, True], ids=["continuous", "sampled"])
@pytest.mark.parametrize("quantity", QUANTITIES)
@pytest.mark.parametrize("names", LAYOUTS.values(), ids=LAYOUTS)
def test_every_layout_and_measurement(names, quantity, sampled):
    system = instrumented(STRUCTURE, sensors(names[0], quantity), actuators(names[1]))
    if sampled:
        system = era(system.sampled(0.2).markov(160)).system
    assert worst_error(second_order(system, dofs=STRUCTURE.dofs), STRUCTURE) < 1e-11


@settings(max_examples=30, deadline=None)
@given(
    st.tuples(*[st.sampled_from(QUANTITIES)] * 3),
    st.lists(st.sampled_from([-1.0, 1.0, 0.3, -40.0]), min_size=5, max_size=5),
)
def test_mixed_measurements_with_any_sign_and_sensitivity(quantities, factors):
    outputs = tuple(
        replace(sensors([dof], quantity)[0], factor=factor)
        for dof, quantity, factor in zip(STRUCTURE.dofs, quantities, factors, strict=False)
    )[:2]
    inputs = tuple(
        replace(channel, factor=factor)
        for channel, factor in zip(actuators(["x2", "x3"]), factors[3:], strict=True)
    )
    system = instrumented(STRUCTURE, outputs, inputs).sampled(0.2)
    assert worst_error(second_order(system, dofs=STRUCTURE.dofs), STRUCTURE) < 1e-10


def test_several_sensors_and_actuators_on_one_degree_of_freedom():
    outputs = (
        *sensors(["x1", "x2"]),
        *sensors(["x2"], "velocity", factor=-2.0),
        *sensors(["x2"], "displacement"),
    )
    inputs = (*actuators(["x2", "x3"]), Channel("hammer", "N", "x3", -1.0))
    system = instrumented(STRUCTURE, outputs, inputs)
    assert worst_error(second_order(system, dofs=STRUCTURE.dofs), STRUCTURE) < 1e-11


def test_channels_that_read_no_motion_or_no_known_place_are_left_aside():
    system = instrumented(STRUCTURE, sensors(["x1", "x2", "x3"]), actuators(["x1"]))
    outputs = (*system.outputs, Channel("cell", "N", "x9"), Channel("somewhere", "m/s^2"))
    noise = np.random.default_rng(0).standard_normal((2, 6))
    padded = replace(
        system, C=np.vstack([system.C, noise]), D=np.vstack([system.D, [[0], [1]]]), outputs=outputs
    )
    assert worst_error(second_order(padded), STRUCTURE) < 1e-11


def test_default_order_is_that_of_the_channels():
    found = second_order(systems.paper_chain3())
    assert found.dofs == ("x2", "x3", "x1")
    assert found.mass[2, 2] == pytest.approx(0.8, rel=1e-12)


def test_overdamped_modes_are_modes():
    heavy = replace(STRUCTURE, damping=STRUCTURE.damping * np.array([[1, 1, 1], [1, 12, 1], [1, 1, 1]]))
    system = instrumented(heavy, sensors(["x1", "x2"]), actuators(["x2", "x3"])).sampled(0.05)
    assert np.any(system.eigen()[0].imag == 0)
    assert worst_error(second_order(era(system.markov(300)).system, dofs=heavy.dofs), heavy) < 1e-9


def test_undamped_structures_are_structures():
    free = replace(STRUCTURE, damping=np.zeros((3, 3)))
    system = instrumented(free, sensors(["x1", "x2"]), actuators(["x2", "x3"])).sampled(0.2)
    found = second_order(system, dofs=free.dofs)
    np.testing.assert_allclose(found.stiffness, free.stiffness, atol=1e-11)
    np.testing.assert_allclose(found.damping, 0, atol=1e-11)


# --- Properties
# ----------------------------------------------------------------------------------------------


@st.composite
def structures(draw):
    """Random symmetric positive definite M, C, K of up to four degrees of freedom, all modes apart."""
    n = draw(st.integers(2, 4))
    rng = np.random.default_rng(draw(st.integers(0, 10_000)))
    G = rng.standard_normal((3, n, n))
    M, C, K = (g @ g.T / n + np.eye(n) for g in G)
    return SecondOrder(M, 0.05 * C, K * 50, tuple(f"q{i}" for i in range(n)))


@settings(max_examples=40, deadline=None)
@given(structures(), st.integers(0, 1000))
def test_any_structure_from_any_sufficient_layout_in_any_coordinates(structure, seed):
    rng = np.random.default_rng(seed)
    n = len(structure.dofs)
    pair = rng.integers(n)
    side = rng.integers(0, 2, n).astype(bool)
    outputs = [
        sensors([dof], QUANTITIES[rng.integers(3)])[0]
        for i, dof in enumerate(structure.dofs)
        if side[i] or i == pair
    ]
    inputs = actuators([dof for i, dof in enumerate(structure.dofs) if not side[i] or i == pair])
    system = instrumented(structure, outputs, inputs).sampled(0.05)
    T = np.linalg.qr(rng.standard_normal((2 * n, 2 * n)))[0] * rng.uniform(0.5, 2, 2 * n)
    moved = replace(
        system, A=np.linalg.solve(T, system.A @ T), B=np.linalg.solve(T, system.B), C=system.C @ T
    )
    found = second_order(moved, dofs=structure.dofs)
    modes = scaled_eigenvectors(moved, dofs=structure.dofs)
    # Modes that lie close, or nearly leave the pair at rest, amplify rounding by the inverse of either.
    gap = (
        np.abs(np.subtract.outer(modes.poles, modes.poles) + 1e9 * np.eye(2 * n)).min()
        / np.abs(modes.poles).max()
    )
    rest = np.abs(modes.psi[pair]).min() / np.abs(modes.psi).max()
    assert worst_error(found, structure) < 1e-10 / min(gap, 0.1) / min(rest, 0.1)
    for matrix in (found.mass, found.stiffness):
        assert np.array_equal(matrix, matrix.T)
        assert np.linalg.eigvalsh(matrix)[0] > 0


@given(st.permutations(range(3)))
def test_matrices_follow_a_permutation_of_the_degrees_of_freedom(order):
    system = systems.paper_chain3("coupled")
    names = tuple(STRUCTURE.dofs[i] for i in order)
    found = second_order(system, dofs=names)
    reference = second_order(system, dofs=STRUCTURE.dofs)
    np.testing.assert_allclose(found.damping, reference.damping[np.ix_(order, order)], atol=1e-13)


def test_scaled_eigenvectors_obey_the_orthogonality_conditions():
    # De Angelis et al. (2002), eq. (4) and (18b): the conditions that define the scaling.
    structure = systems.truss()
    modes = scaled_eigenvectors(systems.paper_truss(), dofs=structure.dofs)
    psi, L = modes.psi, np.diag(modes.poles)
    M, C, K = structure.mass, structure.damping, structure.stiffness
    identity = psi.T @ M @ psi @ L + L @ psi.T @ M @ psi + psi.T @ C @ psi
    np.testing.assert_allclose(identity, np.eye(16), atol=1e-11)
    np.testing.assert_allclose(L @ psi.T @ M @ psi @ L - psi.T @ K @ psi, L, atol=1e-9)
    assert modes.closure < 1e-12


# --- Least squares
# -------------------------------------------------------------------------------------------


def test_more_pairs_scatter_less():
    rng = np.random.default_rng(4)
    model = instrumented(STRUCTURE, sensors(["x1", "x2", "x3"]), actuators(["x1", "x2", "x3"])).sampled(0.05)
    markov = model.markov(300)
    # The same identified models, once with the place of only one actuator known.
    one_pair = tuple(channel if channel.dof == "x1" else replace(channel, dof="") for channel in model.inputs)
    errors = {1: [], 3: []}
    for _ in range(12):
        Y = systems.noisy(np.moveaxis(markov.values, 0, -1), 0.05, rng)
        found = era(replace(markov, values=np.moveaxis(Y, -1, 0)), 6, n_columns=60).system
        for pairs, system in ((1, replace(found, inputs=one_pair)), (3, found)):
            errors[pairs].append(second_order(system, dofs=STRUCTURE.dofs).stiffness - STRUCTURE.stiffness)
    scatter = {pairs: np.sqrt(np.mean(np.square(e))) for pairs, e in errors.items()}
    # x1 hardly moves in two of the three modes; x2 and x3 carry those.
    assert scatter[3] < 0.8 * scatter[1]


# --- Verdicts
# ------------------------------------------------------------------------------------------------


def refused(system, match, **options):
    with pytest.raises(NotSecondOrderError, match=match):
        second_order(system, **options)


def test_no_pair():
    system = instrumented(STRUCTURE, sensors(["x1"]), actuators(["x2", "x3"]))
    refused(system, r"no degree of freedom has both a sensor \(on x1\) and an actuator \(on x2, x3\)")


def test_two_bare_degrees_of_freedom():
    system = instrumented(STRUCTURE, sensors(["x1"]), actuators(["x1"]))
    refused(system, "DOFs x2, x3 have neither sensor nor actuator", dofs=STRUCTURE.dofs)


def test_channels_outside_the_degrees_of_freedom_asked_for():
    refused(systems.paper_chain3(), r"channels read or drive x3, which is not among", dofs=("x1", "x2"))


def test_channels_without_places():
    refused(systems.modes4(), "set `dof` of the channels")


def test_zero_factor():
    system = instrumented(STRUCTURE, sensors(["x1", "x2", "x3"]), actuators(["x1"], factor=0.0))
    refused(system, r"'force_x1' has the factor 0\.0")


def test_too_few_modes():
    found = era(systems.paper_chain3().markov(200), 4).system
    refused(found, "too few modes: 2 for the 3 degrees of freedom x2, x3, x1; take order 6")


def test_too_many_modes():
    system = instrumented(STRUCTURE, sensors(["x1", "x2"]), actuators(["x1"]))
    refused(system, "too many modes: 3 for the 2 degrees of freedom x1, x2; take order 4, or instrument")


def test_unstable_mode():
    driven = replace(STRUCTURE, damping=-STRUCTURE.damping)
    system = instrumented(driven, sensors(["x1", "x2", "x3"]), actuators(["x1"]))
    refused(system, "is unstable")


def test_free_structure():
    loose = replace(STRUCTURE, stiffness=STRUCTURE.stiffness - 2 * np.eye(3), damping=np.zeros((3, 3)))
    system = instrumented(loose, sensors(STRUCTURE.dofs, "displacement"), actuators(["x1"]))
    refused(system.sampled(0.1), "a pole is zero")


def test_pole_on_the_negative_real_axis():
    system = systems.paper_chain3()
    A = np.diag([-0.5, 0.5, 0.4, 0.3, 0.2, 0.1])
    refused(replace(system, A=A), "negative real axis")


def test_spurious_real_poles():
    system = systems.paper_chain3()
    rng = np.random.default_rng(0)
    A = np.diag([0.9, 0.7, 0.6, 0.5, 0.4, 0.3])
    refused(
        replace(system, A=A, B=rng.standard_normal((6, 2)), C=rng.standard_normal((2, 6))),
        "are real and belong to no mode",
    )


def test_coinciding_modes():
    twins = SecondOrder(np.eye(2), 0.1 * np.eye(2), 10 * np.eye(2), ("a", "b"))
    refused(
        instrumented(twins, sensors(["a", "b"]), actuators(["a", "b"])), "two modes coincide at 0.503292 Hz"
    )


def test_node_at_the_only_pair():
    # Three equal masses in a symmetric chain: the second mode leaves the middle at rest.
    K = np.array([[3.0, -1, 0], [-1, 3, -1], [0, -1, 3]])
    chain = SecondOrder(np.eye(3), 0.01 * K, K, ("a", "b", "c"))
    system = instrumented(chain, sensors(["a", "b"]), actuators(["b", "c"]))
    refused(system, r"the mode at 0\.2757 Hz does not move b, the only place with both")


def test_degrees_of_freedom_that_move_together():
    system = instrumented(STRUCTURE, sensors(["x1", "x2", "x3"]), actuators(["x1"]))
    C = system.C.copy()
    C[2] = C[1]
    refused(replace(system, C=C), "move together")
