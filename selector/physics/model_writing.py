"""How is a model file written whose values were changed: as TOML text that reads back as the same values."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

_DEEPEST = 3
"""Parts of a header; tables further inside are written in a line."""


def model_file_text(values: Mapping[str, Any], *, head: str = "") -> str:
    """Plain values of a model file as TOML text; `head` becomes comment lines at its beginning.

    >>> values = {"model": {"kind": "drive", "name": "axis"}, "links": [{"between": ["a", "b"]}]}
    >>> print(model_file_text(values).rstrip())
    [model]
    kind = "drive"
    name = "axis"
    <BLANKLINE>
    [[links]]
    between = ["a", "b"]
    """
    comments = [f"# {line}".rstrip() for line in head.splitlines()]
    return "\n".join([*comments, *_table(values, ())]).lstrip("\n") + "\n"


def _table(values: Mapping[str, Any], path: tuple[str, ...]) -> Iterator[str]:
    inside = {key: value for key, value in values.items() if _has_sections(value, len(path))}
    for key, value in values.items():
        if value is not None and key not in inside:
            yield f"{_key(key)} = {_value(value)}"
    for key, value in inside.items():
        several = not isinstance(value, Mapping)
        name = ".".join(_key(part) for part in (*path, key))
        for table in value if several else [value]:
            if several or not table or any(not _has_sections(one, len(path) + 1) for one in table.values()):
                yield from ("", f"[[{name}]]" if several else f"[{name}]")
            yield from _table(table, (*path, key))


def _has_sections(value: Any, depth: int) -> bool:
    """Whether a value at this depth is written below headers of its own."""
    return depth < _DEEPEST and (isinstance(value, Mapping) or _is_array_of_tables(value))


def _is_array_of_tables(value: Any) -> bool:
    return isinstance(value, list | tuple) and bool(value) and all(isinstance(one, Mapping) for one in value)


def _key(name: str) -> str:
    return name if re.fullmatch(r"[A-Za-z0-9_-]+", name) else _text(name)


def _value(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, int | float):
        return repr(float(value)) if isinstance(value, float) else str(value)
    if isinstance(value, Mapping):
        parts = ", ".join(f"{_key(key)} = {_value(one)}" for key, one in value.items() if one is not None)
        return "{ " + parts + " }" if parts else "{}"
    if isinstance(value, Sequence) and not isinstance(value, str):
        return "[" + ", ".join(_value(one) for one in value) + "]"
    return _text(str(value))


def _text(text: str) -> str:
    # JSON's escapes are TOML's, but for the control character that JSON lets through
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
