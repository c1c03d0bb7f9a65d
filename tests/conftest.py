"""Settings of all tests."""

import os

from hypothesis import settings

# Matrices here are small: threads cost more than they bring, tenfold where other work shares the cores.
for library in ("OMP", "OPENBLAS", "MKL"):
    os.environ.setdefault(f"{library}_NUM_THREADS", "1")

# Rerun takes bad arguments with a mere warning unless told to be strict.
os.environ.setdefault("RERUN_STRICT", "1")

# The same examples every time, and no judgement on speed where other work shares the machine.
settings.register_profile("project", deadline=None, derandomize=True)
settings.load_profile("project")
