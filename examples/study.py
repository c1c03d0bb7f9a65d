"""How the error of a stiffness matrix grows with noise: six tests on two processes; it resumes if stopped."""

from pathlib import Path

import lab

STUDY = """
title = "Stiffness against noise"
scenario = "chain3_pulse"
repeats = 2
paired = true

[vary]
instruments.noise_percent = [0.01, 0.1, 1.0]
criteria = [{}]
"""

# The workers are new processes, which read this file too.
if __name__ == "__main__":
    Path("noise.toml").write_text(STUDY)
    outcome = lab.study("noise.toml", "out/noise", workers=2)
    for point, error in enumerate(outcome["stiffness_error"].value):
        print(outcome.study.setting(point)["instruments.noise_percent"], "% noise:", f"{error:.2e}")
