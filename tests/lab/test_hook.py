"""A callback of the whole process stays set for whoever holds it, and is put back behind the last."""

from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from threading import Barrier

import mujoco
import numpy as np
import pytest

from lab import mjcf
from lab.effects.hysteresis import Hysteresis
from lab.excitation import Random
from lab.hook import Hook
from lab.rig import Rig
from lab.simulate import simulate
from tests.lab import structures


@pytest.mark.parametrize("first_out", [0, 1])
def test_put_back_behind_the_last_in_any_order(first_out):
    told = []

    def set_callback():
        told.append("set")
        return lambda: told.append("put back")

    hook = Hook(set_callback)
    for _ in range(2):
        stacks = [ExitStack(), ExitStack()]
        for stack in stacks:
            stack.enter_context(hook.held())
        stacks[first_out].close()
        assert told[-1] == "set"
        stacks[1 - first_out].close()
    assert told == ["set", "put back"] * 2


def test_an_error_puts_back():
    told = []
    with pytest.raises(RuntimeError, match="stop"), Hook(lambda: lambda: told.append("put back")).held():
        raise RuntimeError("stop")
    assert told == ["put back"]


def test_who_still_listens_hears_warnings_when_another_has_gone():
    before = mujoco.get_mju_user_warning()
    first, second = ExitStack(), ExitStack()
    early, late = first.enter_context(mjcf.quiet()), second.enter_context(mjcf.quiet())
    first.close()
    data = mujoco.MjData(Rig.from_xml(structures.oscillator()).model)
    data.qpos[0] = np.nan
    mujoco.mj_step(Rig.from_xml(structures.oscillator()).model, data)
    second.close()
    assert not early
    assert len(late) == 1
    assert mujoco.get_mju_user_warning() is before


def test_laws_act_in_threads_side_by_side():
    springs = [Hysteresis("x", stiffness=30.0, yield_displacement=y) for y in (0.01, 0.02, 0.05)]
    rigs = [spring.apply(Rig.from_xml(structures.oscillator())) for spring in springs]
    # Of different lengths, so that one is done while others still run.
    seconds, together = (0.5, 1.0, 2.0), Barrier(len(rigs))

    def alone(rig, duration):
        return simulate(rig, Random(rms=1.0), sample_rate=50.0, duration=duration, seed=1, substeps=8)

    def beside(rig, duration):
        together.wait(60.0)
        return alone(rig, duration)

    expected = [alone(rig, duration) for rig, duration in zip(rigs, seconds, strict=True)]
    with ThreadPoolExecutor(len(rigs)) as pool:
        found = list(pool.map(beside, rigs, seconds))
    for a, b in zip(expected, found, strict=True):
        np.testing.assert_array_equal(
            a.records[0].outputs, b.records[0].outputs
        )  # the same arithmetic, to the last bit
