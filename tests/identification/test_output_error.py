"""The fitting problem: what is unknown, what is compared with what, and what cannot be fitted."""

from dataclasses import replace

import numpy as np
import pytest

from identification.errors import RecordingError
from identification.modal_parameters import modal_parameters
from identification.output_error import output_error, simulated
from identification.recording import Record
from identification.structures import free_matrices
from tests import systems

SYSTEM = systems.paper_chain3("coupled")
TRUTH = systems.chain3("coupled")
FAMILY = free_matrices(TRUTH.dofs)
THETA = FAMILY.start(TRUTH)
RNG = np.random.default_rng(0)
RANDOM = systems.recorded(SYSTEM, [RNG.standard_normal((2, 150)), RNG.standard_normal((2, 90))])


def released_recording():
    """A random record from rest, a free decay, and a random record that begins in motion."""
    x0 = [np.zeros(6), np.arange(1.0, 7), -np.arange(1.0, 7)]
    inputs = [RNG.standard_normal((2, 100)), np.zeros((2, 120)), RNG.standard_normal((2, 80))]
    recording = systems.recorded(SYSTEM, inputs, initial=x0)
    records = list(recording.records)
    records[1] = replace(records[1], kind="free_decay", inputs=np.zeros((0, 120)))
    return replace(recording, records=tuple(records)), x0


def test_the_truth_leaves_nothing():
    problem = output_error(RANDOM, FAMILY, THETA)
    assert (problem.n_theta, problem.n_unknowns) == (18, 18)
    power = [[np.sum(row**2) for row in record.outputs] for record in RANDOM.records]
    assert np.all(problem.squares(THETA) < 1e-24 * np.array(power))  # rounding, squared


def test_initial_states_are_unknowns_of_their_record():
    recording, x0 = released_recording()
    auto = output_error(recording, FAMILY, THETA)
    assert auto.released == (False, True, False)
    assert auto.n_unknowns == 18 + 6
    free = output_error(recording, FAMILY, THETA, initial_state="free")
    assert free.n_unknowns == 18 + 18
    q = np.concatenate([THETA, *x0])
    assert np.all(free.squares(q) < 1e-20)
    from_rest = output_error(replace(recording, records=recording.records[2:]), FAMILY, THETA)
    assert np.all(from_rest.squares(THETA) > 1)


def test_normal_equations_collect_all_records():
    recording, x0 = released_recording()
    problem = output_error(recording, FAMILY, THETA, initial_state="free")
    q = np.concatenate([THETA * 1.01, *x0])
    weights = 0.5 + RNG.random((3, 2))
    gradient, information = problem.normal_equations(q, weights)

    def outputs(q):
        return np.concatenate(
            [
                (np.sqrt(w)[:, None] * y).ravel()
                for y, w in zip(
                    simulated(problem.tangent(q).system, problem.runs, problem.initial(q)),
                    weights,
                    strict=True,
                )
            ]
        )

    steps = 6e-6 * np.maximum(np.abs(q), 0.1)
    J = np.stack(
        [
            (outputs(q + h * e) - outputs(q - h * e)) / (2 * h)
            for h, e in zip(steps, np.eye(q.size), strict=True)
        ]
    )
    measured = np.concatenate(
        [(np.sqrt(w)[:, None] * run.outputs).ravel() for run, w in zip(problem.runs, weights, strict=True)]
    )
    # Central differences with steps of eps^(1/3): about ten digits of the largest derivative.
    np.testing.assert_allclose(gradient, J @ (measured - outputs(q)), atol=1e-7 * np.abs(gradient).max())
    np.testing.assert_allclose(information, J @ J.T, atol=1e-7 * np.abs(information).max())


def test_missing_outputs_leave_the_sum():
    outputs = np.array(RANDOM.records[0].outputs)
    outputs[1, 7:60] = outputs[0, 3] = np.nan
    gaps = output_error(
        replace(RANDOM, records=(replace(RANDOM.records[0], outputs=outputs), RANDOM.records[1])),
        FAMILY,
        THETA,
    )
    assert gaps.n_samples.tolist() == [[149, 97], [90, 90]]
    elsewhere = output_error(RANDOM, FAMILY, THETA)
    q = 1.01 * THETA
    errors = (
        elsewhere.runs[0].outputs - simulated(elsewhere.tangent(q).system, elsewhere.runs, [None, None])[0]
    )
    expected = np.nansum(np.where(np.isnan(outputs), np.nan, errors) ** 2, axis=1)
    np.testing.assert_allclose(gaps.squares(q)[0], expected, rtol=1e-12)  # sums in another order
    np.testing.assert_allclose(gaps.squares(q)[1], elsewhere.squares(q)[1], rtol=1e-12)


def test_growth_beyond_all_numbers_has_infinite_squares():
    problem = output_error(RANDOM, FAMILY, THETA)
    assert problem.grows(THETA) < 0
    wild = FAMILY.start(replace(TRUTH, damping=-300 * TRUTH.damping))
    assert problem.grows(wild) > 200
    assert np.all(np.isinf(problem.squares(wild)))
    singular = FAMILY.start(replace(TRUTH, mass=np.zeros((3, 3))))
    assert np.all(np.isinf(problem.squares(singular)))


def test_what_cannot_be_fitted():
    ambient = replace(RANDOM, records=(Record("ambient", np.zeros((0, 50)), np.ones((2, 50))),))
    with pytest.raises(RecordingError, match="record 0 of kind ambient has no measured inputs"):
        output_error(ambient, FAMILY, THETA)
    with pytest.raises(RecordingError, match="initial_state is 'unknown'; expected auto, rest or free"):
        output_error(RANDOM, FAMILY, THETA, initial_state="unknown")
    for side, value in (("inputs", np.nan), ("outputs", np.inf)):
        broken = np.array(getattr(RANDOM.records[0], side))
        broken[1, 7] = value
        with pytest.raises(RecordingError, match=r"of record 0 misses a sample at t = 0\.35 s"):
            output_error(
                replace(RANDOM, records=(replace(RANDOM.records[0], **{side: broken}),)), FAMILY, THETA
            )
    family = modal_parameters(SYSTEM, inputs=SYSTEM.inputs)
    with pytest.raises(RecordingError, match="recording has 10 Hz and the start is sampled at 20 Hz"):
        output_error(replace(RANDOM, sample_rate=10.0), family, family.values)
