"""What a finished study takes in memory does not grow with its runs."""

import json
import tracemalloc

import h5py

from lab.studies import journal, table
from lab.studies.axes import Axis
from lab.studies.plan import Study
from lab.studies.statistics import statistics
from lab.studies.table import columns_of, write_table

SCORE = {"frequency_error": [0.1] * 3, "frequency_std": [0.2] * 3, "mass_error": 0.1, "verdict": "explained"}


def peak(folder, n):
    """Largest memory [B] while a journal of n runs becomes statistics."""
    folder.mkdir()
    book = folder / journal.NAME
    with book.open("w") as file:
        file.write("{}\n")
        for k in range(n):
            file.write(json.dumps({"run": k, "seed": k, "seconds": 0.1, "score": SCORE}) + "\n")
    study = Study("", {}, folder, (Axis(("a",), ((1, 2),)),), n // 2)
    tracemalloc.start()
    write_table(folder / "study.h5", study, book, columns_of(book))
    with h5py.File(folder / "study.h5") as file:
        assert statistics(file)[0].n.sum() == n
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return most


def test_memory_is_that_of_a_few_blocks(tmp_path, monkeypatch):
    monkeypatch.setattr(table, "BLOCK", 128)
    monkeypatch.setattr(table, "MAX_BUFFERED", 256)
    peak(tmp_path / "warm", 128)
    few, many = (peak(tmp_path / str(n), n) for n in (600, 3000))
    # Numbers of runs take 32 bytes each while they are written; runs themselves, held, would take a thousand each.
    assert many - few < 2400 * 100
    assert few < 5e6
