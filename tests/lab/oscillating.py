"""One mass on a spring, simulated, and what is said of such recordings."""

import dataclasses

import numpy as np
import scipy.linalg

import lab
from identification.systems import SecondOrder
from lab.excitation import Random
from lab.rig import Rig
from tests.lab.structures import oscillator

ONE = SecondOrder([[2.0]], [[0.4]], [[50.0]], ("x",))
WHITE = Random(rms=2.0)


def one(chain=None, **settings):
    rig = Rig.from_xml(oscillator(**settings)).connected(outputs=["pos", "vel", "acc.x"])
    return rig if chain is None else rig.with_chain(dataclasses.replace(chain, outputs=rig.chain.outputs))


def run(rig, drive, *, sample_rate=20.0, duration=10.0, **settings):
    return lab.simulate(rig, drive, sample_rate=sample_rate, duration=duration, **settings)


def same(a, b):
    """Whether two recordings agree to the last bit, missing samples included."""
    return len(a.records) == len(b.records) and all(
        np.array_equal(np.asarray(x.inputs), np.asarray(y.inputs), equal_nan=True)
        and np.array_equal(np.asarray(x.outputs), np.asarray(y.outputs), equal_nan=True)
        for x, y in zip(a.records, b.records, strict=True)
    )


def lagged_response(recording, time_constant, *, gain=1.0):
    """Response of the one mass to a force a with ȧ = (u - a) / τ, u held: position, acceleration."""
    u, dt = np.asarray(recording.records[0].inputs)[0], recording.dt
    F = np.zeros((4, 4))  # x, v, a, u
    F[0, 1] = 1
    F[1] = [-25, -0.2, gain / 2, 0]
    F[2] = [0, 0, -1 / time_constant, 1 / time_constant]
    step, state, y = scipy.linalg.expm(F * dt), np.zeros(3), []
    for value in u:
        full = np.append(state, value)
        y.append([state[0], F[1] @ full])
        state = (step @ full)[:3]
    return np.array(y).T


def relative(found, exact):
    """Largest error relative to the largest value of its channel."""
    return np.max(np.abs(found - exact) / np.max(np.abs(exact), axis=1, keepdims=True))
