"""A universal file in, modes in a universal file out; run simulate.py first, whose recording stands in for yours."""

import lab

lab.export_file("three_masses.h5", "my_test.uff", what="data")

foreign = lab.read_foreign("my_test.uff", kind="random")
print(foreign.recording)
lab.save_recording(foreign.recording, "my_test.h5")
result = lab.identify_file("my_test.h5", "out/my_test")
print(result.modes)
lab.export_file("out/my_test", "modes.uff", recording="my_test.h5")
