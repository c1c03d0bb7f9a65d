"""Effects that the catalogue neither has nor comes near: the answer is that they are unexplained."""

from __future__ import annotations

import numpy as np
import scipy.signal

from benchmarks.blind_cases import motion
from benchmarks.blind_cases.motion import DENSE, Law
from benchmarks.blind_cases.strange import Draw, Strange, on_row, sharpness
from benchmarks.blind_cases.structure import Array, Spring
from benchmarks.blind_cases.truth import Hidden, Scale


def _spring(scale: Scale, rng: np.random.Generator) -> tuple[Spring, Array, float, float]:
    spring = scale.structure.springs[int(rng.integers(len(scale.structure.springs)))]
    return spring, scale.structure.row(spring), *scale.extension(spring)


def _output(scale: Scale, rng: np.random.Generator) -> tuple[int, str, float]:
    row = int(rng.integers(len(scale.structure.outputs)))
    port = scale.structure.outputs[row]
    return row, port.name, scale.rms(port)


def pulsating_spring(scale: Scale, rng: np.random.Generator, size: float) -> Strange:
    """Stiffness and damping beat with time, as in a rotating part."""
    spring, row, _, _ = _spring(scale, rng)
    omega = 2 * np.pi * scale.structure.frequencies_hz[0] * float(rng.uniform(0.15, 0.6))
    law = 2 * spring.damping * size, omega, 0.15 * spring.stiffness * size, float(rng.uniform(-3, 3))
    return Strange(Hidden("pulsating_spring", spring.name), (Law(motion.PULSATING, row, law),))


def quintic_spring(scale: Scale, rng: np.random.Generator, size: float) -> Strange:
    """Hardens with the fifth power only."""
    spring, row, x, _ = _spring(scale, rng)
    law = (spring.stiffness / x**4 * 0.05 * size,)
    return Strange(Hidden("quintic_spring", spring.name), (Law(motion.QUINTIC, row, law),))


def magnetic_detent(scale: Scale, rng: np.random.Generator, size: float) -> Strange:
    """A force that repeats with the distance, several times over the travel."""
    spring, row, x, _ = _spring(scale, rng)
    law = 0.1 * spring.stiffness * x * size, 0.3 * x
    return Strange(Hidden("magnetic_detent", spring.name), (Law(motion.SINE, row, law),))


def loaded_friction(scale: Scale, rng: np.random.Generator, size: float) -> Strange:
    """Friction at a joint that grows with the force in a spring elsewhere."""
    dof = int(rng.integers(scale.structure.n))
    _, other, x, _ = _spring(scale, rng)
    force = 0.3 * scale.push * size
    law = force / x, sharpness(scale, dof, 3 * force)
    row = np.eye(scale.structure.n)[dof]
    return Strange(
        Hidden("loaded_friction", scale.structure.dofs[dof]), (Law(motion.LOADED_FRICTION, row, law, other),)
    )


def wandering_clock(scale: Scale, rng: np.random.Generator, size: float) -> Strange:
    """Samples are longer and shorter by a few percent, back and forth."""
    turns, shift = float(rng.uniform(2, 5)), float(rng.uniform(-3, 3))

    def clock(n: int) -> Array:
        return np.asarray(1 + 0.01 * size * np.sin(2 * np.pi * turns * np.arange(n) / n + shift))

    return Strange(Hidden("wandering_clock", "*"), clock=clock)


def telegraph(scale: Scale, rng: np.random.Generator, size: float) -> Strange:
    """A sensor's zero jumps between two levels at random instants."""
    row, name, rms = _output(scale, rng)
    seed = int(rng.integers(2**31))

    def jump(y: Array) -> Array:
        flips = np.random.default_rng(seed).random(y.size) < 1 / (40 * DENSE)
        return np.asarray(y + 0.1 * size * rms * (-1.0) ** np.cumsum(flips))

    return Strange(Hidden("telegraph", name), sense=on_row(row, jump))


def wandering_zero(scale: Scale, rng: np.random.Generator, size: float) -> Strange:
    """A sensor's zero drifts as slow noise."""
    row, name, rms = _output(scale, rng)
    seed = int(rng.integers(2**31))

    def wander(y: Array) -> Array:
        keep = np.exp(-1 / (100 * DENSE))
        steps = np.random.default_rng(seed).standard_normal(y.size) * np.sqrt(1 - keep**2)
        return np.asarray(y + 0.1 * size * rms * scipy.signal.lfilter([1.0], [1.0, -keep], steps))

    return Strange(Hidden("wandering_zero", name), sense=on_row(row, wander))


def dropouts(scale: Scale, rng: np.random.Generator, size: float) -> Strange:
    """A loose cable: a sensor reads nothing for moments."""
    row, name, _ = _output(scale, rng)
    seed = int(rng.integers(2**31))

    def drop(y: Array) -> Array:
        lost = np.random.default_rng(seed).random(y.size // DENSE) < 0.004 * size
        lost = np.convolve(lost, np.ones(5))[: lost.size] > 0
        return np.where(np.repeat(lost, DENSE), 0.0, y)

    return Strange(Hidden("dropouts", name), sense=on_row(row, drop))


def crosstalk(scale: Scale, rng: np.random.Generator, size: float) -> Strange:
    """One channel leaks into another."""
    outputs = scale.structure.outputs
    if len(outputs) < 2:
        return telegraph(scale, rng, size)
    a, b = (int(i) for i in rng.choice(len(outputs), size=2, replace=False))
    leak = 0.15 * size * scale.rms(outputs[a]) / scale.rms(outputs[b])

    def sense(y: Array) -> Array:
        return np.asarray(y + leak * np.outer(np.eye(len(y))[a], y[b]))

    return Strange(Hidden("crosstalk", outputs[a].name), sense=sense)


def crooked_sensor(scale: Scale, rng: np.random.Generator, size: float) -> Strange:
    """A sensor answers more to one side than to the other."""
    row, name, rms = _output(scale, rng)
    return Strange(Hidden("crooked_sensor", name), sense=on_row(row, lambda y: y + 0.05 * size * y**2 / rms))


def breathing_gain(scale: Scale, rng: np.random.Generator, size: float) -> Strange:
    """A sensor's gain goes up and down over the record."""
    row, name, _ = _output(scale, rng)
    turns, shift = float(rng.uniform(1, 4)), float(rng.uniform(-3, 3))

    def breathe(y: Array) -> Array:
        return np.asarray(
            y * (1 + 0.1 * size * np.sin(2 * np.pi * turns * np.arange(y.size) / y.size + shift))
        )

    return Strange(Hidden("breathing_gain", name), sense=on_row(row, breathe))


def weak_amplifier(scale: Scale, rng: np.random.Generator, size: float) -> Strange:
    """A shaker loses force with the square of what is asked."""
    row = int(rng.integers(len(scale.structure.inputs)))
    rms = float(np.std(scale.inputs[row]))
    name = scale.structure.inputs[row].name
    lossy = on_row(row, lambda u: u - 0.1 * size * u**2 / rms)
    return Strange(Hidden("weak_amplifier", name), feel=lossy)


OUTSIDE: dict[str, Draw] = {
    draw.__name__: draw
    for draw in (
        pulsating_spring, quintic_spring, magnetic_detent, loaded_friction, wandering_clock, telegraph, wandering_zero,
        dropouts, crosstalk, crooked_sensor, breathing_gain, weak_amplifier,
    )
}  # fmt: skip
