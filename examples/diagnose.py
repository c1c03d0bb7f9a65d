"""What a model gets wrong: a test of a structure whose spring hardens, held against a model in which none does."""

import lab
from lab.effects import CubicStiffness

model = lab.load_model("chain3_uncoupled").connected(
    inputs=["force1", "force3"], outputs=["acc1.x", "acc2.x", "acc3.x"]
)
hardening = CubicStiffness("spring2_3", k3=3.0).apply(model)
noisy = lab.instrument(hardening, noise_percent=1.0)
recording = lab.simulate(noisy, lab.Random(rms=1.0), sample_rate=5.0, duration=200.0, seed=2)

diagnosis = lab.diagnose(recording, model)
print(diagnosis.verdict)
for finding in diagnosis.findings:
    print(finding.says)
diagnosis.extended.save("extended.xml")
