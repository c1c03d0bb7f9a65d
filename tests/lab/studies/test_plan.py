"""Studies: read strictly, and each run's setting and seed follow from what it is, not from its place."""

import pytest

from lab import catalogue
from lab.errors import FileError, StudyError, UnknownNameError
from lab.studies.axes import Axis
from lab.studies.plan import Study, load_study
from tests.lab.studies.small import STUDY, loaded, written


def test_every_setting_has_every_repeat_once(tmp_path):
    study = loaded(tmp_path)
    assert (study.n_points, study.n_runs) == (4, 12)
    runs = [study.run(k) for k in range(study.n_runs)]
    settings = [tuple(run.setting.items()) for run in runs]
    assert sorted(set(settings)) == sorted(settings[:4])
    assert settings == settings[:4] * 3
    assert len({run.seed for run in runs}) == 12
    # A scenario file holds the seed, to repeat a run alone.
    assert all(0 <= run.seed < 2**63 for run in runs)


def seeds(study):
    found = {}
    for number in range(study.n_runs):
        run = study.run(number)
        found.setdefault(tuple(sorted(run.setting.items())), []).append(run.seed)
    return found


def test_seeds_stay_when_values_and_repeats_are_added(tmp_path):
    few = seeds(loaded(tmp_path / "few"))
    more = STUDY.replace("[1.0, 2.0]", "[0.5, 2.0, 1.0]").replace("repeats = 3", "repeats = 5")
    many = seeds(loaded(tmp_path / "many", more))
    assert few.keys() < many.keys()
    assert all(many[setting][:3] == own for setting, own in few.items())


def test_paired_settings_share_their_seeds(tmp_path):
    study = loaded(tmp_path, STUDY.replace("repeats = 3", "repeats = 3\npaired = true"))
    (own,) = {tuple(each) for each in seeds(study).values()}
    assert len(set(own)) == 3


def test_a_varied_seed_is_the_seed(tmp_path):
    text = STUDY.replace("repeats = 3", "").replace(
        "[vary]", "[vary]\nseed = { first = 5, last = 7, count = 3 }"
    )
    assert {loaded(tmp_path, text).run(k).seed for k in range(12)} == {5, 6, 7}


def test_a_study_without_axes_is_one_point():
    study = Study("one", {}, None, ())
    assert (study.n_points, study.n_runs, study.run(0).setting) == (1, 1, {})
    assert Study("two", {}, None, (Axis(("a",), ((1, 2),)),)).n_points == 2


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        (
            "repeats = 3",
            "repaets = 3",
            "unknown key 'repaets' at the top; allowed are title, scenario, seed, repeats",
        ),
        ("repeats = 3", "repeats = 0", "repeats = 0 at the top: input should be greater than 0"),
        ('title = "A small study"', "", "key 'title' is missing at the top"),
        (
            "identification.order",
            "identification.oder",
            "unknown key 'oder' in [identification]; allowed are method, order",
        ),
        ("identification.order", "tset.order", "unknown key 'tset' at the top; allowed are title, model"),
        ("[6, 8]", "[6, -8]", "(with identification.order = -8 of [vary])"),
        ("result.modes", "result.mode", "no key 'mode' in result.json; allowed are method, order"),
        ("result.modes", "modes", "expected a path that begins with result. or diagnosis."),
        ("f1 =", '"1f" =', "name '1f' in [collect]; expected a letter"),
        ("instruments.noise_percent = [1.0, 2.0]", "seed = [1, 2]", "repeats = 3 with 'seed' in [vary]"),
        ("[vary]", "[vary", "is not TOML"),
    ],
)
def test_complaints_name_the_file_the_key_and_what_is_allowed(tmp_path, old, new, complaint):
    assert old in STUDY
    path = written(tmp_path, STUDY.replace(old, new, 1))
    with pytest.raises(StudyError) as caught:
        load_study(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert complaint in str(caught.value)
    assert "\n" not in str(caught.value).rstrip()


def test_unknown_files_and_names(tmp_path):
    with pytest.raises(FileError, match="cannot be read"):
        load_study(tmp_path / "none.toml")
    with pytest.raises(UnknownNameError):
        load_study(written(tmp_path, STUDY.replace("small.toml", "nowhere")))
    with pytest.raises(UnknownNameError, match="model 'none'"):
        load_study(written(tmp_path, STUDY.replace("[vary]", '[vary]\nmodel = ["none"]')))


@pytest.mark.parametrize(
    "path", sorted((catalogue.folder("scenarios") / "studies").glob("*.toml")), ids=lambda p: p.stem
)
def test_the_examples_load(path):
    study = load_study(path)
    assert study.n_runs > 10
