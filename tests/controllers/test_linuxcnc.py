"""The component for LinuxCNC: its text, and what it gives when LinuxCNC itself calls it."""

from __future__ import annotations

import re
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from selector.controllers import Input, ModelFile, Output, PositionPart, Term, read_model
from selector.controllers.evaluator import axes_of
from selector.controllers.replay import compiled
from selector.controllers.replay.compiled import (
    INSTALL,
    RESOLUTION_UM,
    environment,
    halrun,
    halrun_answers,
    halrun_columns,
    installed,
    missing_program,
    single_session,
)
from selector.controllers.replay.parts import Rows, reference_answers
from selector.controllers.writers.linuxcnc import READY_PERIODS, component, linuxcnc_export
from selector.errors import NotExecutableError, OptionError
from tests.controllers import hostile
from tests.controllers.golden_text import golden, without_version
from tests.patience import PATIENCE_S, wait_for

PATENT = Path(__file__).parents[2] / "fixtures" / "models" / "patent-two-sensors.json"
NAMES = ("T1 */ \"; ;; ' //", "№2 °C {x} [HAL]A $(B) \\", "(* 温度 *) #")


HALCMD = """#!/bin/sh
[ "$1" = setp ] && { echo "$2 $3" >> told.txt; exit; }
case "$3" in *has-*) echo TRUE ;; *.start-1) echo 21.5 ;; *) [ ! -e broken ] && echo 22.25 ;; esac
"""


@pytest.fixture
def linuxcnc() -> None:
    if missing_program() is not None:
        pytest.skip(f"no LinuxCNC here: {INSTALL}")


@contextmanager
def as_root_or_skipped() -> Iterator[None]:
    try:
        yield
    except NotExecutableError as refused:
        pytest.skip(str(refused))


def hostile_names() -> ModelFile:
    return ModelFile(
        name='";; /* */ \\ "',
        inputs=tuple(Input(name=name, valid_min=0.0, valid_max=10.0) for name in NAMES),
        outputs=(
            Output(name='Z ";', axis='Z";', intercept=1.0, terms=(Term(powers={NAMES[0]: 1}, coefficient=2.0),),
                   position=PositionPart(axis="Z*/", reference_m=0.0, valid_min_m=-1.0, valid_max_m=1.0,
                                         intercept=3.0)),
            Output(name="X", axis="x", intercept=0.0, terms=(Term(powers={NAMES[2]: 1}, coefficient=2.0),)),
        ),
    )  # fmt: skip


def calls(n: int, inputs: int, dt_s: float = 1.0) -> Rows:
    readings = 20.0 + 4.0 * np.sin(np.arange(n)[:, None] * 0.01 + np.arange(inputs))
    always, never = np.ones(n, dtype=bool), np.zeros(n, dtype=bool)
    return Rows(np.full(n, dt_s), readings, np.zeros((n, 0)), always, always, never, np.zeros(n))


@pytest.mark.parametrize("name", sorted(linuxcnc_export(read_model(PATENT)).files))
def test_golden_files(name):
    text = linuxcnc_export(read_model(PATENT)).files[name]
    assert without_version(text) == golden(f"linuxcnc/{name}")


def test_the_head_says_that_the_sign_is_unverified_until_somebody_verified_it():
    model = read_model(PATENT)
    for name in ("thermcorr.comp", "thermcorr.hal"):
        assert "SIGN UNVERIFIED" in linuxcnc_export(model).files[name]
        assert "UNVERIFIED" not in linuxcnc_export(model, is_sign_verified=True).files[name]


def test_names_of_a_model_are_never_statements():
    files = linuxcnc_export(hostile_names()).files
    declared, _, code = files["thermcorr.comp"].partition("\n;;\n")
    assert code.startswith("/* a * b")
    for line in declared.splitlines():
        if line.startswith(("pin", "param")):
            assert re.fullmatch(r'(pin (in|out)|param rw) (float|bit|s32) \w+( = \S+)? "[^"\\]*";', line)
    for line in files["thermcorr.hal"].splitlines():
        assert re.fullmatch(r"#.*|[\w .=>-]*", line)


def test_memory_is_given_back_to_the_same_model_only(tmp_path, monkeypatch):
    (tmp_path / "halcmd").write_text(HALCMD)
    (tmp_path / "halcmd").chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}:/usr/bin:/bin")
    of_patent, of_hostile = (
        linuxcnc_export(model).files["thermcorr_memory.sh"] for model in (read_model(PATENT), hostile.model())
    )

    def called(script: str, what: str) -> int:
        return subprocess.run(["sh", "-c", script, "sh", what], cwd=tmp_path, capture_output=True).returncode

    assert called(of_patent, "restore") == 0  # the first time there is nothing
    assert called(of_patent, "save") == 0
    assert called(of_hostile, "restore") == 0
    assert not (tmp_path / "told.txt").exists()
    (tmp_path / "broken").touch()
    assert called(of_patent, "save") == 1  # and what was saved stays
    assert called(of_patent, "restore") == 0
    told = (tmp_path / "told.txt").read_text().splitlines()
    standstill = told.pop(0).removeprefix("thermcorr.standstill ")
    assert 0 <= int(standstill) < 60
    expected = ("has-memory-1 TRUE", "start-1 21.5", "has-start-1 TRUE",
                "has-memory-2 TRUE", "start-2 22.25", "has-start-2 TRUE", "restart 1")  # fmt: skip
    assert told == [f"thermcorr.{line}" for line in expected]
    # a clock that was put back
    kept = tmp_path / "thermcorr_kept.txt"
    kept.write_text(re.sub(r"(?m)^saved-at \d+$", "saved-at 9999999999", kept.read_text()))
    (tmp_path / "told.txt").unlink()
    assert called(of_patent, "restore") == 0
    assert "thermcorr.standstill 1000000" in (tmp_path / "told.txt").read_text().splitlines()
    assert called(of_patent, "forget") == 2


@pytest.mark.parametrize("axes", [(None, "X"), ("Z1", "X"), ("A", "X")])
def test_an_output_without_a_linear_axis_of_its_own_is_not_wired(axes):
    term = (Term(powers={"T": 1}, coefficient=1.0),)
    model = ModelFile(
        name="m",
        inputs=(Input(name="T", valid_min=0.0, valid_max=1.0),),
        outputs=tuple(Output(name=f"d{k}", axis=axis, intercept=0.0, terms=term) for k, axis in enumerate(axes, 1)),
    )
    exported = linuxcnc_export(model)
    wiring = exported.files["thermcorr.hal"]
    assert [one.evidence["output"] for one in exported.findings] == ["d1"]
    assert "thermcorr.counts-1 =>" not in wiring
    assert "thermcorr.counts-2 => axis.x.eoffset-counts" in wiring


def test_the_sheet_names_the_axis_as_halcmd_has_it():
    exported = linuxcnc_export(read_model(PATENT))
    told = [one.shown for one in exported.sign_test.commanded]
    assert [re.search(r"axis\..\.eoffset -?[0-9.]+ mm", shown) is not None for shown in told] == [True, True]
    assert "axis.z.eoffset 0.01 mm" in told[0]
    assert not any("axis.L" in line for line in (*told, *exported.install))


def test_an_output_that_moves_no_axis_has_no_offset_on_the_sheet():
    term = (Term(powers={"T": 1}, coefficient=1.0),)
    item = Input(name="T", valid_min=0.0, valid_max=1.0)
    output = Output(name="d", axis=None, intercept=0.0, terms=term)
    exported = linuxcnc_export(ModelFile(name="m", inputs=(item,), outputs=(output,)))
    (one,) = exported.sign_test.commanded
    assert "eoffset" not in one.shown
    assert "no axis is wired to it" in one.shown


@pytest.mark.usefixtures("linuxcnc")
@pytest.mark.parametrize(
    ("tried", "refused"), [("setp thermcorr.in0 0", "connected to a signal"), ("sets thermcorr-wanted 0", "has writer")]
)
def test_a_linked_switch_is_set_only_by_what_it_is_linked_to(tried, refused):
    exported = linuxcnc_export(read_model(PATENT))
    for line in (exported.sign_test.before, exported.sign_test.after):
        assert "where the line net thermcorr-wanted is in use, the switch that it names" in line
    linked = "loadrt or2 names=thermcorr,pyvcp\nnet thermcorr-wanted pyvcp.out => thermcorr.in0\n"
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name, single_session(), as_root_or_skipped():
        Path(name).chmod(0o777)
        with pytest.raises(OptionError):
            halrun(linked + tried + "\n", Path(name), 60.0)
        assert refused in (Path(name) / "said.txt").read_text(encoding="utf-8")


def test_positions_come_from_the_axis_or_are_told_as_missing():
    exported = linuxcnc_export(hostile.model())
    assert "\nnet thermcorr-position-1 axis.z.pos-cmd => thermcorr.position-1" in exported.files["thermcorr.hal"]
    assert not exported.findings
    assert [one.id for one in linuxcnc_export(hostile_names()).findings] == ["axis-not-wired", "position-not-wired"]


def test_without_linuxcnc_it_says_what_to_install(monkeypatch):
    monkeypatch.setattr(compiled.shutil, "which", lambda name: None)
    with pytest.raises(NotExecutableError, match="linuxcnc-uspace-dev"):
        halrun_answers(hostile.model(), hostile.rows(5, 0))


def test_more_than_a_session_can_hold_is_refused(linuxcnc, monkeypatch):
    monkeypatch.setattr(compiled, "LARGEST_REPLAY", 4)
    with pytest.raises(OptionError, match="5 rows"):
        halrun_answers(hostile.model(), hostile.rows(5, 0))


def test_no_rows_are_no_session(linuxcnc):
    assert len(halrun_answers(read_model(PATENT), calls(0, 2)).mode) == 0


@pytest.mark.xdist_group("linuxcnc")
@pytest.mark.parametrize("kind", [{}, {"outside_valid_range": "fault", "restart": "new-start", "on_fault": "hold"}])
def test_linuxcnc_calculates_what_the_guard_does_on_hostile_rows(linuxcnc, kind):
    model = hostile.model(**kind)
    rows = hostile.rows(21_000, 11, len(axes_of(model)))
    with as_root_or_skipped():
        found = halrun_answers(model, rows)
    expected = reference_answers(model, rows)
    for name in ("correction_um", "k0_um", "slope_um_per_m"):
        # halsampler prints 6 decimals; positions go from m to mm and back
        assert np.abs(getattr(found, name) - getattr(expected, name)).max() <= RESOLUTION_UM
    assert np.array_equal(found.mode, expected.mode)
    assert np.array_equal(found.sensors, expected.sensors)
    assert np.array_equal(found.axes, expected.axes)
    assert len(np.unique(expected.mode)) >= 4


@pytest.mark.xdist_group("linuxcnc")
def test_nothing_is_corrected_for_a_while_and_counts_are_the_correction_to_the_nearest(linuxcnc):
    model = hostile.model()
    rows = hostile.rows(3000, 5)
    with as_root_or_skipped():
        columns = halrun_columns(model, rows, READY_PERIODS)
    ready_for, is_ready = 0, rows.is_ready.copy()
    for k, flag in enumerate(rows.is_ready):
        ready_for = ready_for + 1 if flag else 0
        is_ready[k] = ready_for > READY_PERIODS
    expected = reference_answers(model, replace(rows, is_ready=is_ready))
    assert np.array_equal(columns["mode"], expected.mode)
    for i in range(2):
        assert np.abs(columns[f"counts_{i + 1}"] - 10.0 * expected.correction_um[:, i]).max() <= 0.5 + 1e-9
        assert not columns[f"counts_{i + 1}"][~is_ready].any()
    assert 100 < np.sum(rows.is_ready & ~is_ready) < 1500


@pytest.mark.xdist_group("linuxcnc")
def test_more_sensors_than_a_fifo_has_pins(linuxcnc):
    names = [f"T{k}" for k in range(1, 26)]
    terms = tuple(Term(powers={name: 1}, coefficient=0.1 * k) for k, name in enumerate(names, 1))
    model = ModelFile(
        name="many",
        inputs=tuple(Input(name=name, valid_min=-9.0, valid_max=9.0) for name in names),
        outputs=(Output(name="Z", axis="Z", intercept=0.0, terms=terms),),
    )
    rows = calls(500, len(names))
    with as_root_or_skipped():
        found = halrun_answers(model, rows)
    assert np.abs(found.correction_um - reference_answers(model, rows).correction_um).max() <= RESOLUTION_UM


@pytest.mark.xdist_group("linuxcnc")
def test_without_dt_the_period_of_the_thread_counts_and_unwired_readings_are_missing(linuxcnc):
    with (
        as_root_or_skipped(),
        session_folder() as folder,
        installed(component(read_model(PATENT)), "thermcorr", folder),
    ):
        said = halrun(
            "loadrt thermcorr\nloadrt threads name1=t1 period1=1000000\naddf thermcorr t1\n"
            "setp thermcorr.is-enabled 1\nsetp thermcorr.is-homed 1\nsetp thermcorr.reading-1 20\n"
            "start\nloadusr -w sleep 0.2\nsetp thermcorr.dt 10\nloadusr -w sleep 0.1\nsetp thermcorr.dt 0\n"
            "getp thermcorr.sensor-1\ngetp thermcorr.sensor-2\n"
            "getp thermcorr.has-start-1\ngetp thermcorr.has-start-2\nsetp thermcorr.reading-2 20\n"
            # missing at first, so it has to be good for a minute
            "setp thermcorr.dt 10\nloadusr -w sleep 0.1\nsetp thermcorr.dt 0\nloadusr -w sleep 0.5\n"
            "getp thermcorr.mode\ngetp thermcorr.correction-1\n"
            "setp thermcorr.reading-1 24\nsetp thermcorr.new-start 1\nloadusr -w sleep 1.2\n"
            "setp thermcorr.new-start 0\ngetp thermcorr.start-1\n",
            folder, 60.0,
        )  # fmt: skip
    told = [line for line in said.splitlines() if re.fullmatch(r"[-\d.e+]+|TRUE|FALSE", line)]
    assert told == ["0", "3", "TRUE", "FALSE", "1", "1.871", "24"]


@pytest.mark.xdist_group("linuxcnc")
def test_halcompile_and_halcmd_read_hostile_names(linuxcnc):
    files = linuxcnc_export(hostile_names()).files
    # motion and axes are in test_linuxcnc_control.py
    lines = [line for line in files["thermcorr.hal"].splitlines() if re.match("#|loadrt|loadusr", line)]
    with as_root_or_skipped(), session_folder() as folder, installed(files["thermcorr.comp"], "thermcorr", folder):
        (folder / "thermcorr_memory.sh").write_text(files["thermcorr_memory.sh"])
        said = halrun("\n".join(lines) + "\ngetp thermcorr.mode\n", folder, 60.0)
    assert "0" in said.splitlines()


@pytest.mark.xdist_group("linuxcnc")
def test_a_session_that_does_not_end_is_ended_and_one_that_runs_is_left_alone(linuxcnc):
    with session_folder() as folder:
        with pytest.raises(OptionError, match="does not end"):
            halrun("loadrt threads name1=t1\nstart\nloadusr -w sleep 50\n", folder, 2.0)
        (folder / "other.hal").write_text("loadrt threads name1=t1\nstart\nloadusr -w sh other.sh\n")
        (folder / "other.sh").write_text("touch begun\nwhile [ ! -e end ]; do sleep 0.05; done\n")
        other = subprocess.Popen(
            ["halrun", "other.hal"], cwd=folder, env=environment(folder), stderr=subprocess.DEVNULL
        )  # fmt: skip
        wait_for((folder / "begun").exists)
        with pytest.raises(NotExecutableError, match="LinuxCNC is running"):
            halrun("getp t1.time\n", folder, 20.0)
        (folder / "end").touch()
        assert other.wait(timeout=PATIENCE_S) == 0


@contextmanager
def session_folder() -> Iterator[Path]:
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name, single_session():
        Path(name).chmod(0o777)
        yield Path(name)
