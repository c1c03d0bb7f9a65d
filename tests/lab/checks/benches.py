"""Clean recordings of every kind, and what may be wrong with one: made without MuJoCo, from a seed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.linalg
import scipy.signal

from identification.recording import Array, Channel, Record, Recording

KINDS = ("random", "ambient", "pulse", "impact", "free_decay", "sweep", "multisine", "burst_random")
N_SAMPLES = 8192
RATE = 200.0
READ = {"m": "pos", "m/s": "vel", "m/s^2": "acc"}


def chain(rng: np.random.Generator, n: int = 4) -> tuple[Array, Array]:
    """A and B of n masses in a chain to the ground, modes drawn between 2 and 60 Hz, damped by about 1 %."""
    mass = rng.uniform(0.5, 2.0, n)
    k = rng.uniform(0.5, 2.0, n) * 10 ** rng.uniform(3.0, 4.3)
    K = np.diag(k + np.append(k[1:], 0)) - np.diag(k[1:], 1) - np.diag(k[1:], -1)
    lowest = np.sqrt(scipy.linalg.eigvalsh(K, np.diag(mass))[0])
    C = 0.01 * lowest * np.diag(mass) + 0.01 / lowest * K * rng.uniform(0.5, 1.0)
    inverse = np.diag(1 / mass)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ K, -inverse @ C]])
    return A, np.vstack([np.zeros((n, n)), inverse])


def forces(kind: str, rng: np.random.Generator, n: int) -> Array:
    """Forces on n masses, shape (n, N_SAMPLES); on the last alone unless they are ambient."""
    t = np.arange(N_SAMPLES) / RATE
    u = np.zeros((n, N_SAMPLES))
    if kind == "ambient":
        return rng.standard_normal((n, N_SAMPLES))
    if kind == "random":
        u[-1] = rng.standard_normal(N_SAMPLES)
    elif kind == "pulse":
        u[-1, 0] = 100.0
    elif kind == "impact":
        width = int(rng.integers(3, 8))
        start = int(rng.integers(0, 200))
        u[-1, start : start + width] = 100 * np.sin(np.pi * (np.arange(width) + 0.5) / width)
    elif kind == "sweep":
        u[-1] = scipy.signal.chirp(t, 0.5, t[-1], 0.4 * RATE)
    elif kind == "multisine":
        lines = np.zeros(N_SAMPLES // 8 + 1, complex)
        lines[4 : 3 * lines.size // 4] = np.exp(2j * np.pi * rng.random(3 * lines.size // 4 - 4))
        u[-1] = np.tile(np.fft.irfft(lines, N_SAMPLES // 4), 4) * N_SAMPLES / 100
        if rng.random() < 0.5:
            u[-1] = np.sign(u[-1])  # two levels, as small a crest as can be
    elif kind == "burst_random":
        u[-1, : N_SAMPLES // 3] = rng.standard_normal(N_SAMPLES // 3)
    return u


def clean(kind: str, seed: int, *, noise: float = 0.01, unit: str | None = None) -> Recording:
    """A recording in which nothing is wrong.

    Args:
        kind: one of `KINDS`.
        seed: of structure, forces and noise.
        noise: standard deviation of white noise over the RMS of each output.
        unit: of the outputs; drawn when None.
    """
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    n = 4
    A, B = chain(rng, n)
    unit = unit or str(rng.choice(list(READ)))
    C, D = {
        "m": (np.eye(2 * n)[:n], np.zeros((n, n))),
        "m/s": (np.eye(2 * n)[n:], np.zeros((n, n))),
        "m/s^2": (A[n:], B[n:]),
    }[unit]
    E = scipy.linalg.expm(np.block([[A, B], [np.zeros((n, 3 * n))]]) / RATE)
    u = forces(kind, rng, n)
    x0 = rng.standard_normal(2 * n) * np.repeat([0.01, 0.0], n) if kind == "free_decay" else np.zeros(2 * n)
    y = C @ states(E[: 2 * n, : 2 * n], E[: 2 * n, 2 * n :] @ u, x0) + D @ u
    y += noise * np.sqrt(np.mean(y**2, axis=1, keepdims=True)) * rng.standard_normal(y.shape)
    outputs = tuple(Channel(f"{READ[unit]}{i + 1}", unit) for i in range(n))
    measured = kind not in ("ambient", "free_decay")
    inputs = (Channel(f"force{n}", "N"),) if measured else ()
    return Recording(
        (Record(kind, u[-1:] if measured else np.zeros((0, N_SAMPLES)), y),), inputs, outputs, RATE
    )


def states(A: Array, forcing: Array, x0: Array) -> Array:
    """States of x_{k+1} = A x_k + f_k, mode by mode, shape (n_states, n_samples)."""
    poles, V = np.linalg.eig(A)
    f = np.linalg.solve(V, np.column_stack([x0, forcing[:, :-1]]).astype(complex))
    modal = [scipy.signal.lfilter([1.0], [1.0, -pole], row) for pole, row in zip(poles, f, strict=True)]
    return np.real(V @ np.array(modal))


def spoilt(recording: Recording, row: int, change) -> Recording:
    """The recording with one output row changed by a function of its samples."""
    record = recording.records[0]
    y = np.array(record.outputs)
    y[row] = change(y[row])
    return replace(recording, records=(replace(record, outputs=y),))


def rms(x: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(x**2)))


def with_spikes(rng):
    def change(x):
        x = x.copy()
        where = rng.choice(np.arange(100, x.size - 100), 3, replace=False)
        x[where] += 6 * rms(x) * rng.choice([-1, 1], 3)
        return x

    return change


def with_jump(rng):
    k = int(rng.integers(2000, 6000))
    return lambda x: x + 5 * rms(x) * (np.arange(x.size) >= k)


def with_drift(rng):
    sign = rng.choice([-1, 1])
    return lambda x: x + sign * 3 * rms(x) * np.linspace(0, 1, x.size) ** 1.5


def with_hum(rng):
    phase = rng.uniform(0, 2 * np.pi)
    frequency = 50 + rng.uniform(-0.05, 0.05)
    return lambda x: x + rms(x) * np.sin(2 * np.pi * frequency * np.arange(x.size) / RATE + phase)


def with_clipping(rng):
    # As a share of the largest of the last three quarters, which a decay leaves out of its first swings.
    return lambda x: np.clip(x, -0.4 * np.max(np.abs(x)), 0.4 * np.max(np.abs(x)))


def with_steps(rng):
    return lambda x: np.round(x / (0.3 * rms(x))) * 0.3 * rms(x)


def with_missing(rng):
    return lambda x: np.where(rng.random(x.size) < 0.002, np.nan, x)


def with_holds(rng):
    starts = rng.choice(np.arange(100, 1500, 100), 5, replace=False)

    def change(x):
        x = x.copy()
        for k in starts:
            x[k : k + 20] = x[k]
        return x

    return change


def dead(rng):
    return lambda x: np.full_like(x, 0.01)


SPOIL = {
    "spikes": with_spikes,
    "jumps": with_jump,
    "drift": with_drift,
    "hum": with_hum,
    "clipping": with_clipping,
    "quantization": with_steps,
    "missing": with_missing,
    "dropouts": with_holds,
    "dead": dead,
}
"""Name of the check that must notice it: what is done to the channel, given a generator."""
