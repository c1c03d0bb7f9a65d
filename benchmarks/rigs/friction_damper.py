"""Friction damper: its force under an imposed displacement, by a diagnosis and by laws fitted directly.

A diagnosis needs forces that drive and motion that answers; here the motion is imposed and the force answers. The model
`imposed.xml` reads that the other way round. The backlash is in series with the friction, where no law of the catalogue is, so
that laws are fitted to the force directly besides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import scipy.optimize

import lab
from benchmarks.rigs.row import DATA, RIGS, Row, measured, told
from identification.recording import Array, Record, Recording
from lab.diagnosis.colour import colour
from lab.effects import EFFECTS
from lab.files.importing import read_foreign
from lab.files.recipe import parse_recipe
from lab.rig import Rig

EVERY = 16
"""Samples skipped: 64 Hz are plenty for a sine of 0.5 Hz."""
TRAINED = 0.7

WIDTHS = {"mass": 1e-4, "stiffness": 1.0, "damping": 1.0}
LAWS_OF_FORCE = (
    "bilinear_stiffness",
    "coulomb_friction",
    "cubic_stiffness",
    "freeplay",
    "gap_contact",
    "hysteresis",
    "quadratic_damping",
)
"""What may be named: the servo is exact and the force known, so that nothing else can be wrong."""

Law = Callable[[Array, Array, Array], Array]
"""Displacement, velocity, parameters -> force."""


def viscous(x: Array, v: Array, p: Array) -> Array:
    """A spring and a dashpot: k x + c v + offset."""
    return p[0] * x + p[1] * v + p[2]


def coulomb(x: Array, v: Array, p: Array) -> Array:
    """Dry friction of two levels: p0 forwards, -p1 backwards."""
    return np.where(v > 0, p[0], -p[1])


def slider(x: Array, v: Array, p: Array) -> Array:
    """A spring of stiffness p2 in series with dry friction of levels p0 and p1 (Jenkins)."""
    return _slid(x, p[0], p[1], p[2], 0.0)


def slider_with_backlash(x: Array, v: Array, p: Array) -> Array:
    """The same with a clearance of half-gap p3 in the spring."""
    return _slid(x, p[0], p[1], p[2], abs(p[3]))


def _slid(x: Array, forwards: float, backwards: float, k: float, half_gap: float) -> Array:
    """Force of a spring with clearance whose far end slips."""
    force, foot = np.empty_like(x), x[0]
    reach, back = half_gap + forwards / k, half_gap + backwards / k
    for i, xi in enumerate(x):
        foot = min(max(foot, xi - reach), xi + back)
        stretch = xi - foot
        force[i] = k * (np.sign(stretch) * max(abs(stretch) - half_gap, 0.0))
    return force


LAWS: dict[str, tuple[Law, tuple[float, ...]]] = {
    "viscous damping": (viscous, (1e5, 1e5, 1e3)),
    "coulomb_friction": (coulomb, (1e4, 1e4)),
    "friction behind a spring": (slider, (1e4, 1e4, 1e7)),
    "friction behind a spring with backlash": (slider_with_backlash, (1e4, 1e4, 1e7, 2e-3)),
}
"""Name: law, scale of its parameters."""


@dataclass(frozen=True, eq=False)
class Fitted:
    """A law at its best parameters, with one standard deviation and its error on data kept aside, RMS over RMS."""

    values: Array
    stds: Array
    error: float


def fitted(law: Law, scale: tuple[float, ...], x: Array, v: Array, force: Array) -> Fitted:
    """The law by least squares on the first part of a record; samples with alike errors count as one."""
    size, n = np.array(scale), int(TRAINED * x.size)
    level = float(np.quantile(np.abs(force), 0.7))

    def residual(q: Array) -> Array:
        return (law(x, v, q * size) - force)[:n] / level

    starts = [np.array([level, level, *size[2:]]) / size, np.array([level, level, *(size[2:] / 3)]) / size]
    found = min(
        (scipy.optimize.least_squares(residual, start, diff_step=1e-3, x_scale="jac") for start in starts),
        key=lambda each: each.cost,
    )
    power = np.mean(found.fun**2) * colour(found.fun[None])
    covariance = np.linalg.pinv(found.jac.T @ found.jac) * power
    late = slice(n, None)
    error = np.sqrt(np.mean((law(x, v, found.x * size)[late] - force[late]) ** 2) / np.mean(force[late] ** 2))
    return Fitted(found.x * size, np.sqrt(np.diag(covariance)) * size, float(error))


def imposed(tension: int, every: int = 1) -> Recording:
    """The tests of one tension [lb], all amplitudes, for `imposed.xml`; every so many samples."""
    text = (RIGS / "friction_damper" / "imposed.toml").read_text("utf-8")
    recipe = parse_recipe(text.replace("0.5Hz36lb", f"0.5Hz{tension}lb"))
    recording = read_foreign(DATA / "friction_damper", recipe).recording
    assert recording is not None
    records = tuple(Record(r.kind, r.inputs[:, ::every], r.outputs[:, ::every]) for r in recording.records)
    return replace(recording, records=records, sample_rate=recording.sample_rate / every)


def diagnosed(tension: int, every: int = 1) -> lab.Diagnosis:
    """What the lab says of a device that is believed to be a weak spring and damper."""
    rig = Rig.load(RIGS / "friction_damper" / "imposed.xml")
    laws = {cause: EFFECTS[cause] for cause in LAWS_OF_FORCE}
    return lab.diagnose(imposed(tension, every), rig, widths=WIDTHS, effects=laws)


def level(diagnosis: lab.Diagnosis) -> float:
    """Force at which the device slides [N], of the first finding; not a number where it is no friction."""
    found = {name: q.value for f in diagnosis.findings[:1] for name, q in f.parameters.items()}
    return found.get("force", found.get("stiffness", np.nan) * found.get("yield_displacement", np.nan))


def named() -> Iterator[Row]:
    """What a diagnosis says of each tension."""
    for tension in (0, 36):
        diagnosis = diagnosed(tension)
        rivals = ", ".join(f"{a.cause} {a.log_evidence_gain:.0f}" for a in diagnosis.alternatives[:2])
        gains = ", ".join(f"{f.log_evidence_gain:.0f}" for f in diagnosis.findings)
        yield told(
            "Friction damper",
            f"What does the device add at {tension} lb (0.5, 1 and 1.5 in together)?",
            "dry friction with backlash, rising with tension",
            diagnosis,
            remark=f"level {level(diagnosis) / 1e3:.3g} kN; log evidence {gains or 'none'}, next {rivals}; levels forwards and "
            "backwards differ, and the backlash lies in series with the friction: no law of the catalogue has either",
        )


def rows() -> Iterator[Row]:
    """All rows of this rig."""
    yield from named()
    yield from fitted_laws()


def fitted_laws() -> Iterator[Row]:
    """Laws fitted directly to the force of each test."""
    for tension in (0, 36):
        for amplitude in ("0.5", "1", "1.5"):
            place = f"friction_damper/0.5Hz{tension}lbtension{amplitude}amplitude.json"
            record = measured(place, "friction_damper/characterization.toml").records[0]
            x, force, v = (row[::EVERY] for row in (record.inputs[0], record.outputs[0], record.outputs[1]))
            results = {name: fitted(law, scale, x, v, force) for name, (law, scale) in LAWS.items()}
            best = min(results, key=lambda name: results[name].error)
            p, s = results[best].values, results[best].stds
            parts = [f"{p[0] / 1e3:.2f} ± {s[0] / 1e3:.1g} kN", f"-{p[1] / 1e3:.2f} ± {s[1] / 1e3:.1g} kN"]
            if len(p) > 2:
                parts.append(f"stiffness {p[2] / 1e6:.2g} ± {s[2] / 1e6:.1g} MN/m")
            if len(p) > 3:
                parts.append(f"half gap {1e3 * abs(p[3]):.2f} ± {1e3 * s[3]:.1g} mm")
            yield Row(
                "Friction damper",
                f"Which law at a tension of {tension} lb, {amplitude} in?",
                "dry friction with backlash, rising with tension",
                best,
                ", ".join(parts),
                "error " + ", ".join(f"{r.error:.2f} {name}" for name, r in results.items()),
                "fitted to the force directly, outside the diagnosis"
                + ("; tension of this test measured wrongly" if (tension, amplitude) == (0, "0.5") else ""),
            )
