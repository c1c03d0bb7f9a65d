"""Blind trials of the diagnosis: hide something, hand over only the recording and the nominal model, check the answer.

Cases are drawn from seeds, family by family. Data with causes of the catalogue are made by MuJoCo, those with other laws by a
Runge-Kutta integrator of their own; the diagnosis explains with its fast twin, which takes part in neither. Answers are
appended to a file of JSON lines, and a run that was stopped goes on where it was. Printed are, per family: cause and place
right, false alarms, parameters within two standard deviations and their median relative error, held-out gain, verdicts and
seconds; then detection against the best possible test, what was said of every cause, and every answer that is not right.

    python benchmarks/blind.py [--cases 24] [--seed 0] [--family singles sparse …] [--only CAUSE] [--withhold] [--reload]
                               [--strength 1 0.3 0.1] [--masses 3] [--samples 2048] [--jobs 1] [--out blind.jsonl]
                               [--write DIR] [--table]
"""

from __future__ import annotations

import argparse
import itertools
import json
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import Executor, as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

# Matrices here are small: threads would cost more than they bring.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

import numpy as np

from benchmarks.blind_cases.draw import FAMILIES, Family, draw
from benchmarks.blind_cases.judge import judged, said
from benchmarks.blind_cases.table import tables
from benchmarks.blind_cases.truth import Case
from identification.errors import IdentificationError
from lab.diagnosis.diagnose import diagnose
from lab.diagnosis.outcome import Diagnosis
from lab.effects import EFFECTS
from lab.errors import LabError
from lab.files.recording import save
from lab.hands import by_itself
from lab.processes import process_pool
from lab.rig import Rig


@dataclass(frozen=True)
class Trial:
    """One case to be drawn, and how it is to be asked."""

    family: str
    seed: int
    only: str | None = None
    withheld: bool = False
    strength: float = 1.0
    masses: int | None = None
    samples: int | None = None
    reload: bool = False

    @property
    def key(self) -> dict[str, Any]:
        """Plain data that tells trials apart."""
        return vars(self)

    @property
    def kind(self) -> Family:
        """The family, with as many masses and samples as asked for."""
        kind = FAMILIES[self.family]
        if self.masses is not None and kind.masses is not None:
            kind = replace(kind, masses=(self.masses, self.masses))
        return kind if self.samples is None else replace(kind, n_samples=self.samples)


def answered(trial: Trial, write: Path | None = None) -> dict[str, Any]:
    """The judged answer of one trial."""
    case = draw(trial.seed, trial.family, kind=trial.kind, only=trial.only, strength=trial.strength)
    if write is not None:
        written(case, write / f"{trial.family}_{trial.seed}")
    effects = dict(EFFECTS)
    if trial.withheld:
        for hidden in case.hidden:
            effects.pop(hidden.cause, None)
    start = time.perf_counter()
    try:
        diagnosis = diagnose(case.recording, Rig.from_xml(case.xml), effects=effects)
    except (LabError, IdentificationError, ArithmeticError, ValueError, AssertionError) as error:
        return {**trial.key, "error": f"{case!r}: {type(error).__name__}: {error}"}
    seconds = time.perf_counter() - start
    row = {**trial.key, **judged(case, diagnosis, withheld=trial.withheld), "seconds": seconds}
    if trial.reload:
        row["reloaded"] = reloaded(case, diagnosis)
    return row


def reloaded(case: Case, diagnosis: Diagnosis) -> str:
    """What is said of the same recording by the extended model, written and read again; it should be consistent."""
    with tempfile.TemporaryDirectory() as folder:
        diagnosis.extended.save(Path(folder) / "extended.xml")
        again = diagnose(case.recording, Rig.load(Path(folder) / "extended.xml"))
    names = [f"{f.effect.cause}@{f.effect.location}" for f in again.findings]
    return " ".join([again.verdict, *names])


def written(case: Case, folder: Path) -> None:
    """Writes a case as files: what `lab diagnose` takes, and the truth beside them."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "model.xml").write_text(case.xml, encoding="utf-8")
    save(case.recording, folder / "recording.h5", dtype=np.float32)
    findings = [
        {"cause": h.cause, "location": h.location, "parameters": dict(h.parameters)} for h in case.hidden
    ]
    truth = {"seed": case.seed, "findings": findings, "jitter": int(case.jitter)}
    truth["lookalike"] = not all(h.exact for h in case.hidden)
    (folder / "truth.json").write_text(json.dumps(truth, indent=1), encoding="utf-8")


def read(path: Path) -> list[dict[str, Any]]:
    """Answers so far."""
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines() if line.strip()]


def _as_they_come(pool: Executor, todo: list[Trial], places: list[Path | None]) -> Iterator[dict[str, Any]]:
    """Answers in the order in which they are ready, so that one that takes long holds up no other."""
    sent = [pool.submit(answered, trial, place) for trial, place in zip(todo, places, strict=True)]
    try:
        for each in as_completed(sent):
            yield each.result()
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def run(trials: list[Trial], path: Path, *, jobs: int, write: Path | None) -> None:
    """Answers the trials that the file does not have, one line each."""
    known = {json.dumps({name: row[name] for name in vars(Trial("", 0))}) for row in read(path)}
    todo = [trial for trial in trials if json.dumps(trial.key) not in known]
    places = [write] * len(todo)
    with path.open("a", encoding="utf-8") as file, process_pool(jobs, by_itself) as pool:
        if jobs == 1:
            rows: Iterator[dict[str, Any]] = map(answered, todo, places)
        else:
            rows = _as_they_come(pool, todo, places)
        for number, row in enumerate(rows, start=1):
            file.write(json.dumps(row) + "\n")
            file.flush()
            result = row.get(
                "error"
            ) or f"{'right' if row['place_right'] else 'WRONG'}  {said(row)}  {row['seconds']:.1f} s" + (
                f"; extended: {row['reloaded']}" if "reloaded" in row else ""
            )
            names = "+".join(f"{c}@{p}" for c, p, _ in row.get("hidden", [])) or "nothing"
            print(
                f"{number}/{len(todo)} {row['family']} {row['seed']} {names}: {result}",
                file=sys.stderr,
                flush=True,
            )


def main(arguments: list[str] | None = None) -> None:
    """Runs the trials and prints the tables."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--cases", type=int, default=24, help="per family")
    parser.add_argument("--seed", type=int, default=0, help="of the first case of every family")
    parser.add_argument("--family", nargs="+", choices=list(FAMILIES), default=list(FAMILIES))
    parser.add_argument("--only", help="hide this cause only")
    parser.add_argument("--withhold", action="store_true", help="take the hidden cause out of the catalogue")
    parser.add_argument("--reload", action="store_true", help="diagnose again with the extended model")
    parser.add_argument("--strength", type=float, nargs="+", default=[1.0], help="times the usual sizes")
    parser.add_argument("--masses", type=int, help="of every network, instead of the family's own number")
    parser.add_argument("--samples", type=int, help="of every record, instead of the family's own number")
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--out", type=Path, default=Path("blind.jsonl"), help="answers, one JSON line each")
    parser.add_argument("--write", type=Path, help="folder for the cases as files")
    parser.add_argument("--table", action="store_true", help="print the answers in the file and stop")
    options = parser.parse_args(arguments)

    if not options.table:
        seeds = range(options.seed, options.seed + options.cases)
        trials = [
            Trial(
                family,
                seed,
                options.only,
                options.withhold,
                strength,
                options.masses,
                options.samples,
                options.reload,
            )
            for seed, family, strength in itertools.product(seeds, options.family, options.strength)
        ]
        run(trials, options.out, jobs=options.jobs, write=options.write)
    print(tables(read(options.out)))


if __name__ == "__main__":
    main()
