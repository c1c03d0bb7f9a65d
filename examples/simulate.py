"""A virtual test: three masses pushed at random, measured with 2 % noise, kept in a file."""

import lab

rig = lab.load_model("chain3_uncoupled").connected(inputs=["force1", "force2"], outputs=["acc2.x", "acc3.x"])
noisy = lab.instrument(rig, noise_percent=2.0)
recording = lab.simulate(noisy, lab.Random(rms=1.0), sample_rate=10.0, duration=200.0, seed=1)
lab.save_recording(recording, "three_masses.h5")

print(recording)
print("true modes:", rig.modes())
