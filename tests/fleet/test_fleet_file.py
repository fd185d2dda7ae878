"""FLEET.toml: machines by pattern or by name, the question of each, and what cannot be."""

from pathlib import Path

import pytest

from selector.errors import StudyError
from selector.fleet import read_fleet, run_fleet
from tests.fleet.machines import Here, fleet_file, machine


@pytest.fixture
def plant(tmp_path):
    """Three folders, a stray text and a results folder."""
    for name in ("m10", "m2", "m1", "results"):
        (tmp_path / "plant" / name).mkdir(parents=True)
    (tmp_path / "plant" / "notes.md").write_text("")
    (tmp_path / "plant" / "one.csv").write_text("")
    return tmp_path


def test_a_pattern_means_every_folder_and_recording_in_natural_order(plant):
    fleet = read_fleet(fleet_file(plant, 'folders = ["plant/*"]\nresults = "plant/results"\n'))
    assert list(fleet.studies) == ["m1", "m2", "m10", "one"]
    assert fleet.studies["m2"].recordings.runs == (str(plant / "plant" / "m2"),)
    assert fleet.results == plant / "plant" / "results"
    url = f"{(plant / 'plant').as_uri()}/"
    far = read_fleet(fleet_file(plant, f'folders = ["{url}*"]\nresults = "{url}m1"\n'))
    assert list(far.studies) == ["m2", "m10", "one", "results"]
    assert str(far.results) == f"{url}m1"
    assert fleet.time_limit_s == 3600.0


def test_a_link_that_leads_nowhere_is_a_machine_that_is_told(plant):
    link = plant / "plant" / "m3"
    try:
        link.symlink_to(plant / "away", target_is_directory=True)
    except OSError:
        pytest.skip("this account may not make links")
    assert "m3" in read_fleet(fleet_file(plant, 'folders = ["plant/*"]\nresults = "plant/results"\n')).studies


def test_answers_among_the_machines_are_no_machines(tmp_path):
    for number in range(2):
        machine(tmp_path / "plant" / f"m{number}", number, n_runs=2)
    path = fleet_file(tmp_path, 'folders = ["plant/*"]\nresults = "plant"\n')
    for done, reused in ((2, 0), (0, 2)):
        answer = run_fleet(read_fleet(path), Here())
        assert (answer.done, answer.reused, answer.failed) == (done, reused, 0)
    assert list(answer.machines) == ["m0", "m1"]


def test_a_machine_has_a_name_even_where_its_folder_has_none(plant):
    root = Path(plant.anchor).as_posix()
    assert list(read_fleet(fleet_file(plant, f'folders = ["{root}"]\n')).studies) == [root]


def test_a_machine_is_a_text_an_array_or_a_table_and_changes_single_options(plant):
    text = """
    results = "answers"
    time_limit_s = 60
    machine = "machine.toml"
    [select]
    responses = ["Z"]
    lambda = 0.99
    max_sensors = 3
    [machines]
    a = "plant/m1"
    b = ["plant/one.csv", "s3://bucket/b/*.csv"]
    [machines.c]
    runs = "plant/m2"
    machine = "own.toml"
    select.max_sensors = 2
    reading.decimal = ","
    """
    studies = read_fleet(fleet_file(plant, text)).studies
    assert studies["a"].recordings.machine == str(plant / "machine.toml")
    assert studies["b"].recordings.runs == (str(plant / "plant" / "one.csv"), "s3://bucket/b/*.csv")
    assert studies["c"].recordings.runs == (str(plant / "plant" / "m2"),)
    assert studies["c"].recordings.machine == str(plant / "own.toml")
    assert (studies["c"].select.max_sensors, studies["a"].select.max_sensors) == (2, 3)
    assert studies["c"].select.lambda_ == 0.99
    assert (studies["c"].reading.decimal, studies["a"].reading.decimal) == (",", None)


@pytest.mark.parametrize(
    ("text", "found", "where"),
    [
        ("", "no machine", "FLEET.toml"),
        ("folders = [", "not TOML", "FLEET.toml"),
        ('folder = ["plant/*"]', "'folder'", "key folder"),
        ('folders = ["plant/*"]\ntime_limit_s = true', "True", "key time_limit_s"),
        ('[machines]\nm1 = "plant/m1"\n[machines.m2]\nruns = ["plant/m2"]\ncolour = 3', "'colour'", "machines.m2"),
        ('[machines]\nm1 = "plant/m1"\n[select]\ndegree = 7', "degree", "key select.degree"),
        ('folders = ["plant/*"]\n[machines]\nm1 = "elsewhere"', "two machines called 'm1'", "FLEET.toml"),
        ('folders = ["nowhere/*"]', "'nowhere/*'", "key folders"),
        ('folders = ["plant/*"]\n[select]\nmust = ["T1"]\nnever = ["T1"]', "T1 in both", "--must"),
        ('schema = "selector.study/1"\nfolders = ["plant/*"]', "selector.study/1", "key schema"),
    ],
)
def test_what_cannot_be_is_told_with_its_place(plant, text, found, where):
    with pytest.raises(StudyError) as told:
        read_fleet(fleet_file(plant, text))
    assert found in told.value.found
    assert where in told.value.where


def test_the_nearest_key_of_a_machine_is_named(plant):
    with pytest.raises(StudyError, match="'machine' perhaps"):
        read_fleet(fleet_file(plant, '[machines.m1]\nruns = ["plant/m1"]\nmachin = "m.toml"'))


def test_a_fleet_file_that_is_not_there(tmp_path):
    with pytest.raises(StudyError, match=r"FLEET\.toml"):
        read_fleet(tmp_path / "FLEET.toml")


def test_a_folder_whose_name_is_no_unicode_is_told(plant):
    try:
        (plant / "plant" / "m\udcff").mkdir()
    except (OSError, UnicodeError):
        pytest.skip("this file system has no such names")
    with pytest.raises(StudyError, match=r"key folders, found .*udcff"):
        read_fleet(fleet_file(plant, 'folders = ["plant/*"]'))
