"""What a study costs beside its runs: efficiency, overhead, the pace of the journal, and a million runs on paper.

    python benchmarks/study.py [WORKERS]

Runs that wait instead of work show the machinery alone, whatever else the machine is doing; real runs follow. A wait
occupies a worker as a run does, and costs no processor.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
import tomllib
from collections.abc import Sequence
from pathlib import Path

for library in ("OMP", "OPENBLAS", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")
ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from lab.scenario import load_scenario  # noqa: E402
from lab.studies import journal  # noqa: E402
from lab.studies.dispatch import dispatch  # noqa: E402
from lab.studies.evaluate import Task, perform  # noqa: E402
from lab.studies.plan import Run, Study  # noqa: E402
from lab.studies.table import columns_of, write_table  # noqa: E402
from lab.studies.workers import Crew, local_crew  # noqa: E402

SCORE = {
    "frequency_error": [0.1234567890123456] * 3,
    "frequency_std": [0.1234567890123456] * 3,
    "mass_error": 0.1,
}
MILLION = 1_000_000


def wait(task: Task, runs: Sequence[Run]) -> list[str]:
    """Runs that take as long as their setting says."""
    lines = []
    for run in runs:
        begun = time.perf_counter()
        time.sleep(run.setting["seconds"])
        seconds = time.perf_counter() - begun
        lines.append(json.dumps({"run": run.number, "seed": run.seed, "seconds": seconds, "score": SCORE}))
    return lines


def waiting(crew: Crew, seconds: float, n: int, folder: Path) -> tuple[float, float]:
    """Share of the workers' time that runs take, and what a run costs beyond [s per worker]."""
    busy = 0.0
    book = folder / f"{seconds:g}-{n}.jsonl"
    journal.create(book, EMPTY)
    with journal.Journal(book) as open_book:

        def keep(lines: Sequence[str]) -> None:
            nonlocal busy
            open_book.write(lines)
            busy += sum(json.loads(line)["seconds"] for line in lines)

        begun = time.perf_counter()
        runs = (Run(k, {"seconds": seconds}, k) for k in range(n))
        dispatch(Task({}, "", {}), runs, n, crew, keep, work=wait)
        spent = (time.perf_counter() - begun) * crew.size()
    return busy / spent, (spent - busy) / n


def real(crew: Crew, name: str, n: int) -> tuple[float, float, float]:
    """Wall time of n runs of a scenario, their summed time, and the efficiency of the crew."""
    busy = []
    task = Task(tomllib.loads(load_scenario(name).text), "", {})

    def keep(lines: Sequence[str]) -> None:
        busy.extend(json.loads(line)["seconds"] for line in lines)

    begun = time.perf_counter()
    dispatch(task, (Run(k, {"instruments.noise_percent": 1.0}, k) for k in range(n)), n, crew, keep)
    wall = time.perf_counter() - begun
    return wall, sum(busy) / n, sum(busy) / wall / crew.size()


def filing(n: int, folder: Path) -> tuple[float, float, int]:
    """Seconds per run to write the journal, and to make study.h5 of it, and bytes per run."""
    book = folder / "filing.jsonl"
    journal.create(book, EMPTY)
    lines = [json.dumps({"run": k, "seed": k, "seconds": 0.1, "score": SCORE}) for k in range(n)]
    begun = time.perf_counter()
    with journal.Journal(book) as open_book:
        for line in lines:
            open_book.write([line])
    written = time.perf_counter()
    write_table(folder / "study.h5", Study("", {}, folder, (), n), book, columns_of(book))
    return (written - begun) / n, (time.perf_counter() - written) / n, book.stat().st_size // n


EMPTY = Study(
    "", {"model": "chain3_uncoupled.xml", **tomllib.loads(load_scenario("chain3_pulse").text)}, ROOT, ()
)


def main() -> None:
    """Print every figure."""
    workers = int(sys.argv[1]) if len(sys.argv) > 1 else 2
    with tempfile.TemporaryDirectory() as name, local_crew(workers) as crew:
        folder = Path(name)
        waiting(crew, 0.0, 10 * workers, folder)
        # Workers import the lab while they do their first real run.
        real(crew, "modes4_noisy", 2 * workers)
        print(f"{workers} workers, load of the machine {os.getloadavg()[0]:.1f}")
        for seconds, n in ((1.0, 20), (0.3, 60), (0.1, 100), (0.01, 2000), (0.001, 10_000)):
            share, beyond = waiting(crew, seconds, n, folder)
            print(
                f"runs of {1e3 * seconds:6g} ms: efficiency {share:.3f}, overhead {1e3 * beyond:.3f} ms per run"
            )
        for scenario, n in (("modes4_noisy", 30 * workers), ("chain3_pulse", 6 * workers)):
            wall, each, share = real(crew, scenario, n)
            print(f"{scenario}: {n} runs of {each:.3f} s in {wall:.1f} s, efficiency {share:.3f}")
        write, fold, size = filing(20_000, folder)
        print(f"journal {1e6 * write:.0f} µs and {size} bytes per run, study.h5 {1e6 * fold:.0f} µs per run")
        print(f"a million runs: journal {size} MB, study.h5 made of it in {MILLION * fold:.0f} s")
        print(f"one journal keeps up with {1 / write:.0f} runs a second")
    for scenario, n in (("modes4_noisy", 10), ("chain3_pulse", 5), ("chain3_hardening", 1)):
        paper(scenario, n)


def paper(name: str, n: int) -> None:
    """What a million runs of a scenario take, from the processor time of a few, at an efficiency of 0.95."""
    task = Task(tomllib.loads(load_scenario(name).text), "", {})
    perform(task, [Run(0, {"diagnosis": None}, 0)])
    begun = time.process_time()
    lines = perform(task, [Run(k, {}, k) for k in range(n)])
    failed = [error for line in lines if (error := json.loads(line).get("error"))]
    if failed:
        raise SystemExit(f"{name}: {failed[0]}")
    each = (time.process_time() - begun) / n
    hours = MILLION * each / 3600
    times = "; ".join(f"{cores} cores {hours / cores / 0.95:.1f} h" for cores in (64, 1000))
    print(f"a million runs of {name}: {each:.2f} s of processor time each, {hours:.0f} core hours; {times}")


if __name__ == "__main__":
    main()
