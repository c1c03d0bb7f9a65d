"""Modes, and mass, damping and stiffness, of a recording, with error bars; run simulate.py first."""

import identification
import lab

recording = lab.load_recording("three_masses.h5")
found = identification.identify(recording, refine=True)
modes, matrices = found.modes, found.second_order

print(found.explanation)
for k in range(len(modes)):
    print(
        f"{modes.frequency_hz[k]:.5f} ± {modes.frequency_std[k]:.5f} Hz, {100 * modes.damping_ratio[k]:.2f} %"
    )
print("stiffness", matrices.dofs, matrices.stiffness.round(2), "±", matrices.stiffness_std.round(2), sep="\n")
