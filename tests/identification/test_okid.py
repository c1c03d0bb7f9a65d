"""Observer identification: exact without noise, from any start, in any units, and where it must refuse."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from identification.errors import IdentificationError, RecordingError, TooShortError
from identification.input_fit import fit_inputs
from identification.observer import observe
from identification.okid import okid, okid_era
from identification.second_order import second_order
from identification.systems import StateSpace
from tests import systems

CHAIN3 = systems.paper_chain3("coupled")
TRUSS = systems.paper_truss()


def random_recording(model, n_samples, seed=0, *, start=0.1, n_records=1):
    """Random forces on a structure that moves already when the record begins."""
    rng = np.random.default_rng(seed)
    inputs = [rng.standard_normal((len(model.inputs), n_samples)) for _ in range(n_records)]
    starts = [start * rng.standard_normal(model.n_states) for _ in range(n_records)]
    return systems.recorded(model, inputs, initial=starts)


def poles(system):
    return np.sort_complex(system.eigen()[0])


def response_error(found, model):
    f = np.linspace(0.002, 0.49, 300) / model.dt
    H = model.frequency_response(f)
    return np.abs(found.frequency_response(f) - H).max() / np.abs(H).max()


# --- Without noise
# -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("damping", ["uncoupled", "coupled"])
def test_three_masses_from_4000_samples_are_exact(damping):
    model = systems.paper_chain3(damping)
    found = okid_era(random_recording(model, 4000))
    assert found.order == 6
    # Required: 1e-9. Rounding times the condition of the regression, about 30, leaves 1e-12.
    np.testing.assert_allclose(poles(found.system), poles(model), atol=1e-11)
    assert response_error(found.system, model) < 1e-11
    np.testing.assert_allclose(found.system.D, model.D, atol=1e-12)
    structure = systems.chain3(damping)
    matrices = second_order(found.system, dofs=structure.dofs)
    np.testing.assert_allclose(matrices.damping, structure.damping, atol=1e-10)
    # B itself, in the coordinates of A: the response to a pulse.
    Y = model.markov(50).values
    np.testing.assert_allclose(found.system.markov(50).values, Y, atol=1e-12)


def test_truss_from_general_forces():
    found = okid_era(random_recording(TRUSS, 4000))
    assert found.order == 16
    assert response_error(found.system, TRUSS) < 1e-9
    structure = systems.truss()
    matrices = second_order(found.system, dofs=structure.dofs)
    for name in ("mass", "damping", "stiffness"):
        truth = getattr(structure, name)
        # Required: 1e-8 of the largest entry.
        assert np.abs(getattr(matrices, name) - truth).max() < 1e-9 * np.abs(truth).max()


@pytest.mark.parametrize("observer", [4, 6, 15, 40])
def test_any_sufficient_observer_gives_the_same_markov_parameters(observer):
    # The regression has no unique solution here: 2 outputs times 4 samples hold more than 6 states.
    Y = CHAIN3.markov(200).values
    found = okid(random_recording(CHAIN3, 3000), observer=observer, n_lags=200)
    np.testing.assert_allclose(found.values, Y, atol=1e-9 * np.abs(Y).max())


def test_recursion_is_not_off_by_one():
    # A delay line: y(k) = 2 u(k) + 3 u(k - 1) + 5 u(k - 2), every lag known by sight.
    A = np.array([[0.0, 0], [1, 0]])
    model = StateSpace(
        A, [[1.0], [0]], [[3.0, 5]], [[2.0]], 0.1, systems.actuators(["x"]), systems.sensors(["x"])
    )
    found = okid(random_recording(model, 200), observer=3, n_lags=7)
    np.testing.assert_allclose(found.values[:, 0, 0], [2, 3, 5, 0, 0, 0, 0], atol=1e-12)
    assert found.inputs == model.inputs


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 100), st.integers(1, 3), st.floats(0, 10))
def test_the_start_of_a_record_and_the_number_of_records_do_not_matter(seed, n_records, start):
    recording = random_recording(CHAIN3, 600, seed, start=start, n_records=n_records)
    found = okid_era(recording, 6, observer=10)
    # A free motion a hundred times the forced one costs two digits of the latter.
    assert response_error(found.system, CHAIN3) < 1e-8


@settings(max_examples=10, deadline=None)
@given(st.lists(st.floats(-6, 6), min_size=4, max_size=4))
def test_units_do_not_matter(powers):
    scale = 10.0 ** np.array(powers)
    recording = random_recording(CHAIN3, 600)
    records = [
        replace(
            r, inputs=np.asarray(r.inputs) * scale[:2, None], outputs=np.asarray(r.outputs) * scale[2:, None]
        )
        for r in recording.records
    ]
    found = okid_era(replace(recording, records=tuple(records)), 6).system
    own = okid_era(recording, 6).system
    np.testing.assert_allclose(poles(found), poles(own), atol=1e-10)
    H, G = (system.frequency_response([0.1, 0.3]) for system in (own, found))
    np.testing.assert_allclose(G * scale[:2] / scale[2:, None], H, atol=1e-9)


def test_mixed_measurements_from_general_forces():
    structure = systems.chain3("coupled")
    outputs = (
        *systems.sensors(["x1"], "displacement"),
        *systems.sensors(["x2"]),
        *systems.sensors(["x3"], "velocity"),
    )
    model = systems.instrumented(structure, outputs, systems.actuators(["x2"])).sampled(0.05)
    matrices = second_order(okid_era(random_recording(model, 3000)).system, dofs=structure.dofs)
    np.testing.assert_allclose(matrices.stiffness, structure.stiffness, atol=1e-8)


@pytest.mark.parametrize("quantity", ["displacement", "acceleration"])
def test_fast_sampling_is_exact_too(quantity):
    # 600 samples per period of the slowest mode: successive rows of the regression are nearly equal.
    structure = systems.chain3("coupled")
    system = systems.instrumented(
        structure, systems.sensors(["x2", "x3"], quantity), systems.actuators(["x1", "x2"])
    )
    found = okid_era(random_recording(system.sampled(0.005), 4000))
    matrices = second_order(found.system, dofs=structure.dofs)
    np.testing.assert_allclose(matrices.stiffness, structure.stiffness, rtol=0, atol=1e-8)


def test_impact_records_start_from_rest():
    u = np.zeros((2, 400))
    u[0, :3] = [0.3, 1.0, 0.4]
    v = np.zeros((2, 400))
    v[1, :3] = [0.5, 0.9, 0.2]
    recording = systems.recorded(CHAIN3, [u, v], kind="impact")
    found = okid_era(recording, 6, observer=20)
    # Two pulses of three samples say less than forces that never stop.
    assert response_error(found.system, CHAIN3) < 1e-8


def test_float32_data_give_as_many_digits_as_they_hold():
    recording = random_recording(CHAIN3, 3000)
    records = [replace(r, outputs=np.asarray(r.outputs, dtype=np.float32)) for r in recording.records]
    found = okid_era(replace(recording, records=tuple(records)))
    assert found.order == 6
    # Rounding to 6e-8 is noise of 3e-8 RMS; 3000 samples average it.
    assert response_error(found.system, CHAIN3) < 1e-7


# --- With noise
# ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("model", "order"), [(CHAIN3, 6), (TRUSS, 16)], ids=["chain3", "truss"])
def test_five_per_cent_noise(model, order):
    found = okid_era(systems.with_noise(random_recording(model, 4000, 3, start=0), 0.05, 4))
    assert found.order == order
    assert "Akaike" in found.notes[0]
    assert "edge of the noise" in found.notes[1]
    truth, modes = model.modes(), found.system.modes()
    # Seen over 8 seeds: 0.1 % in frequency, 1 % in damping and in the response; short observers give 40 %.
    np.testing.assert_allclose(modes.frequency_hz, truth.frequency_hz, rtol=4e-3)
    np.testing.assert_allclose(modes.damping_ratio, truth.damping_ratio, rtol=0.05)
    assert response_error(found.system, model) < 0.04


@pytest.mark.slow
def test_error_falls_with_the_root_of_the_length():
    errors = []
    for n_samples in (4000, 16_000):
        e = []
        for seed in range(4):
            recording = systems.with_noise(
                random_recording(CHAIN3, n_samples, seed, start=0), 0.05, seed + 50
            )
            e.append(poles(okid_era(recording, 6, observer=80).system) - poles(CHAIN3))
        errors.append(scipy.linalg.norm(e))
    # Four times the data, half the error; four seeds leave a factor of about 1.4 either way.
    assert 1.4 < errors[0] / errors[1] < 2.9


def test_further_orders_come_from_the_same_decomposition():
    found = okid_era(random_recording(CHAIN3, 1500), 6, orders=(2, 4), observer=30)
    assert found.orders == (2, 4, 6)
    assert found.settings["observer"] == 30


# --- Observer
# ------------------------------------------------------------------------------------------------


def test_all_lengths_from_one_factor_equal_a_regression_for_each():
    recording = systems.with_noise(random_recording(CHAIN3, 300), 0.05, 1)
    u, y = (np.asarray(x) for x in (recording.records[0].inputs, recording.records[0].outputs))
    v = np.vstack([u, y])
    for p in (1, 4, 9):
        found = observe(recording, observer=p)
        rows = np.vstack([u[:, p:]] + [v[:, p - i : -i] for i in range(1, p + 1)])
        theta = np.linalg.lstsq(rows.T, y[:, p:].T, rcond=None)[0]
        D, past = theta[:2].T, theta[2:].reshape(p, 4, 2)
        scale = found.output_rms[:, None] / found.input_rms
        np.testing.assert_allclose(found.direct * scale, D, atol=1e-11)
        np.testing.assert_allclose(found.beta * scale, past[:, :2].transpose(0, 2, 1), atol=1e-11)
        error = np.sqrt(np.mean((y[:, p:] - theta.T @ rows) ** 2, axis=1)) / found.output_rms
        np.testing.assert_allclose(found.residual, error, rtol=1e-9)


def test_blocks_of_a_long_record_join_without_a_seam():
    recording = systems.with_noise(random_recording(CHAIN3, 9000), 0.05, 1)
    whole = observe(recording, observer=5)
    record = recording.records[0]
    # The same rows from overlapping short records.
    cuts = [
        replace(record, inputs=record.inputs[:, a : a + 1005], outputs=record.outputs[:, a : a + 1005])
        for a in range(0, 8900, 1000)
    ]
    pieces = observe(replace(recording, records=tuple(cuts)), observer=5)
    ratio = (pieces.output_rms / whole.output_rms)[:, None]
    np.testing.assert_allclose(pieces.alpha * ratio / ratio.T, whole.alpha, atol=1e-12)
    assert whole.residual == pytest.approx(pieces.residual * ratio[:, 0], rel=1e-12)


# --- B and D
# -------------------------------------------------------------------------------------------------


def test_fitted_inputs_equal_a_plain_regression():
    recording = systems.with_noise(random_recording(CHAIN3, 250, 2, n_records=2), 0.1, 3)
    fitted = fit_inputs(CHAIN3, recording)
    scale = np.sqrt(np.mean([np.mean(np.asarray(r.outputs) ** 2, axis=1) for r in recording.records], axis=0))
    A, C = CHAIN3.A, CHAIN3.C
    blocks, right = [], []
    for number, record in enumerate(recording.records):
        u = np.asarray(record.inputs)
        x, free = (
            np.zeros((6, 12)),
            np.eye(6),
        )  # states per entry of B, column-major; states per initial state
        for k in range(u.shape[1]):
            start = np.zeros((2, 12))
            start[:, 6 * number : 6 * number + 6] = C @ free
            row = np.hstack([C @ x, np.kron(np.eye(2), u[:, k]), start]) / scale[:, None]
            blocks.append(row)
            right.append(np.asarray(record.outputs)[:, k] / scale)
            x = A @ x + np.kron(u[:, k], np.eye(6))
            free = A @ free
    theta = np.linalg.lstsq(np.vstack(blocks), np.concatenate(right), rcond=None)[0]
    np.testing.assert_allclose(fitted.B, theta[:12].reshape(2, 6).T, atol=1e-10)
    np.testing.assert_allclose(fitted.D, theta[12:16].reshape(2, 2), atol=1e-10)


def test_fitted_inputs_with_a_real_pole():
    # A sensor with a lag of its own adds one state that does not oscillate.
    A = scipy.linalg.block_diag(CHAIN3.A, 0.7)
    model = replace(
        CHAIN3, A=A, B=np.vstack([CHAIN3.B, [[0.3, 0.1]]]), C=np.hstack([CHAIN3.C, [[1.0], [0.2]]])
    )
    wrong = replace(model, B=np.zeros((7, 2)), D=np.zeros((2, 2)))
    fitted = fit_inputs(wrong, random_recording(model, 400))
    np.testing.assert_allclose(fitted.B, model.B, atol=1e-11)
    np.testing.assert_allclose(fitted.D, model.D, atol=1e-12)


def test_fitted_inputs_need_the_same_channels():
    recording = random_recording(CHAIN3, 100)
    with pytest.raises(RecordingError, match="select the same channels"):
        fit_inputs(CHAIN3, recording.select(inputs=["force_x1"]))


# --- Refusals
# ------------------------------------------------------------------------------------------------


def test_no_inputs_are_refused():
    recording = random_recording(CHAIN3, 100)
    silent = replace(recording, records=(replace(recording.records[0], inputs=np.zeros((0, 100))),))
    with pytest.raises(RecordingError, match="needs measured inputs in every record"):
        okid(silent)


def test_a_silent_channel_is_named():
    recording = random_recording(CHAIN3, 100)
    u = np.array(recording.records[0].inputs)
    u[1] = 0
    with pytest.raises(RecordingError, match="'force_x2' is zero throughout"):
        okid(replace(recording, records=(replace(recording.records[0], inputs=u),)))


def test_a_missing_sample_is_named():
    recording = random_recording(CHAIN3, 100)
    y = np.array(recording.records[0].outputs)
    y[0, 7] = np.nan
    with pytest.raises(RecordingError, match=r"'acceleration_x2' of record 0 misses a sample at t = 0\.35 s"):
        okid(replace(recording, records=(replace(recording.records[0], outputs=y),)))


def test_too_few_samples_are_counted():
    with pytest.raises(TooShortError, match="15 samples are too few"):
        okid(random_recording(CHAIN3, 15))
    with pytest.raises(TooShortError, match="length 20 has 82 coefficients per output for 80 samples"):
        okid(random_recording(CHAIN3, 100), observer=20)


def test_an_observer_of_no_length_is_refused():
    with pytest.raises(IdentificationError, match="looks back 0 samples"):
        okid(random_recording(CHAIN3, 100), observer=0)


def test_an_observer_that_grows_is_refused():
    rng = np.random.default_rng(0)
    grows = StateSpace(
        [[2.0]], [[1.0]], [[1.0]], [[0.0]], 0.1, systems.actuators(["x"]), systems.sensors(["x"])
    )
    recording = systems.recorded(grows, [rng.standard_normal((1, 30))])
    with pytest.raises(IdentificationError, match="grows without bound"):
        okid(recording, observer=1, n_lags=1000)


def test_an_unstable_model_keeps_the_inputs_of_the_observer():
    grows = StateSpace(
        [[1.02]], [[1.0]], [[1.0]], [[0.0]], 0.1, systems.actuators(["x"]), systems.sensors(["x"])
    )
    recording = systems.recorded(grows, [np.random.default_rng(0).standard_normal((1, 300))])
    found = okid_era(recording, 1, observer=4)
    assert any("unstable pole" in note for note in found.notes)
    assert response_error(found.system, grows) < 1e-6
