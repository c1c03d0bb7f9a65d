"""Suspects: what every cause of the catalogue would do to the outputs of a planned test."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.information import planned
from identification.recording import Array, Channel
from lab.diagnosis.calibrate import parameters_of, survey_of
from lab.diagnosis.changes import OWN_PARAMETERS
from lab.diagnosis.fit import theta_slopes
from lab.diagnosis.hypothesis import Hypothesis
from lab.diagnosis.misfit import Misfit
from lab.diagnosis.screening import hypotheses
from lab.effects import EFFECTS
from lab.errors import LabError, UnknownNameError
from lab.hands import beside
from lab.placement.plan import Plan
from lab.responder import NO_OBSERVER
from lab.rig import Rig
from lab.twin import twin

PROBE = 0.1
"""Share of a noticeable size at which the effect of a cause is computed."""
MEMORY = 2e9
"""Bytes that all effects may take."""
NOTHING = 1e-9
"""An effect below this share of the output is rounding."""


@dataclass(frozen=True, eq=False)
class Suspects:
    """Effects of causes on a planned test.

    Attributes:
        keys: cause and location of each effect; a cause with several variables has several.
        needs: output channels that a cause sits in, as positions; it is no suspect where one is not connected.
        drives: input channels that it sits in, likewise; it is no suspect where one does not act.
        acting: input channels that act.
        probes: the change that gives each effect: a hypothesis, or the number of a parameter.
        slopes: of the model's parameters, shape (n_parameters, n_outputs, n_total), per width of their prior.
        effects: at the size of the probes, shape (n_effects, n_outputs, n_total).
        outputs: without any cause, shape (n_outputs, n_total).
        precision: of the prior of the parameters.
    """

    keys: tuple[tuple[str, str], ...]
    needs: tuple[tuple[int, ...], ...]
    drives: tuple[tuple[int, ...], ...]
    acting: tuple[int, ...]
    probes: tuple[Hypothesis | int, ...]
    slopes: Array
    effects: Array
    outputs: Array
    precision: Array


def suspects(
    rig: Rig,
    plan: Plan,
    *,
    causes: Sequence[str] = (),
    acting: Sequence[int] | None = None,
    like: Suspects | None = None,
    widths: Mapping[str, float] | None = None,
) -> Suspects:
    """Every cause at every place and what it does.

    Args:
        rig: with the candidate outputs and inputs connected.
        plan: the test.
        causes: names of the causes to consider; the whole catalogue when empty.
        acting: positions of the inputs that act; all when None.
        like: the same causes at the same physical sizes, from another test of the same rig; proposed anew when None.
        widths: relative tolerance of the model's parameters, as for `lab.diagnose`.

    Raises:
        LabError: the effects do not fit into memory.
        UnknownNameError: no such cause.
    """
    unknown = [cause for cause in causes if cause not in EFFECTS]
    if unknown:
        raise UnknownNameError(f"cause {unknown[0]!r} does not exist; there are {', '.join(EFFECTS)}")
    acts = tuple(range(len(rig.inputs)) if acting is None else acting)
    misfit = _misfit(rig, plan, widths, acts)
    theta = np.zeros(misfit.parameters.n)
    y = misfit.measured
    slopes = -theta_slopes(misfit, theta, (), NO_OBSERVER, misfit.residual(theta), None)
    probes = _probes(misfit, causes or tuple(EFFECTS)) if like is None else like.probes
    n = len(probes) + len(slopes)
    if n * y.nbytes + 8 * n**2 * y.shape[0] > MEMORY:
        raise LabError(
            f"{len(probes)} effects on {y.shape[0]} outputs of {y.shape[1]} samples do not fit into memory; record shorter, "
            "forbid some candidates, or name the causes to tell apart"
        )

    def effect(probe: Hypothesis | int) -> Array:
        return slopes[probe] if isinstance(probe, int) else -misfit.residual(theta, (probe,))

    effects = np.array(list(beside(effect, probes)))
    if like is not None:
        # What runs away in this test shows itself, but not how: it counts as unseen.
        effects[~np.all(np.isfinite(effects), axis=(1, 2))] = 0.0
        return replace(like, acting=acts, slopes=slopes, effects=effects, outputs=y)
    scale = np.sqrt(np.mean(y**2, axis=1, keepdims=True))
    size = np.max(np.abs(effects) / np.where(scale > 0, scale, np.inf), axis=(1, 2))
    kept = np.isfinite(size) & (size > NOTHING)
    chosen = [probe for probe, is_kept in zip(probes, kept, strict=True) if is_kept]
    keys = tuple(_key(misfit, probe) for probe in chosen)
    needs, drives = (
        tuple(_positions(location, channels) for _, location in keys)
        for channels in (rig.outputs, rig.inputs)
    )
    precision = misfit.parameters.precision
    return Suspects(keys, needs, drives, acts, tuple(chosen), slopes, effects[kept], y, precision)


def _positions(location: str, channels: Sequence[Channel]) -> tuple[int, ...]:
    """Which of the channels a location names."""
    names = [channel.name for channel in channels]
    return tuple(names.index(part) for part in location.split("|") if part in names)


def _misfit(rig: Rig, plan: Plan, widths: Mapping[str, float] | None, acting: Sequence[int]) -> Misfit:
    """The planned test of the rig's twin, its outputs as the twin predicts them."""
    signals = plan.signals(rig, acting)
    test = planned([u for _, u in signals], rig.inputs, rig.outputs, sample_rate=plan.sample_rate)
    model = twin(rig)
    silent = Misfit.of(test, model, parameters_of(model, widths), share=1.0)
    y = -silent.residual(np.zeros(silent.parameters.n))
    ends = np.cumsum(silent.n_train)[:-1]
    records = tuple((u, part) for (u, _), part in zip(silent.records, np.split(y, ends, axis=1), strict=True))
    misfit = replace(silent, records=records)
    survey = survey_of(misfit, rig, np.zeros(misfit.parameters.n))
    # Without data no tone stands out: one amid the modes stands for all.
    tone = (survey.middle_frequency,)
    return replace(misfit, survey=replace(survey, tones=(tone,) * len(rig.outputs), common_tones=tone))


def _probes(misfit: Misfit, causes: Sequence[str]) -> list[Hypothesis | int]:
    """One change for each variable of each cause at each place, and each parameter that the model has."""
    found: list[Hypothesis | int] = [j for j in range(misfit.parameters.n) if _key(misfit, j)[0] in causes]
    for h in hypotheses(misfit, {cause: EFFECTS[cause] for cause in causes}):
        absent = [
            j for j, name in enumerate(h.guess.scale) if name not in h.kind.positive and not h.values[j]
        ]
        for j in absent:
            values = h.values.copy()
            values[j] = PROBE
            found.append(h.at(values))
        if not absent:
            found.append(h)
    return found


def _key(misfit: Misfit, probe: Hypothesis | int) -> tuple[str, str]:
    if isinstance(probe, int):
        group, _, place = misfit.parameters.names[probe].partition(" ")
        return OWN_PARAMETERS[group], place
    return probe.kind.cause, probe.location
