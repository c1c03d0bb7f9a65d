"""A Dask cluster on this machine, and MPI where its executor is loaded: the same results as in one process."""

import importlib.util
import os
import runpy
import shutil
import signal
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from types import ModuleType

import pytest

import lab
from lab.errors import StudyError
from lab.studies.workers import mpi_crew
from tests.lab.studies.small import STUDY, conducted, rows, written


@pytest.mark.slow
def test_two_workers_of_which_one_is_killed_half_way_give_the_same_bits(tmp_path):
    distributed = pytest.importorskip("distributed")
    path = written(tmp_path, STUDY.replace("repeats = 3", "repeats = 8"))
    conducted(path, tmp_path / "alone")
    done, killed = [], []

    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None, silence_logs=50
        ) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):

        def kill(n, *, total):
            done.append(n)
            if not killed and sum(done) > total // 4:
                killed.extend(client.run(os.getpid).values())
                os.kill(killed[0], signal.SIGKILL)

        lab.study(path, tmp_path / "two", scheduler=cluster.scheduler_address, progress=kill)
    assert len(killed) == 2
    assert sum(done) == 32
    assert rows(tmp_path / "two") == rows(tmp_path / "alone")


def test_nobody_at_the_address_is_told(tmp_path):
    pytest.importorskip("distributed")
    with pytest.raises(StudyError, match="no Dask scheduler answers at"):
        lab.study(written(tmp_path), tmp_path / "out", scheduler="nonsense://")


def test_without_distributed_the_next_step_is_told(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(StudyError, match="install the group cluster, or use --workers"):
        lab.study(written(tmp_path), tmp_path / "out", scheduler="tcp://127.0.0.1:8786")


def test_under_mpi_its_executor_does_the_work(monkeypatch):
    assert mpi_crew() is None

    class Pool(ThreadPoolExecutor):
        num_workers = 7

    futures = ModuleType("mpi4py.futures")
    futures.MPIPoolExecutor = Pool
    monkeypatch.setitem(sys.modules, "mpi4py", ModuleType("mpi4py"))
    monkeypatch.setitem(sys.modules, "mpi4py.futures", futures)
    crew = mpi_crew()
    assert crew.size() == 7
    assert crew.submit(pow, 2, 3).result() == 8


def test_a_worker_that_imports_the_command_does_not_run_it():
    # Workers of mpi4py read the main module of their master under a name of their own.
    assert runpy.run_module("lab.__main__", run_name="__worker__")["main"]


@pytest.mark.slow
@pytest.mark.skipif(
    not (importlib.util.find_spec("mpi4py") and shutil.which("mpiexec")), reason="needs mpi4py and mpiexec"
)
def test_two_workers_under_mpi_give_the_same_bits(tmp_path):
    path = written(tmp_path)
    conducted(path, tmp_path / "alone")
    typed = ["-m", "mpi4py.futures", "-m", "lab", "study", str(path), "--out", str(tmp_path / "mpi")]
    done = subprocess.run(
        ["mpiexec", "-n", "3", sys.executable, *typed], capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert rows(tmp_path / "mpi") == rows(tmp_path / "alone")
