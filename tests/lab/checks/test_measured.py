"""Real recordings whose flaws are known; they lie beside the repository or the tests are skipped."""

from pathlib import Path

import numpy as np
import pytest

import lab
from identification.recording import Channel, Record, Recording
from lab.rig import Rig
from tests.lab.structures import chain_xml

DATA = Path(__file__).parents[4] / "shared" / "data"
pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the measured data are not beside the repository")

COUNT = 0.01 / 560
"""Metres for each count of the carts' encoders."""


def tower() -> Rig:
    """Five equal storeys of 19.37 t, as stiff as the lowest mode at 0.53 Hz asks for."""
    mass = 19.37e3
    k = float(mass * (np.pi * 0.53 / np.sin(np.pi / 22)) ** 2)
    ground = [(k, 0.004 * k), *[(0.0, 0.0)] * 4]
    return Rig.from_xml(chain_xml([mass] * 5, ground, {(i - 1, i): (k, 0.004 * k) for i in range(1, 5)}))


@pytest.mark.parametrize("name", ["wn_01", "wn_02"])
@pytest.mark.parametrize("factors", [(9.8, 2, 2, 1, 1), (1, 1, 1, 1, 1)], ids=["factors", "volts"])
def test_the_towers_floor_order_and_sign(name, factors):
    """Columns are floors 5, 4, 1, 2, 3 and that of floor 5 is upside down; with the factors lost as well."""
    columns = np.loadtxt(DATA / "unison_tower" / f"{name}.dat").T[2:7] * np.array(factors)[:, None]
    rig = tower()
    outputs = [
        channel for channel in rig.outputs if channel.name.startswith("acc") and channel.name.endswith(".x")
    ]
    record = Record("ambient", np.zeros((0, columns.shape[1])), columns)
    remarks = lab.check(Recording((record,), (), tuple(outputs), 100.0), rig)
    order = next(remark for remark in remarks if remark.check == "order")
    for wrong, right in ((0, 4), (1, 3), (2, 0), (3, 1), (4, 2)):
        assert f"acc{wrong}.x is acc{right}.x" in order.says
    assert [remark.channel for remark in remarks if remark.check == "sign"] == ["acc0.x"]


def cart(folder, units, kind="other", factor=1.0):
    """A recording of the carts; positions times a factor."""
    table = np.vstack(
        [np.loadtxt(f, ndmin=2) for f in sorted((DATA / "ecp_carts" / folder).glob("data*.txt"))]
    ).T
    inputs = [k for k, unit in enumerate(units) if unit != "m"]
    outputs = [k for k, unit in enumerate(units) if unit == "m"]
    record = Record(kind, table[inputs], table[outputs] * factor)
    sides = [tuple(Channel(f"{units[k]}{k}", units[k]) for k in rows) for rows in (inputs, outputs)]
    return Recording((record,), *sides, 200.0)


def test_an_encoder_that_is_wrong_by_1320_counts_for_a_second():
    made = cart("amplitude_series_one_cart/Klow_3V_pulses", ("V", "A", "m"), factor=COUNT)
    (remark,) = [r for r in lab.check(made) if r.check == "jumps"]
    assert abs(remark.evidence["largest"]) == pytest.approx(1320 * COUNT, rel=0.001)
    assert remark.stop - remark.start == pytest.approx(1.0, abs=0.02)


def test_counts_for_metres():
    made = cart("amplitude_series_one_cart/Klow_3V_pulses", ("V", "A", "m"))
    assert any("whole numbers" in r.says for r in lab.check(made) if r.channel == "m2")


def test_the_current_sensor_stops_near_4_4_amperes():
    made = cart("amplitude_series_one_cart/Kmed_4V_pulses", ("V", "A", "m"), factor=COUNT)
    (remark,) = [r for r in lab.check(made) if r.check == "clipping"]
    assert remark.channel == "A1"
    assert remark.evidence["level"] == pytest.approx(4.42, abs=0.01)


@pytest.mark.parametrize("side", ["free_release_motor_detached", "free_release_motor_attached"])
def test_releases_of_a_cart_that_sticks_in_the_end_are_clean(side):
    """Held, pulled, let go, stopped by dry friction: neither drift, nor interruption, nor limit."""
    for folder in sorted((DATA / "ecp_carts" / side).iterdir()):
        assert lab.check(cart(folder, ("m",), "free_decay", 0.01)) == [], folder.name


def test_a_second_encoder_without_a_cart_is_dead_and_the_current_reading_levels_off():
    made = cart("current_sensor_saturation/Positive_saturation", ("V", "V", "A", "m", "m"), factor=0.01)
    remarks = lab.check(made)
    # The cart that the motor holds against its stop stays as well.
    expected = {("dead", "m4"), ("saturation", "A2"), ("saturation", "m3")}
    assert {(r.check, r.channel) for r in remarks} == expected
    (current,) = [r for r in remarks if r.channel == "A2"]
    # Documented as about 4.4 A; this record stays between 4.0 and 4.3.
    assert 4.0 < current.evidence["level"] < 4.4


@pytest.mark.parametrize("folder", ["random_one_cart/KmNoM", "amplitude_series_one_cart/Klow_3V_pulses"])
def test_currents_within_their_range_do_not_level_off(folder):
    columns = ("V", "A", "m") if "series" in folder else ("A", "m", "m")
    assert "saturation" not in {r.check for r in lab.check(cart(folder, columns, factor=0.01))}
