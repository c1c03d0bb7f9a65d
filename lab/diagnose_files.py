"""A recording file, with samples or frequency responses, and a model file in, a folder with the diagnosis out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from identification.progress import UNHEARD, Progress, Work
from identification.response import FrequencyResponse
from lab.diagnosis.calibrate import WIDTHS, gain_names, parameters_of
from lab.diagnosis.diagnose import diagnose
from lab.diagnosis.outcome import Diagnosis
from lab.effects import EFFECTS
from lab.effects.effect import Effect
from lab.errors import LabError, UnknownNameError
from lab.files.checksum import sha256_of
from lab.files.diagnosis import save_diagnosis
from lab.files.folder import output_folder
from lab.files.model import load_model
from lab.files.recording import load
from lab.files.recording_responses import load_responses, only_responses
from lab.hands import meanwhile
from lab.matching import Names, matched, read_mapping, renamed, same_channels
from lab.replay import Replay
from lab.rig import Rig
from lab.show.diagnosed import Diagnosed
from lab.simulate import Motion, motion
from lab.twin import twin

PERIODS_SHOWN = 20
"""Length of the motion kept for the viewer, in periods of the lowest mode."""
COSTS = 1.0, 10.0, 3.0
"""Of reading (and loading what fits), diagnosing and writing, as measured."""


def diagnose_file(
    path: str | Path,
    model: str | Path,
    out: str | Path,
    *,
    baseline: str | Path | None = None,
    mapping: str | Path | Names | None = None,
    widths: Mapping[str, float] | None = None,
    effects: Sequence[str] | None = None,
    force: bool = False,
    command: str = "",
    progress: Progress | None = None,
) -> tuple[Diagnosis, Diagnosed]:
    """What a model gets wrong in a recording: found, written, shown.

    Args:
        path: recording file; where it holds no samples, its frequency responses are taken.
        model: model file, or a name from the catalogue of models.
        out: folder to come, with diagnosis.json, extended.xml, report.html and run.rrd.
        baseline: recording file of the same rig in its known state.
        mapping: file that renames channels of recording and baseline, or the names themselves (see `lab.matching`).
        widths: prior standard deviations of the model's own numbers, as for `lab.diagnose`.
        effects: names of the causes that may be named; all of the catalogue when None.
        force: replace an earlier output there.
        command: how the lab was called, for the report.
        progress: told what is being done, and the share of it that is done; it falls where the search goes on.

    Returns:
        The diagnosis, and what it was found in, with channels as the model names them and without those that never change.

    Raises:
        UnknownNameError: a width or an effect is of nothing that exists.
        LabError, IdentificationError: the files do not fit together, or the folder cannot be written.
    """
    with output_folder(out, force=force) as folder:
        reading, diagnosing, writing = Work(progress).parts(*COSTS)
        reading.called("reading")
        names = read_mapping(mapping) if isinstance(mapping, str | Path) else mapping or {}
        recording = _named(path, names)
        rig = matched(load_model(model), recording)
        known = None if baseline is None else same_channels(_named(baseline, names), recording)
        diagnosis = _engine(recording)(
            recording,
            rig,
            baseline=known,
            widths=_widths(widths or {}, rig),
            effects=_effects(effects),
            progress=None if progress is None else diagnosing,
        )
        recording = recording.select(outputs=[channel.name for channel in diagnosis.nominal.outputs])
        facts = _facts({"Recording": path, "Model": model, "Baseline": baseline, "Names": mapping})
        present_diagnosis(folder, diagnosis, recording, command=command, facts=facts, work=writing)
    return diagnosis, recording


def present_diagnosis(
    folder: Path,
    diagnosis: Diagnosis,
    recording: Diagnosed,
    *,
    command: str = "",
    facts: dict[str, str] | None = None,
    work: Work = UNHEARD,
) -> None:
    """Writes diagnosis.json, extended.xml, report.html and run.rrd into a folder.

    Args:
        folder: to write into.
        diagnosis: what to tell.
        recording: what it was found in, with the channels of the diagnosis.
        command: how the lab was called.
        facts: further facts to reproduce it, by name.
        work: told how much of this is done.
    """
    showing, reporting = work.called("writing the report").parts(2.0, 3.5)
    save_diagnosis(diagnosis, folder / "diagnosis.json")
    diagnosis.extended.save(folder / "extended.xml")
    report = meanwhile(
        _write_report, folder / "report.html", diagnosis, recording, command=command, facts=facts
    )
    # Imported here because drawing is slow to load and `lab` must come up without it.
    from lab.show.rerun_log.diagnosis import write_diagnosis_rrd

    write_diagnosis_rrd(folder / "run.rrd", diagnosis, recording, motions=_first_swings(diagnosis, recording))
    showing.done()
    report()
    reporting.done()


def _write_report(*page: Any, **told: Any) -> None:
    from lab.show.diagnosis_report import write_diagnosis_report

    write_diagnosis_report(*page, **told)


def _engine(recording: Diagnosed) -> Any:
    """What finds causes in samples, or in frequency responses."""
    if not isinstance(recording, FrequencyResponse):
        return diagnose
    from lab.diagnosis.spectral.diagnose import diagnose_spectra  # slow to load

    return diagnose_spectra


def _named(path: str | Path, names: Names) -> Diagnosed:
    """Samples, or else frequency responses, with channels as the model names them."""
    if not only_responses(path):
        return renamed(load(path), names)
    return renamed(load_responses(path), names)


def _widths(given: Mapping[str, float], rig: Rig) -> Mapping[str, float]:
    if not given:
        return given
    model = twin(rig)
    known = (*WIDTHS, "gain", *parameters_of(model).names, *gain_names(model))
    for name in given:
        if name not in known:
            raise UnknownNameError(
                f"a width is given for {name!r}, which is no parameter of the model; there are {', '.join(known)}"
            )
    return given


def _effects(names: Sequence[str] | None) -> Mapping[str, type[Effect]]:
    for name in names or ():
        if name not in EFFECTS:
            raise UnknownNameError(f"effect {name!r} does not exist; there are {', '.join(EFFECTS)}")
    return EFFECTS if names is None else {name: EFFECTS[name] for name in names}


def _facts(given: dict[str, str | Path | Names | None]) -> dict[str, str]:
    """The files given, with their checksums."""
    facts: dict[str, str] = {}
    for name, path in given.items():
        if isinstance(path, str | Path):
            own = f", SHA-256 {sha256_of(path)}" if Path(path).is_file() else ""  # a name has no file
            facts[name] = f"{path}{own}"
    return facts


def _first_swings(diagnosis: Diagnosis, recording: Diagnosed) -> tuple[Motion, Motion] | None:
    """The start of the first record in both models, long enough to watch; None where it cannot be had."""
    if isinstance(recording, FrequencyResponse):
        return None
    record = recording.records[0]
    if not record.inputs.shape[0]:
        return None
    lowest = diagnosis.nominal.second_order().modes().frequency_hz[:1]
    duration = record.n_samples / recording.sample_rate
    if lowest.size and lowest[0] > 0:
        duration = min(duration, PERIODS_SHOWN / lowest[0])
    again = Replay(inputs=record.inputs[:, :])
    try:
        nominal, extended = (
            motion(rig, again, sample_rate=recording.sample_rate, duration=duration)
            for rig in (diagnosis.nominal, diagnosis.extended)
        )
    except LabError:
        # A picture is no reason to lose a diagnosis: the numbers do not depend on it.
        return None
    return nominal, extended
