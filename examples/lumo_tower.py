"""A minute of the LUMO lattice tower under wind, as a recording file: 18 accelerations at nine heights.

    python examples/lumo_tower.py FOLDER lumo.h5
    lab identify lumo.h5 --out out/lumo

FOLDER holds data_lumo.csv.gz and coords_lumo.csv of "LUMO - Leibniz University Test Structure for Monitoring",
Wernitz et al. (2021), doi 10.25835/0027803. The sampling rate is 1651 Hz. The unit is not stated and taken for
m/s^2; another one would scale the shapes alike and leave frequencies and damping as they are.
"""

import sys
from pathlib import Path

import numpy as np

from identification import Channel, Record, Recording
from lab import save_recording

if len(sys.argv) != 3 or not (folder := Path(sys.argv[1])).joinpath("data_lumo.csv.gz").is_file():
    sys.exit("usage: python examples/lumo_tower.py FOLDER OUT.h5, with data_lumo.csv.gz in FOLDER")

samples = np.loadtxt(folder / "data_lumo.csv.gz", delimiter=",", usecols=range(18)).T
places = np.loadtxt(folder / "coords_lumo.csv", delimiter=",", skiprows=1, max_rows=18, usecols=(4, 5))
channels = tuple(
    Channel(f"acc_{'xy'[int(direction) - 1]}_{height:g}m", "m/s^2") for height, direction in places
)
record = Record("ambient", np.zeros((0, samples.shape[1])), samples)
recording = Recording(
    (record,), (), channels, 1651.0, title="LUMO lattice tower", source="doi 10.25835/0027803"
)
save_recording(recording, sys.argv[2])
print(f"{sys.argv[2]}: {recording}")
