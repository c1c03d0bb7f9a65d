"""Recipes for published recordings: they are read, and they import the recordings where these lie beside the project."""

from pathlib import Path

import numpy as np
import pytest

import lab
from lab.files.importing import read_foreign
from lab.files.recipe import load_recipe

ROOT = Path(__file__).parents[2]
RECIPES = ROOT / "examples" / "rigs"
DATA = ROOT.parent / "shared" / "data"

CASES = {
    "ecp_carts/free_release.toml": ("ecp_carts/free_release_motor_*", "*", "x1", 0, 0.01),
    "ecp_carts/random_one_cart.toml": ("ecp_carts/random_one_cart", "*", "x1", 1, 0.01),
    "ecp_carts/random_two_carts.toml": ("ecp_carts/random_two_carts", "*", "x2", 2, 0.01),
    "ecp_carts/pulses_steps_one_cart.toml": ("ecp_carts/[pa]*_one_cart", "*", "x1", 2, 0.01 / 560),
    "ecp_carts/three_carts.toml": ("ecp_carts/three_carts", "*", "x2", 5, 0.01),
    "ecp_carts/current_sensor_saturation.toml": ("ecp_carts/current*", "*", "x1", 3, 0.01),
    "unison_tower/wn.toml": ("unison_tower", "wn_*.dat", "floor5.x", 2, -9.8),
}
"""Recipe: folders, recordings in them, an output, its column counted from 0, SI per number."""

MODELS = {
    "ecp_carts/free_release.toml": "ecp_carts/one_cart_detached.xml",
    "ecp_carts/random_one_cart.toml": "ecp_carts/one_cart.xml",
    "ecp_carts/pulses_steps_one_cart.toml": "ecp_carts/one_cart.xml",
    "ecp_carts/random_two_carts.toml": "ecp_carts/two_carts.xml",
    "ecp_carts/three_carts.toml": "ecp_carts/three_carts.xml",
    "silverbox/snls80mv.toml": "silverbox/silverbox.xml",
    "beam_masses/response.toml": "beam_masses/beam.xml",
    "friction_damper/imposed.toml": "friction_damper/imposed.xml",
    "unison_tower/wn.toml": "unison_tower/tower.xml",
    "lumo_tower/acceleration.toml": "lumo_tower/tower.xml",
}
"""Recipe: the model whose actuators and sensors its channels are."""

needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="the recordings are not part of the project")


@pytest.mark.parametrize("path", sorted(RECIPES.rglob("*.toml")), ids=lambda path: path.stem)
def test_every_recipe_is_sound_and_listed(path):
    recipe = load_recipe(path)
    assert recipe.source
    listed = (RECIPES / "README.md").read_text("utf-8")
    assert f"{path.parent.name}/{path.name}" in listed or f"{path.parent.name}/*.toml" in listed


@pytest.mark.parametrize("name", MODELS)
def test_channels_of_a_recipe_are_actuators_and_sensors_of_its_model(name):
    recipe, rig = load_recipe(RECIPES / name), lab.Rig.load(RECIPES / MODELS[name])
    outputs = {channel.name: channel.dof for channel in rig.outputs}
    assert {part.name for part in recipe.inputs} <= {channel.name for channel in rig.inputs}
    assert {part.name for part in recipe.outputs} <= set(outputs)
    # Slides one by one, so that each channel moves its own place in the viewer; the beam's pieces turn one another.
    if name != "beam_masses/response.toml":
        assert all(outputs[part.name] for part in recipe.outputs)


@needs_data
def test_the_lattice_tower_has_its_sensors_where_they_are_documented():
    rig = lab.Rig.load(RECIPES / "lumo_tower/tower.xml")
    recipe = load_recipe(RECIPES / "lumo_tower/acceleration.toml")
    rows = np.loadtxt(
        DATA / "lumo_tower/coords_lumo.csv", delimiter=",", skiprows=1, max_rows=18, usecols=range(6)
    )
    for part, (_, number, x, y, z, direction) in zip(recipe.outputs, rows, strict=True):
        level, axis = part.name.split(".")
        assert part.column == number
        ring = rig.model.body(level.replace("level", "ring"))
        np.testing.assert_array_equal(
            ring.pos + rig.model.site(level.replace("level", "site")).pos, (x, y, z)
        )
        assert axis == "xy"[int(direction) - 1]


@needs_data
@pytest.mark.parametrize("name", CASES)
def test_columns_become_channels(name):
    folders, pattern, output, column, factor = CASES[name]
    recipe = load_recipe(RECIPES / name)
    places = sorted(place for folder in DATA.glob(folders) for place in folder.glob(pattern))
    assert places
    for place in places:
        found = read_foreign(place, recipe).recording
        # Names run data0000, …, data0009, data00010: in the order of the number, not of the letters.
        files = sorted(place.glob("data*.txt"), key=lambda file: int(file.stem[4:])) or [place]
        rows = np.concatenate([np.loadtxt(file, ndmin=2) for file in files])
        signal = found.select(outputs=[output]).records[0].outputs[0]
        np.testing.assert_allclose(signal, rows[:, column] * factor, rtol=1e-14)


@needs_data
def test_the_silverbox_has_two_parts():
    found = read_foreign(
        DATA / "silverbox/SNLS80mV.mat", load_recipe(RECIPES / "silverbox/snls80mv.toml")
    ).recording
    assert [record.n_samples for record in found.records] == [40500, 86750]
    # The arrow and the multisine are loud, their offsets small beside them.
    for record in found.records:
        assert np.std(record.inputs[0]) > 0.02
        assert abs(np.mean(record.inputs[0])) < 0.01


@needs_data
def test_the_friction_damper_moves_as_its_file_says():
    recipe = load_recipe(RECIPES / "friction_damper/characterization.toml")
    for path in sorted((DATA / "friction_damper").glob("*.json")):
        found = read_foreign(path, recipe).recording
        amplitude = float(path.stem.partition("tension")[2].removesuffix("amplitude"))
        displacement, velocity = found.records[0].inputs[0], found.records[0].outputs[1]
        # The name states the amplitude in inches; a hydraulic actuator keeps it to a few per cent.
        assert np.ptp(displacement) / 2 == pytest.approx(amplitude * 0.0254, rel=0.05)
        slope = np.gradient(displacement, 1 / found.sample_rate)
        assert np.corrcoef(slope, velocity)[0, 1] > 0.9


@needs_data
def test_the_beam_gives_responses():
    recipe = load_recipe(RECIPES / "beam_masses/response.toml")
    path = DATA / "beam_masses/Beam_healthy/P-1.txt"
    response = read_foreign(path, recipe).response
    f, decibel, degrees = np.loadtxt(path, skiprows=1).T
    kept = (f >= 18) & (f <= 1300)
    np.testing.assert_array_equal(response.frequency_hz, f[kept])
    expected = 10 ** (decibel / 20) * np.exp(1j * np.radians(degrees)) / (2j * np.pi * f)
    np.testing.assert_allclose(response.values[:, 0, 0], expected[kept], rtol=1e-12)
    assert response.scale == "unknown per input"


@needs_data
@pytest.mark.slow
def test_the_lattice_tower_has_eighteen_accelerations():
    recipe = load_recipe(RECIPES / "lumo_tower/acceleration.toml")
    found = read_foreign(DATA / "lumo_tower/data_lumo.csv.gz", recipe)
    assert (len(found.recording.outputs), found.recording.n_samples) == (18, 100000)
    assert any("column 22" in note for note in found.notes)
