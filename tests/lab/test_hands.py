"""Hands: the same outcomes in the same order whoever does the work, and nobody left behind."""

import multiprocessing
import os
import signal
import time

import pytest

from lab.diagnosis.diagnose import diagnose
from lab.effects import EFFECTS
from lab.excitation import Random
from lab.files.diagnosis import diagnosis_document
from lab.hands import HANDS, beside, helped, meanwhile, shared
from lab.instruments import instrument
from lab.rig import Rig
from lab.simulate import simulate


@pytest.fixture(scope="module")
def helper():
    with helped(n=1):
        latest = time.monotonic() + 60
        while shared_by_one() and time.monotonic() < latest:
            time.sleep(0.05)
        yield


def where(item):
    time.sleep(0.02)
    return item, os.getpid()


def unwilling(item):
    if multiprocessing.parent_process() is not None:
        raise ValueError("only at home")
    return item


def fatal(item):
    if multiprocessing.parent_process() is not None:
        os.kill(os.getpid(), signal.SIGKILL)
    return item


def failing(item):
    raise ValueError(f"no {item}")


def test_outcomes_come_in_order_from_both(helper):
    outcomes = list(shared(where, range(40)))
    assert [item for item, _ in outcomes] == list(range(40))
    assert len({process for _, process in outcomes}) == 2


def shared_by_one():
    """Whether the helper is still getting ready."""
    return len({process for _, process in shared(where, range(4))}) < 2


def slow_last(item):
    time.sleep({0: 0.3, 3: 1.0}.get(item, 0.01))
    return item, os.getpid()


def test_nobody_waits_for_what_is_not_begun(helper):
    outcomes = list(shared(slow_last, range(4)))
    assert [item for item, _ in outcomes] == list(range(4))
    # The helper begins at the far end while this process does the first, and takes longer than all others do.
    assert [process == os.getpid() for _, process in outcomes] == [True, True, True, False]


def test_without_helpers_all_is_done_here(nobody):
    assert {process for _, process in shared(where, range(3))} == {os.getpid()}
    assert meanwhile(where, 1)() == (1, os.getpid())


def test_what_a_helper_cannot_do_is_done_here(helper):
    assert list(shared(unwilling, range(6))) == list(range(6))
    assert meanwhile(unwilling, 7)() == 7


def test_what_cannot_be_sent_is_done_here(helper):
    home = os.getpid()
    assert list(shared(lambda item: (item, os.getpid()), range(4))) == [(i, home) for i in range(4)]
    assert meanwhile(lambda: os.getpid())() == home


def test_an_error_is_raised_here(helper):
    with pytest.raises(ValueError, match="no 0"):
        list(shared(failing, range(4)))
    with pytest.raises(ValueError, match="no 1"):
        meanwhile(failing, 1)()


def test_a_call_is_made_meanwhile(helper):
    later = meanwhile(where, 5)
    item, process = later()
    assert item == 5
    assert process != os.getpid()


def test_threads_step_aside_while_helpers_have_the_cores(helper):
    assert not HANDS.alone
    assert set(shared(alone, range(4))) == {True}
    assert not HANDS.alone
    assert list(beside(abs, [-1, 2])) == [1, 2]


def alone(item):
    return HANDS.alone


@pytest.fixture
def nobody(monkeypatch):
    """As if no helpers were there."""
    for name, value in (("helpers", None), ("n_helpers", 0), ("folder", "")):
        monkeypatch.setattr(HANDS, name, value)


def interrupted():
    with helped(n=1):
        meanwhile(time.sleep, 3600)
        raise KeyboardInterrupt


def test_nobody_is_left_behind(nobody):
    before = set(multiprocessing.active_children())
    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert HANDS.helpers is None
    assert set(multiprocessing.active_children()) == before


@pytest.mark.slow
def test_a_lost_helper_is_not_missed(nobody):
    with helped(n=1):
        assert list(shared(fatal, range(8))) == list(range(8))
        assert list(shared(fatal, range(8))) == list(range(8))
        assert meanwhile(fatal, 3)() == 3


@pytest.mark.slow
def test_a_diagnosis_is_the_same_with_help(nobody):
    rig = Rig.load("models/chain3_coupled.xml")
    rig = rig.connected(inputs=["force1", "force2"], outputs=["acc1.x", "acc2.x", "acc3.x"])
    bent = EFFECTS["cubic_stiffness"]("spring2_3", k3=2.0).apply(rig)
    measured = instrument(bent, noise_percent=1.0)
    recording = simulate(measured, Random(rms=1.0), sample_rate=5.0, duration=400.0, seed=2)
    diagnoses = []
    for n in (0, 1):
        with helped(n=n):
            diagnoses.append(diagnose(recording, rig))
    here, shared_out = (diagnosis_document(diagnosis) for diagnosis in diagnoses)
    assert shared_out == here
