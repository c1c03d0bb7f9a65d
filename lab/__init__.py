"""The virtual modal lab: excite, measure, identify, compare.

    rig = lab.Rig.load("models/chain3_uncoupled.xml")
    recording = lab.simulate(rig, lab.EXCITATIONS["pulse"](), sample_rate=20.0, duration=10.0)
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
    from lab.effects import EFFECTS
    from lab.excitation import EXCITATIONS
    from lab.files.recording import load as load_recording
    from lab.files.recording import save as save_recording
    from lab.instruments import instrument
    from lab.placement.outcome import Placement
    from lab.placement.place import place
    from lab.result import Result
    from lab.rig import Rig
    from lab.run import identify_file, run
    from lab.scenario import Scenario, load_scenario
    from lab.simulate import simulate
    from lab.studies.conduct import study

_WHERE = {
    "Diagnosis": ("lab.diagnosis.outcome", "Diagnosis"),
    "EFFECTS": ("lab.effects", "EFFECTS"),
    "EXCITATIONS": ("lab.excitation", "EXCITATIONS"),
    "Placement": ("lab.placement.outcome", "Placement"),
    "Result": ("lab.result", "Result"),
    "Rig": ("lab.rig", "Rig"),
    "Scenario": ("lab.scenario", "Scenario"),
    "check": ("lab.checks", "check"),
    "compare": ("lab.compare", "compare"),
    "diagnose": ("lab.diagnosis.diagnose", "diagnose"),
    "diagnose_file": ("lab.diagnose_files", "diagnose_file"),
    "identify_file": ("lab.run", "identify_file"),
    "instrument": ("lab.instruments", "instrument"),
    "load_recording": ("lab.files.recording", "load"),
    "load_scenario": ("lab.scenario", "load_scenario"),
    "place": ("lab.placement.place", "place"),
    "run": ("lab.run", "run"),
    "save_recording": ("lab.files.recording", "save"),
    "simulate": ("lab.simulate", "simulate"),
    "study": ("lab.studies.conduct", "study"),
}

__all__ = [
    "EFFECTS",
    "EXCITATIONS",
    "Diagnosis",
    "Placement",
    "Result",
    "Rig",
    "Scenario",
    "check",
    "compare",
    "diagnose",
    "diagnose_file",
    "identify_file",
    "instrument",
    "load_recording",
    "load_scenario",
    "place",
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
