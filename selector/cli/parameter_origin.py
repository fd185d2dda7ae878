"""Where is each number of a model from: its model file, or what holds where the file leaves it out."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from selector.physics.model_entries import Entry
    from selector.physics.model_parameters import Parameter

SAID = "model file"
LEFT_OUT = "left out: default"


def parameters_with_origin(file: Entry, parameters: Mapping[str, Parameter]) -> tuple[tuple[str, float, str, str], ...]:
    """(name, value, unit, where it is from) of every number of a model; names are the keys of the file."""
    from selector.physics.model_text import plain_values

    values = plain_values(file)
    return tuple(
        (name, one.value, one.unit, SAID if is_said(values, name.split(".")) else LEFT_OUT)
        for name, one in parameters.items()
    )


def is_said(values: Any, path: list[str]) -> bool:
    """Whether plain values of a model file have this key; entries of lists count from 1 in its parts."""
    for part in path:
        if isinstance(values, Mapping) and part in values:
            values = values[part]
        elif isinstance(values, list | tuple) and part.isdigit() and 0 < int(part) <= len(values):
            values = values[int(part) - 1]
        else:
            return False
    return True


def facts_of(path: Path, note: str | None) -> dict[str, Any]:
    """What a page says of the origin of a simulation: the model file `path`, its hash, its note."""
    return {
        "model file": path.name,
        "SHA-256 of the model file": hashlib.sha256(path.read_bytes()).hexdigest(),
        "note": note,
    }
