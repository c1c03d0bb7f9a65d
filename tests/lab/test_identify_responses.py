"""`lab identify` on files that hold frequency responses and no samples."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from identification.response import FrequencyResponse
from lab.files.recording_responses import save_responses
from lab.rig import Rig
from tests.lab.test_cli import complaint, status


@pytest.fixture(scope="module")
def rig():
    return Rig.load("models/chain3_uncoupled.xml").connected(
        inputs=["force1"], outputs=["acc1.x", "acc2.x", "acc3.x"]
    )


def write(rig, dt):
    """Responses with complex noise of 1 % of their RMS in the file frf.h5."""
    rng, f = np.random.default_rng(1), 0.004 * np.arange(5, 300)
    system = rig.state_space().sampled(dt) if dt else rig.state_space()
    H = system.frequency_response(f)
    level = 0.01 * np.sqrt(np.mean(np.abs(H) ** 2, axis=0) / 2)
    H = H + level * (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape))
    save_responses(FrequencyResponse(f, H, dt, rig.inputs, rig.outputs), "frf.h5")


@pytest.mark.parametrize("dt", [0.0, 0.4])
def test_responses_are_identified(rig, tmp_path, monkeypatch, capsys, dt):
    monkeypatch.chdir(tmp_path)
    write(rig, dt)
    assert status("identify", "frf.h5", "--out", "out") == 0
    printed = capsys.readouterr().out
    assert printed.startswith("plscf, order ")
    assert ("continuous in time" if dt == 0 else "sampled at 2.5 Hz") in printed
    assert sorted(os.listdir("out")) == ["report.html", "result.json", "run.rrd"]
    result = json.loads(Path("out/result.json").read_text("utf-8"))
    assert result["sample_rate"] == (1 / dt if dt else None)
    assert len(result["modes"]) == 3
    for mode, truth in zip(result["modes"], rig.modes().frequency_hz, strict=True):
        # Five standard deviations, and what a polynomial of finite degree leaves, 1e-4 at these dampings.
        assert abs(mode["frequency_hz"] - truth) < 5 * mode["frequency_std"] + 1e-4 * truth
    page = Path("out/report.html").read_text("utf-8")
    assert "from the frequency responses of 3 outputs to 1 input, 295 lines from 0.02 to 1.196 Hz" in page
    assert "Frequency responses, magnitude" in page
    assert "Nyquist plots" in page


def test_what_needs_samples_is_one_line(rig, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write(rig, 0.0)
    assert "'okid_era' needs samples" in complaint(capsys, "identify", "frf.h5", "--method", "okid_era")
    assert "frequency responses alone; to refine, samples are needed" in complaint(
        capsys, "identify", "frf.h5", "--refine"
    )
    assert os.listdir() == ["frf.h5"]
