"""Units: every factor from its definition."""

import math

import pytest

from identification.recording import QUANTITIES
from lab.errors import FileError
from lab.files.units import to_si


@pytest.mark.parametrize("unit", QUANTITIES)
def test_si_units_stay_as_they_are(unit):
    assert to_si(unit) == (unit, 1.0)


@pytest.mark.parametrize(
    ("unit", "si", "factor"),
    [
        ("g", "m/s^2", 9.80665),
        ("mg", "m/s^2", 9.80665e-3),
        ("mm", "m", 1e-3),
        ("µm", "m", 1e-6),
        ("μm/s", "m/s", 1e-6),
        ("um", "m", 1e-6),
        ("mm/s²", "m/s^2", 1e-3),
        ("mm/s**2", "m/s^2", 1e-3),
        ("cm/s2", "m/s^2", 1e-2),
        ("m/s/s", "m/s^2", 1.0),
        ("in/s", "m/s", 0.0254),
        ("ft", "m", 12 * 0.0254),
        ("kN", "N", 1e3),
        ("Nm", "N m", 1.0),
        ("kN m", "N m", 1e3),
        ("kN·m", "N m", 1e3),
        ("lbf", "N", 0.45359237 * 9.80665),
        ("deg", "rad", math.pi / 180),
        ("°/s", "rad/s", math.pi / 180),
        ("mV", "V", 1e-3),
        ("kPa", "Pa", 1e3),
        ("ustrain", "1", 1e-6),
        ("%", "1", 0.01),
        ("  mm / s ", "m/s", 1e-3),
    ],
)
def test_conversions(unit, si, factor):
    found = to_si(unit)
    assert found[0] == si
    # Products of two rounded constants: one rounding each.
    assert found[1] == pytest.approx(factor, rel=4e-16)


@pytest.mark.parametrize("unit", ["", "furlong", "N/s", "g/s", "kkN", "mK", "m/s^3", "m/", "degC", "s"])
def test_unknown_units_are_refused_with_a_list(unit):
    with pytest.raises(FileError, match="expected one of m, in, ft") as caught:
        to_si(unit)
    assert repr(unit) in str(caught.value)
    assert "\n" not in str(caught.value)
