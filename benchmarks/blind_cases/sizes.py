"""Places and sizes of the causes of the catalogue, drawn so that they matter and yet leave the structure what it is."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from benchmarks.blind_cases.structure import Body, Port, Spring, Structure
from benchmarks.blind_cases.truth import Hidden, Scale

Draw = Callable[[Scale, np.random.Generator, float], Hidden]


def hidden_cause(cause: str, scale: Scale, rng: np.random.Generator, *, size: float = 1.0) -> Hidden:
    """A cause at a place, with `size` times the usual strength."""
    return CAUSES[cause](scale, rng, size)


def _spring(scale: Scale, rng: np.random.Generator) -> Spring:
    return scale.structure.springs[int(rng.integers(len(scale.structure.springs)))]


def _body(scale: Scale, rng: np.random.Generator) -> Body:
    return scale.structure.bodies[int(rng.integers(len(scale.structure.bodies)))]


def _output(scale: Scale, rng: np.random.Generator) -> Port:
    return scale.structure.outputs[int(rng.integers(len(scale.structure.outputs)))]


def _input(scale: Scale, rng: np.random.Generator) -> str:
    return str(rng.choice([port.name for port in scale.structure.inputs]))


def _one_of(rng: np.random.Generator, *values: float) -> float:
    return float(rng.choice(values))


def _sign(rng: np.random.Generator) -> float:
    return _one_of(rng, -1.0, 1.0)


def _in_band(scale: Scale, rng: np.random.Generator) -> float:
    f = scale.structure.frequencies_hz
    return float(rng.uniform(0.8 * f[0], 1.1 * f[-1]))


def _delay(scale: Scale, rng: np.random.Generator, size: float) -> float:
    """Whole samples, or parts of them [s]."""
    samples = _one_of(rng, 1, 2) if rng.random() < 0.5 else float(rng.uniform(0.6, 2.0))
    return scale.dt * samples * size


def _mass_change(scale: Scale, rng: np.random.Generator, size: float) -> Hidden:
    body = _body(scale, rng)
    return Hidden("mass_change", body.name, {"delta_mass": _one_of(rng, 0.08, 0.12, 0.2) * size * body.mass})


def _stiffness_change(scale: Scale, rng: np.random.Generator, size: float) -> Hidden:
    change = _one_of(rng, -0.3, -0.2, -0.15, 0.15, 0.25) * size
    return Hidden("stiffness_change", _spring(scale, rng).name, {"relative_change": change})


def _damping_change(scale: Scale, rng: np.random.Generator, size: float) -> Hidden:
    # Two or four times more, as the tolerance of a damping is wide.
    change = _one_of(rng, 2.0, 4.0) * size
    return Hidden("damping_change", _spring(scale, rng).name, {"relative_change": change})


def _missing_spring(scale: Scale, rng: np.random.Generator, size: float) -> Hidden:
    if not scale.structure.untied:
        return _stiffness_change(scale, rng, size)
    name = str(rng.choice(list(scale.structure.untied)))
    typical = float(np.median([spring.stiffness for spring in scale.structure.springs]))
    return Hidden("missing_spring", name, {"stiffness": typical * float(rng.uniform(0.1, 0.4)) * size})


def _attached_oscillator(scale: Scale, rng: np.random.Generator, size: float) -> Hidden:
    body = _body(scale, rng)
    mass = body.mass * float(rng.uniform(0.04, 0.1)) * size
    values = {"mass": mass, "frequency_hz": _in_band(scale, rng), "damping_ratio": 0.02}
    return Hidden("attached_oscillator", body.name, values)


def _cubic_stiffness(scale: Scale, rng: np.random.Generator, size: float) -> Hidden:
    spring = _spring(scale, rng)
    x, _ = scale.extension(spring)
    k3 = spring.stiffness / x**2 * _one_of(rng, 0.05, 0.1, 0.2) * size
    return Hidden("cubic_stiffness", spring.name, {"k3": k3})


def _bilinear_stiffness(scale: Scale, rng: np.random.Generator, size: float) -> Hidden:
    change = _one_of(rng, -0.3, -0.2, 0.2, 0.3) * size
    return Hidden("bilinear_stiffness", _spring(scale, rng).name, {"relative_change_in_extension": change})


def _freeplay(scale: Scale, rng: np.random.Generator, size: float) -> Hidden:
    spring = _spring(scale, rng)
    half_gap = scale.extension(spring)[0] * float(rng.uniform(0.1, 0.3)) * size
    return Hidden("freeplay", spring.name, {"half_gap": half_gap})


def _gap_contact(scale: Scale, rng: np.random.Generator, size: float) -> Hidden:
    spring = _spring(scale, rng)
    gap = _sign(rng) * scale.extension(spring)[0] * float(rng.uniform(0.8, 1.5))
    stop = spring.stiffness * float(np.exp(rng.uniform(0, np.log(6)))) * size
    return Hidden("gap_contact", spring.name, {"gap": gap, "contact_stiffness": stop})


def _coulomb_friction(scale: Scale, rng: np.random.Generator, size: float) -> Hidden:
    dof = int(rng.integers(scale.structure.n))
    force = scale.push * _one_of(rng, 0.1, 0.2) * size
    return Hidden(
        "coulomb_friction", scale.structure.dofs[dof], {"force": force}, same_as(scale.structure, dof)
    )


def same_as(structure: Structure, dof: int) -> tuple[str, ...]:
    """Springs whose extension is the position of a joint: friction there is the same."""
    return tuple(
        s.name for s in structure.springs if [d for d, _ in s.row] == [dof] and abs(s.row[0][1]) == 1
    )


def _quadratic_damping(scale: Scale, rng: np.random.Generator, size: float) -> Hidden:
    spring = _spring(scale, rng)
    x, v = scale.extension(spring)
    c2 = spring.stiffness * x / v**2 * _one_of(rng, 0.06, 0.15) * size
    return Hidden("quadratic_damping", spring.name, {"c2": c2})


def _hysteresis(scale: Scale, rng: np.random.Generator, size: float) -> Hidden:
    spring = _spring(scale, rng)
    x, _ = scale.extension(spring)
    stiffness = spring.stiffness * float(rng.uniform(0.15, 0.6)) * size
    return Hidden(
        "hysteresis",
        spring.name,
        {"stiffness": stiffness, "yield_displacement": x * float(rng.uniform(0.3, 1.0))},
    )


def _stiffness_drift(scale: Scale, rng: np.random.Generator, size: float) -> Hidden:
    change = _one_of(rng, -0.2, -0.1, -0.06, 0.1) * size
    return Hidden("stiffness_drift", _spring(scale, rng).name, {"relative_change_over_record": change})


def _unmeasured_force(scale: Scale, rng: np.random.Generator, size: float) -> Hidden:
    amplitude = scale.push * _one_of(rng, 0.1, 0.2) * size
    values = {
        "frequency_hz": _in_band(scale, rng),
        "amplitude": amplitude,
        "phase": float(rng.uniform(-3, 3)),
    }
    return Hidden("unmeasured_force", _body(scale, rng).name, values)


def _sensor_gain(scale: Scale, rng: np.random.Generator, size: float) -> Hidden:
    change = -2.0 if rng.random() < 0.1 else _one_of(rng, -0.12, -0.07, 0.07, 0.12) * size
    return Hidden("sensor_gain", _output(scale, rng).name, {"relative_change": change})


def _sensor_delay(scale: Scale, rng: np.random.Generator, size: float) -> Hidden:
    return Hidden("sensor_delay", _output(scale, rng).name, {"delay": _delay(scale, rng, size)})


def _sensor_lag(scale: Scale, rng: np.random.Generator, size: float) -> Hidden:
    corner = scale.structure.frequencies_hz[-1] * float(rng.uniform(0.6, 2.0)) / size
    return Hidden("sensor_lag", _output(scale, rng).name, {"corner_hz": corner})


def _sensor_saturation(scale: Scale, rng: np.random.Generator, size: float) -> Hidden:
    port = _output(scale, rng)
    return Hidden(
        "sensor_saturation",
        port.name,
        {"limit": scale.rms(port) * float(rng.uniform(1.2, 2.0)) * 2 ** (1 - size)},
    )


def _sensor_swap(scale: Scale, rng: np.random.Generator, size: float) -> Hidden:
    outputs = scale.structure.outputs
    alike = [
        f"{a.name}|{b.name}"
        for i, a in enumerate(outputs)
        for b in outputs[i + 1 :]
        if a.quantity == b.quantity
    ]
    return Hidden("sensor_swap", str(rng.choice(alike))) if alike else _sensor_gain(scale, rng, size)


def _line_hum(scale: Scale, rng: np.random.Generator, size: float) -> Hidden:
    port = _output(scale, rng)
    values = {
        "frequency_hz": _in_band(scale, rng),
        "amplitude": scale.rms(port) * _one_of(rng, 0.05, 0.1) * size,
    }
    return Hidden("line_hum", port.name, {**values, "phase": float(rng.uniform(-3, 3))})


def _actuator_gain(scale: Scale, rng: np.random.Generator, size: float) -> Hidden:
    return Hidden(
        "actuator_gain", _input(scale, rng), {"relative_change": _one_of(rng, -0.15, -0.1, 0.1, 0.15) * size}
    )


def _actuator_lag(scale: Scale, rng: np.random.Generator, size: float) -> Hidden:
    return Hidden(
        "actuator_lag", _input(scale, rng), {"time_constant": scale.dt * float(rng.uniform(0.4, 1.5)) * size}
    )


def _actuator_delay(scale: Scale, rng: np.random.Generator, size: float) -> Hidden:
    return Hidden("actuator_delay", _input(scale, rng), {"delay": _delay(scale, rng, size)})


def _actuator_saturation(scale: Scale, rng: np.random.Generator, size: float) -> Hidden:
    row = int(rng.integers(len(scale.structure.inputs)))
    limit = float(np.std(scale.inputs[row])) * float(rng.uniform(1.2, 2.0)) * 2 ** (1 - size)
    return Hidden("actuator_saturation", scale.structure.inputs[row].name, {"limit": limit})


CAUSES: dict[str, Draw] = {
    draw.__name__.removeprefix("_"): draw
    for draw in (
        _mass_change, _stiffness_change, _damping_change, _missing_spring, _attached_oscillator, _cubic_stiffness,
        _bilinear_stiffness, _freeplay, _gap_contact, _coulomb_friction, _quadratic_damping, _hysteresis,
        _stiffness_drift, _unmeasured_force, _sensor_gain, _sensor_delay, _sensor_lag, _sensor_saturation, _sensor_swap,
        _line_hum, _actuator_gain, _actuator_lag, _actuator_delay, _actuator_saturation,
    )
}  # fmt: skip
