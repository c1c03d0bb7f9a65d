"""Conclude: what a diagnosis tells of the causes that it found."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence

import numpy as np

from identification.progress import UNHEARD, Work
from identification.recording import Array, Recording
from lab.diagnosis import words
from lab.diagnosis.baseline import Baseline
from lab.diagnosis.candidate import Candidate
from lab.diagnosis.check import check
from lab.diagnosis.evidence import undecided
from lab.diagnosis.gain import errors_of, held_out, noise_floor, predictions_of, simulated
from lab.diagnosis.misfit import Misfit
from lab.diagnosis.noise import noise_of
from lab.diagnosis.outcome import (
    CONSISTENT,
    EXPLAINED,
    UNEXPLAINED,
    Alternative,
    Calibrated,
    Diagnosis,
    Errors,
    Finding,
    Quantity,
)
from lab.diagnosis.starts import best_starts, motions_of, starts_of
from lab.diagnosis.state import State
from lab.diagnosis.unlearnable import unlearnable
from lab.diagnosis.whiteness import Whiteness
from lab.effects.actuator_gain import ActuatorGain
from lab.effects.damping_change import DampingChange
from lab.effects.edits import law_of, with_law, with_mass
from lab.effects.effect import EVERYWHERE, Effect
from lab.effects.mass_change import MassChange
from lab.effects.stiffness_change import StiffnessChange
from lab.hands import meanwhile
from lab.rig import Rig


def effects_of(state: State) -> list[tuple[Candidate, Effect, dict[str, Quantity]]]:
    """The accepted causes at their fitted size, with error bars."""
    found, used = [], 0
    covariance, n = state.fit.covariance, state.fit.theta.size
    offset = n
    for candidate in state.accepted:
        if candidate.direction is not None:
            found.append((candidate, *_own_change(state, candidate, covariance)))
            continue
        cause = state.fit.causes[used]
        used += 1
        slopes = []
        for j in range(cause.n):
            step = np.zeros(cause.n)
            step[j] = 1e-4
            up, down = (
                cause.at(cause.values + step).effect.parameters,
                cause.at(cause.values - step).effect.parameters,
            )
            slopes.append([(up[name] - down[name]) / 2e-4 for name in up])
        J = np.array(slopes).reshape(cause.n, len(cause.effect.parameters))
        own = covariance[offset : offset + cause.n, offset : offset + cause.n]
        stds = np.sqrt(np.maximum(np.einsum("ja,jk,ka->a", J, own, J), 0.0))
        effect = cause.effect
        quantities = {
            name: Quantity(float(value), float(std), effect.units[name])
            for (name, value), std in zip(effect.parameters.items(), stds, strict=True)
        }
        offset += cause.n
        found.append((candidate, effect, quantities))
    return found


def _own_change(state: State, candidate: Candidate, covariance: Array) -> tuple[Effect, dict[str, Quantity]]:
    """A mass, stiffness or damping that left its tolerance, as an effect."""
    assert candidate.direction is not None
    parameters, theta = state.misfit.parameters, state.fit.theta
    members = np.flatnonzero(candidate.direction)
    logs = theta[members] * parameters.widths[members]
    weights = np.full(members.size, 1 / members.size)
    change = float(np.expm1(weights @ logs))
    scale = weights * parameters.widths[members]
    # What changed is known no better than what it was before: its tolerance belongs to the error bar.
    tolerance = float(np.sqrt(np.sum(scale**2)))
    fitted = float(np.sqrt(scale @ covariance[np.ix_(members, members)] @ scale))
    std = (1 + change) * float(np.hypot(fitted, tolerance))
    if candidate.cause == "mass_change" and candidate.location != EVERYWHERE:
        mass = float(state.misfit.twin.body_mass[members[0]])
        effect: Effect = MassChange(candidate.location, delta_mass=mass * change)
        return effect, {"delta_mass": Quantity(mass * change, mass * std, "kg")}
    kinds = {"mass_change": MassChange, "stiffness_change": StiffnessChange, "damping_change": DampingChange}
    effect = kinds[candidate.cause](candidate.location, relative_change=change)
    return effect, {"relative_change": Quantity(change, std, "1")}


def conclude(
    state: State,
    recording: Recording,
    nominal: Rig,
    rig: Rig,
    first: Sequence[Candidate],
    left: Whiteness,
    known: Baseline | None,
    refused: Candidate | None,
    as_given: Callable[[], list[Array]],
    work: Work = UNHEARD,
) -> Diagnosis:
    """What a diagnosis tells: findings with their sizes, alternatives, the extended model, and the gain on data kept aside.

    Args:
        state: with all causes.
        recording: measured.
        nominal: rig as the engineer believes it.
        rig: what was calibrated: the nominal one, or what a baseline made of it.
        first: candidates of the first search.
        left: whether what remains is noise.
        known: what the baseline taught.
        refused: cause that the data ask for and that may not be named.
        as_given: how to get the outputs of the nominal rig, as `nominal_ahead` gives it.
        work: told how much of this is done.
    """
    causes = effects_of(state)
    calibrated = calibrated_rig(state.misfit, state.origin.theta, rig)
    extended = extended_rig(state, rig)
    misfit = state.misfit
    floor = floor_of(state)
    driven = [
        (model, motions_of(model, nominal.dofs, starts_of(misfit, found.theta)))
        for model, found in ((calibrated, state.origin), (extended, state.fit))
    ]
    predictions = predictions_of(
        recording, misfit, as_given, driven, accuracy=accuracy_below(floor), work=work
    )
    shares = _shares(state, floor)
    findings = [
        Finding(effect, quantities, 0.5 * candidate.gain, share, words.says(effect, quantities))
        for (candidate, effect, quantities), share in zip(causes, shares, strict=True)
    ]
    verdict, warnings = (EXPLAINED if findings else CONSISTENT), []
    if not left.passed and known is not None and known.covers(state.misfit, state.fit):
        warnings.append(words.as_in_the_baseline(known.power, recording))
    elif not left.passed:
        verdict = UNEXPLAINED
        warnings.append(words.left_over(left, recording))
    errors = errors_of(predictions, floor)
    # A baseline excuses what is left; then the data kept aside must tell whether what was named explains anything.
    if known is not None and findings and not predicts(errors):
        verdict = UNEXPLAINED
        warnings.append(words.no_gain(errors))
    if refused is not None:
        verdict = UNEXPLAINED
        warnings.append(words.not_to_be_named(refused.cause, refused.location))
    if known is not None and findings:
        warnings += [words.shared(name, std) for name, std in known.gains.items()]
    alternatives = _alternatives(first, misfit.colour) if findings else ()
    warnings += words.inseparable(alternatives)
    return Diagnosis(
        verdict,
        tuple(sorted(findings, key=lambda f: -f.holdout_gain)),
        alternatives,
        calibration_of(state),
        errors,
        predictions,
        nominal,
        extended,
        tuple(warnings),
        noise=noise_of(misfit.made_whole(state.fit.residual), recording),
        unlearnable=(*check(recording, nominal), *unlearnable(state.misfit, state.fit)),
    )


def nominal_ahead(state: State, recording: Recording, nominal: Rig) -> Callable[[], list[Array]]:
    """How to get the outputs of the nominal rig, which a helper simulates while this process goes on.

    They are as accurate as the noise asks for that the fit so far leaves.
    """
    misfit = state.misfit
    return meanwhile(
        simulated,
        recording,
        (nominal, motions_of(nominal, nominal.dofs, best_starts(misfit))),
        accuracy=accuracy_below(floor_of(state)),
        substeps=misfit.substeps,
    )


def predicts(errors: Errors) -> bool:
    """Whether the extended model predicts the data kept aside better than the calibrated one, and than nothing at all."""
    return errors.extended < min(errors.calibrated, 1.0)


def extended_rig(state: State, rig: Rig) -> Rig:
    """The rig with its parameters as fitted, and with the causes so far."""
    extended = calibrated_rig(state.misfit, state.fit.theta, rig)
    for cause in state.fit.causes:
        extended = cause.effect.apply(extended)
    return extended


def floor_of(state: State) -> float:
    """Noise over signal, as the fit so far leaves it."""
    return noise_floor(state.misfit.made_whole(state.fit.residual), held_out(state.misfit))


def accuracy_below(floor: float) -> float:
    """Relative error of a simulation that noise hides."""
    return max(0.2 * floor, 1e-6)


def _shares(state: State, floor: float) -> list[float]:
    """Share of the calibrated model's excess error on data kept aside that each cause removed, 0 to 1."""
    errors = state.held_out
    excess = max(errors[0] - floor, 1e-12)
    return [float(np.clip((a - b) / excess, 0.0, 1.0)) for a, b in itertools.pairwise(errors)]


def _alternatives(first: Sequence[Candidate], colour: float) -> tuple[Alternative, ...]:
    """The next best explanations of the first finding."""
    told = first[0]
    found = []
    for c in first[1:6]:
        if c.gain > 0:
            # Only a baseline teaches a colour; white errors the evidence knows already.
            chance = undecided(told.fit, c.fit, colour) if colour > 1 else 0.0
            advice = words.advice(told.cause, c.cause, 0.5 * (told.gain - c.gain), chance)
            found.append(Alternative(c.cause, c.location, 0.5 * c.gain, advice))
    return tuple(found)


def calibration_of(state: State) -> dict[str, Calibrated]:
    """Nominal and calibrated value of every parameter of the model, with the causes in it."""
    misfit, n = state.misfit, state.misfit.parameters.n_factors
    model = misfit.twin
    gains = np.ones(len(misfit.parameters.inputs))
    nominal = np.concatenate([model.body_mass, model.stiffness, model.damping, gains])
    widths = misfit.parameters.widths[:n]
    factors = np.exp(state.fit.theta[:n] * widths)
    stds = nominal * factors * widths * np.sqrt(np.diag(state.fit.covariance)[:n])
    rows = zip(misfit.parameters.names[:n], nominal, nominal * factors, stds, strict=True)
    return {name: Calibrated(float(a), float(b), float(c)) for name, a, b, c in rows}


def calibrated_rig(misfit: Misfit, theta: Array, rig: Rig) -> Rig:
    """The rig with its masses, stiffnesses, dampings and gains at the parameters `theta`."""
    mass, stiffness, damping = misfit.parameters.factors(theta)
    original = rig
    for body, factor in zip(misfit.twin.bodies, mass, strict=True):
        rig = with_mass(rig, body, float(factor))
    for name, k, c in zip(misfit.twin.springs, stiffness, damping, strict=True):
        elastic, viscous = law_of(original, original.spring(name))
        rig = with_law(
            rig,
            name,
            stiffness=[float(k) * elastic[0], *elastic[1:]],
            damping=[float(c) * viscous[0], *viscous[1:]],
        )
    gains = misfit.parameters.gains(theta)
    for i, gain in zip(misfit.parameters.inputs, gains, strict=True):
        rig = ActuatorGain(rig.inputs[i].name, relative_change=float(gain) - 1).apply(rig)
    return rig
