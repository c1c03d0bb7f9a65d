"""The models are the structures of the papers."""

import re
import shutil
import subprocess
import sys

import numpy as np
import pytest

import lab
from lab.excitation import Random
from tests.lab.structures import LINEAR, MODELS, model, moving

EVERY = sorted(path.stem for path in MODELS.glob("*.xml"))

# De Angelis et al. (2002), Tables 1 and 2.
CHAIN3_MASS = np.diag([0.8, 2.0, 1.2])
CHAIN3_STIFFNESS = np.array([[4.0, -1.0, -1.0], [-1.0, 4.0, -1.0], [-1.0, -1.0, 4.0]])
CHAIN3_DAMPING = {
    "uncoupled": np.array([[0.4, -0.1, -0.1], [-0.1, 0.4, -0.1], [-0.1, -0.1, 0.4]]),
    "coupled": np.array([[0.5, -0.1, -0.2], [-0.1, 0.7, -0.3], [-0.2, -0.3, 0.6]]),
}

# Cambraia and Kurka (2010), Table 1, with the first frequency of Table 2 (2.1048 is a misprint).
CHAIN7_FREQUENCY = [1.6636, 4.9182, 7.9577, 10.6495, 12.8759, 14.5395, 15.5677]
CHAIN7_DAMPING = [0.0052, 0.0155, 0.0250, 0.0335, 0.0405, 0.0457, 0.0489]

# De Angelis et al. (2002), Table 8: order u1, v1, u2, v2, u3, v3, u4, v4.
TRUSS_DAMPING = """
136.4   0.0   0.0   0.0 -50.0   0.0 -17.7 -17.7
  0.0  86.4   0.0 -50.0   0.0   0.0 -17.7 -17.7
  0.0   0.0 136.4   0.0 -17.7  17.7 -50.0   0.0
  0.0 -50.0   0.0  86.4  17.7 -17.7   0.0   0.0
-50.0   0.0 -17.7  17.7 136.4   0.0   0.0   0.0
  0.0   0.0  17.7 -17.7   0.0  86.4   0.0 -50.0
-17.7 -17.7 -50.0   0.0   0.0   0.0 136.4   0.0
-17.7 -17.7   0.0   0.0   0.0 -50.0   0.0  86.4"""
TRUSS_STIFFNESS = """
 27071.1      0.0      0.0      0.0 -10000.0      0.0  -3535.5  -3535.5
     0.0  17071.1      0.0 -10000.0      0.0      0.0  -3535.5  -3535.5
     0.0      0.0  27071.1      0.0  -3535.5   3535.5 -10000.0      0.0
     0.0 -10000.0      0.0  17071.1   3535.5  -3535.5      0.0      0.0
-10000.0      0.0  -3535.5   3535.5  27071.1      0.0      0.0      0.0
     0.0      0.0   3535.5  -3535.5      0.0  17071.1      0.0 -10000.0
 -3535.5  -3535.5 -10000.0      0.0      0.0      0.0  27071.1      0.0
 -3535.5  -3535.5      0.0      0.0      0.0 -10000.0      0.0  17071.1"""


def printed(table):
    return np.array([line.split() for line in table.strip().splitlines()], dtype=float)


@pytest.mark.parametrize("damping", CHAIN3_DAMPING)
def test_three_masses_have_the_printed_matrices(damping):
    found = model(f"chain3_{damping}").second_order()
    assert found.dofs == ("x1", "x2", "x3")
    # Printed in full: equal but for the rounding of a few sums.
    np.testing.assert_allclose(found.mass, CHAIN3_MASS, rtol=0, atol=1e-15)
    np.testing.assert_allclose(found.stiffness, CHAIN3_STIFFNESS, rtol=0, atol=1e-15)
    np.testing.assert_allclose(found.damping, CHAIN3_DAMPING[damping], rtol=0, atol=1e-15)


def test_seven_masses_have_the_printed_modes():
    modes = model("chain7").modes()
    # Half a unit of the last digit printed.
    np.testing.assert_allclose(modes.frequency_hz, CHAIN7_FREQUENCY, rtol=0, atol=0.5e-4)
    np.testing.assert_allclose(modes.damping_ratio, CHAIN7_DAMPING, rtol=0, atol=0.5e-4)


@pytest.mark.parametrize("name", ["truss", "truss_spatial"])
def test_truss_has_the_printed_matrices(name):
    found = model(name).second_order()
    assert found.dofs == ("u1", "v1", "u2", "v2", "u3", "v3", "u4", "v4")
    # Mass is printed in full, the others to one decimal.
    np.testing.assert_allclose(found.mass, 100 * np.eye(8), rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.damping, printed(TRUSS_DAMPING), rtol=0, atol=0.051)
    np.testing.assert_allclose(found.stiffness, printed(TRUSS_STIFFNESS), rtol=0, atol=0.051)


@pytest.mark.parametrize("name", LINEAR)
def test_matrices_equal_an_assembly_of_our_own(name):
    found, (_, expected) = model(name).second_order(), LINEAR[name]
    assert found.dofs == expected.dofs
    for matrix in ("mass", "damping", "stiffness"):
        a, b = getattr(found, matrix), getattr(expected, matrix)
        # Sums of up to six terms in another order.
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-15 * np.max(np.abs(b)) * 6)


def test_spatial_truss_linearizes_to_the_linear_one():
    flat, real = model("truss"), model("truss_spatial")
    for matrix in ("mass", "damping", "stiffness"):
        expected = getattr(flat.second_order(), matrix)
        # Differences of order four over a step of 1e-3 of the extent.
        np.testing.assert_allclose(
            getattr(real.second_order(), matrix), expected, rtol=0, atol=1e-9 * np.max(expected)
        )
    np.testing.assert_allclose(real.modes().frequency_hz, flat.modes().frequency_hz, rtol=1e-10)
    assert real.inputs == flat.inputs
    assert real.outputs == flat.outputs


@pytest.fixture(scope="module")
def geometric_differences():
    """Largest displacement and relative difference of the two trusses under random forces of three sizes."""
    sizes = []
    # Far below the difference of the two, and above the rounding of lengths.
    for rms, accuracy in ((1e-3, 1e-8), (1e-1, 1e-9), (10.0, 1e-9)):
        both = [
            lab.simulate(
                moving(name), Random(rms=rms), sample_rate=50.0, duration=2.0, seed=2, accuracy=accuracy
            )
            for name in ("truss", "truss_spatial")
        ]
        flat, real = (recording.records[0].outputs[-8:] for recording in both)
        largest = np.max(np.abs(flat))
        sizes.append((largest, np.max(np.abs(real - flat)) / largest))
    return np.array(sizes)


def test_small_motion_of_the_spatial_truss_is_that_of_the_linear_one(geometric_differences):
    (largest, difference), *_ = geometric_differences
    assert largest < 1e-6
    # Geometry leaves about max|q|, and differences of lengths cancel to 1e-16 / |q|.
    assert difference < 2e-6


def test_geometric_nonlinearity_grows_with_amplitude(geometric_differences):
    q, difference = geometric_differences.T
    # Relative to a bay of 1 m, the difference is about the displacement itself, at every size.
    assert np.all(difference / q > 0.2)
    assert np.all(difference / q < 5)
    # The leading term alone is left at these sizes: proportional to within the next one.
    np.testing.assert_allclose(difference[2] / difference[1], q[2] / q[1], rtol=0.05)


@pytest.mark.parametrize("name", ["truss", "truss_spatial"])
def test_generator_writes_the_models_that_are_here(name, tmp_path):
    shutil.copy(MODELS / "generate_truss.py", tmp_path)
    subprocess.run([sys.executable, str(tmp_path / "generate_truss.py")], check=True)
    assert (tmp_path / f"{name}.xml").read_text() == (MODELS / f"{name}.xml").read_text()


@pytest.mark.parametrize("name", EVERY)
def test_models_can_be_drawn_and_carry_no_clutter(name):
    rig = model(name)
    m = rig.model
    for body in range(1, m.nbody):
        assert m.body_geomnum[body] > 0
    assert (m.ncam, m.nlight, m.ntex, m.nmat) == (0, 0, 0, 0)
    assert rig.name == name


@pytest.mark.parametrize("name", [*LINEAR, "truss_spatial"])
def test_every_degree_of_freedom_has_a_force_and_an_accelerometer(name):
    rig = model(name)
    assert {c.dof for c in rig.inputs} == set(rig.dofs)
    assert {c.dof for c in rig.outputs if c.quantity == "acceleration"} - {""} == set(rig.dofs)
    assert all(c.factor == 1.0 for c in (*rig.inputs, *rig.outputs))


def table():
    text = (MODELS / "README.md").read_text("utf-8")
    rows = re.findall(r"^\| `(\w+)` \|(.*)\|$", text, re.MULTILINE)
    return {name: [cell.strip() for cell in cells.split(" | ")] for name, cells in rows}


@pytest.mark.parametrize("name", EVERY)
def test_the_table_is_true(name):
    _, springs, n_dofs, frequencies, ratios = table()[name]
    rig = model(name)
    modes = rig.modes()
    assert (int(springs), int(n_dofs)) == (len(rig.springs), len(rig.dofs))
    # As many digits as are printed, and as many modes, where a long list breaks off.
    for cell, values in (
        (frequencies, [f"{f:.4f}" for f in modes.frequency_hz]),
        (ratios, [f"{100 * z:.2f}" for z in modes.damping_ratio]),
    ):
        *listed, last = cell.split(", ")
        assert listed == values[: len(listed)]
        assert last == "…" or [*listed, last] == values


def test_the_table_lists_every_model():
    assert sorted(table()) == EVERY


@pytest.mark.parametrize("name", EVERY)
def test_the_text_names_channels_that_exist(name):
    text = (MODELS / "README.md").read_text("utf-8")
    section = next(part for part in text.split("\n## ")[1:] if name in part.splitlines()[0].split(", "))
    listed = set(re.findall(r"`((?:force|acc|vel|pos)[\w.]*)`", section))
    rig = model(name)
    assert listed
    assert listed <= {c.name for c in (*rig.inputs, *rig.outputs)}
