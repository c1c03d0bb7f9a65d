"""Maximum likelihood after any method: M, C, K where the layout allows, else the modes, with honest error bars."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from identification.errors import IdentificationError, RecordingError
from identification.likelihood import SUSPICIOUS, Estimate, refine
from identification.modes import Modes
from identification.recording import Recording
from identification.segments import TRANSIENT
from identification.structures import free_matrices
from identification.systems import SecondOrder, StateSpace

FAR = 0.2
"""Relative distance of a refined pole beyond which it is another mode."""


@dataclass(frozen=True, eq=False)
class Refinement:
    """The likeliest model near what a method found.

    Attributes:
        estimate: parameters, modes and matrices with standard deviations.
        modes: those of the method, moved to where they are likeliest.
        partners: the nearest mode of the method to each of them, by position.
        second_order: M, C_d and K; None where the layout or the data do not determine them.
        sentence: what was done and how it ended.
        warnings: what a careful reader should know, one sentence each.
    """

    estimate: Estimate
    modes: Modes
    partners: tuple[int, ...]
    second_order: SecondOrder | None
    sentence: str
    warnings: tuple[str, ...]


def refinement(
    recording: Recording,
    modes: Modes,
    *,
    system: StateSpace | None = None,
    matrices: SecondOrder | None = None,
) -> Refinement:
    """Modes, and M, C, K where there are some to begin with, at the maximum of the likelihood.

    Args:
        recording: records with inputs, or free decays.
        modes: found by any method at the outputs of the recording.
        system: model with these modes and the inputs of the recording, where the method gives one; without it the
            participation of the inputs is found by least squares first.
        matrices: found with them; None leaves it at the modes.

    Returns:
        The estimate that was reached; where M, C, K cannot be fitted, that of the modes, which is then said.

    Raises:
        RecordingError: forces were not measured, or samples are missing.
        IdentificationError: there is no mode, or the likelihood has no maximum nearby.

    Source: Ljung (1999), System Identification, 2nd ed., eq. (7.76) and section 10.2; whether the records begin at
        rest by the criterion of Schwarz (1978), Ann. Stat. 6(2), 461-464.
    """
    _require_forces(recording)
    if not len(modes):
        raise IdentificationError("there is no mode to refine; record for longer or try another method")
    structure, warnings = _structure(recording, matrices)
    if structure is not None:
        return _of_structure(structure, modes)
    start = system if system is not None and len(system.inputs) == len(recording.inputs) else modes
    found = _likeliest(recording, start)
    if not found.converged or not _has_all(found, modes):
        raise IdentificationError(
            f"the likelihood has no maximum near the modes found ({found.n_iterations} steps); take another method or "
            "order to start from"
        )
    nearest = np.array(_partners(found.modes, modes)[0])
    rank = np.argsort(nearest)
    own = found.modes.take(nearest[rank]).normalized()
    sentence = _sentence("The modes were", found)
    return Refinement(found, own, tuple(rank.tolist()), None, sentence, (*warnings, *found.notes))


def _structure(recording: Recording, matrices: SecondOrder | None) -> tuple[Estimate | None, tuple[str, ...]]:
    """The likeliest M, C, K, or why there are none."""
    if matrices is None:
        return None, ()
    try:
        found = _likeliest(recording, matrices)
        if found.converged:
            return found, ()
        why = f"no maximum near the start ({found.n_iterations} steps)"
    except IdentificationError as error:
        why = str(error)
    return None, (f"Mass, damping and stiffness could not be refined: {why}.",)


def _require_forces(recording: Recording) -> None:
    recording.require_complete()
    for number, record in enumerate(recording.records):
        if record.kind != "free_decay" and not record.inputs.shape[0]:
            raise RecordingError(
                f"record {number} of kind {record.kind} has no measured inputs; maximum likelihood needs them, or free "
                "decays; leave the refinement out"
            )


def _likeliest(recording: Recording, start: SecondOrder | StateSpace | Modes) -> Estimate:
    """The estimate from rest, or with free initial states where the data ask for them."""
    structure = free_matrices(start.dofs) if isinstance(start, SecondOrder) else None
    found = refine(recording, start, parameterization=structure)
    if all(record.kind in TRANSIENT for record in recording.records):
        return found
    near = found.second_order or found.system
    free = refine(recording, near, parameterization=structure, initial_state="free")
    n_states = sum(x.size for x in free.initial_states)
    n_values = recording.n_samples * len(recording.outputs)
    gain = free.log_likelihood - found.log_likelihood
    return free if gain > 0.5 * n_states * np.log(n_values) else found


def _partners(refined: Modes, modes: Modes) -> tuple[list[int], list[bool]]:
    """The nearest refined mode to each mode, and whether it is near."""
    gap = np.abs(refined.poles[:, None] - modes.poles) / np.abs(modes.poles)
    nearest = np.argmin(gap, axis=0)
    near = gap[nearest, np.arange(len(modes))] < FAR
    return nearest.tolist(), near.tolist()


def _has_all(found: Estimate, modes: Modes) -> bool:
    """Whether each of the modes has a refined one of its own."""
    if len(found.modes) < len(modes):
        return False
    nearest, near = _partners(found.modes, modes)
    return all(near) and len(set(nearest)) == len(modes)


def _of_structure(found: Estimate, modes: Modes) -> Refinement:
    """All modes of M, C, K; those of the method that are none of these are said to be lost."""
    nearest, near = _partners(found.modes, modes)
    lost = [k for k in range(len(modes)) if not near[k] or nearest.index(nearest[k]) != k]
    warnings = found.notes
    if lost:
        listed = ", ".join(f"{modes.frequency_hz[k]:.4g}" for k in lost)
        white = float(np.min(found.whiteness)) >= SUSPICIOUS
        why = (
            "these leave nothing but white noise, so they are taken for noise"
            if white
            else "these leave more than white noise, so they may be real; refine with another method or order"
        )
        warnings = (
            f"The modes at {listed} Hz are not among those of mass, damping and stiffness; {why}.",
            *warnings,
        )
    partners = np.argmin(np.abs(modes.poles[:, None] - found.modes.poles), axis=0)
    sentence = _sentence("Mass, damping and stiffness, and with them the modes, were", found)
    return Refinement(
        found, found.modes.normalized(), tuple(partners.tolist()), found.second_order, sentence, warnings
    )


def _sentence(what: str, found: Estimate) -> str:
    free = ", with free initial states," if found.initial_states else ""
    return (
        f"{what} moved{free} to the maximum of the output-error likelihood over {len(found.names)} parameters in "
        f"{found.n_iterations} steps."
    )
