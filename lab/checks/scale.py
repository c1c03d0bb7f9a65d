"""Channels larger or smaller than the model's by a factor."""

from __future__ import annotations

import numpy as np

from identification.errors import IdentificationError
from identification.recording import Array
from identification.spectra import frequency_response
from lab.checks.arrangement import balanced, mean_mac
from lab.checks.layout import chosen_arrangement
from lab.checks.remark import Remark
from lab.checks.survey import Survey

OFF = 1.6
"""Factor that no nominal model explains."""

KNOWN = {
    9.80665: "g for m/s^2",
    1e3: "a prefix milli or kilo",
    100.0: "cm for m",
    25.4: "inches for mm",
    0.0254: "inches for m",
    4.4482: "pounds of force for N",
    56000.0: "560 counts per cm for m",
    2 * np.pi: "Hz for rad/s",
    180 / np.pi: "degrees for radians",
    2.0: "peak-to-peak for peak, or half the gain",
    np.sqrt(2): "RMS for peak",
}
"""Factors that mix-ups of units make."""

NEAR = 0.12
COHERENT = 0.7


def scale(survey: Survey) -> list[Remark]:
    """Outputs off the others by a factor in all modes, and a common factor or sign between inputs and outputs."""
    pairs = survey.pairs
    if pairs is None:
        return []
    return _among_outputs(survey) + _from_inputs(survey)


def _among_outputs(survey: Survey) -> list[Remark]:
    """Outputs whose share in every mode is off by one factor."""
    pairs = survey.pairs
    assert pairs is not None
    if pairs.measured.size < 2 or len(survey.recording.outputs) < 3:
        return []
    chosen = chosen_arrangement(pairs, same_units=survey.same_units)
    if chosen is None:
        return []
    phi, psi = chosen.arranged(pairs.measured_shapes), pairs.modelled_shapes
    if mean_mac(phi, psi) > 0.95:
        return []
    factors = _row_factors(phi, psi)
    factors /= np.median(factors)
    after = mean_mac(phi / factors[:, None], psi)
    remarks = []
    for row, factor in zip(chosen.order, factors, strict=True):
        if 1 / OFF < factor < OFF or after < 0.85:
            continue
        remarks.append(
            _remark(
                survey,
                survey.recording.outputs[row].name,
                f"reads {_times(factor)} the model's share of every mode, next to the other outputs",
                factor,
            )
        )
    return remarks


def _row_factors(phi: Array, psi: Array) -> Array:
    """Factor of each row of Φ over Ψ when both are balanced alike, shape (n_outputs,)."""
    a, b = balanced(phi), balanced(psi)
    return _row_scale(phi, a) / _row_scale(psi, b)


def _row_scale(x: Array, balanced_x: Array) -> Array:
    """Row factors r of x = r c balanced_x, up to a common one."""
    ratio = np.abs(np.divide(x, balanced_x, out=np.ones_like(x), where=balanced_x != 0))
    columns = np.exp(np.mean(np.log(ratio), axis=0))
    return np.asarray(np.exp(np.mean(np.log(ratio / columns), axis=1)))


def _from_inputs(survey: Survey) -> list[Remark]:
    """A factor or sign of each input against the outputs, by the frequency responses."""
    recording, rig = survey.recording, survey.rig
    assert rig is not None
    pairs = survey.pairs
    measured_inputs = recording.inputs and all(record.inputs.shape[0] for record in recording.records)
    if not measured_inputs or pairs is None:
        return []
    chosen = chosen_arrangement(pairs, same_units=survey.same_units)
    if len(recording.outputs) > 1 and pairs.measured.size > 1 and (chosen is None or not chosen.as_named):
        return []  # first things first
    try:
        response = frequency_response(recording)
    except IdentificationError:
        return []
    f = response.frequency_hz
    within = (f > 0.3 * np.min(pairs.measured)) & (
        f < min(1.5 * np.max(pairs.measured), 0.35 * recording.sample_rate)
    )
    f, H = f[within], response.values[within]
    if f.size < 8:
        return []
    model = rig.state_space().frequency_response(f / pairs.ratio)
    # The hold of the samples delays by half a sample, which matters to the phase alone.
    model = model * np.exp(-1j * np.pi * f / recording.sample_rate)[:, None, None]
    weight = (
        np.ones(H.shape[:2]) if response.coherence is None else (response.coherence[within] > COHERENT) * 1.0
    )
    remarks = []
    for k, channel in enumerate(recording.inputs):
        both = (weight > 0) & (np.abs(H[:, :, k]) > 0) & (np.abs(model[:, :, k]) > 0)
        if np.sum(both) < 8:
            continue
        ratio = H[:, :, k][both] / model[:, :, k][both]
        factor = float(np.exp(np.median(np.log(np.abs(ratio)))))
        polarity = float(np.mean(np.cos(np.angle(ratio))))
        if not 1 / OFF < factor < OFF:
            remarks.append(
                _remark(
                    survey,
                    channel.name,
                    f"moves the outputs {_times(factor)} as much as in the model",
                    factor,
                )
            )
        if polarity < -0.5:
            remarks.append(
                Remark(
                    "sign",
                    channel.name,
                    "doubt",
                    f"pushes against the model's direction (mean cosine of the phase {polarity:.2f})",
                    "change the sign of the input, or of all outputs",
                    0,
                    0.0,
                    recording.records[0].n_samples / recording.sample_rate,
                    {"polarity": polarity},
                )
            )
    return remarks


def _remark(survey: Survey, name: str, says: str, factor: float) -> Remark:
    stop = survey.recording.records[0].n_samples / survey.recording.sample_rate
    hint = _hint(factor)
    advice = f"check its unit and factor{f' ({hint}?)' if hint else ''}"
    return Remark("scale", name, "doubt", says, advice, 0, 0.0, stop, {"factor": factor})


def _times(factor: float) -> str:
    return f"{factor:.4g} x" if factor >= 1 else f"1/{1 / factor:.4g} of"


def _hint(factor: float) -> str:
    size = max(factor, 1 / factor)
    near = [(abs(np.log(size / max(k, 1 / k))), text) for k, text in KNOWN.items()]
    distance, text = min(near)
    return text if distance < NEAR else ""
