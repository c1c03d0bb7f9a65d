"""Whether recording and model can be held against each other at all."""

from __future__ import annotations

from dataclasses import replace

from identification.recording import Recording
from lab.checks.remark import Remark
from lab.checks.survey import Survey
from lab.errors import UnknownNameError
from lab.rig import Rig


def fitted(rig: Rig, recording: Recording) -> Rig:
    """The rig with the recording's channels connected in their order, whatever their units.

    Raises:
        UnknownNameError: the model lacks a channel.
    """
    everything = rig.with_chain(replace(rig.chain, inputs=None, outputs=None))
    for side in ("inputs", "outputs"):
        known = [channel.name for channel in getattr(everything, side)]
        for channel in getattr(recording, side):
            if channel.name not in known:
                raise UnknownNameError(
                    f"the recording has {side[:-1]} channel {channel.name!r}, which model {rig.name!r} lacks; the model has "
                    f"{', '.join(known) or 'none'}; rename it with --map FILE.toml or add it to the model"
                )
    return rig.connected(
        inputs=[channel.name for channel in recording.inputs],
        outputs=[channel.name for channel in recording.outputs],
    )


def fitting(survey: Survey) -> list[Remark]:
    """Channels in another unit than the model's, and recordings without a mode of the model's."""
    if survey.rig is None:
        return []
    recording = survey.recording
    stop = recording.records[0].n_samples / recording.sample_rate
    remarks = [
        Remark(
            "units",
            channel.name,
            "fault",
            f"is recorded in {channel.unit}, and the model has it in {own.unit}",
            "give its sensitivity and unit when importing it",
            0,
            0.0,
            stop,
        )
        for side in ("inputs", "outputs")
        for channel, own in zip(getattr(recording, side), getattr(survey.rig, side), strict=True)
        if channel.unit != own.unit
    ]
    if survey.pairs is None:
        remarks.append(
            Remark(
                "fitting",
                "",
                "doubt",
                f"order, signs, factors and rate cannot be held against the model: {survey.why_unpaired}",
                "mend what else is said here first, or check that this is the right model",
                0,
                0.0,
                stop,
            )
        )
    return remarks
