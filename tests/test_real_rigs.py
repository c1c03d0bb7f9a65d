"""Published rigs: their models are as documented, and the lab says of the recordings what is known of them.

The recordings are not part of the project; tests that need them skip where they are absent.
"""

import numpy as np
import pytest
import scipy.optimize

import lab
from benchmarks import real_rigs
from benchmarks.rigs import beam, duffing, ecp, friction_damper, silverbox, towers
from benchmarks.rigs.row import DATA, RIGS, Row, measured
from identification.identify import identify
from identification.recording import Record, Recording
from lab.effects import EFFECTS
from lab.effects.edits import with_law
from lab.files.recipe import load_recipe
from lab.matching import placed
from lab.replay import replay

needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="the recordings are not part of the project")

DOCUMENTED = {
    "ecp_carts/one_cart_detached.xml": [np.sqrt(315.5 / 0.5685)],
    "ecp_carts/one_cart.xml": [np.sqrt(340.1 / 0.8906)],
    "ecp_carts/two_carts.xml": np.sqrt(
        np.linalg.eigvals(
            np.diag([1 / 0.8906, 1 / 0.5685]) @ np.array([[712.6 + 315.5, -315.5], [-315.5, 315.5]])
        )
    ),
    # A chain of equal storeys, fixed below and free above: 2 √(k/m) sin((2 r - 1) π / 22).
    "unison_tower/tower.xml": 2 * np.sqrt(2.652e6 / 19370) * np.sin((2 * np.arange(1, 6) - 1) * np.pi / 22),
}


@pytest.mark.parametrize("name", DOCUMENTED)
def test_models_have_the_frequencies_of_their_documented_values(name):
    system = lab.Rig.load(RIGS / name).second_order()
    found = np.sqrt(np.linalg.eigvals(np.linalg.solve(system.mass, system.stiffness)))
    np.testing.assert_allclose(np.sort(found), np.sort(DOCUMENTED[name]), rtol=1e-9)


def test_the_beam_alone_on_a_rigid_clamp_is_a_cantilever():
    rig = lab.Rig.load(RIGS / "beam_masses" / "beam.xml")
    for body in ("accelerometer", *(f"nut{number}" for number in range(1, 7))):
        mass = float(rig.model.body(body).mass[0])
        rig = EFFECTS["mass_change"](body, delta_mass=-(1 - 1e-9) * mass).apply(rig)
    rig = EFFECTS["stiffness_change"]("clamp", relative_change=1e5).apply(rig)
    found = rig.second_order().modes().frequency_hz[:3]
    # Euler and Bernoulli: (β L)² √(E I / ρ A) / L²; hinges 10 mm apart bend a wave of mode three to about (β h)² / 24.
    beta = np.array([1.875104, 4.694091, 7.854757])
    exact = beta**2 * np.sqrt(2.491e11 * 4.75e-3**2 / 12 / 7850) / 0.39**2 / (2 * np.pi)
    np.testing.assert_allclose(found, exact, rtol=5e-3)


def test_the_lattice_tower_bends_as_a_cantilever_in_both_directions():
    """Nine lumps of 10 kg, 1 m apart, are a beam of 10 kg/m with half a lump more at its tip."""
    found = lab.Rig.load(RIGS / "lumo_tower" / "tower.xml").second_order().modes().frequency_hz
    np.testing.assert_allclose(found[0::2], found[1::2], rtol=1e-9)

    # Euler and Bernoulli with a tip mass of the share mu: 1 + cos cosh + mu b (cos sinh - sin cosh) = 0.
    def free_end(b, mu=0.5 / 9):
        return 1 + np.cos(b) * np.cosh(b) + mu * b * (np.cos(b) * np.sinh(b) - np.sin(b) * np.cosh(b))

    beta = np.array([scipy.optimize.brentq(free_end, a, a + 1) for a in (1.2, 3.8)]) / 9
    exact = beta**2 * np.sqrt(2.032e6 / 10) / (2 * np.pi)
    # Lumps and hinges a distance h = 1 m apart err by (beta h)² / 12 within a wave, and about as much again at each end.
    assert np.all(np.abs(found[[0, 2]] / exact - 1) < beta**2 / 4)


def test_every_model_is_listed():
    listed = (RIGS / "README.md").read_text("utf-8")
    for path in RIGS.rglob("*.xml"):
        assert f"{path.parent.name}/{path.name}" in listed


def test_the_page_has_a_place_for_every_rig():
    page = real_rigs.PAGE.read_text("utf-8")
    for rig in real_rigs.RIGS:
        inside = page.partition(f"<!-- {rig} -->")[2].partition(f"<!-- end {rig} -->")[0].strip()
        assert inside.startswith(real_rigs.HEAD)
        assert len(inside.splitlines()) > 2


def test_a_row_stays_a_row_whatever_it_holds():
    cells = Row("a", "b|c", "d", "e", "f", "g", "h").markdown().replace("\\|", "").split("|")
    assert len(cells) == 9


def test_releases_are_found_in_pulls_and_swings():
    dt, t = 0.005, np.arange(0, 4, 0.005)
    swing = 0.02 * np.exp(-1.5 * t) * np.cos(15 * t)
    pull = np.concatenate([np.zeros(300), np.linspace(0, 0.02, 200), np.full(200, 0.02)])
    position = np.concatenate([pull, swing, np.zeros(200), -pull[300:], -swing, np.zeros(200)])
    found = ecp.releases(position, dt)
    # The first zero of the cosine comes at π/30 s, 20.9 samples after letting go.
    assert [a for a, _ in found] == [700 + 20, 700 + 800 + 200 + 400 + 20]
    for a, b in found:
        assert np.ptp(position[b : b + 50]) < ecp.STILL
        assert np.ptp(position[b - 60 : b]) > 1e-5
        assert b > a


def test_held_inputs_push_as_the_smooth_signal_does():
    """A sine that is held after the turn drives a mass on a spring as the continuous sine does, at the samples."""
    dt, n, cycles = 1 / 610.35, 1024, 64
    t = np.arange(n) * dt
    omega, wave = 2 * np.pi * cycles / (n * dt), np.sin(2 * np.pi * cycles * np.arange(n) / n)
    turned = silverbox.held(wave[None], dt)[0]
    # Fourier coefficient of the staircase at the frequency of the sine.
    fine = 64
    stairs = np.repeat(turned, fine)
    s = (np.arange(n * fine) + 0.5) * dt / fine
    coefficient = 2 * np.mean(stairs * np.exp(-1j * omega * s))
    # The midpoint rule errs by (ω dt / fine)² / 24, 2e-6.
    assert coefficient == pytest.approx(-1j, abs=1e-5)
    assert np.allclose(wave, np.sin(omega * t))


def test_the_equation_of_a_cubic_spring_moves_as_its_exact_solution():
    """Force that a chosen motion needs returns the motion: x = A sin⁴(w t / 2), which begins at rest and smoothly."""
    n, dt, m, c, k, k3 = 2048, 1 / 610.35, 5e-6, 2e-4, 1.0, 4.0
    omega = 2 * np.pi * 16 / (n * dt)
    t = np.arange(n * duffing.FINER) * dt / duffing.FINER
    s, w = np.sin(omega * t / 2), omega / 2
    x, v = 0.1 * s**4, 0.4 * w * s**3 * np.cos(omega * t / 2)
    a = 0.1 * w**2 * (12 * s**2 - 16 * s**4)
    force = m * a + c * v + k * x + k3 * x**3
    # Fourth order: the error of a step falls with (w dt / 4)^4, here below 1e-7 of the motion.
    np.testing.assert_allclose(duffing.motion(force, dt, m, c, k, k3), x[:: duffing.FINER], atol=1e-8)
    np.testing.assert_allclose(duffing.between(force[:: duffing.FINER]), force, atol=1e-12)


def test_a_slider_with_backlash_has_its_level_and_its_gap():
    x = 0.02 * np.sin(np.linspace(0, 4 * np.pi, 4001))
    force = friction_damper.slider_with_backlash(x, np.gradient(x), np.array([1e4, 2e4, 1e7, 2e-3]))
    assert force.max() == pytest.approx(1e4)
    assert force.min() == pytest.approx(-2e4)
    # After a reversal the force is nil over twice the half gap.
    back = (np.arange(x.size) > 500) & (np.arange(x.size) < 1500)
    idle = x[back & (np.abs(force) < 1)]
    assert np.ptp(idle) == pytest.approx(4e-3, abs=1e-4)


@needs_data
def test_the_check_finds_the_odd_order_and_the_turned_floor():
    order, sign, right = (row.says for row in towers.wiring())
    assert "another order" in order
    assert "floor5.x: has its sign flipped" in order
    assert "floor5.x: has its sign flipped" in sign
    assert right == "no remark"


@needs_data
@pytest.mark.slow
def test_the_tower_has_the_modes_that_its_authors_look_for():
    assert "in 5 of the five bands" in next(towers.unison()).says


@needs_data
def test_the_lattice_tower_sways_as_its_model_on_which_it_is_shown():
    rig = lab.Rig.load(RIGS / "lumo_tower" / "tower.xml")
    recording = measured("lumo_tower/data_lumo.csv.gz", "lumo_tower/acceleration.toml")
    found = identify(placed(towers.ambient(recording, step=towers.DECIMATED), rig), uncertainty=False).modes
    assert [channel.dof for channel in found.outputs] == [c.name.replace(".", "_") for c in found.outputs]
    model = rig.second_order().modes()
    rows = [[c.dof for c in model.outputs].index(channel.dof) for channel in found.outputs]
    assert found.frequency_hz[:2] == pytest.approx([2.79, 2.79], rel=0.02)
    # Both lowest modes of the model have one frequency, so that any mix of them is one: the share of the measured shape
    # that they span. What the mast of the model, even all along, lacks of the tower's own curve is less than a per cent.
    basis = np.linalg.qr(model.shapes[rows, :2])[0]
    for shape in (found.shapes[:, k] / np.linalg.norm(found.shapes[:, k]) for k in (0, 1)):
        assert np.linalg.norm(basis.conj().T @ shape) ** 2 > 0.99


@needs_data
def test_the_nut_at_the_clamp_goes_first():
    first = next(beam.by_frequencies())
    assert first.says.startswith("(1,)")


@needs_data
@pytest.mark.slow
def test_one_response_of_unknown_scale_names_the_nut_at_the_clamp():
    assert "`mass_change` at nut1" in next(beam.diagnosed()).says


@needs_data
def test_friction_rises_with_tension_and_backlash_is_named():
    found = list(friction_damper.fitted_laws())
    assert all(row.says == "friction behind a spring with backlash" for row in found)
    levels = [float(row.parameter.split(" ")[0]) for row in found]
    assert min(levels[3:]) > 3 * max(levels[:3])


@needs_data
@pytest.mark.slow
def test_a_diagnosis_names_the_friction_of_the_damper_and_its_level():
    slack, tight = (friction_damper.diagnosed(tension, every=4) for tension in (0, 36))
    assert [d.findings[0].effect.cause for d in (slack, tight)] == ["hysteresis", "hysteresis"]
    # Measured while it slides: 12.4 to 14.4 kN forwards, 16.6 to 19.9 kN backwards; 1.6 to 3.7 kN where it is slack.
    assert 12e3 < friction_damper.level(tight) < 20e3
    assert friction_damper.level(tight) > 5 * friction_damper.level(slack)


def test_the_servo_moves_what_resists_as_measured_just_as_measured():
    """A damper's own force and motion, fed to the model with that damper in it, return the motion."""
    dt, omega, amplitude, c = 1 / 1024, np.pi, 0.02, 5e4
    t = np.arange(6144) * dt
    x, v = amplitude * np.sin(omega * t), amplitude * omega * np.cos(omega * t)
    # Of the model's own device: 0.1 MN/m and 50 kN s/m.
    force = 1e5 * x + c * v
    rig = lab.Rig.load(RIGS / "friction_damper" / "imposed.xml")
    recipe = load_recipe(RIGS / "friction_damper" / "imposed.toml")
    share = next(part.factor for part in recipe.inputs if part.name == "imposed")
    inputs = np.stack([force, share * x, v])
    record = Record("other", inputs, x[None])
    recording = Recording((record,), rig.inputs, rig.outputs, 1024.0)
    (moved,) = replay(rig, recording, accuracy=1e-6)
    # A start at rest dies out with the servo's 0.4 s; inputs held over a sample lag half of one, 1.5 mrad.
    assert np.max(np.abs(moved[0] - x)[4096:]) < 2e-3 * amplitude


@needs_data
@pytest.mark.slow
def test_the_silverbox_has_a_cubic_spring():
    quiet, _, multisine, last = silverbox.parts()
    rig = lab.Rig.load(RIGS / "silverbox" / "silverbox.xml")
    low = lab.diagnose(quiet, rig, widths=silverbox.WIDTHS, effects={})
    high = lab.diagnose(multisine, low.extended, baseline=quiet, widths=silverbox.WIDTHS)
    assert [f.effect.cause for f in high.findings] == ["cubic_stiffness"]
    assert high.verdict == "explained"
    # A linear model errs by a third of the signal; physical models of second order are published with 1 mV.
    assert silverbox.millivolts(low.extended, last) > 10
    assert silverbox.millivolts(high.extended, last) < 1


@needs_data
@pytest.mark.slow
def test_a_cart_is_the_same_the_second_time_and_heavier_with_its_load():
    rig = lab.Rig.load(RIGS / "ecp_carts" / "one_cart.xml")
    first, second = ecp.driven("KhNoM", stop=17.5), ecp.driven("KhNoM", start=17.5)
    assert lab.diagnose(second, rig, baseline=first, widths=ecp.DRIVEN).verdict == "consistent"
    loaded = lab.diagnose(ecp.driven("Kh2M"), rig, baseline=ecp.driven("KhNoM"), widths=ecp.DRIVEN)
    (finding,) = loaded.findings
    assert (finding.effect.cause, finding.effect.location) == ("mass_change", "cart1")
    # 0.986 kg as nominal newtons weigh it: the force per ampere is known to 14 %.
    change = finding.parameters["delta_mass"]
    assert abs(change.value - ecp.LOAD) < 2 * np.hypot(change.std, 0.14 * ecp.LOAD)


@needs_data
@pytest.mark.slow
def test_a_spring_four_times_as_stiff_is_no_spring_with_a_memory():
    rig = lab.Rig.load(RIGS / "ecp_carts" / "one_cart.xml")
    rig = with_law(rig, "spring1", stiffness=[ecp.SPRINGS["low"], 0, 0], damping=[9.0, 0, 0])
    soft, stiff = ecp.pulsed("pulse_klow_2mass"), ecp.pulsed("pulse_kbig_2mass")
    (finding,) = lab.diagnose(stiff, rig, baseline=soft, widths=ecp.DRIVEN).findings
    assert (finding.effect.cause, finding.effect.location) == ("stiffness_change", "spring1")
    # Two estimates of the authors' differ: 712.6 / 175.3 and 720.6 / 216.4.
    assert 3.3 < 1 + finding.parameters["relative_change"].value < 4.1


@needs_data
@pytest.mark.slow
def test_what_predicts_nothing_better_is_no_explanation():
    base = ecp.released("Hard_nomass", folder=ecp.ATTACHED)
    rig = ecp.cart("high", 0.322)
    laws = {"hysteresis": EFFECTS["hysteresis"]}
    rig = lab.diagnose(
        base, rig, widths={"mass": 0.3, "stiffness": 0.05, "damping": 1.0}, effects=laws
    ).extended
    heavier, other = (
        ecp.free(ecp.released(name, folder=ecp.ATTACHED), rig, base) for name in ("Hard_2mass", "Med_2mass")
    )
    assert [(f.effect.cause, f.effect.location) for f in heavier.findings] == [("mass_change", "cart1")]
    assert heavier.verdict == "explained"
    # Load and spring changed together: a release tells their ratio, and the load alone predicts nothing.
    assert other.verdict == "unexplained"
    assert any("does not predict the data kept aside" in warning for warning in other.warnings)
