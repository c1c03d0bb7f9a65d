"""Laws that resemble those of the catalogue: the nearest name is the answer."""

from __future__ import annotations

import numpy as np
import scipy.signal

from benchmarks.blind_cases import motion
from benchmarks.blind_cases.motion import DENSE, Law
from benchmarks.blind_cases.sizes import same_as
from benchmarks.blind_cases.strange import Draw, Strange, on_row, sharpness
from benchmarks.blind_cases.structure import Array, Spring
from benchmarks.blind_cases.truth import Hidden, Scale


def _spring(scale: Scale, rng: np.random.Generator) -> tuple[Spring, Array, float, float]:
    spring = scale.structure.springs[int(rng.integers(len(scale.structure.springs)))]
    return spring, scale.structure.row(spring), *scale.extension(spring)


def _friction(
    scale: Scale, rng: np.random.Generator, size: float
) -> tuple[Hidden, Array, float, float, float]:
    dof = int(rng.integers(scale.structure.n))
    force = scale.push * float(rng.uniform(0.1, 0.2)) * size
    row = np.eye(scale.structure.n)[dof]
    places = scale.structure.dofs[dof], {"force": force}, same_as(scale.structure, dof)
    hidden = Hidden("coulomb_friction", *places, exact=False)
    return hidden, row, force, sharpness(scale, dof, force), float(np.std(scale.motion[1, dof]))


def steep_friction(scale: Scale, rng: np.random.Generator, size: float) -> Strange:
    """Dry friction with a steep but finite slope at rest."""
    hidden, row, force, sharp, _ = _friction(scale, rng, size)
    return Strange(hidden, (Law(motion.FRICTION, row, (force, sharp)),))


def stribeck_friction(scale: Scale, rng: np.random.Generator, size: float) -> Strange:
    """Dry friction whose breakaway force exceeds the sliding force by a third or so."""
    hidden, row, force, sharp, v = _friction(scale, rng, size)
    peak, fall = float(rng.uniform(0.2, 0.5)), v * float(rng.uniform(0.1, 0.3))
    hidden = Hidden(hidden.cause, hidden.location, {}, hidden.also, exact=False)
    sharp = max(sharp, sharp * (1 + peak))
    return Strange(hidden, (Law(motion.STRIBECK, row, (force, sharp, peak, fall)),))


def soft_stop(scale: Scale, rng: np.random.Generator, size: float) -> Strange:
    """A stop of rubber, whose stiffness builds up over a part of the travel."""
    spring, row, x, _ = _spring(scale, rng)
    gap = float(rng.choice([-1.0, 1.0])) * x * float(rng.uniform(0.8, 1.3))
    law = gap, spring.stiffness * float(rng.uniform(2, 5)) * size, x * float(rng.uniform(0.1, 0.3))
    return Strange(Hidden("gap_contact", spring.name, exact=False), (Law(motion.SOFT_STOP, row, law),))


def hardening(scale: Scale, rng: np.random.Generator, size: float) -> Strange:
    """A spring that hardens a little faster than with the cube."""
    spring, row, x, _ = _spring(scale, rng)
    k3 = spring.stiffness / x**2 * float(rng.uniform(0.05, 0.15)) * size
    law = k3, 0.05 * k3 / x**2
    return Strange(Hidden("cubic_stiffness", spring.name, exact=False), (Law(motion.HARDENING, row, law),))


def drag(scale: Scale, rng: np.random.Generator, size: float) -> Strange:
    """A drag that grows with the power 1.8 or 2.2 of the velocity."""
    spring, row, x, v = _spring(scale, rng)
    power = float(rng.choice([1.8, 2.2]))
    law = spring.stiffness * x / v**power * float(rng.uniform(0.06, 0.15)) * size, power
    return Strange(Hidden("quadratic_damping", spring.name, exact=False), (Law(motion.DRAG, row, law),))


def round_bilinear(scale: Scale, rng: np.random.Generator, size: float) -> Strange:
    """A spring stiffer one way than the other, with a smooth turn."""
    spring, row, x, _ = _spring(scale, rng)
    law = spring.stiffness * float(rng.choice([-0.3, 0.3])) * size, 0.15 * x
    return Strange(
        Hidden("bilinear_stiffness", spring.name, exact=False), (Law(motion.ROUND_BILINEAR, row, law),)
    )


def round_freeplay(scale: Scale, rng: np.random.Generator, size: float) -> Strange:
    """Play with rounded corners."""
    spring, row, x, _ = _spring(scale, rng)
    law = spring.stiffness, x * float(rng.uniform(0.1, 0.3)) * size
    return Strange(Hidden("freeplay", spring.name, exact=False), (Law(motion.ROUND_FREEPLAY, row, law),))


def ageing(scale: Scale, rng: np.random.Generator, size: float) -> Strange:
    """A spring that loses stiffness first faster, then slower."""
    spring, row, _, _ = _spring(scale, rng)
    duration = scale.inputs.shape[1] * scale.dt
    law = -spring.stiffness * float(rng.uniform(0.1, 0.3)) * size, duration * float(rng.uniform(0.7, 1.5))
    return Strange(Hidden("stiffness_drift", spring.name, exact=False), (Law(motion.AGEING, row, law),))


def triangle_force(scale: Scale, rng: np.random.Generator, size: float) -> Strange:
    """An unmeasured force of triangles: one ninth of the third harmonic."""
    body = scale.structure.bodies[int(rng.integers(len(scale.structure.bodies)))]
    f = scale.structure.frequencies_hz
    omega = 2 * np.pi * float(rng.uniform(0.8 * f[0], 1.1 * f[-1]))
    row = np.eye(scale.structure.n)[body.dofs[0]]
    law = scale.push * float(rng.uniform(0.1, 0.2)) * size, omega, float(rng.uniform(-3, 3))
    return Strange(Hidden("unmeasured_force", body.name, exact=False), (Law(motion.TRIANGLE, row, law),))


def second_order_lag(scale: Scale, rng: np.random.Generator, size: float) -> Strange:
    """A sensor with a second pole a few times above the first."""
    row = int(rng.integers(len(scale.structure.outputs)))
    corner = scale.structure.frequencies_hz[-1] * float(rng.uniform(0.5, 1.2)) / size
    poles = 2 * np.pi * np.array([corner, corner * float(rng.uniform(4, 8))])
    b, a = scipy.signal.bilinear([poles.prod()], np.poly(-poles), DENSE / scale.dt)
    hidden = Hidden("sensor_lag", scale.structure.outputs[row].name, exact=False)
    return Strange(hidden, sense=on_row(row, lambda y: np.asarray(scipy.signal.lfilter(b, a, y))))


def soft_clipping(scale: Scale, rng: np.random.Generator, size: float) -> Strange:
    """A sensor that bends before it clips."""
    row = int(rng.integers(len(scale.structure.outputs)))
    port = scale.structure.outputs[row]
    limit = scale.rms(port) * float(rng.uniform(1.3, 2.0)) / size
    hidden = Hidden("sensor_saturation", port.name, exact=False)
    return Strange(hidden, sense=on_row(row, lambda y: y / (1 + np.abs(y / limit) ** 8) ** (1 / 8)))


def late_shaker(scale: Scale, rng: np.random.Generator, size: float) -> Strange:
    """A shaker whose lag has a small second pole."""
    row = int(rng.integers(len(scale.structure.inputs)))
    slow, fast = np.exp(-1 / (float(rng.uniform(0.6, 1.5)) * size)), 0.03
    b, a = [(1 - slow) * (1 - fast)], np.poly([slow, fast])
    hidden = Hidden("actuator_lag", scale.structure.inputs[row].name, exact=False)
    return Strange(hidden, feel=on_row(row, lambda u: np.asarray(scipy.signal.lfilter(b, a, u))))


LOOKALIKES: dict[str, Draw] = {
    draw.__name__: draw
    for draw in (
        steep_friction, stribeck_friction, soft_stop, hardening, drag, round_bilinear, round_freeplay, ageing,
        triangle_force, second_order_lag, soft_clipping, late_shaker,
    )
}  # fmt: skip
