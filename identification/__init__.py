"""Signals in, systems out: modes, and mass, damping and stiffness, from recorded vibration.

    record = Record("ambient", np.zeros((0, n_samples)), accelerations)
    recording = Recording((record,), (), channels, sample_rate=100.0)
    found = identify(recording)
    found.modes

Needs numpy and scipy only. Names are imported when first used, so that each costs no more than it needs.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from identification.covariance import output_covariances
    from identification.era import era, era_dc
    from identification.errors import (
        IdentificationError,
        NotSecondOrderError,
        OrderError,
        RecordingError,
        TooShortError,
    )
    from identification.fdd import fdd
    from identification.frequency_domain import plscf_recording
    from identification.from_responses import identify_responses
    from identification.identify import Identification, identify
    from identification.lsfd import lsfd
    from identification.methods import METHODS
    from identification.modal_scaling import modal_scaling
    from identification.modes import (
        Modes,
        auto_mac,
        comac,
        cross_orthogonality,
        mac,
        mean_phase,
        mean_phase_deviation,
        modal_phase_collinearity,
        real_shapes,
    )
    from identification.next_era import next_era
    from identification.okid import okid, okid_era
    from identification.plscf import plscf
    from identification.pulse import markov_parameters
    from identification.recording import Channel, Record, Recording
    from identification.response import FrequencyResponse
    from identification.second_order import second_order
    from identification.spectra import cross_spectra, frequency_response, positive_spectra
    from identification.ssi import ssi_cov
    from identification.ssi_data import ssi_data
    from identification.stability import Stabilization, stabilize
    from identification.systems import MarkovParameters, Realization, SecondOrder, StateSpace

_MODULES = {
    "covariance": ("output_covariances",),
    "era": ("era", "era_dc"),
    "errors": (
        "IdentificationError",
        "NotSecondOrderError",
        "OrderError",
        "RecordingError",
        "TooShortError",
    ),
    "from_responses": ("identify_responses",),
    "identify": ("Identification", "identify"),
    "methods": ("METHODS",),
    "modes": (
        "Modes",
        "auto_mac",
        "comac",
        "cross_orthogonality",
        "mac",
        "mean_phase",
        "mean_phase_deviation",
        "modal_phase_collinearity",
        "real_shapes",
    ),
    "fdd": ("fdd",),
    "frequency_domain": ("plscf_recording",),
    "lsfd": ("lsfd",),
    "modal_scaling": ("modal_scaling",),
    "next_era": ("next_era",),
    "plscf": ("plscf",),
    "response": ("FrequencyResponse",),
    "spectra": (
        "cross_spectra",
        "frequency_response",
        "positive_spectra",
    ),
    "okid": ("okid", "okid_era"),
    "pulse": ("markov_parameters",),
    "recording": ("Channel", "Record", "Recording"),
    "second_order": ("second_order",),
    "ssi": ("ssi_cov",),
    "ssi_data": ("ssi_data",),
    "stability": ("Stabilization", "stabilize"),
    "systems": ("MarkovParameters", "Realization", "SecondOrder", "StateSpace"),
}
_WHERE = {name: module for module, names in _MODULES.items() for name in names}

__all__ = [
    "METHODS",
    "Channel",
    "FrequencyResponse",
    "Identification",
    "IdentificationError",
    "MarkovParameters",
    "Modes",
    "NotSecondOrderError",
    "OrderError",
    "Realization",
    "Record",
    "Recording",
    "RecordingError",
    "SecondOrder",
    "Stabilization",
    "StateSpace",
    "TooShortError",
    "auto_mac",
    "comac",
    "cross_orthogonality",
    "cross_spectra",
    "era",
    "era_dc",
    "fdd",
    "frequency_response",
    "identify",
    "identify_responses",
    "lsfd",
    "mac",
    "markov_parameters",
    "mean_phase",
    "mean_phase_deviation",
    "modal_phase_collinearity",
    "modal_scaling",
    "next_era",
    "okid",
    "okid_era",
    "output_covariances",
    "plscf",
    "plscf_recording",
    "positive_spectra",
    "real_shapes",
    "second_order",
    "ssi_cov",
    "ssi_data",
    "stabilize",
]


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        known = ", ".join(__all__)
        raise AttributeError(f"module 'identification' has no attribute {name!r}; there are {known}")
    value = getattr(importlib.import_module(f"identification.{_WHERE[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


class _Package(ModuleType):
    def __setattr__(self, name: str, value: Any) -> None:
        # Importing the module identification.era must not hide the function of that name.
        if not (name in _WHERE and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
