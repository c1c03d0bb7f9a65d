"""What every layout of sensors and actuators could tell, from one pass over all candidates.

Outputs are linear in the inputs, and so are their sensitivities: those of a layout are sums over its actuators. The
information of independent outputs is a sum over its sensors. So one set of signal products serves every layout, however
long the records.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.modal_responses import derivative_weights, output_weights
from identification.modal_signals import close_pairs, signals, spectrum
from identification.output_error import OutputError, output_error
from identification.parameterizations import Parameterization
from identification.recording import Array, Recording, frozen


@dataclass(frozen=True, eq=False)
class _Sensitivities:
    """One record: outputs and their derivatives as combinations of signals.

    Attributes:
        products: of the signals among themselves, shape (n_signals, n_signals).
        source: input that each signal comes from, shape (n_signals,).
        outputs: coefficients of the outputs, shape (n_outputs, n_signals).
        derivatives: coefficients of their derivatives, shape (n_outputs, n_parameters, n_signals).
        n_samples: length of the record.
    """

    products: Array
    source: NDArray[np.intp]
    outputs: Array
    derivatives: Array
    n_samples: int


@dataclass(frozen=True, eq=False)
class LayoutInformation:
    """Fisher information of any choice among candidate sensors and actuators.

    Attributes:
        names: one per parameter.
        values: the parameters, shape (n_parameters,).
        n_inputs, n_outputs: candidates.
    """

    names: tuple[str, ...]
    values: Array
    n_inputs: int
    n_outputs: int
    _records: tuple[_Sensitivities, ...]

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", frozen(self.values))

    def rms(self, inputs: Sequence[int]) -> Array:
        """RMS of every output in each record, shape (n_records, n_outputs), when only these inputs act."""
        found = []
        for record in self._records:
            own = np.isin(record.source, inputs)
            y = record.outputs[:, own]
            power = np.einsum("oi,ij,oj->o", y, record.products[np.ix_(own, own)], y) / record.n_samples
            found.append(np.sqrt(np.maximum(power, 0.0)))
        return np.array(found)

    def of_outputs(self, inputs: Sequence[int], noise_std: Array) -> Array:
        """Information that each output would give, shape (n_outputs, n_parameters, n_parameters).

        The information of a layout is the sum over its outputs.

        Args:
            inputs: positions of the inputs that act.
            noise_std: shape (n_records, n_outputs); infinite for an output that tells nothing.
        """
        n = len(self.names)
        total = np.zeros((self.n_outputs, n, n))
        for record, std in zip(self._records, noise_std, strict=True):
            own = np.isin(record.source, inputs)
            G = record.products[np.ix_(own, own)]
            for information, T, s in zip(total, record.derivatives[:, :, own], std, strict=True):
                if np.isfinite(s):
                    information += T @ G @ T.T / s**2
        return total


def layout_information(
    model: object, recording: Recording, parameterization: Parameterization
) -> LayoutInformation:
    """What each output tells about the parameters under any choice of the inputs, all records beginning at rest.

    Args:
        model: the truth, as `parameterization.start` takes it.
        recording: planned (see `planned`), with every candidate input and output.
        parameterization: what is not known.

    Returns:
        Information of each output, for any choice of the inputs.

    Raises:
        IdentificationError: the model has no full set of eigenvectors, or does not fit the recording.

    Source: Kay (1993), Fundamentals of Statistical Signal Processing I, eq. (3.31).
    """
    theta = parameterization.start(model)
    problem = output_error(recording, parameterization, theta, initial_state="rest")
    return LayoutInformation(
        parameterization.names,
        theta,
        len(recording.inputs),
        len(recording.outputs),
        _sensitivities(problem, theta),
    )


def _sensitivities(problem: OutputError, theta: Array) -> tuple[_Sensitivities, ...]:
    tangent = problem.tangent(theta)
    system, modes = tangent.system, spectrum(tangent.system)
    if modes is None:
        raise IdentificationError(
            "a pole of the model is critically damped, so that its modes do not tell its responses; change a damping slightly"
        )
    found = []
    for run in problem.runs:
        pairs = close_pairs(modes, system.dt, run)
        products: Array = np.zeros(())
        for _, X in signals(system, modes, run, False, pairs):
            products = products + X @ X.T
        outputs = output_weights(system, modes, run, None)
        outputs = np.pad(outputs, ((0, 0), (0, len(products) - outputs.shape[1])))
        derivatives = np.stack([*derivative_weights(tangent, modes, run, None, pairs)])
        # Each kind of signal has one row per active input, inputs running fastest.
        source = np.tile(run.active, len(products) // max(len(run.active), 1))
        found.append(_Sensitivities(products, source, outputs, derivatives, run.outputs.shape[1]))
    return tuple(found)
