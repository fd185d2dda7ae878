"""The exported functional mock-up unit, run, checked and built by FMPy: the guard, to the last bit."""

from __future__ import annotations

import io
import shutil
import subprocess
import zipfile
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from selector.controllers import GuardedModel, Input, Output, State, Term, read_model
from selector.controllers.c_compiler import compiler
from selector.controllers.evaluator import axes_of
from selector.controllers.guard.decided import Mode, decided_limits
from selector.controllers.program.guarded_program import guarded_program
from selector.controllers.replay.compiled import fmpy_version, fmu_answers
from selector.controllers.replay.parts import Answers, Rows, reference_answers
from selector.controllers.writers.fmu import FILE, _binary, fmu_export
from selector.errors import NotExecutableError
from tests.controllers import hostile
from tests.controllers.golden_text import golden, members_of, without_version
from tests.controllers.model_builders import rise_model
from tests.controllers.test_generated_programs import KINDS

fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed (extra fmu)")
pytestmark = pytest.mark.skipif(compiler() is None, reason="no C compiler; Debian: apt install gcc")

PATENT = Path(__file__).parents[2] / "fixtures" / "models" / "patent-two-sensors.json"
SANITIZED = ("-O1", "-g", "-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all")
EVIL = ['"><evil/>', "*/ int x; /*", "T & <T>", "温度一", "@token", "@{token}", "]]>", "--", "a\\", "??/", "T [m]"]


def same(one: Answers, other: Answers) -> bool:
    return all(np.array_equal(getattr(one, field.name), getattr(other, field.name)) for field in fields(Answers))


def unpacked(model, folder):
    """The folder of the unit, its description, and what importers call its variables by."""
    fmpy.extract(io.BytesIO(fmu_export(model).files[FILE]), folder)
    description = fmpy.read_model_description(folder)
    return description, {one.name: one.valueReference for one in description.modelVariables}


@pytest.fixture
def unit(tmp_path):
    """An instance of the hostile model with touch-offs, initialised."""
    description, references = unpacked(hostile.adapted(hostile.model()), tmp_path)
    made = fmpy.instantiate_fmu(str(tmp_path), description, "CoSimulation")
    made.enterInitializationMode()
    made.exitInitializationMode()
    yield made, references
    made.freeInstance()


@pytest.mark.parametrize("is_adapted", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_the_unit_is_the_guard_bit_for_bit(kind, is_adapted):
    model = hostile.model(**kind)
    rows = hostile.rows(4000, 41, len(axes_of(model)))
    if is_adapted:
        model, rows = hostile.adapted(model), hostile.touched(rows, 5)
    answers = fmu_answers(model, rows)
    assert same(answers, reference_answers(model, rows))
    assert len(set(answers.mode.tolist())) > 3


def test_the_unit_that_was_written_is_what_is_executed():
    model, rows = hostile.model(), hostile.rows(2000, 42)
    moved = [one.model_copy(update={"intercept": one.intercept + 0.5}) for one in model.outputs]
    other = model.model_copy(update={"outputs": tuple(moved)})
    assert same(fmu_answers(model, rows, fmu_export(other).files), reference_answers(other, rows))
    assert not same(reference_answers(other, rows), reference_answers(model, rows))


@pytest.mark.parametrize("evil", [*EVIL, "plain"])
def test_fmpy_finds_nothing_wrong_whatever_the_names(evil, tmp_path):
    from fmpy.validation import validate_fmu

    names = [evil, f"{evil} late"]
    model = rise_model(
        name=evil,
        inputs=(Input(name=evil, valid_min=0.0, valid_max=9.0, place=evil),),
        states=(State(name=names[1], source=evil, tau_s=60.0),),
        outputs=(Output(name=evil, axis=evil, intercept=0.0,
                        terms=(Term(powers=dict.fromkeys(names, 1), coefficient=2.0),)),),
    )  # fmt: skip
    (tmp_path / FILE).write_bytes(fmu_export(model).files[FILE])
    assert validate_fmu(str(tmp_path / FILE)) == []
    rows = hostile.rows(300, 1, 0)
    rows = replace(rows, readings=rows.readings[:, :1], test_um=rows.test_um[:, :1])
    assert same(fmu_answers(model, rows), reference_answers(model, rows))
    description = fmpy.read_model_description(tmp_path / FILE)
    units = {one.name: one.unit for one in description.modelVariables}
    assert (units["reading_1"], units["correction_1"], units["start_1"]) == ("degC", "um", None)


def test_a_simulation_of_fmpy_is_the_guard_called_with_the_readings_before_each_step(tmp_path):
    """simulate_fmu interpolates inputs at the points of communication, and holds them over a step."""
    model = read_model(PATENT)
    (tmp_path / FILE).write_bytes(fmu_export(model).files[FILE])
    n = 400
    readings = 20.0 + np.outer(np.sin(np.arange(n) / 150.0), [4.0, 2.0])
    given = np.array(
        [(float(k), *row) for k, row in enumerate(readings)],
        dtype=[("time", float), ("reading_1", float), ("reading_2", float)],
    )
    found = fmpy.simulate_fmu(
        str(tmp_path / FILE), stop_time=n - 1.0, output_interval=1.0, input=given, output=["correction_1", "mode"]
    )
    yes = np.ones(n - 1, dtype=bool)
    rows = Rows(np.ones(n - 1), readings[:-1], np.zeros((n - 1, 0)), yes, yes, ~yes, np.zeros(n - 1))
    guard = reference_answers(model, rows)
    assert found["correction_1"].tolist() == [0.0, *guard.correction_um[:, 0].tolist()]
    assert found["mode"].tolist() == [Mode.OFF, *guard.mode.tolist()]
    assert np.abs(guard.correction_um).max() > 5.0


def test_fmpy_builds_the_sources_and_that_is_the_guard_too(tmp_path):
    if shutil.which("cmake") is None:
        pytest.skip("no CMake; Debian: apt install cmake")
    from fmpy.build import build_platform_binary

    model, rows = hostile.model(), hostile.rows(1500, 43)
    unpacked(model, tmp_path)
    (binary,) = (tmp_path / "binaries").rglob("thermal_correction.*")
    binary.unlink()
    (tmp_path / "built").mkdir()
    build_platform_binary(tmp_path, tmp_path / "built")
    shutil.rmtree(tmp_path / "built")
    assert binary.is_file()
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as archive:
        for file in (path for path in tmp_path.rglob("*") if path.is_file()):
            archive.write(file, file.relative_to(tmp_path).as_posix())
    assert same(fmu_answers(model, rows, {FILE: packed.getvalue()}), reference_answers(model, rows))


def test_every_function_is_declared_as_in_the_headers_of_the_standard(tmp_path):
    unpacked(hostile.model(), tmp_path)
    headers = Path(fmpy.__file__).parent / "c-code"
    command = [compiler(), "-std=c99", "-Wall", "-Werror", "-fsyntax-only", "-I", headers, "-include",
               headers / "fmi3Functions.h", tmp_path / "sources" / "fmi3.c"]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_a_reading_that_is_not_valid_counts_as_missing():
    model, rows = hostile.model(), hostile.rows(2000, 44)
    is_bad = np.random.default_rng(0).random(rows.readings.shape) < 0.02
    missing = replace(rows, readings=np.where(is_bad, np.nan, rows.readings))

    class Flagged(Rows):
        def columns(self, of):
            valid = {f"is_valid_{k}": ~column for k, column in enumerate(is_bad.T, 1)}
            return super().columns(of) | valid

    flagged = Flagged(**{field.name: getattr(rows, field.name) for field in fields(Rows)})
    answers = fmu_answers(model, flagged)
    assert same(answers, reference_answers(model, missing))
    assert not same(answers, reference_answers(model, rows))


def test_within_a_long_step_the_program_is_called_at_its_period(unit):
    made, references = unit
    model = GuardedModel(hostile.adapted(hostile.model()))
    made.setFloat64([references["period_s"]], [1.0])
    for minute in range(20):
        readings = {"T1": 25.0 + 0.1 * minute, "T2": 30.0 + 0.1 * minute, "n": 3000.0}
        made.setFloat64([references[f"reading_{k}"] for k in (1, 2, 3)], list(readings.values()))
        made.doStep(60.0 * minute, 60.0)
        for _ in range(60):
            now = model.step(1.0, readings)
        shown = made.getFloat64([references["correction_1"], references["correction_2"], references["time"]])
        assert shown == [*now.correction_um.values(), 60.0 * (minute + 1)]
    assert shown[0] != 0.0
    # 2.5 s in three calls
    made.doStep(1200.0, 2.5)
    for _ in range(3):
        now = model.step(2.5 / 3.0, readings)
    assert made.getFloat64([references["correction_1"]]) == [now.correction_um["Z"]]


def test_what_is_refused_is_told(tmp_path):
    description, references = unpacked(hostile.model(), tmp_path)
    told = []
    made = fmpy.fmi3.FMU3Slave(
        guid=description.guid, unzipDirectory=str(tmp_path), modelIdentifier="thermal_correction", instanceName="x"
    )
    made.instantiate(logMessage=lambda _environment, status, category, text: told.append((status, category, text)))
    made.enterInitializationMode()
    made.exitInitializationMode()

    def refused(call, *arguments):
        before = len(told)
        with pytest.raises(fmpy.fmi1.FMICallException):
            call(*arguments)
        assert len(told) == before + 1
        assert told[-1][:2] == (3, b"logStatusError")
        return told[-1][2].decode()

    assert "cannot be set" in refused(made.setFloat64, [references["correction_1"]], [5.0])
    assert "cannot be set" in refused(made.setFloat64, [0], [5.0])
    assert "no variable of this type" in refused(made.getFloat64, [references["mode"]])
    assert "no variable of this type" in refused(made.setBoolean, [10_000], [True])
    assert "co-simulation" in refused(made.getFloat32, [references["reading_1"]])
    made.setFloat64([references["period_s"]], [1e-9])
    assert "million periods" in refused(made.doStep, 0.0, 60.0)
    # all or nothing
    refused(made.setFloat64, [references["reading_1"], references["k0_1"]], [7.0, 7.0])
    assert made.getFloat64([references["reading_1"]]) == [1e30]
    made.freeInstance()
    other = fmpy.fmi3.FMU3Slave(
        guid="another", unzipDirectory=str(tmp_path), modelIdentifier="thermal_correction", instanceName="x"
    )
    with pytest.raises(Exception, match=r"(?i)instantiate"):
        other.instantiate(logMessage=lambda _environment, _status, _category, text: told.append(text))
    assert b"token" in told[-1]


def test_a_state_is_taken_put_back_and_carried_in_bytes(unit):
    made, references = unit
    readings = [references[f"reading_{k}"] for k in (1, 2, 3)]
    outputs = [one for name, one in references.items() if name.startswith(("correction", "k0", "slope"))]

    def stepped(n):
        for k in range(n):
            made.setFloat64(readings, [20.0 + 0.01 * k, 30.0, 3000.0])
            made.doStep(float(k), 1.0)
        return made.getFloat64(outputs)

    first = stepped(300)
    state = made.getFMUState()
    carried = made.serializeFMUState(state)
    after = stepped(200)
    assert after != first
    made.setFMUState(state)
    made.freeFMUState(state)
    assert made.getFloat64(outputs) == first
    assert stepped(200) == after
    again = made.deserializeFMUState(carried)
    made.setFMUState(again)
    made.freeFMUState(again)
    assert stepped(200) == after
    with pytest.raises(fmpy.fmi1.FMICallException):
        made.deserializeFMUState(carried[:-1])
    made.reset()
    assert made.getFloat64(outputs) == [0.0] * len(outputs)
    assert stepped(300) == first


def test_what_was_kept_is_put_back_before_the_first_step(tmp_path):
    model = hostile.model()
    description, references = unpacked(model, tmp_path)
    yes, n = np.ones(600, dtype=bool), 600
    readings = np.column_stack([22.0 + np.arange(n) / 100.0, np.full(n, 26.0), np.full(n, 3000.0)])
    rows = Rows(np.ones(n), readings, np.full((n, 1), 0.1), yes, yes, ~yes, np.zeros(n))
    rows.is_restart[300], rows.standstill_s[300], rows.dt_s[300] = True, 100.0, 0.0
    # the kept members after row 299, from the program itself
    kept = list(guarded_program(model).of("retained"))
    made = fmpy.instantiate_fmu(str(tmp_path), description, "CoSimulation")

    def stepped(these):
        found = []
        for k in these:
            made.setFloat64([references[f"reading_{i}"] for i in (1, 2, 3)], readings[k].tolist())
            made.setFloat64([references["position_1"], references["standstill_s"]], [0.1, rows.standstill_s[k]])
            made.setBoolean([references["is_restart"]], [bool(rows.is_restart[k])])
            made.doStep(float(k), float(rows.dt_s[k]))
            found.append(made.getFloat64([references["correction_1"]])[0])
        return found

    def access(call, kind):
        of = [references[one.name] for one in kept if one.kind == kind]
        return call, of

    stepped(range(300))
    reals, flags = (access(call, kind) for call, kind in ((made.getFloat64, "real"), (made.getBoolean, "flag")))
    was = reals[0](reals[1]), flags[0](flags[1])
    made.reset()
    made.setFloat64(reals[1], was[0])
    made.setBoolean(flags[1], [bool(one) for one in was[1]])
    found = stepped(range(300, 600))
    made.freeInstance()
    expected = reference_answers(model, rows).correction_um[300:, 0]
    assert np.abs(expected).max() > 1.0
    assert np.array_equal(found, expected)


def test_without_a_compiler_the_unit_has_sources_only_and_says_so(monkeypatch):
    monkeypatch.setattr("selector.controllers.writers.fmu.compiler", lambda: None)
    export = fmu_export(hostile.model())
    assert [finding.id for finding in export.findings] == ["fmu-without-binary"]
    assert "no C compiler" in export.findings[0].statement
    assert not any(name.startswith("binaries/") for name in members_of(export.files[FILE]))
    assert any("C sources only" in step for step in export.install)
    with pytest.raises(NotExecutableError, match="no binary for"):
        fmu_answers(hostile.model(), hostile.rows(5, 0), export.files)


@pytest.mark.parametrize("text", ["#!/bin/sh\nexit 0\n", "\x7fELF, of another machine"], ids=["silent", "not-ours"])
def test_a_compiler_that_makes_nothing_leaves_sources_only_and_is_named(tmp_path, monkeypatch, text):
    cc = tmp_path / "cc"
    cc.write_text(text)
    cc.chmod(0o755)
    monkeypatch.setenv("CC", str(cc))
    export = fmu_export(hostile.model())
    assert [finding.id for finding in export.findings] == ["fmu-without-binary"]
    assert f"{cc} refuses" in export.findings[0].statement


def test_a_compiler_may_be_named_from_the_folder_that_one_is_in(tmp_path, monkeypatch):
    (tmp_path / "own-cc").symlink_to(shutil.which(str(compiler())))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("CC", "./own-cc")
    assert fmu_export(hostile.model()).findings == ()


def test_without_fmpy_the_advice_says_what_to_install(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "fmpy", None)
    with pytest.raises(NotExecutableError, match=r"pip install '\.\[fmu\]'"):
        fmu_answers(hostile.model(), hostile.rows(5, 0))


def test_the_same_model_gives_the_same_bytes_and_the_version_of_fmpy_is_told():
    first = fmu_export(read_model(PATENT)).files
    _binary.cache_clear()
    assert fmu_export(read_model(PATENT)).files == first
    assert fmpy_version().startswith(f"FMPy {fmpy.__version__}, ")


@pytest.mark.parametrize("name", ["modelDescription.xml", "sources/fmi3.c", "sources/buildDescription.xml"])
def test_the_files_for_the_patent_model_are_as_they_were(name):
    text = members_of(fmu_export(read_model(PATENT)).files[FILE])[name].decode("ascii")
    assert without_version(text) == golden(f"fmu/{Path(name).name}")


HOSTILE_CALLS = r"""
#include "sources/fmi3.c"
#include <math.h>
#include <stdio.h>

static const struct { fmi3ValueReference correction; double clamp_um; } LIMITS[] = {@LIMITS};
static int messages;
static void say(fmi3InstanceEnvironment e, fmi3Status s, fmi3String c, fmi3String t)
{
    (void)e; (void)s; (void)c;
    messages += t[0] != 0;
}

int main(void)
{
    const double strange[] = {0.0, 1.0, -1.0, 1e300, -1e300, INFINITY, -INFINITY, NAN, 5e-324, 60.0, 25.0};
    const size_t n = sizeof strange / sizeof *strange, all = sizeof VARIABLES / sizeof *VARIABLES;
    unsigned k, seed = 1;
    fmi3Boolean a, b, c;
    double t, x;
    fmi3FMUState state = NULL;
    fmi3Byte bytes[sizeof(struct state)];
    void *unit = fmi3InstantiateCoSimulation("x", "@TOKEN", "", false, false, false, false, NULL, 0, NULL, say, NULL);
    if (unit == NULL || fmi3InstantiateCoSimulation("x", NULL, "", 0, 0, 0, 0, NULL, 0, NULL, say, NULL) != NULL)
        return 1;
    if (fmi3GetFMUState(unit, &state) || fmi3SerializeFMUState(unit, state, bytes, sizeof bytes)) return 2;
    for (k = 0; k < 200000; k++) {
        seed = seed * 1664525u + 1013904223u;
        fmi3ValueReference r = (seed >> 8) % (all + 3);
        double value = strange[(seed >> 16) % n];
        fmi3Int32 code;
        fmi3Boolean flag = (seed >> 20) & 1;
        fmi3SetFloat64(unit, &r, 1, &value, 1 + (seed % 50 == 0));
        fmi3SetBoolean(unit, &r, 1, &flag, 1);
        fmi3GetInt32(unit, &r, 1, &code, 1);
        if (seed % 7 == 0) {
            r = 1; /* the longest time between two calls */
            value = (seed >> 24) & 1 ? 0.0 : 0.5;
            fmi3SetFloat64(unit, &r, 1, &value, 1);
        }
        fmi3DoStep(unit, 0.0, strange[(seed >> 12) % n], true, &a, &b, &c, &t);
        for (r = 0; r < all; r++)
            if (fmi3GetFloat64(unit, &r, 1, &x, 1) == fmi3OK && !VARIABLES[r].may_be_set && r && !isfinite(x)) return 3;
        for (r = 0; r < sizeof LIMITS / sizeof *LIMITS; r++)
            if (fmi3GetFloat64(unit, &LIMITS[r].correction, 1, &x, 1) || !(fabs(x) <= LIMITS[r].clamp_um)) return 6;
        if (seed % 1000 == 0) fmi3Reset(unit);
        if (seed % 1001 == 0) fmi3SetFMUState(unit, state);
    }
    fmi3DeserializeFMUState(unit, bytes, sizeof bytes, &state);
    fmi3FreeFMUState(unit, &state);
    fmi3FreeInstance(unit);
    fmi3FreeInstance(NULL);
    if (fmi3DoStep(NULL, 0.0, 1.0, true, &a, &b, &c, &t) != fmi3Error || fmi3Reset(NULL) != fmi3Error) return 4;
    return messages > 1000 ? 0 : 5;
}
"""


def test_sanitizers_have_nothing_to_say_of_hostile_calls(tmp_path):
    """Any value in any variable at any time: finite outputs within the clamp, and every refusal is told."""
    model = hostile.adapted(hostile.model())
    description, references = unpacked(model, tmp_path)
    clamps = [limits.clamp_um for limits in decided_limits(model)[0].values()]
    limits = ", ".join(f"{{{references[f'correction_{k}']}, {clamp!r}}}" for k, clamp in enumerate(clamps, 1))
    calls = HOSTILE_CALLS.replace("@TOKEN", description.guid).replace("@LIMITS", limits)
    (tmp_path / "calls.c").write_text(calls, encoding="ascii")
    command = [compiler(), "-std=c99", *SANITIZED, "-o", "calls", "calls.c", "-lm"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    if done.returncode != 0 and "sanitize" in done.stderr:
        pytest.skip(f"{compiler()} has no sanitizers")
    assert done.returncode == 0, done.stderr
    ran = subprocess.run(["./calls"], cwd=tmp_path, capture_output=True, text=True)
    assert (ran.stderr, ran.returncode) == ("", 0)
