"""Scenarios: read strictly, and every complaint names the key and what is allowed."""

import pytest

from lab import catalogue
from lab.errors import FileError, StudyError, UnknownNameError
from lab.excitation import Pulse, Sweep
from lab.scenario import Identification, Scenario, load_scenario

PLAIN = """
title = "A plain test"
model = "chain3_uncoupled.xml"
seed = 3

[test]
sample_rate = 20
duration = 10.0

[excitation]
kind = "sweep"
amplitude = 2
band = [0.1, 5.0]

[channels]
outputs = ["acc2.x"]

[identification]
method = "era"
order = 6
settings = { n_rows = 20 }

[criteria]
modes = 3
"""


def written(tmp_path, text, name="scenario.toml"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


def test_reads_what_is_written(tmp_path):
    scenario = load_scenario(written(tmp_path, PLAIN))
    assert (scenario.title, scenario.seed) == ("A plain test", 3)
    assert (scenario.test.sample_rate, scenario.test.duration, scenario.test.runs) == (20.0, 10.0, 1)
    assert scenario.test.accuracy is None
    assert scenario.drive() == Sweep(amplitude=2.0, band=(0.1, 5.0))
    assert scenario.channels.inputs is None
    assert scenario.channels.outputs == ["acc2.x"]
    assert scenario.identification == Identification(method="era", order=6, settings={"n_rows": 20})
    assert scenario.criteria.modes == 3
    assert scenario.text == PLAIN


def test_the_model_beside_the_scenario_comes_first(tmp_path):
    path = written(tmp_path, PLAIN)
    assert load_scenario(path).model_file() == catalogue.find("models", "chain3_uncoupled")
    (tmp_path / "chain3_uncoupled.xml").write_text("<mujoco/>")
    assert load_scenario(path).model_file() == tmp_path / "chain3_uncoupled.xml"


def test_a_name_stands_for_a_scenario_of_the_catalogue():
    assert load_scenario("chain3_pulse").drive() == Pulse(1.0)
    with pytest.raises(UnknownNameError, match=r"there are .*chain3_pulse"):
        load_scenario("chain3_puls")


def test_changed():
    scenario = load_scenario("chain3_pulse")
    assert scenario.changed() == scenario
    assert scenario.changed(seed=5).seed == 5
    assert scenario.changed(order=4).identification == scenario.identification.model_copy(update={"order": 4})
    assert scenario.changed(method="okid_era").identification == Identification(method="okid_era")
    assert scenario.changed(method="okid_era", seed=5).text == scenario.text


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("seed", "sead", "unknown key 'sead' at the top; allowed are title, model, seed, test,"),
        ("title", "tilte", "unknown key 'tilte' at the top"),
        (
            "duration",
            "length",
            "unknown key 'length' in [test]; allowed are sample_rate, duration, runs, accuracy",
        ),
        ("band", "bend", "unknown key 'bend' in [excitation]; allowed are kind, amplitude, band, law"),
        ("outputs", "sensors", "unknown key 'sensors' in [channels]; allowed are inputs, outputs"),
        ("modes", "modus", "unknown key 'modus' in [criteria]; allowed are modes, frequency_error,"),
        ("[criteria]", "[criterions]", "unknown key 'criterions' at the top"),
        ('title = "A plain test"', "", "key 'title' is missing at the top"),
        ("duration = 10.0", "", "key 'duration' is missing in [test]"),
        ('kind = "sweep"', "", "key 'kind' is missing in [excitation]"),
        ('"sweep"', '"swing"', "kind = 'swing' in [excitation]; expected one of pulse, impact"),
        (
            "sample_rate = 20",
            "sample_rate = -20",
            "sample_rate = -20 in [test]: input should be greater than 0",
        ),
        (
            "sample_rate = 20",
            'sample_rate = "20"',
            "sample_rate = '20' in [test]: input should be a valid number",
        ),
        ("sample_rate = 20", "sample_rate = nan", "should be a finite number"),
        (
            "amplitude = 2",
            'amplitude = "2"',
            "amplitude = '2' in [excitation]: input should be a valid number",
        ),
        ("[0.1, 5.0]", "5.0", "band = 5.0 in [excitation]"),
        ('["acc2.x"]', '["acc2.x", 7]', "outputs[1] = 7 in [channels]: input should be a valid string"),
        (
            "[criteria]",
            "[diagnosis]\nwidth = 1\n[criteria]",
            "unknown key 'width' in [diagnosis]; allowed are widths, verdict, parameter_error",
        ),
        (
            "[criteria]",
            '[diagnosis]\nverdict = "guilty"\n[criteria]',
            "verdict = 'guilty' in [diagnosis]: input should be 'consistent', 'explained' or 'unexplained'",
        ),
        ("seed = 3", "seed = -1", "seed = -1 at the top"),
        ("order = 6", "order = 6.5", "order = 6.5 in [identification]"),
        ("[test]", "[test", "is not TOML"),
    ],
)
def test_mistakes_are_named_in_one_line(tmp_path, old, new, says):
    assert old in PLAIN
    path = written(tmp_path, PLAIN.replace(old, new, 1))
    with pytest.raises(StudyError) as caught:
        load_scenario(path)
    assert says in str(caught.value)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_files_that_are_no_scenario(tmp_path):
    with pytest.raises(FileError, match="No such file"):
        load_scenario(tmp_path / "absent.toml")
    (tmp_path / "picture.toml").write_bytes(b"\x89PNG\xff")
    with pytest.raises(FileError, match="is not text"):
        load_scenario(tmp_path / "picture.toml")
    with pytest.raises(UnknownNameError, match=r"'nowhere.xml' is neither a file nor in"):
        load_scenario(written(tmp_path, PLAIN.replace("chain3_uncoupled", "nowhere"))).model_file()


@pytest.mark.parametrize("path", catalogue.files("scenarios").values(), ids=lambda path: path.stem)
def test_every_scenario_of_the_catalogue_is_complete(path):
    scenario = load_scenario(path)
    assert isinstance(scenario, Scenario)
    assert scenario.model_file().parent == catalogue.folder("models")
    assert any(limit is not None for _, limit in scenario.criteria)
