"""Generated C and Python compute what the guard means, to the last bit, on rows that no sane control would send."""

from __future__ import annotations

import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from selector.controllers import Input, Output, OutputLimits, Term, read_model
from selector.controllers.c_compiler import compiler
from selector.controllers.evaluator import axes_of
from selector.controllers.guard.decided import decided_limits
from selector.controllers.program.guarded_program import guarded_program
from selector.controllers.replay.compiled import c_answers, python_answers
from selector.controllers.replay.parts import Answers, Rows
from selector.controllers.writers.c99 import c_export, c_files
from selector.controllers.writers.exported import ExportRefusedError
from selector.controllers.writers.python_module import python_export
from selector.controllers.writers.targets import TARGETS
from selector.errors import NotExecutableError
from tests.controllers import hostile
from tests.controllers.golden_text import golden, without_version
from tests.controllers.model_builders import rise_model
from tests.controllers.plain_guard import plain_answers

PATENT = Path(__file__).parents[2] / "fixtures" / "models" / "patent-two-sensors.json"
needs_cc = pytest.mark.skipif(compiler() is None, reason="no C compiler; Debian: apt install gcc")

KINDS = [
    {},
    {"on_fault": "hold", "hold_at_most_s": None},
    {"on_fault": "ramp-to-zero", "has_slope": False},
    {"outside_valid_range": "fault", "restart": "new-start", "without_fallback": "ramp-to-zero"},
]


def same(one: Answers, other: Answers) -> bool:
    return all(np.array_equal(getattr(one, field.name), getattr(other, field.name)) for field in fields(Answers))


@needs_cc
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("precision", "number"), [("double", float), ("float", np.float32)])
def test_compiled_c_is_the_guard_bit_for_bit(kind, precision, number):
    model = hostile.model(**kind)
    rows = hostile.rows(4000, 7, len(axes_of(model)))
    assert same(c_answers(model, rows, precision), plain_answers(model, rows, number))


@needs_cc
def test_compiled_c_on_thirty_thousand_rows():
    # a million is measured in benchmarks/bench_guard.py
    model = hostile.model()
    rows = hostile.rows(30_000, 11)
    answers = c_answers(model, rows)
    assert same(answers, plain_answers(model, rows))
    limits, _ = decided_limits(model)
    assert np.isfinite(answers.correction_um).all()
    for k, limit in enumerate(limits.values()):
        assert np.abs(answers.correction_um[:, k]).max() <= limit.clamp_um


@pytest.mark.parametrize("kind", KINDS)
def test_the_python_module_is_the_guard_bit_for_bit(kind):
    model = hostile.model(**kind)
    rows = hostile.rows(4000, 8, len(axes_of(model)))
    assert same(python_answers(model, rows), plain_answers(model, rows))


@needs_cc
def test_single_precision_is_within_a_hundredth_of_a_micrometre_over_the_valid_range():
    model = read_model(PATENT)
    limits = tuple(OutputLimits(output=o.name, clamp_um=500.0, slew_um_per_s=1e5) for o in model.outputs)
    model = model.model_copy(update={"guard": model.guard.model_copy(update={"limits": limits})})
    rng, n = np.random.default_rng(0), 20_000
    low, high = (np.array([getattr(item, key) for item in model.inputs]) for key in ("valid_min", "valid_max"))
    readings = 20.0 + low + (high - low) * rng.random((n, len(low)))
    readings[0] = 20.0
    yes, no = np.ones(n, dtype=bool), np.zeros(n, dtype=bool)
    rows = Rows(np.full(n, 10.0), readings, np.zeros((n, 0)), yes, yes, no, np.zeros(n))
    difference = c_answers(model, rows, "float").correction_um - c_answers(model, rows).correction_um
    assert 0.0 < np.abs(difference).max() <= 0.01


def test_names_of_a_model_cannot_leave_their_remarks():
    evil = '*/ int x; /* """ \\ // */'
    model = rise_model(
        name=evil,
        inputs=(Input(name=evil, valid_min=0.0, valid_max=9.0, place="*/"),),
        outputs=(Output(name="*/Z", intercept=0.0, terms=(Term(powers={evil: 1}, coefficient=2.0),)),),
    )
    for text in [*c_export(model).files.values(), *python_export(model).files.values()]:
        assert text.isascii()
        code = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL)
        assert "int x;" not in "\n".join(line.split("#")[0] for line in code.splitlines())
    rows = hostile.rows(200, 1, 0)
    one = replace(rows, readings=rows.readings[:, :1], test_um=rows.test_um[:, :1])
    assert same(python_answers(model, one), plain_answers(model, one))
    if compiler() is not None:
        assert same(c_answers(model, one), plain_answers(model, one))


def test_variables_are_short_ascii_and_declared_once():
    names = [variable.name for variable in guarded_program(hostile.model()).variables]
    assert len(set(names)) == len(names)
    assert all(re.fullmatch(r"[a-z][a-z0-9_]{0,23}", name) for name in names)


@pytest.mark.parametrize("name", ["thermal_correction.h", "thermal_correction.c", "thermal_correction.py"])
def test_golden_files(name):
    model = read_model(PATENT)
    text = {**c_export(model).files, **python_export(model).files}[name]
    assert without_version(text) == golden(name)


def test_the_head_says_that_the_sign_is_unverified_until_somebody_verified_it():
    model = read_model(PATENT)
    assert "SIGN UNVERIFIED" in c_files(model)["thermal_correction.c"]
    assert "UNVERIFIED" not in c_files(model, is_sign_verified=True)["thermal_correction.c"]


def test_without_a_compiler_it_says_what_to_install(monkeypatch):
    monkeypatch.setattr("selector.controllers.replay.compiled.compiler", lambda: None)
    with pytest.raises(NotExecutableError, match="gcc"):
        c_answers(hostile.model(), hostile.rows(5, 0))


@pytest.mark.parametrize("target", sorted(TARGETS))
def test_two_outputs_on_one_axis_are_refused_alike_where_the_control_moves_it(target):
    model = hostile.model()
    outputs = tuple(one.model_copy(update={"axis": "Z", "position": None}) for one in model.outputs)
    twice = model.model_copy(update={"outputs": outputs, "fallbacks": ()})
    if target in ("c", "fmu", "st", "plcopen", "tcpou", "python"):
        # two numbers for whoever wires them: two probes along one axis are a usual test
        given, names = TARGETS[target].write(twice), " and ".join(one.name for one in outputs)
        assert given.install[0].startswith(f"{names} each correct the whole axis Z: wire one of them")
        assert target == "fmu" or "Never add them" in " ".join(next(iter(given.files.values())).split())
        assert not any("Never add them" in line for line in TARGETS[target].write(model).install)
        return
    with pytest.raises(ExportRefusedError) as refused:
        TARGETS[target].write(twice)
    if target != "rexroth":  # which takes no such model at all
        assert "both correct axis Z" in str(refused.value)
