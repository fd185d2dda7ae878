"""The exported Structured Text, read by a parser of IEC 61131-3, computes what the guard means to the last bit."""

from __future__ import annotations

import re
import sys
import xml.etree.ElementTree as ElementTree
from dataclasses import fields, replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from selector.controllers import Guard, Input, Output, State, Term, read_model
from selector.controllers.evaluator import axes_of
from selector.controllers.program.guarded_program import guarded_program
from selector.controllers.program.language import Negative, Real, Variable
from selector.controllers.replay.parts import Answers, Rows, reference_answers
from selector.controllers.replay.structured_text_executed import (
    executable,
    parser_name,
    st_answers,
    text_of_plcopen,
    text_of_tcpou,
)
from selector.controllers.writers.sinumerik import scl_text, sinumerik_export
from selector.controllers.writers.structured_text import (
    LONGEST_LINE,
    LONGEST_NAME,
    StructuredText,
    guid,
    is_reserved,
    plcopen_export,
    st_export,
    st_text,
    tcpou_export,
)
from selector.errors import NotExecutableError, OptionError
from tests.controllers import hostile
from tests.controllers.golden_text import golden, without_version
from tests.controllers.model_builders import rise_model

PATENT = Path(__file__).parents[2] / "fixtures" / "models" / "patent-two-sensors.json"


def tcpou_text(model):
    return text_of_tcpou(*tcpou_export(model).files.values())


def plcopen_text(model):
    return text_of_plcopen(*plcopen_export(model).files.values())


needs_parser = pytest.mark.skipif(
    find_spec("tree_sitter") is None or find_spec("tree_sitter_iec61131_3_st") is None,
    reason='no parser of Structured Text; pip install ".[controls]"',
)

KINDS = [
    {},
    {"on_fault": "hold", "hold_at_most_s": None},
    {"on_fault": "ramp-to-zero", "has_slope": False},
    {"outside_valid_range": "fault", "restart": "new-start", "without_fallback": "ramp-to-zero"},
]
EVIL = ["*) END_IF; (*", "*)", "(* ", "]]>", "温度一", "'\"$'", "}{attribute", "// T1", "T\\", ")*", "BEGIN", "=1+1"]


def same(one: Answers, other: Answers) -> bool:
    return all(np.array_equal(getattr(one, field.name), getattr(other, field.name)) for field in fields(Answers))


@needs_parser
@pytest.mark.parametrize("kind", KINDS)
def test_structured_text_is_the_guard_bit_for_bit(kind):
    model = hostile.model(**kind)
    rows = hostile.rows(4000, 21, len(axes_of(model)))
    reference = reference_answers(model, rows)
    assert same(st_answers(model, rows), reference)
    assert same(st_answers(model, rows, tcpou_text(model)), reference)
    assert same(st_answers(model, rows, plcopen_text(model)), reference)


@needs_parser
@pytest.mark.parametrize("kind", KINDS)
def test_scl_in_real_is_the_guard_in_single_precision_bit_for_bit(kind):
    model = hostile.model(**kind)
    rows = hostile.rows(4000, 22, len(axes_of(model)))
    assert same(st_answers(model, rows, scl_text(model)), reference_answers(model, rows, np.float32))


@needs_parser
def test_a_whole_recording_of_five_thousand_rows():
    model = hostile.model()
    rows = hostile.rows(5_000, 23)
    answers = st_answers(model, rows)
    assert same(answers, reference_answers(model, rows))
    assert {0, 1, 2, 3, 4, 10, 11} <= set(answers.mode.tolist())


@needs_parser
@pytest.mark.parametrize(
    ("was", "becomes"),
    [
        (r"own := own \+ (.*);", r"own := own - \1;"),
        (r"IF since_1 > ", "IF since_1 >= "),
        (r"sensor_1 := 4;", "sensor_1 := 5;"),
        (r"low := k0_1 - reach;", "low := k0_1;"),
        (r"has_start_1 := TRUE;", "has_start_1 := FALSE;"),
    ],
)
def test_the_text_is_what_is_executed(was, becomes):
    model = hostile.model()
    rows = hostile.rows(4000, 21)
    text, count = re.subn(was, becomes, st_text(model))
    assert count > 0
    # the first clock reaches its end only where it is set to it anyway
    assert same(st_answers(model, rows, text), reference_answers(model, rows)) is ("since_1" in was)


GOLDEN_FILES = (
    "thermal_correction.st",
    "FB_ThermalCorrection.TcPOU",
    "FB_ThermalCorrection.xml",
    "thermal_correction.scl",
    "thermal_to_sd.scl",
    "sinumerik_settings.csv",
    "thermal_handover.scl",
    "thermal_sd.spf",
)


@pytest.mark.parametrize("name", GOLDEN_FILES)
def test_the_files_for_the_patent_model_are_as_they_were(name):
    model = read_model(PATENT)
    exports = (st_export(model), tcpou_export(model), plcopen_export(model), sinumerik_export(model))
    (text,) = (one.files[name] for one in exports if name in one.files)
    assert without_version(text) == golden(name)


def test_names_are_no_words_of_the_language_and_short_enough():
    program = guarded_program(hostile.model())
    language = StructuredText()
    names = {one.name: language.name(one) for one in program.variables}
    assert not any(is_reserved(name) for name in names.values())
    assert len({name.lower() for name in names.values()}) == len(names)
    assert max(map(len, names.values())) <= LONGEST_NAME
    assert all(re.fullmatch(r"[A-Za-z][A-Za-z0-9]*(_[A-Za-z0-9]+)*", name) for name in names.values())
    # what is wired from outside has the same name in every language
    assert all(language.name(one) == one.name for one in program.variables if one.place in ("input", "output"))


@pytest.mark.parametrize("name", ["dt", "LIMIT", "max", "Abs", "at", "T1", "c3", "DB12", "mw10", "Z1", "e0", "time"])
def test_words_addresses_and_blocks_are_reserved(name):
    assert is_reserved(name)
    assert not is_reserved(StructuredText().name(Variable(name, "real", "temporary")))


@pytest.mark.parametrize("name", ["at_1", "x", "low", "high", "most", "mode", "change", "z_1", "x_1", "k0_1"])
def test_these_names_are_free(name):
    assert not is_reserved(name)


@pytest.mark.parametrize(
    ("value", "lreal", "real"),
    [
        (1.0, "1.0", "1.0"),
        (-3.0, "-3.0", "-3.0"),
        (1e-5, "1.0E-5", "1.0E-5"),
        (1.5e300, "1.5E+300", None),
        (1e16, "1.0E+16", "1.0E+16"),
        (0.1 + 0.2, "0.30000000000000004", "0.3"),
        (16777217.0, "16777217.0", "1.6777216E+7"),
        (1e-60, "1.0E-60", None),
        (2.0**-149, "1.401298464324817E-45", "1.0E-45"),
    ],
)
def test_real_literals_have_digits_around_their_point_and_come_back(value, lreal, real):
    assert StructuredText().real(value) == lreal
    assert float(lreal) == value
    single = StructuredText(real_type="REAL")
    if real is None:
        with pytest.raises(OptionError, match="REAL"):
            single.real(value)
    else:
        assert single.real(value) == real
        assert np.float32(float(real)) == np.float32(value)


def test_no_two_signs_stand_in_a_row():
    x = Variable("x", "real", "temporary")
    language = StructuredText()
    assert language.expression(x >= Real(-1.0)) == "x >= (-1.0)"
    assert language.expression(x - Negative(x)) == "x - (-x)"
    assert language.expression(Negative(x)) == "-x"


@needs_parser
@pytest.mark.parametrize("evil", EVIL)
def test_names_of_a_model_cannot_leave_their_comments(evil):
    model = rise_model(
        name=evil,
        inputs=(Input(name=evil, valid_min=0.0, valid_max=9.0, place=evil),),
        states=(State(name=f"{evil} late", source=evil, tau_s=60.0),),
        outputs=(
            Output(name=evil, axis=evil, intercept=0.0,
                   terms=(Term(powers={evil: 1, f"{evil} late": 1}, coefficient=2.0),)),
        ),
    )  # fmt: skip
    rows = hostile.rows(300, 1, 0)
    rows = replace(rows, readings=rows.readings[:, :1], test_um=rows.test_um[:, :1])
    assert same(st_answers(model, rows), reference_answers(model, rows))
    assert same(st_answers(model, rows, tcpou_text(model)), reference_answers(model, rows))
    assert same(st_answers(model, rows, plcopen_text(model)), reference_answers(model, rows))
    assert same(st_answers(model, rows, scl_text(model)), reference_answers(model, rows, np.float32))
    written = (*tcpou_export(model).files.values(), *plcopen_export(model).files.values())
    # an NC refuses an axis of such a name
    named = model.model_copy(update={"outputs": (model.outputs[0].model_copy(update={"axis": "Z"}),)})
    for text in (*written, *sinumerik_export(named).files.values()):
        assert text.isascii()
    (xml,) = tcpou_export(model).files.values()
    pou = ElementTree.fromstring(xml).find("POU")
    assert [one.tag for one in pou] == ["Declaration", "Implementation"]
    both = pou.findtext("Declaration") + pou.findtext("Implementation/ST") + "END_FUNCTION_BLOCK\n"
    assert both == text_of_tcpou(xml)


def test_what_is_to_be_kept_is_retained_in_the_xml():
    model = hostile.model()
    (xml,) = plcopen_export(model).files.values()
    lists = ElementTree.fromstring(xml).findall(".//{*}localVars[@retain='true']/{*}variable")
    assert [one.get("name") for one in lists] == [one.name for one in guarded_program(model).of("retained")]
    assert all(plcopen_text(model).count(f"\n{one.get('name')} : ") == 1 for one in lists)


def _many_sensors(n):
    names = [f"temperature of place number {k} of the machine" for k in range(n)]
    return rise_model(
        inputs=tuple(Input(name=name, valid_min=0.0, valid_max=9.0) for name in names),
        outputs=(
            Output(
                name="Z",
                axis="Z",
                intercept=1.0,
                terms=tuple(Term(powers={name: 1}, coefficient=0.1 + 0.01 * k) for k, name in enumerate(names)),
            ),
        ),
        guard=Guard(recover_after_s=0.0),
    )


@needs_parser
def test_lines_are_short_however_many_sensors_there_are():
    model = _many_sensors(60)
    for text in (st_text(model), scl_text(model)):
        assert max(map(len, text.splitlines())) <= LONGEST_LINE
    rng, k = np.random.default_rng(0), 30
    yes = np.ones(k, dtype=bool)
    readings = 20.0 + np.cumsum(rng.normal(0.0, 0.1, (k, 60)), axis=0)
    rows = Rows(np.ones(k), readings, np.zeros((k, 0)), yes, yes, ~yes, np.zeros(k))
    answers = st_answers(model, rows)
    assert same(answers, reference_answers(model, rows))
    assert np.abs(answers.correction_um).max() > 0.0


def test_the_same_model_has_the_same_guid_and_another_has_another():
    model = read_model(PATENT)
    assert tcpou_export(model) == tcpou_export(model)
    assert str(guid(model)) in tcpou_export(model).files["FB_ThermalCorrection.TcPOU"]
    assert guid(model) != guid(hostile.model())


@pytest.mark.skipif(find_spec("blark") is None, reason="no parser of TwinCAT files; pip install blark")
def test_blark_reads_the_twincat_file(tmp_path):
    from blark.parse import parse

    # it takes seconds for a page
    sensor = Input(name="*) ]]> (*", reference="absolute", valid_min=0.0, valid_max=9.0)
    model = rise_model(
        inputs=(sensor,),
        outputs=(Output(name="Z", intercept=0.5, terms=(Term(powers={sensor.name: 2}, coefficient=-1e-5),)),),
        guard=Guard(break_codes=(-9999.0,)),
    )
    ((name, text),) = tcpou_export(model).files.items()
    (tmp_path / name).write_text(text, encoding="ascii")
    parts = list(parse(tmp_path / name))
    assert [part.exception for part in parts] == [None, None]
    assert [part.identifier for part in parts] == [
        "FB_ThermalCorrection/declaration",
        "FB_ThermalCorrection/implementation",
    ]


def _block(statements, declared="x : LREAL := 0.0;"):
    return (
        f"FUNCTION_BLOCK b\nVAR\n{declared}\nEND_VAR\nVAR_TEMP\nt : LREAL;\nEND_VAR\n{statements}\nEND_FUNCTION_BLOCK\n"
    )


@needs_parser
@pytest.mark.parametrize(
    ("text", "what"),
    [
        (_block("FOR i := 1 TO 3 DO x := 1.0; END_FOR;"), "for_statement"),
        (_block("x := ABS(1.0);"), "call"),
        (_block("x := 1;"), "a code where a real belongs"),
        (_block("x := x + 1;"), "a code where a real belongs"),
        (_block("x := x ** 2.0;"), "the operation"),
        (_block("IF x THEN x := 1.0; END_IF;"), "a real where a flag belongs"),
        (_block("y := 1.0;"), "not declared"),
        (_block("x := 1.0", "x : LREAL; y : REAL;"), "no Structured Text"),
        (_block("x := 1.0;", "x : LREAL; y : REAL;"), "2 types of real numbers"),
        (_block("x := 1.0;", "x : LREAL; X : LREAL;"), "a second declaration"),
        (_block("x := 1.0;", "x : STRING;"), "a declaration"),
        (_block("n := 40000;", "x : LREAL; n : INT;"), "16 bits"),
        (_block("x := 1.0;") * 2, "one function block"),
        ("温度", "no Structured Text"),
    ],
)  # fmt: skip
def test_what_no_exported_program_has_is_refused(text, what):
    with pytest.raises(NotExecutableError, match=what):
        executable(text)


@needs_parser
def test_a_temporary_that_is_read_before_it_is_set_is_found_out():
    with pytest.raises(NameError, match="v_t"):
        executable(_block("x := t;")).call()


@needs_parser
@pytest.mark.parametrize(("type_", "one"), [("LREAL", 0.1 + 0.2), ("REAL", float(np.float32(0.1) + np.float32(0.2)))])
def test_numbers_are_of_the_declared_type(type_, one):
    block = executable(f"FUNCTION_BLOCK b\nVAR\nx : {type_} := 0.1;\nEND_VAR\nx := x + 0.2;\nEND_FUNCTION_BLOCK\n")
    block.call()
    assert float(block.v_x) == one


@needs_parser
@pytest.mark.parametrize(
    ("condition", "holds"),
    [
        ("TRUE OR TRUE AND FALSE", True),
        ("(TRUE OR TRUE) AND FALSE", False),
        ("NOT (FALSE) AND FALSE", False),
        ("7.0 - 2.0 - 1.0 = 4.0", True),
        ("8.0 / 2.0 / 2.0 = 2.0", True),
        ("2.0 + 3.0 * 2.0 = 8.0", True),
        ("1.0 <> 2.0", True),
        ("-2.0 < -1.0", True),
    ],
)
def test_operations_bind_as_the_standard_says(condition, holds):
    block = executable(_block(f"f := {condition};", "x : LREAL; f : BOOL;"))
    block.call()
    assert block.v_f is holds


def test_without_the_parser_the_advice_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "tree_sitter_iec61131_3_st", None)
    with pytest.raises(NotExecutableError, match=re.escape('pip install ".[controls]"')):
        executable(_block("x := 1.0;"))


@needs_parser
def test_the_parser_tells_its_version():
    assert re.fullmatch(r"tree-sitter-iec61131-3-st \d+\.\d+\.\d+", parser_name())
