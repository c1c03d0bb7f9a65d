"""Effects: the causes that a test can hide and a diagnosis can name. This is the whole catalogue."""

from __future__ import annotations

from lab.effects.actuator_delay import ActuatorDelay
from lab.effects.actuator_gain import ActuatorGain
from lab.effects.actuator_lag import ActuatorLag
from lab.effects.actuator_saturation import ActuatorSaturation
from lab.effects.attached_oscillator import AttachedOscillator
from lab.effects.bilinear_stiffness import BilinearStiffness
from lab.effects.coulomb_friction import CoulombFriction
from lab.effects.cubic_stiffness import CubicStiffness
from lab.effects.damping_change import DampingChange
from lab.effects.effect import Effect
from lab.effects.freeplay import Freeplay
from lab.effects.gap_contact import GapContact
from lab.effects.hysteresis import Hysteresis
from lab.effects.line_hum import LineHum
from lab.effects.mass_change import MassChange
from lab.effects.missing_spring import MissingSpring
from lab.effects.quadratic_damping import QuadraticDamping
from lab.effects.sensor_delay import SensorDelay
from lab.effects.sensor_gain import SensorGain
from lab.effects.sensor_lag import SensorLag
from lab.effects.sensor_saturation import SensorSaturation
from lab.effects.sensor_swap import SensorSwap
from lab.effects.stiffness_change import StiffnessChange
from lab.effects.stiffness_drift import StiffnessDrift
from lab.effects.unmeasured_force import UnmeasuredForce

EFFECTS: dict[str, type[Effect]] = {
    "mass_change": MassChange,
    "stiffness_change": StiffnessChange,
    "damping_change": DampingChange,
    "missing_spring": MissingSpring,
    "attached_oscillator": AttachedOscillator,
    "cubic_stiffness": CubicStiffness,
    "bilinear_stiffness": BilinearStiffness,
    "freeplay": Freeplay,
    "gap_contact": GapContact,
    "coulomb_friction": CoulombFriction,
    "quadratic_damping": QuadraticDamping,
    "hysteresis": Hysteresis,
    "stiffness_drift": StiffnessDrift,
    "unmeasured_force": UnmeasuredForce,
    "sensor_gain": SensorGain,
    "sensor_delay": SensorDelay,
    "sensor_lag": SensorLag,
    "sensor_saturation": SensorSaturation,
    "sensor_swap": SensorSwap,
    "line_hum": LineHum,
    "actuator_gain": ActuatorGain,
    "actuator_lag": ActuatorLag,
    "actuator_delay": ActuatorDelay,
    "actuator_saturation": ActuatorSaturation,
}
