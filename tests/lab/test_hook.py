"""A callback of the whole process stays set for whoever holds it, and is put back behind the last."""

from contextlib import ExitStack

import mujoco
import numpy as np
import pytest

from lab import mjcf
from lab.hook import Hook
from lab.rig import Rig
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
