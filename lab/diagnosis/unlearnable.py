"""Unlearnable: parameters that these data leave where the prior put them, and scales that no such data can tell."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from lab.diagnosis.check import listed
from lab.diagnosis.fit import Fit
from lab.diagnosis.misfit import Misfit

NARROWED = 0.9
"""A posterior wider than this share of the prior has learned nothing."""
EXACT = 1e-6
"""Two changes cancel when together they move all predictions less than this share of what one does: rounding leaves 1e-10."""
FACTOR = 1.05
CLOSER = "excite it more, or measure closer to it"
GROUPS = {
    "mass": ("every body", CLOSER),
    "stiffness": ("every spring", CLOSER),
    "damping": ("every spring", CLOSER),
    "gain": ("every input", "weigh one body, or calibrate the input"),
}
"""What all of a group are called, and how to learn more of them."""


def unlearnable(misfit: Misfit, fit: Fit) -> tuple[str, ...]:
    """What these data cannot tell about the model's parameters and the channels' gains, one sentence each."""
    return (*_left_to_the_prior(misfit, fit), *_common_scales(misfit, fit))


def _left_to_the_prior(misfit: Misfit, fit: Fit) -> Iterator[str]:
    """Parameters whose posterior is hardly narrower than their prior."""
    prior = np.diag(np.linalg.pinv(fit.precision, hermitian=True))
    posterior = np.diag(fit.covariance)[: fit.theta.size]
    wide = posterior > NARROWED**2 * prior
    for group, (everyone, advice) in GROUPS.items():
        members = misfit.parameters.group(group)
        names = [misfit.parameters.names[j].partition(" ")[2] for j in members if wide[j]]
        if not names:
            continue
        whose = everyone if len(names) == len(members) > 1 else listed(names)
        yield (
            f"the {group} of {whose} cannot be learned from these data: it stays where the model and its tolerance put it; "
            f"{advice}"
        )


def _common_scales(misfit: Misfit, fit: Fit) -> Iterator[str]:
    """Scales of everything together that no reading shows, tried out."""
    parameters, plant = misfit.parameters, misfit.twin.plant
    scaled = fit.theta.copy()
    n = parameters.n_structural
    scaled[:n] += np.log(FACTOR) / parameters.widths[:n]
    as_it_is = misfit.residual(fit.theta)
    change = np.linalg.norm(misfit.residual(scaled) - as_it_is)
    # Heavier, stiffer and more damped by one factor, a structure moves less by that factor: more force, or more gain, makes up.
    for channels, side, what, instrument in (
        (plant.inputs, "input", "the gain of", "load cell"),
        (plant.outputs, "output", "the gain of all sensors,", "sensor"),
    ):
        if not channels or not change > 0:
            continue
        together = _with_gains(misfit, side).residual(scaled)
        if np.linalg.norm(together - as_it_is) < EXACT * change:
            yield (
                f"a common factor on all masses, stiffnesses and dampings cannot be told from one on {what} "
                f"{listed([channel.name for channel in channels])}: weigh one body, or calibrate one {instrument}"
            )


def _with_gains(misfit: Misfit, side: str) -> Misfit:
    """The misfit with all gains of one side larger by the factor."""
    plant = misfit.twin.plant
    for i, path in enumerate(plant.input_paths if side == "input" else plant.output_paths):
        change = plant.with_input if side == "input" else plant.with_output
        plant = change(i, gain=FACTOR * path.gain)
    return replace(misfit, twin=replace(misfit.twin, plant=plant))
