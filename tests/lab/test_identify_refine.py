"""`lab identify --refine`: matrices with error bars in the result, and one line where forces are missing."""

import json

import numpy as np
import pytest

from identification.errors import RecordingError
from lab.files.recording import save
from lab.run import identify_file
from tests.ambient import ambient
from tests.identification.test_refinement import TRUTH, shaken


def test_the_result_tells_how_the_maximum_was_reached(tmp_path):
    save(shaken(), tmp_path / "test.h5")
    identify_file(tmp_path / "test.h5", tmp_path / "out", refine=True)
    found = json.loads((tmp_path / "out/result.json").read_text("utf-8"))
    assert found["refinement"]["converged"]
    assert found["refinement"]["noise_std"].keys() == found["refinement"]["whiteness"].keys()
    matrices = found["second_order"]
    rank = [TRUTH.dofs.index(dof) for dof in matrices["dofs"]]
    error = np.abs(np.array(matrices["mass"]) - TRUTH.mass[np.ix_(rank, rank)])
    # Nine entries: one test in 15 000 has an error beyond four and a half standard deviations.
    assert np.all(error < 4.5 * np.array(matrices["mass_std"]))
    assert found["explanation"] in (tmp_path / "out/report.html").read_text("utf-8").replace("&#39;", "'")


def test_without_forces_nothing_is_written(tmp_path):
    save(ambient(3000, 0), tmp_path / "wind.h5")
    with pytest.raises(RecordingError, match="maximum likelihood needs them"):
        identify_file(tmp_path / "wind.h5", tmp_path / "out", refine=True)
    assert not (tmp_path / "out").exists()
