"""The state of a study: what cannot be read is set aside, and nothing else is lost."""

from __future__ import annotations

import json
import os
import threading

import pytest

from selector.cli import exit_status
from selector.errors import InputError
from selector.readers import Overrides
from selector.shipped import shipped
from selector.workbench import readable as material_module
from selector.workbench.bench import Bench
from selector.workbench.commands import Export, export_command
from selector.workbench.readable import corrected, rows_of
from tests.patience import wait_for

VMC = shipped("vmc37")


def settled(bench: Bench) -> Bench:
    wait_for(lambda: not bench.is_reading)
    return bench


@pytest.fixture
def bench(tmp_path):
    made = Bench(tmp_path, [VMC / "r1.csv", VMC / "r2.csv"], VMC / "machine.toml")
    made.read()
    yield settled(made)
    made.jobs.close()


def test_recordings_are_read(bench):
    assert [run.name for run in bench.inspection.reading.runs] == ["r1", "r2"]
    assert bench.source_arguments() == (
        str(VMC / "r1.csv"), str(VMC / "r2.csv"), "--machine", str(VMC / "machine.toml")
    )  # fmt: skip


def test_lost_readings_are_told_and_what_is_wrong_where_nothing_can_be_used(tmp_path):
    time_s = range(0, 6000, 60)
    rise = [f"{20.0 + (t // 60) ** 0.5:.2f}" for t in time_s]
    for name, lost in (("one", 30), ("two", 50)):
        rows = [f"{t},{'' if t == 60 * lost else w},{w}" for t, w in zip(time_s, rise, strict=True)]
        (tmp_path / f"{name}.csv").write_text("Time [s],T1 [degC],Z [um]\n" + "\n".join(rows) + "\n")
    bench = Bench(tmp_path, [tmp_path / "one.csv", tmp_path / "two.csv"])
    bench.read()
    assert "readings-lost" in {one.id for one in settled(bench).inspection.findings}
    bench.use([tmp_path / "one.csv"])
    settled(bench)  # it reads them, and would find a file that is half written
    (tmp_path / "one.csv").write_text("Time [s],T1 [degC],Z [um]\n0,20,0\n60,21,1\n")
    bench.read()
    assert "short-run" in {one.id for one in settled(bench).inspection.findings}


@pytest.mark.parametrize(
    "content", [b"", b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 9, b"hello\nworld\n"], ids=["empty", "binary", "text"]
)
def test_a_wrong_file_is_set_aside_with_the_readers_own_words(bench, tmp_path, content):
    (tmp_path / "recordings").mkdir()
    wrong = tmp_path / "recordings" / "wrong.csv"
    wrong.write_bytes(content)
    bench.add(wrong)
    settled(bench)
    assert [run.name for run in bench.inspection.reading.runs] == ["r1", "r2"]
    assert bench.inspection.problem is None
    refused = bench.loaded[-1]
    assert not refused.is_used
    assert "wrong.csv" in str(refused.problem)
    assert str(wrong) not in bench.source_arguments()


def test_files_are_left_out_and_taken_back(bench):
    before = bench.revision
    bench.use([VMC / "r2.csv"])
    assert [run.name for run in settled(bench).inspection.reading.runs] == ["r2"]
    assert bench.revision > before
    bench.use([VMC / "r1.csv", VMC / "r2.csv"])
    assert len(settled(bench).inspection.reading.runs) == 2
    bench.use([])
    assert settled(bench).inspection.reading is None


def test_corrections_are_written_into_the_study_and_the_old_ones_kept(bench, tmp_path):
    given = (VMC / "machine.toml").read_bytes()
    reading = bench.inspection.reading
    bench.correct(corrected(reading, rows_of(reading)))
    assert bench.machine == tmp_path / "machine.toml"
    assert bench.source_arguments()[-2:] == ("--machine", "machine.toml")
    first = (tmp_path / "machine.toml").read_bytes()
    bench.correct(corrected(reading, rows_of(reading)))
    assert (tmp_path / "machine.before.toml").read_bytes() == first
    assert (VMC / "machine.toml").read_bytes() == given


def test_corrections_that_cannot_be_read_change_nothing(bench, tmp_path):
    machine = corrected(bench.inspection.reading, rows_of(bench.inspection.reading))
    broken = machine.model_copy(update={"time": machine.time.model_copy(update={"column": "not there"})})
    before = bench.inspection
    with pytest.raises(InputError, match="not there"):
        bench.correct(broken)
    assert bench.inspection is before
    assert not bench.is_reading
    assert not (tmp_path / "machine.toml").exists()


def test_a_way_of_reading_that_fails_says_so_and_can_be_taken_back(bench):
    bench.read_as(Overrides(time_column="not there"))
    settled(bench)
    assert bench.inspection.reading is None
    assert all("not there" in str(one.problem) for one in bench.loaded)
    bench.read_as(Overrides())
    assert len(settled(bench).inspection.reading.runs) == 2


def test_the_last_reading_counts(bench):
    for _ in range(3):
        bench.use([VMC / "r1.csv"])
        bench.use([VMC / "r2.csv"])
    assert [run.name for run in settled(bench).inspection.reading.runs] == ["r2"]
    wait_for(lambda: all(thread.name != "selector-read" for thread in threading.enumerate()))
    assert [run.name for run in bench.inspection.reading.runs] == ["r2"]


def test_a_study_folder_is_taken_up(bench, tmp_path):
    (tmp_path / "recordings").mkdir()
    (tmp_path / "recordings" / "r3.csv").write_bytes((VMC / "r3.csv").read_bytes())
    reading = bench.inspection.reading
    bench.correct(corrected(reading, rows_of(reading)))
    again = Bench(tmp_path)
    again.read()
    assert [run.name for run in settled(again).inspection.reading.runs] == ["r3"]
    assert again.machine == tmp_path / "machine.toml"


def test_options_are_judged_as_on_the_command_line(bench):
    assert bench.choose(max_sensors=3) is True
    assert bench.choose(max_sensors=3) is False
    with pytest.raises(InputError, match="--lambda"):
        bench.choose(level=2.0)
    assert bench.options.level is None
    assert bench.options.max_sensors == 3


def test_a_double_click_is_one_job(bench):
    first = bench.start("Long", ("prove", "--jobs", "1", "--out", "proof"))
    # it may have begun meanwhile
    assert bench.start("Long", ("prove", "--jobs", "1", "--out", "proof")).number == first.number
    assert bench.start("Other", ("prove", "--jobs", "1", "--out", "other")).number == 1
    # the same words mean something else when the machine file was corrected meanwhile
    reading = bench.inspection.reading
    bench.correct(corrected(reading, rows_of(reading)))
    assert bench.start("Other", ("prove", "--jobs", "1", "--out", "other")).number == 2


def test_results_are_read_again_when_they_change(bench, tmp_path):
    assert bench.result("selection/selection.json") is None
    (tmp_path / "selection").mkdir()
    path = tmp_path / "selection" / "selection.json"
    path.write_text('{"a": 1}')
    assert bench.result("selection/selection.json") == {"a": 1}
    path.write_text('{"a": 2')
    os.utime(path, (1, 1))
    assert bench.result("selection/selection.json") is None


def test_a_study_file_takes_everything_up_again_and_a_command_does_it_again(bench, tmp_path, capfd):
    bench.use([VMC / "r2.csv", VMC / "r1.csv"])
    settled(bench)
    bench.choose(max_sensors=1, never=("T01", "T02"), cost={"T03": 2.0}, responses=("Z",))
    bench.choose_diagnosis(holdout="0.25")
    bench.save()
    again = Bench(tmp_path)
    assert again.used == bench.used
    assert again.options == bench.options
    assert again.machine == bench.machine
    assert again.diagnosis.holdout == "last"  # nothing was compared, so nothing of it was saved

    assert exit_status(["select", "--study", str(tmp_path), "--json"]) == 0
    chosen = json.loads(capfd.readouterr().out)["chosen"]["sensors"]
    assert len(chosen) == 1
    assert not {"T01", "T02"} & set(chosen)


def test_a_diagnosis_is_saved_with_what_it_compares(bench, tmp_path):
    (tmp_path / "simulation").mkdir()
    (tmp_path / "simulation" / "r1.csv").write_bytes((VMC / "r1.csv").read_bytes())
    bench.choose_diagnosis(holdout="0.25")
    bench.save()
    again = Bench(tmp_path)
    assert again.diagnosis == bench.diagnosis
    assert again.diagnosis.simulation == ("simulation",)
    assert again.diagnosis.holdout == "0.25"


def test_a_recording_is_let_go_and_only_a_file_of_the_study_is_put_away(bench, tmp_path):
    copy = tmp_path / "recordings" / "r3.csv"
    copy.parent.mkdir()
    copy.write_bytes((VMC / "r3.csv").read_bytes())
    bench.add(copy)
    assert len(settled(bench).inspection.reading.runs) == 3
    for path in (copy, VMC / "r2.csv"):
        bench.remove(path)
    assert [run.name for run in settled(bench).inspection.reading.runs] == ["r1"]
    assert [one.path for one in bench.loaded] == [VMC / "r1.csv"]
    assert not copy.exists()
    assert (tmp_path / "removed" / "r3.csv").read_bytes() == (VMC / "r3.csv").read_bytes()
    assert (VMC / "r2.csv").is_file()
    # a second file of that name stays beside the first
    copy.write_text("t\n", encoding="utf-8")
    bench.add(copy)
    bench.remove(copy)
    settled(bench)
    assert len(list((tmp_path / "removed").iterdir())) == 2


def test_an_export_is_taken_up_again_but_nobody_is_told_that_a_sign_test_was_passed(bench, tmp_path):
    asked = {
        "model": "selection/model.json", "target": "st", "replayed": (VMC / "r2.csv",), "clamp_um": {"Z": 40.5},
        "slew_um_per_s": {"Z": 0.5}, "margin": 12.5, "inverted": ("Z",),
    }  # fmt: skip
    bench.choose_export(**asked, is_sign_verified=True, tested="0123456789abcdef")
    bench.save()
    again = Bench(tmp_path)
    assert again.export == Export(**asked)
    # an earlier version refuses a key that it does not know
    bench.choose_export(margin=0.0)
    assert "margin" not in bench.save().read_text(encoding="utf-8")
    bench.choose_export(margin=12.5)
    words = export_command(tmp_path, bench.export, None, Overrides())
    assert words[-11:] == (
        "--clamp", "Z=40.5", "--slew", "Z=0.5", "--margin", "12.5", "--invert", "Z", "--sign-verified", "--tested",
        "0123456789abcdef",
    )  # fmt: skip
    # another model has other outputs, and a control without a guard no limits
    assert bench.export.of(("Y",)).clamp_um == {}
    bench.choose_export(target="rexroth", is_sign_verified=False)
    words = export_command(tmp_path, bench.export, None, Overrides())
    assert words[-2:] == ("--invert", "Z")
    assert not {"--clamp", "--margin"} & {*words}


def test_without_recordings_there_is_nothing_to_save(tmp_path):
    with pytest.raises(InputError, match="no recording was read"):
        Bench(tmp_path).save()
    assert list(tmp_path.iterdir()) == []


def test_a_broken_study_file_is_refused(tmp_path):
    (tmp_path / "study.toml").write_text("schema = 7", encoding="utf-8")
    with pytest.raises(InputError, match=r"study\.toml"):
        Bench(tmp_path)


def test_many_files_at_once_are_read_one_reading_at_a_time(bench, tmp_path, monkeypatch):
    running, most = 0, 0
    real = material_module.read

    def counted(*arguments, **options):
        nonlocal running, most
        running += 1
        most = max(most, running)
        try:
            return real(*arguments, **options)
        finally:
            running -= 1

    monkeypatch.setattr(material_module, "read", counted)
    for name in ("r3.csv", "r4.csv", "r5.csv", "r6.csv"):
        bench.add(VMC / name)
    assert len(settled(bench).inspection.reading.runs) == 6
    assert most == 1


def test_a_defect_of_a_reader_is_told_and_the_page_goes_on(bench, monkeypatch):
    def broken(*_, **__):
        raise ZeroDivisionError("a defect")

    monkeypatch.setattr(material_module, "read", broken)
    bench.read()
    assert all("ZeroDivisionError" in str(one.problem) for one in settled(bench).loaded)
