"""The model file: closed, versioned, bit-exact, and suspicious of what it reads."""

from __future__ import annotations

import copy
import importlib.util
import json
import math
import tracemalloc
from pathlib import Path
from typing import get_args

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from selector import atomic_file
from selector.controllers.model_file import (
    LARGEST_FILE_BYTES,
    Role,
    model_json_schema,
    model_sha256,
    model_text,
    parsed_model,
    read_model,
    write_model,
)
from selector.controllers.self_check import check_vectors
from selector.errors import InputError, ModelFileError, OptionError
from selector.units import ROLES
from tests.controllers.model_builders import rich_model, rise_model

ROOT = Path(__file__).resolve().parents[2]


def document() -> dict:
    model = rich_model()
    return json.loads(model_text(model.model_copy(update={"test_vectors": check_vectors(model)})))


def with_change(path: tuple, value: object) -> dict:
    changed = copy.deepcopy(document())
    place = changed
    for part in path[:-1]:
        place = place[part]
    if value is KeyError:
        del place[path[-1]]
    else:
        place[path[-1]] = value
    return changed


def refusal(text: str) -> ModelFileError:
    with pytest.raises(ModelFileError) as caught:
        parsed_model(text, where="m.json")
    return caught.value


def module_at(path: Path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_shipped_schema_is_up_to_date():
    maker = module_at(ROOT / "fixtures" / "make" / "model_schema.py")
    assert maker.SCHEMA_FILE.read_text(encoding="utf-8") == maker.schema_text(), (
        "run python fixtures/make/model_schema.py; a change of meaning needs a new schema version"
    )


def test_schema_is_valid_and_closed_everywhere():
    schema = model_json_schema()
    Draft202012Validator.check_schema(schema)
    objects = [schema, *schema["$defs"].values()]
    assert all(one["additionalProperties"] is False for one in objects if "properties" in one)
    assert "schema" in schema["required"]
    Draft202012Validator(schema).validate(document())


def test_roles_are_those_of_a_recording():
    assert get_args(Role) == ROLES


def test_round_trip_is_bit_equal(tmp_path):
    model = parsed_model(json.dumps(document()))
    write_model(model, tmp_path / "a.json")
    again = read_model(tmp_path / "a.json")
    write_model(again, tmp_path / "b.json")
    assert again == model
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()
    assert model_sha256(again) == model_sha256(model)
    assert len(model_sha256(model)) == 64


@settings(max_examples=100)
@given(st.floats(allow_nan=False, allow_infinity=False), st.floats(min_value=5e-324, allow_infinity=False))
def test_every_float_survives(coefficient, scale):
    changed = with_change(("inputs", 0, "centre"), coefficient)
    changed["inputs"][0]["scale"] = scale
    model = parsed_model(json.dumps(changed))
    back = parsed_model(model_text(model)).inputs[0]
    assert (back.centre, back.scale) == (coefficient, scale)
    assert math.copysign(1.0, back.centre) == math.copysign(1.0, coefficient)


def test_hash_sees_the_last_bit():
    one = rise_model()
    other = parsed_model(model_text(one).replace('"intercept": 1.0', f'"intercept": {math.nextafter(1.0, 2.0)!r}'))
    assert model_sha256(one) != model_sha256(other)


def test_byte_order_mark_is_accepted(tmp_path):
    (tmp_path / "m.json").write_bytes(b"\xef\xbb\xbf" + model_text(rise_model()).encode())
    assert read_model(tmp_path / "m.json") == rise_model()


STRUCTURAL = [  # what the JSON Schema itself refuses too
    (("schema",), "selector.model/2", "$.schema", "selector.model/2"),
    (("schema",), KeyError, "$.schema", "no field 'schema'"),
    (("colour",), "red", "$.colour", '"red"'),
    (("outputs", 0, "terms", 1, "coefficient"), KeyError, "$.outputs[0].terms[1].coefficient", "no field"),
    (("outputs", 0, "terms", 1, "exponent"), 2, "$.outputs[0].terms[1].exponent", "2"),
    (("outputs", 0, "terms", 0, "coefficient"), "1.5", "$.outputs[0].terms[0].coefficient", '"1.5"'),
    (("outputs", 0, "terms", 0, "coefficient"), True, "$.outputs[0].terms[0].coefficient", "true"),
    (("outputs", 0, "terms", 0, "powers"), {}, "$.outputs[0].terms[0].powers", "object with 0 entries"),
    (("outputs", 0, "terms", 0, "powers", "T1"), 0, "$.outputs[0].terms[0].powers.T1", "0"),
    (("outputs", 0, "terms", 0, "powers", "T1"), 4, "$.outputs[0].terms[0].powers.T1", "4"),
    (("outputs", 0, "terms", 0, "powers", "T1"), 1.5, "$.outputs[0].terms[0].powers.T1", "1.5"),
    (("outputs", 0, "unit"), "mm", "$.outputs[0].unit", '"mm"'),
    (("outputs", 0, "sign"), "correction = +displacement", "$.outputs[0].sign", "correction = +displacement"),
    (("outputs",), [], "$.outputs", "array with 0 entries"),
    (("inputs",), [], "$.inputs", "array with 0 entries"),
    (("inputs", 0, "scale"), 0, "$.inputs[0].scale", "0"),
    (("inputs", 0, "scale"), -1.0, "$.inputs[0].scale", "-1.0"),
    (("inputs", 0, "scale"), None, "$.inputs[0].scale", "null"),
    (("inputs", 0, "role"), "pressure", "$.inputs[0].role", '"pressure"'),
    (("inputs", 0, "reference"), "delta", "$.inputs[0].reference", '"delta"'),
    (("inputs", 0, "name"), "", "$.inputs[0].name", '""'),
    (("inputs", 0, "name"), "T1\n*/", "$.inputs[0].name", '"T1\\n*/"'),
    (("inputs", 0, "name"), "T" * 201, "$.inputs[0].name", "TTT"),
    (("states", 0, "tau_s"), 0.0, "$.states[0].tau_s", "0.0"),
    (("guard", "on_fault"), "pray", "$.guard.on_fault", '"pray"'),
    (("provenance", "date"), "yesterday", "$.provenance.date", '"yesterday"'),
    (("provenance", "data_sha256"), {"r1": "12ab"}, "$.provenance.data_sha256.r1", '"12ab"'),
    (("provenance", "seed"), -1, "$.provenance.seed", "-1"),
    (("test_vectors", 0, "time_s"), [], "$.test_vectors[0].time_s", "array with 0 entries"),
]  # fmt: skip

CONTRADICTIONS = [
    (("inputs", 1, "name"), "T1", "$.inputs[1].name", "'T1' a second time"),
    (("states", 0, "name"), "T1", "$.states[0].name", "'T1' a second time"),
    (("outputs", 1, "name"), "Z", "$.outputs[1].name", "'Z' a second time"),
    (("outputs", 1, "name"), "time_s", "$.outputs[1].name", "'time_s'"),
    (("inputs", 0, "valid_min"), 10.5, "$.inputs[0].valid_min", "10.5"),
    (("inputs", 0, "unit"), "degF", "$.inputs[0].unit", "'degF'"),
    (("states", 1, "source"), "T9", "$.states[1].source", "'T9'"),
    (("outputs", 0, "terms", 0, "powers"), {"T9": 1}, "$.outputs[0].terms[0].powers.T9", "'T9'"),
    (("outputs", 0, "terms", 1, "powers"), {"T1": 3}, "$.outputs[0].terms[1].powers", "a second time"),
    (("outputs", 1, "position", "terms", 0, "powers"), {"?": 1}, '$.outputs[1].position.terms[0].powers["?"]', "'?'"),
    (("outputs", 1, "position", "valid_min_m"), 1.0, "$.outputs[1].position.valid_min_m", "1.0"),
    (("guard", "on_fault"), "fallback", "$.guard.on_fault", "without any fallback"),
    (("guard", "limits"), [{"output": "X"}], "$.guard.limits[0].output", "'X'"),
    (("validation",), {"X": {}}, "$.validation.X", "X"),
    (("test_vectors", 0, "readings", "T1"), [1.0], "$.test_vectors[0].readings.T1", "1 values"),
    (("test_vectors", 0, "readings", "T1"), KeyError, "$.test_vectors[0].readings", "no T1"),
    (("test_vectors", 0, "expected", "X"), [1.0, 2.0], "$.test_vectors[0].expected", "X"),
    (("test_vectors", 0, "positions_m"), {}, "$.test_vectors[0].positions_m", "no Y"),
    (("test_vectors", 1, "start_readings"), {"T9": 1.0}, "$.test_vectors[1].start_readings.T9", "'T9'"),
    (("test_vectors", 0, "time_s"), [5.0, 5.0], "$.test_vectors[0].time_s", "repeats"),
]


@pytest.mark.parametrize(("path", "value", "place", "found"), STRUCTURAL + CONTRADICTIONS)
def test_a_malformed_file_is_refused_with_its_path_and_value(path, value, place, found):
    error = refusal(json.dumps(with_change(path, value), ensure_ascii=False))
    assert error.where == f"m.json, {place}"
    assert found in error.found
    assert error.expected
    assert error.advice


@pytest.mark.parametrize(("path", "value", "place", "found"), STRUCTURAL)
def test_the_shipped_schema_refuses_the_same(path, value, place, found):
    assert not Draft202012Validator(model_json_schema()).is_valid(with_change(path, value))


FALLBACK = {
    "without": ["T1"],
    "inputs": [{"name": "T3", "valid_min": 0, "valid_max": 1}],
    "outputs": [{"name": "Z", "intercept": 0, "terms": [{"powers": {"T3": 1}, "coefficient": 2}]}],
}


def with_fallbacks(*fallbacks: dict) -> str:
    return json.dumps(
        json.loads(model_text(rise_model())) | {"fallbacks": fallbacks, "guard": {"on_fault": "fallback"}}
    )


def test_a_fallback_is_a_whole_model():
    model = parsed_model(with_fallbacks(FALLBACK))
    assert model.fallbacks[0].outputs[0].terms[0].coefficient == 2.0
    assert parsed_model(model_text(model)) == model


@pytest.mark.parametrize(
    ("change", "place"),
    [
        ({"without": ["T9"]}, "$.fallbacks[0].without[0]"),
        ({"without": ["T3"]}, "$.fallbacks[0].inputs[0].name"),
        ({"without": []}, "$.fallbacks[0].without"),
        ({"inputs": [{"name": "T3", "reference": "absolute", "valid_min": 0, "valid_max": 1}]},
         "$.fallbacks[0].inputs[0]"),
        ({"outputs": [{"name": "Y", "intercept": 0}]}, "$.fallbacks[0].outputs"),
        ({"outputs": [{"name": "Z", "intercept": 0, "terms": [{"powers": {"T1": 1}, "coefficient": 2}]}]},
         "$.fallbacks[0].outputs[0].terms[0].powers.T1"),
    ],
)  # fmt: skip
def test_a_fallback_that_does_not_fit_is_refused(change, place):
    assert refusal(with_fallbacks(FALLBACK | change)).where == f"m.json, {place}"


def test_two_fallbacks_for_the_same_sensors_are_refused():
    assert refusal(with_fallbacks(FALLBACK, FALLBACK)).where == "m.json, $.fallbacks[1].without"


@pytest.mark.parametrize("number", ["1e400", "-1e999", "NaN", "Infinity", "-Infinity", "9007199254740993", "1" * 5000])
def test_numbers_that_two_readers_may_read_differently_are_refused(number):
    text = model_text(rise_model()).replace('"coefficient": 3.0', f'"coefficient": {number}')
    error = refusal(text)
    assert error.where == "m.json, $.outputs[0].terms[0].coefficient"
    assert error.found.startswith(number[:70])


@pytest.mark.parametrize(
    ("name", "expected"),
    [("a\nb", "line ends"), ("x" * 201, "at most 200 characters"), ("", "at least 1 "), ("\ud800", "whole characters")],
)
def test_a_name_that_is_none_is_refused_in_words(name, expected):
    error = refusal(model_text(rise_model()).replace('"two rises"', json.dumps(name)))
    assert error.where == "m.json, $.name"
    assert expected in error.expected


def test_a_repeated_key_is_refused():
    text = model_text(rise_model()).replace('"coefficient": 3.0', '"coefficient": 3.0, "coefficient": 4.0')
    error = refusal(text)
    assert error.where == "m.json, $.outputs[0].terms[0].coefficient"
    assert "coefficient" in error.found


@pytest.mark.parametrize(
    "text", ["", "   ", "null", "[]", '"x"', "3", "{}", "\x00", "PK\x03\x04", "<html>", "{'a': 1}"]
)
def test_other_documents_are_refused(text):
    assert "m.json" in refusal(text).where


def test_deep_nesting_is_refused():
    assert "nested" in refusal("[" * 200_000).found
    assert "$.name" in refusal('{"schema": "selector.model/1", "name": ' + "[" * 900 + "]" * 900 + "}").where


def test_a_lone_surrogate_is_refused():
    assert refusal(model_text(rise_model()).replace('"two rises"', '"\\ud800"')).where == "m.json, $.name"


def test_a_truncated_file_is_refused_at_every_length():
    text = model_text(rise_model())
    for length in range(0, len(text.rstrip()), 7):
        error = refusal(text[:length])
        assert "cut off" in error.advice


def test_a_huge_file_is_refused_before_it_is_parsed(tmp_path):
    with (tmp_path / "big.json").open("wb") as file:
        file.truncate(100 * 1024 * 1024)
    with pytest.raises(ModelFileError, match=f"more than {LARGEST_FILE_BYTES // 10**6} MB"):
        read_model(tmp_path / "big.json")


HOSTILE = {
    "inputs": '"inputs": [' + "{}," * 100_000 + "{}]",
    "numbers in a series": '"test_vectors": [{"time_s": [' + "1," * 100_000 + "1]}]",
    "unknown keys": '"validation": {' + ",".join(f'"{i}": {{"x{"y" * (i % 2)}": 1}}' for i in range(20_000)) + "}",
    "small parts": '"fallbacks": [' + ",".join(['{"inputs": [' + "null," * 1200 + "null]}"] * 450) + "]",
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_a_hundred_thousand_small_errors_cost_neither_time_nor_memory(kind):
    """Collecting an error for each took 16 GB and two minutes for a file of 16 MB; now it is refused while walking."""
    tracemalloc.start()
    try:
        text = '{"schema": "selector.model/1", "name": "a", ' + HOSTILE[kind] + "}"
        error = refusal(text)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert "entries" in error.expected or "values" in error.found
    assert peak < 200 * len(text)  # 120 bytes for each character is what the parsed document itself needs


@pytest.mark.parametrize("make", [lambda p: None, lambda p: p.mkdir(), lambda p: p.write_bytes(b"\xff\xfe{\x00}\x00")])
def test_unreadable_files_are_refused(tmp_path, make):
    make(tmp_path / "m.json")
    with pytest.raises(ModelFileError) as caught:
        read_model(tmp_path / "m.json")
    assert str(tmp_path / "m.json") in caught.value.where


@settings(max_examples=75)
@given(st.data())
def test_random_damage_never_gives_a_traceback(data):
    text = model_text(rise_model())
    at = data.draw(st.integers(0, len(text)))
    width = data.draw(st.integers(0, 40))
    damaged = text[:at] + data.draw(st.text(max_size=20)) + text[at + width :]
    try:
        model = parsed_model(damaged)
    except InputError:
        return
    assert parsed_model(model_text(model)) == model


def test_a_failed_write_leaves_the_old_file_and_no_draft(tmp_path, monkeypatch):
    target = tmp_path / "m.json"
    target.write_text("old", encoding="utf-8")

    def full_disk(_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(atomic_file.os, "fsync", full_disk)
    with pytest.raises(OptionError, match="No space left"):
        write_model(rise_model(), target)
    assert target.read_text(encoding="utf-8") == "old"
    assert [path.name for path in tmp_path.iterdir()] == ["m.json"]


def test_missing_folders_are_made_and_a_file_in_their_place_is_told(tmp_path):
    write_model(rise_model(), tmp_path / "new" / "er" / "m.json")
    with pytest.raises(OptionError, match="cannot be written"):
        write_model(rise_model(), tmp_path / "new" / "er" / "m.json" / "m.json")
    assert [path.name for path in tmp_path.rglob("*")] == ["new", "er", "m.json"]


def test_the_written_file_replaces_the_old_one(tmp_path):
    target = tmp_path / "m.json"
    target.write_text("old", encoding="utf-8")
    write_model(rise_model(), target)
    assert target.read_bytes() == model_text(rise_model()).encode("utf-8")
    assert b"\r" not in target.read_bytes()
