"""What the package offers, and that it costs no more than numpy and scipy."""

import subprocess
import sys

import pytest

import identification

FORBIDDEN = ("mujoco", "h5py", "rerun", "matplotlib", "pydantic", "click", "jinja2", "lab")


def loaded_by(statement):
    code = f"{statement}\nimport sys\nprint(*sorted(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    return {name.partition(".")[0] for name in done.stdout.split()}


def test_identifying_needs_nothing_of_the_lab():
    loaded = loaded_by("from identification import identify, METHODS, stabilize")
    assert not loaded & set(FORBIDDEN)
    assert {"numpy", "scipy"} <= loaded


def test_the_package_itself_is_light():
    assert not loaded_by("import identification") & {"numpy", "scipy"}


def test_every_public_name_is_there():
    for name in identification.__all__:
        assert getattr(identification, name) is not None
        assert name in dir(identification)


def test_modules_do_not_hide_functions_of_the_same_name():
    code = (
        "import identification.era, identification.identify, identification.okid, identification.second_order\n"
        "from identification import era, identify, okid, second_order\n"
        "assert all(callable(f) for f in (era, identify, okid, second_order))"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_an_unknown_name_is_told():
    with pytest.raises(AttributeError, match="ssi_cov"):
        identification.ssi_date  # noqa: B018
