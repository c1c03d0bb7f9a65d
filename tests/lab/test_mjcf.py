"""MJCF text: read, with includes in place, and written back to the last digit."""

import math
import shutil
import struct

import mujoco
import numpy as np
import pytest

from lab import mjcf
from lab.errors import FileError, RigError
from lab.rig import Rig
from tests.lab.structures import MODELS, oscillator

PART = """<mujocoinclude><body name="part"><joint name="p" type="slide" stiffness="3"/>
<geom size="0.1" mass="1"/></body></mujocoinclude>"""


def with_include(name):
    return f'<mujoco model="whole"><worldbody><include file="{name}"/></worldbody></mujoco>'


def test_include_takes_its_place(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "part.xml").write_text(PART)
    (tmp_path / "whole.xml").write_text(with_include("parts/part.xml"))
    text = mjcf.read(tmp_path / "whole.xml")
    assert "include" not in text
    assert Rig.load(tmp_path / "whole.xml").dofs == ("p",)


def test_nested_includes_are_seen_from_the_main_file_as_in_mujoco(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "outer.xml").write_text(
        '<mujocoinclude><include file="parts/part.xml"/></mujocoinclude>'
    )
    (tmp_path / "parts" / "part.xml").write_text(PART)
    (tmp_path / "whole.xml").write_text(with_include("parts/outer.xml"))
    assert mujoco.MjModel.from_xml_path(str(tmp_path / "whole.xml")).nv == 1
    assert Rig.load(tmp_path / "whole.xml").dofs == ("p",)


def test_included_elements_keep_their_order(tmp_path):
    (tmp_path / "part.xml").write_text(PART)
    second = '<body name="own" pos="1 0 0"><joint name="q" type="slide" stiffness="1"/><geom size="0.1" mass="1"/></body>'
    (tmp_path / "whole.xml").write_text(
        with_include("part.xml").replace("</worldbody>", second + "</worldbody>")
    )
    assert Rig.load(tmp_path / "whole.xml").dofs == ("p", "q")


def test_missing_include_is_named(tmp_path):
    (tmp_path / "whole.xml").write_text(with_include("gone.xml"))
    with pytest.raises(FileError, match=r"gone\.xml does not exist"):
        mjcf.read(tmp_path / "whole.xml")


@pytest.mark.parametrize("inner", ["whole.xml", "part.xml"])
def test_circle_of_includes_is_refused(tmp_path, inner):
    (tmp_path / "part.xml").write_text(f'<mujocoinclude><include file="{inner}"/></mujocoinclude>')
    (tmp_path / "whole.xml").write_text(with_include("part.xml"))
    with pytest.raises(RigError, match=rf"{inner} is included a second time.*circle"):
        mjcf.read(tmp_path / "whole.xml")


def test_include_without_a_file_is_refused(tmp_path):
    (tmp_path / "whole.xml").write_text("<mujoco><include/></mujoco>")
    with pytest.raises(RigError, match="names no file"):
        mjcf.read(tmp_path / "whole.xml")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<mujoco><worldbody>", r"not well-formed XML"),
        ("<robot/>", r"root element <robot>; expected <mujoco>"),
        ("", r"not well-formed XML"),
    ],
)
def test_text_that_is_no_mjcf(tmp_path, text, message):
    path = tmp_path / "broken.xml"
    path.write_text(text)
    with pytest.raises(RigError, match=message) as caught:
        mjcf.read(path)
    assert "broken.xml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_missing_folder_and_binary_files_are_file_errors(tmp_path):
    (tmp_path / "photo.xml").write_bytes(b"\x89PNG\xff\xfe")
    for path, message in (
        (tmp_path / "no.xml", "does not exist"),
        (tmp_path / "photo.xml", "cannot be read"),
    ):
        with pytest.raises(FileError, match=message):
            mjcf.read(path)
    with pytest.raises(FileError, match="cannot be read"):
        mjcf.read(tmp_path)


def test_byte_order_mark_is_no_content(tmp_path):
    (tmp_path / "marked.xml").write_bytes(b"\xef\xbb\xbf" + oscillator().encode())
    assert Rig.load(tmp_path / "marked.xml").dofs == ("x",)


def test_comments_survive(tmp_path):
    text = mjcf.read(MODELS / "chain7.xml")
    assert "Cambraia and Kurka" in text


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (('type="slide"', 'type="slid"'), "slid"),
        (('joint="x"', 'joint="y"'), "y"),
        (("<joint ", "<joinr "), "joinr"),
        (('mass="2.0"', 'mass="0"'), "mass"),
        (('stiffness="50.0"', 'stiffness="fifty"'), "stiffness"),
    ],
)
def test_mujoco_refuses_in_one_line(change, reason):
    with pytest.raises(RigError, match=rf"MuJoCo refuses the model: .*{reason}") as caught:
        Rig.from_xml(oscillator().replace(*change))
    assert "\n" not in str(caught.value)


def test_warnings_of_the_compiler_leave_no_log_file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(RigError):
        Rig.from_xml(oscillator().replace('size="0.1 0.1 0.1"', 'size="nan 0.1 0.1"'))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("value", [math.pi, 0.1, 1e-300, 2 / 3, -5e-324, 1e22, 100.0])
def test_numbers_read_back_to_the_same_double(value):
    assert float(mjcf.number(value)) == value


def test_numbers_are_plain_floats():
    assert mjcf.number(np.float64(0.25)) == "0.25"


def tetrahedron(path):
    """A binary STL file of four triangles."""
    corners = [(0.0, 0.0, 0.0), (0.2, 0.0, 0.0), (0.0, 0.2, 0.0), (0.0, 0.0, 0.2)]
    faces = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
    body = b"".join(
        struct.pack("<12fH", 0, 0, 0, *(x for corner in face for x in corners[corner]), 0) for face in faces
    )
    path.write_bytes(bytes(80) + struct.pack("<I", len(faces)) + body)


@pytest.mark.parametrize(
    "compiler",
    [
        "",
        '<compiler meshdir="shapes"/>',
        '<compiler assetdir="elsewhere"/><compiler meshdir="shapes"/>',
        '<compiler assetdir="shapes"/>',
    ],
)
def test_meshes_are_found_after_saving_elsewhere(tmp_path, compiler):
    here, there = tmp_path / "here", tmp_path / "there"
    (here / "shapes").mkdir(parents=True)
    there.mkdir()
    tetrahedron(here / "shapes" / "rock.stl")
    name = "rock.stl" if "shapes" in compiler else "shapes/rock.stl"
    asset = f'{compiler}<asset><mesh name="rock" file="{name}"/></asset>'
    geom = '<geom type="mesh" mesh="rock" mass="2"/>'
    text = oscillator(extra=asset).replace('<geom type="box" size="0.1 0.1 0.1" mass="2.0"/>', geom)
    (here / "rock.xml").write_text(text)
    rig = Rig.load(here / "rock.xml")
    assert rig.model.nmesh == 1
    rig.save(there / "moved.xml")
    assert Rig.load(there / "moved.xml").model.nmesh == 1
    assert mujoco.MjModel.from_xml_path(str(there / "moved.xml")).nmesh == 1
    # Beside the original, paths stay as they were written, so that the folder can move as a whole.
    rig.save(here / "copy.xml")
    assert str(tmp_path) not in (here / "copy.xml").read_text()
    shutil.move(here, tmp_path / "moved")
    assert Rig.load(tmp_path / "moved" / "copy.xml").model.nmesh == 1


def test_missing_mesh_is_one_line(tmp_path):
    (tmp_path / "rock.xml").write_text(oscillator(extra='<asset><mesh file="rock.stl"/></asset>'))
    with pytest.raises(RigError, match=r"MuJoCo refuses the model: .*rock\.stl"):
        Rig.load(tmp_path / "rock.xml")


def test_sub_models_are_found_beside_the_model_from_anywhere(tmp_path, monkeypatch):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "child.xml").write_text(f"<mujoco><worldbody>{PART[15:-16]}</worldbody></mujoco>")
    (tmp_path / "main.xml").write_text(
        '<mujoco><asset><model name="child" file="sub/child.xml"/></asset>'
        '<worldbody><attach model="child" body="part" prefix="left_"/></worldbody></mujoco>'
    )
    monkeypatch.chdir(tmp_path / "sub")
    rig = Rig.load(tmp_path / "main.xml")
    assert rig.dofs == ("left_p",)
    (tmp_path / "out").mkdir()
    rig.save(tmp_path / "out" / "main.xml")
    assert Rig.load(tmp_path / "out" / "main.xml").dofs == ("left_p",)
