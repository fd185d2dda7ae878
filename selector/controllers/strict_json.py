"""JSON read with suspicion and written in one way only.

Reading refuses what two readers may understand differently: repeated keys, NaN and Infinity, numbers that do not fit a
float64 (1e400), integers beyond 2**53. Writing is deterministic: field order as given, shortest float text, an array
of plain values on one line.
"""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from selector.errors import ModelFileError

#: Integers above it are not exact in a float64, so a control and a PC could read different numbers.
LARGEST_INTEGER = 2**53
#: Entries of one array or object. A hostile file of 16 MB can hold millions, each of which would cost an error.
LARGEST_COLLECTION = 10_000
#: Values in one document: 37 sensors with all pair products, two outputs and 37 fallbacks need about 320 000.
LARGEST_DOCUMENT = 500_000
SHOWN_CHARACTERS = 80

#: Kind of a problem that pydantic found → what was expected, in words of JSON.
JSON_KINDS = {
    "model_type": "an object",
    "dict_type": "an object",
    "tuple_type": "an array",
    "float_type": "a number",
    "int_type": "an integer",
    "string_type": "a text",
    "string_unicode": "a text of whole characters",
}


def json_path(parts: Sequence[str | int]) -> str:
    """A place in a JSON document as text.

    >>> json_path(("outputs", 0, "terms", 2, "coefficient"))
    '$.outputs[0].terms[2].coefficient'
    >>> json_path(("validation", "Z lower"))
    '$.validation["Z lower"]'
    """
    text = "$"
    for part in parts:
        if isinstance(part, int):
            text += f"[{part}]"
        else:
            text += f".{part}" if part.isidentifier() else f"[{json.dumps(part, ensure_ascii=False)}]"
    return text


def shown(value: object) -> str:
    """A JSON value as one short line for a message."""
    if isinstance(value, dict | list | tuple):
        kind = "object" if isinstance(value, dict) else "array"
        return f"an {kind} with {len(value)} {'entry' if len(value) == 1 else 'entries'}"
    line = value.text if isinstance(value, _Refused) else json.dumps(value, ensure_ascii=True, default=repr)
    return line if len(line) <= SHOWN_CHARACTERS else f"{line[: SHOWN_CHARACTERS - 1]}…"


@dataclass(frozen=True)
class _Refused:
    """Stands in the parsed document where something must be refused, so that its path can be told."""

    text: str
    expected: str


def parsed_json(
    text: str, *, where: str, most_entries: int = LARGEST_COLLECTION, most_values: int = LARGEST_DOCUMENT
) -> Any:
    """The value of a JSON text; `where` names it in messages."""
    try:
        value = json.loads(
            text,
            parse_float=_float,
            parse_int=_int,
            parse_constant=lambda word: _Refused(word, "a finite number"),
            object_pairs_hook=_object,
        )
    except RecursionError:
        raise ModelFileError(
            "arrays or objects nested too deep",
            expected="the shallow structure of a model file or a result of selector",
            where=where,
            advice="this is not a model file of selector; export the model again",
        ) from None
    except json.JSONDecodeError as error:
        cut_off = error.pos >= len(text.rstrip()) or "Unterminated" in error.msg
        raise ModelFileError(
            "the text ends in the middle of the document" if cut_off else f"not JSON: {error.msg}",
            expected="one complete JSON document",
            where=f"{where}, line {error.lineno} column {error.colno}",
            advice="the file was cut off or edited by hand; export the model again or take an intact copy",
        ) from None
    refused = _first_refused(value, most_entries, most_values)
    if refused is not None:
        path, refusal = refused
        raise ModelFileError(
            shown(refusal),
            expected=refusal.expected,
            where=f"{where}, {json_path(path)}",
            advice="correct this place, or export the model again",
        )
    return value


def json_text(value: Any, indent: int = 0) -> str:
    """The one text of a JSON value; arrays of plain values stand on one line."""
    inner = "  " * (indent + 1)
    if isinstance(value, dict) and value:
        rows = [
            f"{inner}{json.dumps(key, ensure_ascii=False)}: {json_text(item, indent + 1)}"
            for key, item in value.items()
        ]
        return "{\n" + ",\n".join(rows) + "\n" + "  " * indent + "}"
    if isinstance(value, list | tuple) and any(isinstance(item, dict | list | tuple) for item in value):
        rows = [inner + json_text(item, indent + 1) for item in value]
        return "[\n" + ",\n".join(rows) + "\n" + "  " * indent + "]"
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def _float(text: str) -> float | _Refused:
    value = float(text)
    return value if math.isfinite(value) else _Refused(text, "a number that fits a float64, magnitude below 1.8e308")


def _int(text: str) -> int | _Refused:
    # the length first: turning a million digits into an int takes minutes
    if len(text) <= 17 and abs(int(text)) <= LARGEST_INTEGER:
        return int(text)
    return _Refused(text, "an integer within ±2**53, or a number with a decimal point or exponent")


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    value = dict(pairs)
    if len(value) != len(pairs):
        seen: set[str] = set()
        for key, _ in pairs:
            if key in seen:
                value[key] = _Refused(f"key {shown(key)} more than once", "every key once in an object")
            seen.add(key)
    return value


def _first_refused(value: Any, most_entries: int, most_values: int) -> tuple[tuple[str | int, ...], _Refused] | None:
    kinds = (dict, list, _Refused)
    stack: list[tuple[tuple[str | int, ...], Any]] = [((), value)] if isinstance(value, kinds) else []
    count = 1
    while stack:
        path, item = stack.pop()
        if isinstance(item, _Refused):
            return path, item
        if len(item) > most_entries:
            return path, _Refused(shown(item), f"at most {most_entries} entries")
        count += len(item)
        if count > most_values:
            return (), _Refused(f"more than {most_values} values", "a document of a size that can be worked with")
        children = item.items() if isinstance(item, dict) else enumerate(item)
        stack.extend(reversed([((*path, key), child) for key, child in children if isinstance(child, kinds)]))
    return None
