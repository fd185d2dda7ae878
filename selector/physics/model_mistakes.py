"""What should have stood in a place of a model file, in the words of the file and not of the program that checks it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

_WORDS = {
    "dict_type": "a table, { key = value }",
    "model_type": "a table, { key = value }",
    "model_attributes_type": "a table, { key = value }",
    "tuple_type": "an array, [ … ]",
    "list_type": "an array, [ … ]",
    "string_type": 'a text in quotation marks, "…"',
    "bool_type": "true or false",
    "int_type": "a whole number",
    "float_type": "a number",
    "string_pattern_mismatch": "a letter, then letters, digits and _, 16 at most",
}
_ENTRIES = {"Dictionary": "entry", "String": "character"}


def expected_text(problem: Mapping[str, Any]) -> str:
    """What a problem that pydantic found asks for, e.g. "at most 2 values"."""
    kind, limits = str(problem["type"]), problem.get("ctx", {})
    if kind in _WORDS:
        return _WORDS[kind]
    if kind in ("too_long", "too_short", "string_too_long", "string_too_short"):
        bound, count = ("at most", "max_length") if kind.endswith("long") else ("at least", "min_length")
        what = "character" if kind.startswith("string") else _ENTRIES.get(limits.get("field_type", ""), "value")
        number = limits[count]
        many = what if number == 1 else f"{what.removesuffix('y')}ies" if what.endswith("y") else f"{what}s"
        return f"{bound} {number} {many}"
    said = str(problem["msg"]).removeprefix("Value error, ").removeprefix("Input should be ")
    return said.removeprefix("a valid ")
