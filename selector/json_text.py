"""Results as JSON text: numbers are finite, and other alphabets stay readable."""

import json
import math
from collections.abc import Iterable, Mapping
from pathlib import PurePath
from typing import Any


def json_text(value: Any) -> str:
    """JSON with every number finite: NaN and infinity become null; other alphabets stay readable."""
    return json.dumps(plain(value), ensure_ascii=False, allow_nan=False, indent=1)


def fields_of(one: Any, *names: str) -> dict[str, Any]:
    """What JSON says of something under the names that it has there."""
    return {name: getattr(one, name) for name in names}


def plain(value: Any) -> Any:
    """The same value of what JSON has: NaN and infinity are None, arrays and tuples lists, paths text."""
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if hasattr(value, "as_dict"):  # a finding
        return plain(value.as_dict())
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, PurePath):
        return value.as_posix()
    if hasattr(value, "tolist"):  # arrays and numbers of numpy
        return plain(value.tolist())
    if isinstance(value, Iterable):
        return [plain(item) for item in value]
    raise TypeError(f"{type(value).__name__} has no JSON form")
