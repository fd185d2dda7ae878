"""What a model file is made of: numbers that are finite, names that fit into remarks, parts without unknown fields."""

from typing import Annotated, Any, Literal, Never

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from selector.controllers.strict_json import LARGEST_COLLECTION

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0)]
NonNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0)]
Power = Annotated[int, Field(strict=True, ge=1, le=3)]
# No control characters or line ends: names go into program comments, table headers and terminals.
Name = Annotated[str, StringConstraints(min_length=1, max_length=100, pattern=r"^[^\x00-\x1f\x7f-\x9f\u2028\u2029]+$")]
Text = Annotated[str, StringConstraints(max_length=4000)]
Sha256 = Annotated[str, StringConstraints(pattern=r"^[0-9a-f]{64}$")]
Date = Annotated[
    str,
    StringConstraints(
        pattern=r"^[0-9]{4}-[0-9]{2}-[0-9]{2}(T[0-9]{2}:[0-9]{2}(:[0-9]{2})?(Z|[+-][0-9]{2}:[0-9]{2})?)?$"
    ),
]
Series = Annotated[tuple[Number, ...], Field(min_length=1, max_length=LARGEST_COLLECTION, fail_fast=True)]
Flags = Annotated[
    tuple[Annotated[bool, Field(strict=True)], ...], Field(min_length=1, max_length=LARGEST_COLLECTION, fail_fast=True)
]
Codes = Annotated[
    tuple[Annotated[int, Field(strict=True, ge=0, le=1000)], ...],
    Field(min_length=1, max_length=LARGEST_COLLECTION, fail_fast=True),
]
Role = Literal[
    "temperature", "ambient", "displacement", "spindle_speed", "feed_rate", "position_command", "position", "velocity",
    "force", "current", "voltage", "acceleration", "flow", "state", "size", "amplitude", "frequency",
]  # fmt: skip
Sign = Literal["correction = -displacement", "correction = displacement"]
KeyPath = tuple[str | int, ...]


class ContradictionError(ValueError):
    """Two places of a model do not fit together; `path` leads from the value under validation to one of them."""

    def __init__(self, path: KeyPath, found: str, expected: str) -> None:
        super().__init__(f"{found}, expected {expected}")
        self.path = path
        self.found = found
        self.expected = expected

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.path, self.found, self.expected), self.__dict__


def refuse(path: KeyPath, found: str, expected: str) -> Never:
    """Ends with a `ContradictionError`."""
    raise ContradictionError(path, found, expected)


class Closed(BaseModel):
    """A part of a file: nothing that its schema does not have, and nothing changes."""

    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=True, serialize_by_alias=True)
