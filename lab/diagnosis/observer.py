"""Observer: a Kalman gain that keeps a wrong model near the measurements while it is being corrected."""

from __future__ import annotations

import numpy as np
import scipy.linalg

from identification.recording import Array
from lab.diagnosis.misfit import Misfit
from lab.responder import NO_OBSERVER, ready


def kalman_gain(misfit: Misfit, theta: Array, force_share: float, *, noise_share: float = 0.01) -> Array:
    """Steady Kalman gain at parameters `theta`, shape (n_states, n_outputs); no rows when `force_share` is zero.

    Args:
        misfit: model and data.
        theta: parameters.
        force_share: RMS of an unknown white force on every degree of freedom, as a share of its inertia force.
        noise_share: noise of each output as a share of its RMS.
    """
    survey = misfit.survey
    if not force_share or survey is None:
        return NO_OBSERVER
    plant = misfit.plant(theta)
    F, G, *_, C, D, _ = ready(_pushed_everywhere(plant), misfit.dt).matrices
    n = plant.n_dofs
    G, D = G[0, :, -n:], D[:, -n:]
    Q = np.diag((force_share * survey.force_rms) ** 2)
    R = np.diag((noise_share * survey.output_rms) ** 2)
    # Scaled states and outputs: displacements and accelerations differ by orders of magnitude.
    x = np.sqrt(np.concatenate([np.diag(survey.covariance), np.diag(survey.speed_covariance)])) + 1e-300
    y = survey.output_rms
    F, G, C, D = (
        F[: 2 * n, : 2 * n] * x / x[:, None],
        G[: 2 * n] / x[:, None],
        C[:, : 2 * n] * x / y[:, None],
        D / y[:, None],
    )
    R = R / np.outer(y, y)
    cross, noise = G @ Q @ D.T, R + D @ Q @ D.T
    P = scipy.linalg.solve_discrete_are(F.T, C.T, G @ Q @ G.T, noise, s=cross)
    K = (F @ P @ C.T + cross) @ np.linalg.inv(C @ P @ C.T + noise)
    # The kernel corrects the state before it moves on; what is gone within a sample needs no correction.
    gain = np.linalg.lstsq(F, K, rcond=None)[0]
    return np.ascontiguousarray(gain * x[:, None] / y)


def _pushed_everywhere(plant):  # type: ignore[no-untyped-def]
    """The plant with a tone's column for a force on every degree of freedom."""
    from dataclasses import replace

    from lab.plant import Tone

    tones = tuple(Tone(row, 1.0, 0.0, 0.0) for row in np.eye(plant.n_dofs))
    return replace(plant, laws=(), tones=tones)
