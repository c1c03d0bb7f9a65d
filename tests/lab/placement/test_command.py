"""`lab place`: what it prints and writes, and one line with status 2 for every mistake."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest

from lab.cli import main
from lab.errors import FileError
from lab.files.placement import load_placement, placement_document, save_placement
from lab.place_files import place_file
from lab.placement.place import place
from lab.placement_summary import placement_summary
from lab.show.figures.placement import draw_placement
from lab.show.marks import actuator_marks, sensor_marks
from lab.show.rerun_log.placement import write_placement_rrd
from tests.lab.placement.structures import row_of_masses
from tests.lab.test_show_rerun import Read


def status(*words):
    with pytest.raises(SystemExit) as ended:
        main([str(word) for word in words])
    return ended.value.code


@pytest.fixture
def model(tmp_path, monkeypatch):
    """A model file in an otherwise empty working folder."""
    (tmp_path / "row.xml").write_text(row_of_masses(3).xml)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_writes_a_whole_folder_and_says_where_sensors_go(model, capsys):
    assert status("place", "--model", "row.xml", "--sensors", 2, "--actuators", 1, "--sensor-mass", 0.01) == 0
    folder = model / "out/row_placement"
    assert sorted(path.name for path in folder.iterdir()) == ["placement.json", "report.html", "run.rrd"]
    document = load_placement(folder / "placement.json")
    said = capsys.readouterr().out
    assert f"sensors: {', '.join(document['sensors'])}" in said
    assert "No other is better: all 3 layouts were compared." in " ".join(said.split())
    page = (folder / "report.html").read_text("utf-8")
    assert "placement-layout" in page
    assert "placement-ranking" in page
    assert "What the mass of the sensors does" in page


def test_json_is_the_document_and_nothing_else(model, capsys):
    words = ("--sensors", 2, "--actuators", 2, "--target", "matrices", "--json")
    assert status("place", "--model", "row.xml", *words) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["format"], document["version"]) == ("modal-placement", 1)
    assert document == load_placement("out/row_placement/placement.json")
    # 3 degrees of freedom and 4 channels: one with both, and one of the other two with the second sensor.
    assert document["n_possible"] == 6


def test_a_scenario_gives_test_and_layout(model, capsys):
    words = ("--scenario", "chain3_pulse", "--sensors", 2, "--actuators", 2, "--target", "matrices")
    assert status("place", *words, "--quantity", "acceleration", "--out", "out/chain") == 0
    rows = load_placement("out/chain/placement.json")["ranking"]
    (planned,) = [row for row in rows if row["name"] == "planned"]
    assert planned["sensors"] == ["acc2.x", "acc3.x"]
    assert planned["actuators"] == ["force1", "force2"]
    assert "The planned layout reaches" in capsys.readouterr().out


def test_quiet_says_only_warnings(model, capsys):
    assert status("place", "--model", "row.xml", "--sensors", 2, "--quiet") == 0
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--sensors", 2), "neither a model nor a scenario is given"),
        (("--model", "row.xml", "--sensors", 7), "7 sensors asked for, of 3 candidates"),
        (("--model", "row.xml", "--sensors", 2, "--target", "matrices"), "no number of actuators is given"),
        (("--model", "row.xml", "--sensors", 2, "--size", 0.1), "--size means nothing for the target modes"),
        (("--model", "row.xml", "--sensors", 2, "--noise", "m"), "expected UNIT=STD"),
        (("--model", "row.xml", "--sensors", 2, "--noise", "m=-1"), "expected a positive number"),
        (("--model", "row.xml", "--sensors", 2, "--noise", "m=1"), "no noise is given for sensors in m/s^2"),
        (("--model", "row.xml", "--sensors", 2, "--fixed", "b"), "'b' is neither a sensor nor an actuator"),
        (("--model", "gone.xml", "--sensors", 2), "'gone.xml' is neither a file nor in the catalogue"),
        (
            (
                "--model",
                "row.xml",
                "--sensors",
                2,
                "--actuators",
                2,
                "--target",
                "matrices",
                "--excitation",
                "ambient",
            ),
            "leaves the forces unknown",
        ),
    ],
)
def test_mistakes_are_one_line_with_status_2(model, capsys, words, message):
    assert status("place", *words) == 2
    told = capsys.readouterr().err
    assert message in told
    assert told.count("\n") == 1
    assert not (model / "out").exists()


def test_marks_sit_where_the_channels_are():
    rig = row_of_masses(3)
    (sensor,), (actuator,) = sensor_marks(rig, ["a2.x"]), actuator_marks(rig, ["f3"])
    np.testing.assert_allclose(sensor.point, [2, 0, 0], atol=1e-12)
    np.testing.assert_allclose(sensor.direction, [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(actuator.point, [3, 0, 0], atol=1e-12)
    np.testing.assert_allclose(actuator.direction, [1, 0, 0], atol=1e-12)
    assert [mark.name for mark in sensor_marks(rig, ["a1", "a3.x"])] == ["a1.x", "a3.x"]


def test_figures_are_drawn_for_what_there_is():
    rig = row_of_masses(3)
    names = [drawing.name for drawing in draw_placement(place(rig, 2), rig)]
    assert names == ["placement-ranking", "placement-layout"]
    assert [drawing.name for drawing in draw_placement(place(rig, 3), rig)] == ["placement-layout"]


def test_a_search_tells_what_could_be_gained():
    placement = place(row_of_masses(6), 3, limit=0)
    assert re.search(
        r"none can go below .* at most .* % could be gained", " ".join(placement_summary(placement).split())
    )
    unbounded = replace(placement, floor=None)
    assert "that none is better is not proven" in " ".join(placement_summary(unbounded).split())


def test_documents_are_read_back_and_checked(tmp_path):
    placement = place(row_of_masses(3), 2)
    save_placement(placement, tmp_path / "placement.json")
    assert load_placement(tmp_path / "placement.json") == placement_document(placement)
    broken = {key: value for key, value in placement_document(placement).items() if key != "sensors"}
    (tmp_path / "broken.json").write_text(json.dumps(broken))
    with pytest.raises(FileError, match="has no 'sensors'"):
        load_placement(tmp_path / "broken.json")


def test_the_same_command_gives_the_same_bytes(model):
    for folder in ("one", "two"):
        place_file("row.xml", folder, 2, n_actuators=2, target="matrices")
    for name in ("placement.json", "report.html"):
        assert (model / "one" / name).read_bytes() == (model / "two" / name).read_bytes()


def test_the_viewer_shows_the_chosen_channels_as_arrows(tmp_path):
    rig = row_of_masses(3)
    placement = place(rig, 2, n_actuators=1)
    write_placement_rrd(tmp_path / "run.rrd", placement, rig)
    read = Read(tmp_path / "run.rrd")
    arrows = {path for path in read.entities if "/sensors/" in path or "/actuators/" in path}
    chosen = [f"sensors/{name}" for name in placement.sensors] + [f"actuators/{placement.actuators[0]}"]
    assert {path.replace("\\", "").removeprefix("/placement/structure/") for path in arrows} == set(chosen)
