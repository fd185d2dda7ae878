"""Programs that take touch-offs compute what the guard means; the guard follows the filter of the adaptation."""

from __future__ import annotations

import re
from dataclasses import fields

import numpy as np
import pytest

from selector.adaptation.drift import Course, Drift, Touches, tracked
from selector.controllers import Input, ModelFile, Output, OutputLimits, Term, model_text, parsed_model
from selector.controllers.c_compiler import compiler
from selector.controllers.closed_values import Adaptation, OutputAdaptation
from selector.controllers.evaluator import axes_of
from selector.controllers.guard.decided import Mode, TouchCode
from selector.controllers.guard.guarded_model import GuardedModel
from selector.controllers.model_file import Guard, read_model
from selector.controllers.replay.compiled import c_answers, halrun_answers, missing_program, python_answers
from selector.controllers.replay.parts import Answers, reference_answers
from selector.controllers.replay.structured_text_executed import parser_name, st_answers
from selector.controllers.writers.sinumerik import scl_text
from selector.controllers.writers.targets import TARGETS
from selector.errors import ModelFileError, NotExecutableError
from selector.exporting import export_model
from tests.controllers import hostile
from tests.controllers.golden_text import texts_of
from tests.controllers.model_builders import PATENT

needs_cc = pytest.mark.skipif(compiler() is None, reason="no C compiler; Debian: apt install gcc")
KINDS = [
    {},
    {"on_fault": "hold", "hold_at_most_s": None},
    {"on_fault": "ramp-to-zero", "has_slope": False},
    {"outside_valid_range": "fault", "restart": "new-start", "without_fallback": "ramp-to-zero"},
]


def same(one: Answers, other: Answers) -> bool:
    return all(np.array_equal(getattr(one, field.name), getattr(other, field.name)) for field in fields(Answers))


def material(kind: dict[str, object], n: int, *, with_gain: bool = True):
    model = hostile.adapted(hostile.model(**kind), with_gain=with_gain)
    return model, hostile.touched(hostile.rows(n, 7, len(axes_of(model))), 3)


@pytest.mark.parametrize("with_gain", [True, False])
@pytest.mark.parametrize("kind", KINDS)
def test_the_python_module_is_the_guard_bit_for_bit(kind, with_gain):
    model, rows = material(kind, 3000, with_gain=with_gain)
    whole = reference_answers(model, rows)
    assert same(python_answers(model, rows), whole)
    alone = reference_answers(model.model_copy(update={"adaptation": None}), rows)
    assert np.abs(whole.correction_um - alone.correction_um).max() > 5.0


@needs_cc
@pytest.mark.parametrize("kind", KINDS[:3])
@pytest.mark.parametrize(("precision", "number"), [("double", float), ("float", np.float32)])
def test_compiled_c_is_the_guard_bit_for_bit(kind, precision, number):
    model, rows = material(kind, 3000)
    assert same(c_answers(model, rows, precision), reference_answers(model, rows, number))


def test_structured_text_and_scl_are_the_guard_bit_for_bit():
    try:
        parser_name()
    except NotExecutableError as error:
        pytest.skip(str(error))
    model, rows = material({}, 800)
    assert same(st_answers(model, rows), reference_answers(model, rows))
    assert same(st_answers(model, rows, scl_text(model)), reference_answers(model, rows, np.float32))


@pytest.mark.skipif(missing_program() is not None, reason="no LinuxCNC")
def test_the_component_of_linuxcnc_is_the_guard():
    model, rows = material({}, 800)
    answers, whole = halrun_answers(model, rows), reference_answers(model, rows)
    # halsampler prints six digits
    assert np.abs(answers.correction_um - whole.correction_um).max() <= 1e-6
    assert np.array_equal(answers.mode, whole.mode)


def steady(**block: float) -> ModelFile:
    """Z = 2 · rise of T1, adapted; nothing limits it."""
    given = {"offset_um2_per_s": 1e-3, "offset_start_um2": 4.0, "noise_um2": 0.3, "offset_limit_um": 40.0, **block}
    return ModelFile(
        name="steady",
        inputs=(Input(name="T1", valid_min=-50.0, valid_max=50.0),),
        outputs=(
            Output(
                name="Z", axis="Z", reference="rise", intercept=0.0, terms=(Term(powers={"T1": 1}, coefficient=2.0),)
            ),
        ),
        guard=Guard(
            limits=(OutputLimits(output="Z", clamp_um=500.0, slew_um_per_s=500.0),),
            recover_after_s=0.0,
            restart="keep-start",
            new_start_after_s=5000.0,
        ),
        adaptation=Adaptation(outputs=(OutputAdaptation(output="Z", **given),)),
    )


def test_the_guard_follows_the_filter_of_the_adaptation():
    gain = {"gain_per_s": 1e-7, "gain_start": 0.01, "gain_limit": 0.3}
    rng = np.random.default_rng(4)
    time_s = np.arange(0.0, 36_001.0, 60.0)
    rise = 12.0 * (1.0 - np.exp(-time_s / 6000.0))
    m = 2.0 * rise
    truth = 1.1 * m + np.r_[0.0, np.cumsum(rng.normal(0.0, 0.2, len(m) - 1))]
    truth[300] += 60.0  # false, if it is touched
    at = np.arange(30, len(m), 30)
    drift = Drift(1e-3, 1e-7, 4.0, 0.01, 0.3, 40.0, 0.3)
    known = tracked(drift, Touches.of([Course("r", time_s, m, truth, at, truth[at])]))
    guarded, before = GuardedModel(steady(**gain)), 0.0
    touched = {int(k): i for i, k in enumerate(at, start=1)}
    for k in range(len(m)):
        dt_s = 60.0 if k else 0.0
        shown = {"Z": truth[k] + before}
        found = guarded.step(dt_s, {"T1": 20.0 + rise[k]}, touch_um=shown, is_touch_valid=k in touched)
        before = found.correction_um["Z"]
        if k in touched:
            i = touched[k]
            # the same numbers, added up in another order
            wanted = m[k] + known.offset[0, i] + known.gain[0, i] * m[k]
            assert before == pytest.approx(-wanted, rel=1e-9)
            assert found.touches["Z"] == (TouchCode.BELIEVED if known.is_believed[0, i] else TouchCode.DOUBTED)
    assert not known.is_believed[0, touched[300]]


def called(guarded: GuardedModel, shown: float | None = None, reading: float = 20.0) -> tuple[float, TouchCode]:
    touch = {} if shown is None else {"Z": shown}
    found = guarded.step(60.0, {"T1": reading}, touch_um=touch, is_touch_valid=shown is not None)
    return float(found.correction_um["Z"]), found.touches["Z"]


def test_what_the_probe_shows_is_what_the_correction_left():
    guarded = GuardedModel(steady())
    assert called(guarded) == (0.0, TouchCode.NONE)
    correction, code = called(guarded, 3.0)
    assert code == TouchCode.BELIEVED
    assert -3.0 < correction < -2.5
    # nothing is left to be corrected
    called(guarded)
    again, _ = called(guarded, 3.0 + correction)
    assert again == pytest.approx(-3.0, abs=0.3)


def test_a_touch_off_that_stays_valid_counts_once():
    guarded, other = GuardedModel(steady()), GuardedModel(steady())
    called(guarded)
    called(other)
    called(other, 3.0)
    for _ in range(4):
        found = guarded.step(60.0, {"T1": 20.0}, touch_um={"Z": 3.0}, is_touch_valid=True)
    assert found.correction_um["Z"] == called(other)[0]


def test_a_touch_off_without_a_model_is_not_used():
    guarded = GuardedModel(steady())
    called(guarded)
    found = guarded.step(60.0, {"T1": float("nan")}, touch_um={"Z": 3.0}, is_touch_valid=True)
    assert (found.mode, found.touches["Z"]) == (Mode.HOLD, TouchCode.UNUSED)
    assert called(guarded)[0] == 0.0


def test_offset_outlives_a_short_standstill_and_not_a_new_start():
    guarded = GuardedModel(steady())
    called(guarded)
    correction, _ = called(guarded, 3.0)
    guarded.restart(1000.0)
    assert called(guarded)[0] == correction
    guarded.restart(6000.0)
    assert called(guarded)[0] == 0.0


def test_models_without_adaptation_are_what_they_were():
    model = read_model(PATENT)
    assert model_text(model) == PATENT.read_text(encoding="utf-8")
    assert '"adaptation"' not in model_text(model)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('"output": "Z",', '"output": "Q",', "one of Z"),
        ('"noise_um2": 0.3', '"noise_um2": 0.0', "greater than 0"),
        ('"noise_um2": 0.3', '"noise_um2": 0.3, "more": 1', "only the fields of the schema"),
        ('"gate": 4.0', '"gate": "4"', "a number"),
    ],
)
def test_blocks_that_are_refused(old, new, says):
    text = model_text(steady())
    before, block = text.split('"adaptation"', 1)
    assert block.count(old) == 1
    with pytest.raises(ModelFileError, match=says):
        parsed_model(before + '"adaptation"' + block.replace(old, new))


@pytest.mark.parametrize("target", [name for name, of in TARGETS.items() if not of.takes_touch_offs])
def test_controls_that_cannot_take_touch_offs_say_so(target, tmp_path):
    from selector.controllers.model_file import write_model

    write_model(steady(), tmp_path / "m.json")
    export = export_model(tmp_path / "m.json", target, tmp_path / "out")
    [told] = [finding for finding in export.findings if finding.id == "adaptation-not-exported"]
    assert export.model.adaptation is None
    # the advice names those that cannot, and no other
    named = set(re.findall(r"\w+", told.suggestion)) & set(TARGETS)
    assert named == {name for name, of in TARGETS.items() if not of.takes_touch_offs}


@pytest.mark.parametrize("target", [name for name, of in TARGETS.items() if of.takes_touch_offs])
def test_programs_have_the_inputs_of_touch_offs(target, tmp_path):
    from selector.controllers.model_file import write_model

    write_model(steady(), tmp_path / "m.json")
    export = export_model(tmp_path / "m.json", target, tmp_path / "out")
    file = TARGETS[target].parts[0].file
    main = "".join(texts_of({file: (tmp_path / "out" / file).read_bytes()}).values())
    assert "is_touch_valid" in main
    assert "touch_um_1" in main
    assert "adaptation-not-exported" not in {finding.id for finding in export.findings}
    assert any(section.id == "touch-offs" for section in export.sheet.sections)
