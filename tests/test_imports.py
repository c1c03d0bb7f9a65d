"""What importing pulls in: identification numpy and scipy alone, the lab nothing that draws."""

import subprocess
import sys
from pathlib import Path

import pytest

import lab

LOADED = """
import sys
before = set(sys.modules)
import {module}
loaded = {{name.partition(".")[0] for name in set(sys.modules) - before}}
print(*sorted(loaded - set(sys.stdlib_module_names)))
"""


def loaded_by(module):
    code = LOADED.format(module=module)
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    return set(done.stdout.split())


def modules_of(package):
    root = Path(__file__).parent.parent
    for path in sorted((root / package).rglob("*.py")):
        if path.name != "__main__.py":
            yield ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")


def test_identification_needs_numpy_and_scipy_only():
    everything = ", ".join(modules_of("identification"))
    foreign = {name for name in loaded_by(everything) if not name.startswith("_")}
    # cython_runtime and the like are made by compiled parts of numpy and scipy themselves.
    assert foreign <= {"identification", "numpy", "scipy", "cython_runtime"}


@pytest.mark.parametrize("module", ["lab", "lab.cli", "lab.run", "lab.simulate"])
def test_the_lab_comes_up_without_pictures(module):
    assert not loaded_by(module) & {"rerun", "matplotlib", "pyarrow", "jinja2", "PIL"}


def test_import_lab_is_light():
    assert loaded_by("lab") == {"lab"}


def test_public_names_of_the_lab_resolve():
    for name in lab.__all__:
        value = getattr(lab, name)
        assert value.__class__.__name__ != "module", name


def test_functions_are_not_hidden_by_modules_of_the_same_name():
    code = "import lab.simulate, lab.compare; assert callable(lab.simulate) and callable(lab.compare)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_the_compiler_comes_with_responses_only():
    code = "import sys, lab.cli, lab.run, lab.effects, lab.catalogue; assert 'numba' not in sys.modules"
    subprocess.run([sys.executable, "-c", code], check=True)
