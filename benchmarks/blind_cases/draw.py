"""Draw: a family and a seed give a case, the same to the last bit."""

from __future__ import annotations

import zlib
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from benchmarks.blind_cases.excite import RUNS, Run
from benchmarks.blind_cases.lookalikes import LOOKALIKES
from benchmarks.blind_cases.make import by_mujoco, recorded
from benchmarks.blind_cases.motion import DENSE, respond
from benchmarks.blind_cases.network import draw_network
from benchmarks.blind_cases.outside import OUTSIDE
from benchmarks.blind_cases.power import deflection
from benchmarks.blind_cases.sizes import CAUSES, hidden_cause
from benchmarks.blind_cases.strange import Strange, by_own_integrator
from benchmarks.blind_cases.structure import Array, Structure
from benchmarks.blind_cases.truss import draw_truss
from benchmarks.blind_cases.truth import Case, Hidden, Scale

MATTERS = 3.0
"""Least change of the worst channel, in units of its noise, by an effect outside the catalogue."""
UNFELT = ("actuator_gain", "actuator_lag", "actuator_delay", "actuator_saturation")
"""Causes that a release does not show."""


@dataclass(frozen=True)
class Family:
    """One kind of case.

    Attributes:
        hides: "cause", "lookalike", "outside" or "nothing".
        masses: least and most of a network; none for a truss.
        unsensed: share of masses without a sensor.
        quantities: what sensors measure.
        runs: kinds of the records.
        n_samples: of every record.
        noise: RMS over that of the channel.
        size: of the effect over the usual one.
        n_hidden: how many causes.
    """

    hides: str = "cause"
    masses: tuple[int, int] | None = (3, 6)
    unsensed: float = 0.0
    quantities: tuple[str, ...] = ("acceleration",)
    runs: tuple[str, ...] = ("random",)
    n_samples: int = 8192
    noise: float = 0.01
    size: float = 1.0
    n_hidden: int = 1


MIXED = ("acceleration", "velocity", "displacement")
FAMILIES = {
    "singles": Family(),
    "sparse": Family(unsensed=0.2),
    "pairs": Family(n_hidden=2),
    "weak": Family(n_samples=4096, noise=0.05, size=0.5),
    "large": Family(masses=(12, 16), unsensed=0.5),
    "xbraced": Family(masses=None, runs=("random", "impact"), n_samples=4096),
    "lookalikes": Family(hides="lookalike"),
    "outside": Family(hides="outside"),
    "clean": Family(hides="nothing"),
    "free_decay": Family(runs=("free_decay", "free_decay"), n_samples=4096),
    "displacement": Family(quantities=("displacement",)),
    "mixed": Family(quantities=MIXED),
    "records": Family(runs=("random", "impact", "sweep"), n_samples=3072),
}


def draw(
    seed: int, family: str, *, kind: Family | None = None, only: str | None = None, strength: float = 1.0
) -> Case:
    """A case of a family.

    Args:
        seed: what everything is drawn from; consecutive seeds go through the causes one after the other.
        family: name in `FAMILIES`.
        kind: what the family is, where it is to differ from that table.
        only: the cause to hide, instead of the seed's own.
        strength: times the family's size of the effect.
    """
    kind = kind or FAMILIES[family]
    rng = np.random.default_rng([seed, zlib.crc32(family.encode())])
    printed = draw_truss(rng) if kind.masses is None else _network(kind, kind.masses, rng)
    jitter = kind.hides == "nothing" or bool(rng.random() < 0.5)
    built = printed.jittered(rng) if jitter else printed
    dt = float(f"{1 / (6 * printed.frequencies_hz[-1]):.3g}")
    runs = [RUNS[run](printed, kind.n_samples, dt, rng) for run in kind.runs]
    scale = _scale(printed, runs, dt)
    size = kind.size * strength
    plain = (
        by_own_integrator(built, runs, dt, Strange(Hidden("nothing", ""))) if not _released(runs) else None
    )
    if kind.hides in ("lookalike", "outside"):
        table = LOOKALIKES if kind.hides == "lookalike" else OUTSIDE
        draw_one = table[only or list(table)[seed % len(table)]]
        clean, hidden = _strange(draw_one, built, runs, dt, scale, plain or [], kind, size, rng)
    else:
        hidden = () if kind.hides == "nothing" else _causes(kind, scale, seed, only, size, rng)
        clean = by_mujoco(built, runs, dt, hidden, 0.01 * kind.noise)
    recording, level = recorded(built, runs, clean, dt, noise=kind.noise, rng=rng)
    away = float("nan")
    # The bars of a spatial truss are straight lines here only to first order: the change would hold that difference too.
    if plain is not None and hidden and kind.masses is not None:
        away = deflection(built, runs, dt, [a - b for a, b in zip(clean, plain, strict=True)], level)
    return Case(family, seed, printed.xml, recording, hidden, jitter, away)


def _network(kind: Family, masses: tuple[int, int], rng: np.random.Generator) -> Structure:
    return draw_network(rng, masses=masses, unsensed=kind.unsensed, quantities=kind.quantities)


def _released(runs: Sequence[Run]) -> bool:
    return any(run.release is not None for run in runs)


def _scale(structure: Structure, runs: Sequence[Run], dt: float) -> Scale:
    """Motion under the first record, or, after a release, under a random force that moves the structure as much."""
    run = runs[0]
    rng = np.random.default_rng(0)
    u = RUNS["random"](structure, run.inputs.shape[1], dt, rng).inputs if _released(runs) else run.inputs
    return Scale(structure, u, dt, respond(structure, u, dt)[:, :, ::DENSE])


def _causes(
    kind: Family, scale: Scale, seed: int, only: str | None, size: float, rng: np.random.Generator
) -> tuple[Hidden, ...]:
    names = [name for name in CAUSES if not ("free_decay" in kind.runs and name in UNFELT)]
    first = only or names[seed % len(names)]
    hidden = [hidden_cause(first, scale, rng, size=size)]
    while len(hidden) < kind.n_hidden:
        others = [name for name in names if name != hidden[0].cause]
        more = hidden_cause(str(rng.choice(others)), scale, rng, size=size)
        taken = {part for h in hidden for part in h.location.split("|")}
        # Two causes at one place are one more unknown of it, not a second finding.
        if not taken & set(more.location.split("|")) and more.cause != hidden[0].cause:
            hidden.append(more)
    return tuple(hidden)


def _strange(
    draw_one: object, built: Structure, runs: Sequence[Run], dt: float, scale: Scale, plain: list[Array], kind: Family,
    size: float, rng: np.random.Generator,
) -> tuple[list[Array], tuple[Hidden, ...]]:  # fmt: skip
    """Clean outputs, the effect so strong that it matters."""
    state = rng.bit_generator.state
    for _ in range(6):
        rng.bit_generator.state = state
        strange = draw_one(scale, rng, size)  # type: ignore[operator]
        clean = by_own_integrator(built, runs, dt, strange)
        change = np.concatenate([a - b for a, b in zip(clean, plain, strict=True)], axis=1)
        signal = np.concatenate(plain, axis=1)
        if np.max(np.std(change, axis=1) / np.std(signal, axis=1)) > MATTERS * kind.noise:
            break
        size *= 1.5
    return clean, (strange.hidden,)
