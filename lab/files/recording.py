"""The recording file: what was measured, by real sensors or by virtual ones, in HDF5.

Attributes of the file are format = "modal-recording" and version = 1, optionally title, source and further
facts. Each test run is a group /records/0, /records/1, … with the attributes kind and sample_rate [Hz],
optionally start_time, note and further facts. In it lie the data sets inputs and outputs, shape
(n_channels, n_samples), chunked along time, with the attributes names and units, optionally dofs and factors,
one entry per channel.
"""

from lab.files.recording_reader import load
from lab.files.recording_writer import RecordingWriter, save

__all__ = ["RecordingWriter", "load", "save"]
