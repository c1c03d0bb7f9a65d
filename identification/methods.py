"""All methods by name, and what each is for."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

from identification.errors import IdentificationError
from identification.fdd import efdd
from identification.frequency_domain import plscf_recording
from identification.markov_methods import MARKOV_METHODS, around_the_order, realize_pulses
from identification.next_era import next_era
from identification.observer import observe
from identification.okid import realize, with_fitted_inputs
from identification.recording import Recording
from identification.ssi import ssi_cov
from identification.ssi_data import ssi_data
from identification.systems import Realization


@dataclass(frozen=True)
class Method:
    """One way from a recording to models.

    Attributes:
        name: as in `METHODS`.
        function: function(recording, order, *, orders, …) -> Realization. Without `order` and `orders` it
            realizes all orders that the data may carry, or the one that noise-free data show.
        needs_inputs: whether forces must be measured.
        finds_order: whether the singular values show the order, as they do where the response to known forces
            is realized and the noise is that of the sensors. Otherwise a sweep of the order tells the modes.
        kinds: kinds of records that it is made for.
        summary: one line.
    """

    name: str
    function: Callable[..., Realization]
    needs_inputs: bool
    finds_order: bool
    kinds: tuple[str, ...]
    summary: str

    @property
    def settings(self) -> tuple[str, ...]:
        """Names of the options."""
        parameters = inspect.signature(self.function).parameters.values()
        return tuple(each.name for each in parameters if each.kind is each.KEYWORD_ONLY)

    def __call__(self, recording: Recording, order: int | None = None, **settings: Any) -> Realization:
        """Models of a recording.

        Raises:
            IdentificationError: there is no such setting, no measured input, or the data do not suit.
        """
        unknown = sorted(set(settings) - set(self.settings))
        if unknown:
            raise IdentificationError(
                f"method {self.name!r} has no setting {unknown[0]!r}; it has {', '.join(self.settings)}"
            )
        if self.needs_inputs and not all(record.inputs.shape[0] for record in recording.records):
            raise IdentificationError(
                f"method {self.name!r} needs the forces and a record has no inputs; "
                "take a method for outputs alone, such as ssi_cov"
            )
        return self._models(recording, order, settings)

    def _models(self, recording: Recording, order: int | None, settings: dict[str, Any]) -> Realization:
        return self.function(recording, order, **settings)


@dataclass(frozen=True)
class PulseMethod(Method):
    """A way from the responses to unit pulses, or from free decays; its function takes Markov parameters."""

    def _models(self, recording: Recording, order: int | None, settings: dict[str, Any]) -> Realization:
        return realize_pulses(self.name, recording, order, **settings)


def okid_era_recording(
    recording: Recording,
    order: int | None = None,
    *,
    orders: Iterable[int] | None = None,
    observer: int | None = None,
    n_lags: int | None = None,
    form: str = "balanced",
) -> Realization:
    """Models from recorded inputs and outputs: `okid_era` at every order.

    Args:
        recording: records with inputs.
        order: number of states; chosen from the singular values when None.
        orders: further orders; when both are None and there is noise, up to twice the order chosen.
        observer: as for `okid_era`.
        n_lags: as for `okid_era`.
        form: as for `okid_era`.

    Returns:
        Models of all orders, and the singular values of the Hankel matrix.

    Raises:
        IdentificationError: as for `okid_era`.

    Source: Juang, Phan, Horta and Longman (1993), J. Guidance 16(2), 320-329.
    """
    found = observe(recording, observer=observer)

    def models(order: int | None, orders: Iterable[int] | None) -> Realization:
        return realize(found, recording, order, n_lags=n_lags, form=form, orders=orders)

    return with_fitted_inputs(around_the_order(models, order, orders), recording)


def _on_pulses(name: str, summary: str) -> Method:
    kinds = ("pulse", "free_decay")
    return PulseMethod(name, MARKOV_METHODS[name], False, True, kinds, summary)


METHODS = {
    method.name: method
    for method in (
        _on_pulses("era", "Eigensystem realization, from the response to unit pulses or from free decays."),
        Method(
            name="okid_era",
            function=okid_era_recording,
            needs_inputs=True,
            finds_order=True,
            kinds=("impact", "random", "burst_random", "sweep", "multisine", "other"),
            summary="Observer and eigensystem realization, from any forces and the response to them.",
        ),
        _on_pulses(
            "era_dc",
            "Eigensystem realization of data correlations, from the response to pulses or from free decays.",
        ),
        _on_pulses("itd", "Ibrahim time domain, from the response to pulses or from free decays."),
        _on_pulses(
            "mrtd", "Multiple-reference time domain, which is eigensystem realization in output-normal form."
        ),
        _on_pulses(
            "mmrtd", "Modified multiple-reference time domain, which is the same in input-normal form."
        ),
        Method(
            name="ssi_cov",
            function=ssi_cov,
            needs_inputs=False,
            finds_order=False,
            kinds=("ambient", "random", "burst_random", "sweep", "multisine", "other"),
            summary="Stochastic subspace identification, from the covariances of the outputs alone.",
        ),
        Method(
            name="ssi_data",
            function=ssi_data,
            needs_inputs=False,
            finds_order=False,
            kinds=("ambient", "random", "burst_random", "sweep", "multisine", "other"),
            summary="Stochastic subspace identification, from a projection of the outputs themselves.",
        ),
        Method(
            name="next_era",
            function=next_era,
            needs_inputs=False,
            finds_order=False,
            kinds=("ambient", "random", "burst_random", "sweep", "multisine", "other"),
            summary="Natural excitation technique: output correlations realized like free decays.",
        ),
        Method(
            name="plscf",
            function=plscf_recording,
            needs_inputs=False,
            finds_order=False,
            kinds=("pulse", "impact", "random", "burst_random", "sweep", "multisine", "ambient", "other"),
            summary="Poly-reference least squares in the frequency domain, from responses or output spectra.",
        ),
        Method(
            name="efdd",
            function=efdd,
            needs_inputs=False,
            finds_order=True,
            kinds=("ambient", "random", "burst_random", "sweep", "multisine", "other"),
            summary="Enhanced frequency domain decomposition: the peaks of the output spectra and their decay.",
        ),
    )
}
"""Name -> method."""


def find_method(name: str) -> Method:
    """The method of that name.

    Args:
        name: as in `METHODS`.

    Returns:
        The entry of `METHODS`.

    Raises:
        IdentificationError: there is none.
    """
    if name not in METHODS:
        raise IdentificationError(f"method {name!r} does not exist; there are {', '.join(METHODS)}")
    return METHODS[name]
