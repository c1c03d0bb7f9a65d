"""Settings of all tests."""

import os

from hypothesis import settings

# Rerun takes bad arguments with a mere warning unless told to be strict.
os.environ.setdefault("RERUN_STRICT", "1")

# The same examples every time, and no judgement on speed where other work shares the machine.
settings.register_profile("project", deadline=None, derandomize=True)
settings.load_profile("project")
