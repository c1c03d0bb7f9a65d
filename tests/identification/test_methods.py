"""Every method by its name: what it accepts, what it refuses, and that it finds a structure."""

import inspect
from dataclasses import replace

import numpy as np
import pytest

from identification.errors import IdentificationError, RecordingError
from identification.markov_methods import shows_rank
from identification.methods import METHODS, find_method
from identification.recording import KINDS, Recording
from identification.systems import Realization
from tests.ambient import ambient, output_record
from tests.systems import chain3, chain7, paper_chain3, pulse_recording, recorded, with_noise

KIND_OF = {
    "era": "pulse",
    "era_dc": "pulse",
    "itd": "pulse",
    "mrtd": "pulse",
    "mmrtd": "pulse",
    "okid_era": "random",
    "ssi_cov": "ambient",
    "ssi_data": "ambient",
    "next_era": "ambient",
    "plscf": "pulse",
    "efdd": "ambient",
}


def suited(method):
    """A recording that the method is made for, and the frequencies behind it."""
    if method.name == "efdd":  # the peaks of the last two modes lie under those before them
        return ambient(20_000, 0), chain7().modes().frequency_hz[:5]
    if KIND_OF[method.name] == "ambient":
        return ambient(20_000, 0), chain7().modes().frequency_hz
    truth = chain3().modes().frequency_hz
    if method.name == "okid_era":
        forces = np.random.default_rng(1).standard_normal((2, 1000))
        return recorded(paper_chain3(), [forces]), truth
    return pulse_recording(paper_chain3(), 200), truth


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_it_is_described(method):
    assert METHODS[method.name] is method
    assert find_method(method.name) is method
    assert set(method.kinds) <= set(KINDS)
    assert KIND_OF[method.name] in method.kinds
    assert method.summary.endswith(".")
    assert "Source:" in inspect.getdoc(method.function)
    assert "orders" in method.settings


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_it_finds_a_structure_at_a_given_order(method):
    recording, frequency_hz = suited(method)
    realization = method(recording, 2 * frequency_hz.size)
    assert isinstance(realization, Realization)
    assert realization.method == method.name
    assert realization.orders == (2 * frequency_hz.size,)
    # Exact but for the scatter of outputs alone, three times 0.2 %.
    accuracy = 1e-2 if KIND_OF[method.name] == "ambient" else 1e-9
    np.testing.assert_allclose(realization.system.modes().frequency_hz, frequency_hz, rtol=accuracy)


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_it_sweeps_the_orders_asked_for(method):
    recording, _ = suited(method)
    assert method(recording, 6, orders=[2, 4]).orders == (2, 4, 6)


@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_it_ignores_no_setting(method):
    recording, _ = suited(method)
    with pytest.raises(IdentificationError, match=rf"{method.name}' has no setting 'n_row'.*orders"):
        method(recording, n_row=3)


def test_an_unknown_name_is_told_with_those_that_exist():
    with pytest.raises(
        IdentificationError,
        match=r"'eera' does not exist; there are era, okid_era, era_dc, itd, mrtd, mmrtd, ssi_cov",
    ):
        find_method("eera")


def test_forces_are_asked_for_where_they_are_needed():
    with pytest.raises(IdentificationError, match="needs the forces"):
        METHODS["okid_era"](ambient(500, 1))


@pytest.mark.parametrize("name", ["era", "okid_era"])
def test_exact_data_show_their_rank_and_noisy_data_are_swept(name):
    recording, _ = suited(METHODS[name])
    exact = METHODS[name](recording)
    assert shows_rank(exact)
    assert exact.orders == (6,)
    measured = METHODS[name](with_noise(recording, 0.05, 2))
    assert not shows_rank(measured)
    assert measured.order == 6
    assert measured.orders == (2, 4, 6, 8, 10, 12)


def test_free_decays_are_realized_without_forces():
    system = paper_chain3()
    at_rest = np.zeros((2, 150))
    rng = np.random.default_rng(3)
    moving = recorded(system, [at_rest, at_rest], initial=rng.standard_normal((2, 6)))
    decays = Recording(
        tuple(output_record(np.asarray(record.outputs), "free_decay") for record in moving.records),
        (),
        moving.outputs,
        moving.sample_rate,
    )
    found = METHODS["era"](decays).system.modes()
    np.testing.assert_allclose(found.poles, chain3().modes().poles, rtol=1e-9)


@pytest.mark.parametrize("place", [0, 150, -1], ids=["first", "within", "last"])
@pytest.mark.parametrize("method", METHODS.values(), ids=METHODS)
def test_a_missing_sample_is_told_or_left_out(method, place):
    recording, _ = suited(method)
    channel, record = recording.outputs[1], recording.records[0]

    def with_value(value):
        outputs = np.array(record.outputs)
        outputs[1, place] = value
        return replace(recording, records=(replace(record, outputs=outputs), *recording.records[1:]))

    try:
        found, told = method(with_value(np.nan), 6), ""
    except RecordingError as error:
        found, told = None, str(error)
    if found is None:
        # One line that names the channel and the time.
        assert repr(channel.name) in told
        assert f"t = {recording.dt * (place % record.n_samples):.6g} s" in told
        assert "\n" not in told
    else:
        # Whatever was there has no say.
        other = method(with_value(1e3), 6).system.modes()
        np.testing.assert_array_equal(found.system.modes().poles, other.poles)
