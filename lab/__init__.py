"""The virtual modal lab: excite, measure, identify, compare.

    rig = lab.load_model("chain3_uncoupled")
    recording = lab.simulate(rig, lab.Random(rms=1.0), sample_rate=20.0, duration=60.0, seed=1)
    result = lab.run("scenarios/chain3_pulse.toml", "out/chain3_pulse")
    diagnosis = lab.diagnose(recording, rig)
    placement = lab.place(rig, 5, n_actuators=4, target="matrices")

Names are imported when first used, so that `import lab` is quick.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from lab.checks import check
    from lab.compare import compare
    from lab.diagnose_files import diagnose_file
    from lab.diagnosis.diagnose import diagnose
    from lab.diagnosis.outcome import Diagnosis
    from lab.diagnosis.spectral.diagnose import diagnose_spectra
    from lab.effects import EFFECTS
    from lab.excitation import (
        EXCITATIONS,
        Ambient,
        BurstRandom,
        FreeDecay,
        Impact,
        Multisine,
        Pulse,
        Random,
        Sweep,
    )
    from lab.files.exporting import export_file
    from lab.files.importing import read_foreign
    from lab.files.model import load_model
    from lab.files.recipe import load_recipe
    from lab.files.recording import load as load_recording
    from lab.files.recording import save as save_recording
    from lab.files.recording_responses import load_responses
    from lab.instruments import instrument
    from lab.place_files import place_file
    from lab.placement.outcome import Placement
    from lab.placement.place import place
    from lab.result import Result
    from lab.rig import Rig
    from lab.run import identify_file, run
    from lab.scenario import Scenario, load_scenario
    from lab.simulate import simulate
    from lab.studies.conduct import study


_WHERE = {
    "Ambient": ("lab.excitation", "Ambient"),
    "BurstRandom": ("lab.excitation", "BurstRandom"),
    "Diagnosis": ("lab.diagnosis.outcome", "Diagnosis"),
    "EFFECTS": ("lab.effects", "EFFECTS"),
    "EXCITATIONS": ("lab.excitation", "EXCITATIONS"),
    "FreeDecay": ("lab.excitation", "FreeDecay"),
    "Impact": ("lab.excitation", "Impact"),
    "Multisine": ("lab.excitation", "Multisine"),
    "Placement": ("lab.placement.outcome", "Placement"),
    "Pulse": ("lab.excitation", "Pulse"),
    "Random": ("lab.excitation", "Random"),
    "Result": ("lab.result", "Result"),
    "Rig": ("lab.rig", "Rig"),
    "Scenario": ("lab.scenario", "Scenario"),
    "Sweep": ("lab.excitation", "Sweep"),
    "check": ("lab.checks", "check"),
    "compare": ("lab.compare", "compare"),
    "diagnose": ("lab.diagnosis.diagnose", "diagnose"),
    "diagnose_file": ("lab.diagnose_files", "diagnose_file"),
    "diagnose_spectra": ("lab.diagnosis.spectral.diagnose", "diagnose_spectra"),
    "export_file": ("lab.files.exporting", "export_file"),
    "identify_file": ("lab.run", "identify_file"),
    "instrument": ("lab.instruments", "instrument"),
    "load_model": ("lab.files.model", "load_model"),
    "load_recipe": ("lab.files.recipe", "load_recipe"),
    "load_recording": ("lab.files.recording", "load"),
    "load_responses": ("lab.files.recording_responses", "load_responses"),
    "load_scenario": ("lab.scenario", "load_scenario"),
    "place": ("lab.placement.place", "place"),
    "place_file": ("lab.place_files", "place_file"),
    "read_foreign": ("lab.files.importing", "read_foreign"),
    "run": ("lab.run", "run"),
    "save_recording": ("lab.files.recording", "save"),
    "simulate": ("lab.simulate", "simulate"),
    "study": ("lab.studies.conduct", "study"),
}

__all__ = [
    "EFFECTS",
    "EXCITATIONS",
    "Ambient",
    "BurstRandom",
    "Diagnosis",
    "FreeDecay",
    "Impact",
    "Multisine",
    "Placement",
    "Pulse",
    "Random",
    "Result",
    "Rig",
    "Scenario",
    "Sweep",
    "check",
    "compare",
    "diagnose",
    "diagnose_file",
    "diagnose_spectra",
    "export_file",
    "identify_file",
    "instrument",
    "load_model",
    "load_recipe",
    "load_recording",
    "load_responses",
    "load_scenario",
    "place",
    "place_file",
    "read_foreign",
    "run",
    "save_recording",
    "simulate",
    "study",
]


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module 'lab' has no attribute {name!r}; there are {', '.join(__all__)}")
    module, attribute = _WHERE[name]
    value = getattr(importlib.import_module(module), attribute)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})


class _Package(ModuleType):
    def __setattr__(self, name: str, value: Any) -> None:
        # Importing lab.simulate would put the module where `lab.simulate(...)` expects the function.
        if not (name in _WHERE and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
