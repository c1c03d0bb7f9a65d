"""Virtual instruments: data sheets of real ones, turned into stages of the measurement chain.

Each instrument is a frozen dataclass with real-world units and ideal defaults; presets read like common hardware.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any, ClassVar

from lab.errors import LabError, UnknownNameError
from lab.rig import Rig
from lab.stages import ALL, Delay, Dropout, Gain, Lag, LowPass, Noise, Resolution, Saturation, Stage

G = 9.80665
"""Standard gravity [m/s^2]."""


@dataclass(frozen=True)
class Sensor:
    """A sensor of one quantity; every value is in the unit of the quantity unless named otherwise.

    Attributes:
        sensitivity: [V per unit]; only needed with an acquisition whose range is in volts.
        sensitivity_error: true sensitivity over the calibrated one, less one.
        noise_density: [unit / √Hz].
        range: largest reading either way; 0 for no limit.
        resolution: smallest step; 0 for none.
        bandwidth: corner frequency [Hz] of its first-order roll-off; 0 for none.
    """

    quantity: ClassVar[str] = ""
    sensitivity: float = 1.0
    sensitivity_error: float = 0.0
    noise_density: float = 0.0
    range: float = 0.0
    resolution: float = 0.0
    bandwidth: float = 0.0

    def stages(self, channel: str) -> tuple[tuple[Stage, ...], tuple[Stage, ...]]:
        """Stages between motion and signal, and stages on the samples."""
        signal: list[Stage] = []
        if self.bandwidth:
            signal.append(Lag(channel, self.bandwidth))
        if self.sensitivity_error:
            signal.append(Gain(channel, self.sensitivity_error))
        if self.range:
            signal.append(Saturation(channel, self.range))
        samples: list[Stage] = []
        if self.noise_density:
            samples.append(Noise(channel, density=self.noise_density))
        if self.resolution:
            samples.append(Resolution(channel, self.resolution))
        return tuple(signal), tuple(samples)


@dataclass(frozen=True)
class Accelerometer(Sensor):
    """An accelerometer [m/s^2]."""

    quantity: ClassVar[str] = "acceleration"


@dataclass(frozen=True)
class VelocitySensor(Sensor):
    """A vibrometer or geophone [m/s]."""

    quantity: ClassVar[str] = "velocity"


@dataclass(frozen=True)
class DisplacementSensor(Sensor):
    """A displacement transducer or encoder [m]."""

    quantity: ClassVar[str] = "displacement"


@dataclass(frozen=True)
class ForceSensor(Sensor):
    """A load cell [N]; with one, the recorded input is the mean force that it saw over each sample."""

    quantity: ClassVar[str] = "force"


@dataclass(frozen=True)
class Shaker:
    """A shaker between the commanded and the applied force.

    Attributes:
        gain_error: true over nominal gain, less one.
        bandwidth: corner frequency [Hz] of its first-order lag; 0 for none.
        range: largest force either way [N]; 0 for no limit.
        delay: [s].
    """

    gain_error: float = 0.0
    bandwidth: float = 0.0
    range: float = 0.0
    delay: float = 0.0

    def stages(self, channel: str) -> tuple[Stage, ...]:
        """Stages between commanded and applied force."""
        stages: list[Stage] = []
        if self.delay:
            stages.append(Delay(channel, self.delay))
        if self.gain_error:
            stages.append(Gain(channel, self.gain_error))
        if self.range:
            stages.append(Saturation(channel, self.range))
        if self.bandwidth:
            stages.append(Lag(channel, self.bandwidth))
        return tuple(stages)


@dataclass(frozen=True)
class Acquisition:
    """Data acquisition behind all sensors.

    Attributes:
        range: full scale either way [V]; 0 for no limit.
        bits: of the converter over its range; 0 for no rounding.
        anti_alias: corner of the anti-alias filter as a share of the sample rate; 0 for none.
        anti_alias_order: of that Butterworth filter.
        delay: common to all outputs [s].
        dropout: probability that a sample is lost.
    """

    range: float = 0.0
    bits: int = 0
    anti_alias: float = 0.0
    anti_alias_order: int = 8
    delay: float = 0.0
    dropout: float = 0.0


PRESETS: dict[str, dict[str, Any]] = {
    "accelerometer": {
        "ideal": Accelerometer(),
        # General-purpose piezoelectric, 100 mV/g, 50 g, to 10 kHz.
        "piezo_100mv_g": Accelerometer(
            sensitivity=0.1 / G, noise_density=6e-6 * G, range=50 * G, bandwidth=10e3
        ),
        # Seismic piezoelectric, 10 V/g, 0.5 g.
        "seismic_10v_g": Accelerometer(
            sensitivity=10 / G, noise_density=4e-8 * G, range=0.5 * G, bandwidth=1e3
        ),
        # Low-noise digital MEMS, 2 g, 20 bits.
        "mems_2g": Accelerometer(noise_density=25e-6 * G, range=2 * G, resolution=3.9e-6 * G, bandwidth=1e3),
        # MEMS of a phone or a wearable, 8 g, 14 bits.
        "phone_8g": Accelerometer(
            noise_density=150e-6 * G, range=8 * G, resolution=1e-3 * G, bandwidth=200.0
        ),
    },
    "velocity_sensor": {
        "ideal": VelocitySensor(),
        # Laser vibrometer, 5 mm/s per volt.
        "laser_vibrometer": VelocitySensor(sensitivity=200.0, noise_density=2e-8, range=0.05, bandwidth=22e3),
    },
    "displacement_sensor": {
        "ideal": DisplacementSensor(),
        # Triangulation laser of 10 mm range.
        "laser_10mm": DisplacementSensor(sensitivity=1000.0, noise_density=2e-8, range=0.005, bandwidth=10e3),
        # Rotary encoder on a rack, 560 counts per centimetre.
        "encoder_560_cm": DisplacementSensor(resolution=0.01 / 560),
    },
    "force_sensor": {
        "ideal": ForceSensor(),
        # Piezoelectric load cell, 11 mV/N, 440 N.
        "piezo_11mv_n": ForceSensor(sensitivity=0.011, noise_density=5e-5, range=440.0),
        # Strain-gauge load cell of 1 kN with 0.1 % calibration error.
        "strain_1kn": ForceSensor(
            sensitivity=0.002, sensitivity_error=1e-3, noise_density=5e-3, range=1000.0
        ),
    },
    "shaker": {
        "ideal": Shaker(),
        # Small electrodynamic exciter of 10 N.
        "exciter_10n": Shaker(bandwidth=9e3, range=10.0),
        # Medium modal shaker of 100 N with its amplifier.
        "modal_100n": Shaker(gain_error=0.01, bandwidth=3e3, range=100.0),
    },
    "acquisition": {
        "ideal": Acquisition(),
        # Laboratory front end: 24 bits, 10 V.
        "lab_24bit": Acquisition(range=10.0, bits=24, anti_alias=0.4),
        # Data logger: 16 bits, 10 V, steep filter.
        "logger_16bit": Acquisition(range=10.0, bits=16, anti_alias=0.4, anti_alias_order=6),
    },
}
WHOLE_NUMBERS = ("bits", "anti_alias_order")
SENSORS = ("accelerometer", "velocity_sensor", "displacement_sensor")

Choice = str | Mapping[str, Any] | None


def instrument(
    rig: Rig,
    *,
    noise_percent: float = 0.0,
    accelerometer: Choice = None,
    velocity_sensor: Choice = None,
    displacement_sensor: Choice = None,
    force_sensor: Choice = None,
    shaker: Choice = None,
    acquisition: Choice = None,
    sample_rate: float | None = None,
) -> Rig:
    """The rig with instruments in its measurement chain.

    Args:
        rig: structure and the chain so far.
        noise_percent: white noise on every output, as a percentage of each channel's RMS.
        accelerometer, velocity_sensor, displacement_sensor, force_sensor, shaker, acquisition: name of a preset, or a
            table of settings that may start from one (`{"preset": …, …}`).
        sample_rate: of the acquisition [Hz], which its anti-alias filter follows.

    Raises:
        UnknownNameError: no such preset.
        LabError: no such setting, a value that is no number or out of its bounds, or settings that do not go together.
    """
    if not (math.isfinite(noise_percent) and noise_percent >= 0):
        raise LabError(f"noise_percent is {noise_percent}; expected a number from 0")
    chain = rig.chain
    cell = _chosen("force_sensor", force_sensor)
    if cell is not None and cell.bandwidth:
        raise LabError(
            f"force_sensor has a bandwidth of {cell.bandwidth} Hz, but forces are recorded as means over samples; leave it out"
        )
    source = _chosen("shaker", shaker)
    front = _chosen("acquisition", acquisition)
    for channel in rig.inputs:
        if source is not None:
            chain = chain.adding("actuators", *source.stages(channel.name))
        if cell is not None and channel.quantity == "force":
            signal, samples = cell.stages(channel.name)
            chain = replace(chain.adding("force_sensors", *signal, *samples), force_measured=True)
    choices = dict(zip(SENSORS, (accelerometer, velocity_sensor, displacement_sensor), strict=True))
    by_quantity = {
        s.quantity: s for s in (_chosen(kind, choice) for kind, choice in choices.items()) if s is not None
    }
    for channel in rig.outputs:
        sensor = by_quantity.get(channel.quantity)
        signal, samples = sensor.stages(channel.name) if sensor is not None else ((), ())
        volts = sensor.sensitivity if sensor is not None else 1.0
        before, after = _acquired(front, channel.name, volts, sample_rate) if front is not None else ((), ())
        chain = chain.adding("sensors", *signal, *before).adding("acquisition", *samples, *after)
    if noise_percent:
        chain = replace(chain, acquisition=(Noise(ALL, percent=float(noise_percent)), *chain.acquisition))
    return rig.with_chain(chain)


def _acquired(
    front: Acquisition, channel: str, volts: float, sample_rate: float | None
) -> tuple[tuple[Stage, ...], tuple[Stage, ...]]:
    """Stages of the acquisition before and after sampling, in the unit of a channel of `volts` per unit."""
    before: list[Stage] = []
    after: list[Stage] = []
    if front.delay:
        before.append(Delay(channel, front.delay))
    if front.anti_alias:
        if sample_rate is None:
            raise LabError(
                "an anti-alias filter follows the sample rate; give sample_rate, or set anti_alias to 0"
            )
        before.append(LowPass(channel, front.anti_alias * sample_rate, front.anti_alias_order))
    if front.bits and not front.range:
        raise LabError(
            f"acquisition has {front.bits} bits and no range; give its range [V], or set bits to 0"
        )
    if front.range:
        after.append(Saturation(channel, front.range / volts))
        if front.bits:
            after.append(Resolution(channel, 2 * front.range / 2**front.bits / volts))
    if front.dropout:
        after.append(Dropout(channel, front.dropout))
    return tuple(before), tuple(after)


def _chosen(kind: str, choice: Choice) -> Any:
    """The instrument meant by a preset's name or a table of settings."""
    if choice is None:
        return None
    presets = PRESETS[kind]
    settings = {"preset": choice} if isinstance(choice, str) else dict(choice)
    name = settings.pop("preset", "ideal")
    if name not in presets:
        raise UnknownNameError(f"{kind} {name!r} is unknown; there are {', '.join(presets)}")
    base = presets[name]
    allowed = [f.name for f in fields(base)]
    for key, value in settings.items():
        if key not in allowed:
            raise LabError(f"{kind} has no setting {key!r}; expected preset, {', '.join(allowed)}")
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise LabError(f"{kind} setting {key} is {value!r}; expected a number")
        if key in WHOLE_NUMBERS and value != int(value):
            raise LabError(f"{kind} setting {key} is {value!r}; expected a whole number")
        # Only an error of a gain has a sign, and a sensitivity must tell volts from nothing.
        if (value < 0 and not key.endswith("_error")) or (key == "sensitivity" and value == 0):
            raise LabError(f"{kind} setting {key} is {value!r}; expected a positive number")
    return replace(base, **{key: int(v) if key in WHOLE_NUMBERS else v for key, v in settings.items()})
