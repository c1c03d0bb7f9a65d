"""Maximum likelihood after any method: M, C, K where the layout allows, else the modes, with honest error bars."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from identification.errors import IdentificationError, NotSecondOrderError, RecordingError
from identification.likelihood import SUSPICIOUS, Estimate, refine
from identification.modes import Modes
from identification.recording import Recording
from identification.second_order import second_order
from identification.segments import TRANSIENT
from identification.structures import free_matrices
from identification.systems import SecondOrder, StateSpace

FEW = 20
"""Steps from the likeliest model with free initial states to that from rest, where it is near."""

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
        RecordingError: forces were not measured, or miss samples.
        IdentificationError: there is no mode, or the likelihood has no maximum nearby.

    Source: Ljung (1999), System Identification, 2nd ed., eq. (7.76) and section 10.2; whether the records begin at
        rest by the criterion of Schwarz (1978), Ann. Stat. 6(2), 461-464.
    """
    _require_forces(recording)
    if not len(modes):
        raise IdentificationError("there is no mode to refine; record for longer or try another method")
    start = system if system is not None and len(system.inputs) == len(recording.inputs) else modes
    found = _likeliest(recording, start)
    structure, warnings = (None, ()) if matrices is None else _structure(recording, matrices, found)
    if structure is not None:
        return _told("Mass, damping and stiffness, and with them the modes, were", structure, modes, warnings)
    if not found.converged or not len(found.modes):
        raise IdentificationError(
            f"the likelihood has no maximum near the modes found ({found.n_iterations} steps); take another method or "
            "order to start from"
        )
    return _told("The modes were", found, modes, warnings)


def _structure(
    recording: Recording, matrices: SecondOrder, found: Estimate
) -> tuple[Estimate | None, tuple[str, ...]]:
    """The likeliest M, C, K, or why there are none.

    Modes bear a worse start than matrices do, so that the matrices of the refined modes are tried first.
    """
    why = ""
    for start in (_matrices_of(found, matrices.dofs), matrices):
        if start is None:
            continue
        try:
            structure = _likeliest(recording, start)
        except IdentificationError as error:
            why = why or str(error)
            continue
        if structure.converged and len(structure.modes):
            return structure, ()
        why = why or f"no maximum near the start ({structure.n_iterations} steps)"
    return None, (f"Mass, damping and stiffness could not be refined: {why}.",)


def _matrices_of(found: Estimate, dofs: Sequence[str]) -> SecondOrder | None:
    try:
        return second_order(found.system, dofs=dofs)
    except NotSecondOrderError:
        return None


def _require_forces(recording: Recording) -> None:
    for number, record in enumerate(recording.records):
        if record.kind != "free_decay" and not record.inputs.shape[0]:
            raise RecordingError(
                f"record {number} of kind {record.kind} has no measured inputs; maximum likelihood needs them, or free "
                "decays; leave the refinement out"
            )


def _likeliest(recording: Recording, start: SecondOrder | StateSpace | Modes) -> Estimate:
    """The estimate with free initial states, or from rest where the data do not ask for them."""
    structure = free_matrices(start.dofs) if isinstance(start, SecondOrder) else None
    if all(record.kind in TRANSIENT for record in recording.records):
        return refine(recording, start, parameterization=structure)
    free = refine(recording, start, parameterization=structure, initial_state="free")
    rest = refine(recording, free.second_order or free.system, parameterization=structure, max_iterations=FEW)
    n_states = sum(x.size for x in free.initial_states)
    n_values = recording.n_samples * len(recording.outputs)
    gain = free.log_likelihood - rest.log_likelihood
    return rest if rest.converged and gain < 0.5 * n_states * np.log(n_values) else free


def _told(what: str, found: Estimate, modes: Modes, warnings: tuple[str, ...]) -> Refinement:
    """The estimate in words; modes of the method that are none of its modes are said to be lost."""
    gap = np.abs(found.modes.poles[:, None] - modes.poles) / np.abs(modes.poles)
    partners, nearest = np.argmin(gap, axis=1), np.argmin(gap, axis=0)
    lost = [k for k in range(len(modes)) if partners[nearest[k]] != k or gap[nearest[k], k] > FAR]
    free = ", with free initial states," if found.initial_states else ""
    sentence = (
        f"{what} moved{free} to the maximum of the output-error likelihood over {len(found.names)} parameters in "
        f"{found.n_iterations} steps."
    )
    return Refinement(
        found,
        found.modes.normalized(),
        tuple(partners.tolist()),
        found.second_order,
        sentence,
        (*warnings, *_on_lost(found, [float(modes.frequency_hz[k]) for k in lost]), *found.notes),
    )


def _on_lost(found: Estimate, frequencies: list[float]) -> tuple[str, ...]:
    if not frequencies:
        return ()
    listed = ", ".join(f"{f:.4g}" for f in frequencies)
    left = (
        "what it leaves is white noise"
        if float(np.min(found.whiteness)) >= SUSPICIOUS
        else "it leaves more than white noise, so they may be real"
    )
    return (f"The likeliest model has no modes near those found at {listed} Hz; {left}.",)
