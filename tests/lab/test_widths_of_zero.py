"""A width of zero, by which a number of the model is known, is taken where it can be."""

import numpy as np
import pytest

from identification.recording import Record, Recording
from lab.diagnose_files import diagnose_file
from lab.errors import LabError
from lab.files.recording import save
from lab.rig import Rig


def test_samples_refuse_it_in_one_line(tmp_path):
    rig = Rig.load("models/chain7.xml").connected(inputs=["force2"], outputs=["acc2.x"])
    noise = np.random.default_rng(1).standard_normal((2, 500))
    save(
        Recording((Record("random", noise[:1], noise[1:]),), rig.inputs, rig.outputs, 50.0), tmp_path / "r.h5"
    )
    with pytest.raises(LabError, match="width of zero is taken with frequency responses only; give a small"):
        diagnose_file(tmp_path / "r.h5", "chain7", tmp_path / "out", widths={"mass": 0.0})
