"""What a model file is made of: numbers that are finite, names that fit into remarks, parts without unknown fields.

Two parts stand here: how touch-offs correct the outputs, and the readings and calls by which the file is checked.
"""

from operator import not_
from typing import Annotated, Any, Literal, Never

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, model_validator

from selector.controllers.strict_json import LARGEST_COLLECTION

Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
Positive = Annotated[float, Field(strict=True, allow_inf_nan=False, gt=0)]
NonNegative = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=0)]
Power = Annotated[int, Field(strict=True, ge=1, le=3)]
# No control characters or line ends: names go into program comments, table headers and terminals.
Name = Annotated[str, StringConstraints(min_length=1, max_length=200, pattern=r"^[^\x00-\x1f\x7f-\x9f\u2028\u2029]+$")]
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


class OutputAdaptation(Closed):
    """How touch-offs correct one output: displacement = m + offset + gain · m, m as the model has it.

    Offset and gain are random walks that a Kalman filter follows; variances grow with the time between touch-offs.
    """

    output: Name
    offset_um2_per_s: NonNegative = Field(description="growth of the variance of the offset")
    offset_start_um2: NonNegative = Field(description="variance of the offset at a new start")
    gain_per_s: NonNegative = Field(default=0.0, description="growth of the variance of the gain")
    gain_start: NonNegative = Field(default=0.0, description="variance of the gain at a new start")
    noise_um2: Positive = Field(description="variance of one touch-off")
    offset_limit_um: Positive = Field(description="largest magnitude of the offset")
    gain_limit: NonNegative = Field(default=0.0, description="largest magnitude of the gain; 0: there is none")
    interval: Positive | None = Field(
        default=None, description="half width of a 90 % prediction interval in standard deviations"
    )


class Adaptation(Closed):
    """How the control keeps the model true with touch-offs."""

    outputs: tuple[OutputAdaptation, ...] = Field(min_length=1, max_length=32, fail_fast=True)
    gate: Positive = Field(
        default=4.0, description="a touch-off farther from what is expected, in standard deviations, is not believed"
    )
    agreeing: Positive = Field(
        default=0.5,
        description="but a second one is (beyond the limit of the offset a third), if it is nearer to the one before "
        "than this share of its way from what is expected",
    )


class CheckVector(Closed):
    """Readings with the outputs that they must give, so that any program can check itself."""

    name: Name
    time_s: Series
    readings: dict[Name, Series]
    start_readings: dict[Name, Number] | None = Field(
        default=None, description="null: the first readings are the start"
    )
    positions_m: dict[Name, Series] | None = Field(default=None, description="axis → position; null: P = P0")
    expected: dict[Name, Series]
    fallbacks: tuple[dict[Name, Series], ...] = Field(
        default=(),
        max_length=500,
        exclude_if=not_,
        description="of each fallback in their order, the outputs on the same readings",
    )

    @model_validator(mode="after")
    def _hangs_together(self) -> "CheckVector":
        if any(b <= a for a, b in zip(self.time_s, self.time_s[1:], strict=False)):
            refuse(("time_s",), "time that repeats or runs backwards", "strictly increasing time")
        _check_lengths(self, "time_s", "readings", "positions_m", "expected")
        for i, outputs in enumerate(self.fallbacks):
            for name, series in outputs.items():
                if len(series) != len(self.time_s):
                    refuse(("fallbacks", i, name), f"{len(series)} values", f"{len(self.time_s)}, as time_s has")
        return self


class GuardVector(Closed):
    """Calls of the model behind its guard with what they must give: a path that is taken when something fails."""

    name: Name
    dt_s: Series
    readings: dict[Name, Series]
    positions_m: dict[Name, Series] = Field(default_factory=dict, description="axis → position")
    test_um: dict[Name, Series] = Field(default_factory=dict, description="output → what is commanded; none: nothing")
    standstill_s: Series = Field(description="0, or: before this call the control was off for so long")
    is_ready: Flags
    is_wanted: Flags
    expected: dict[Name, Series] = Field(description="output → correction [µm]")
    mode: Codes
    sensors: dict[Name, Codes] = Field(description="input → its code")

    @model_validator(mode="after")
    def _hangs_together(self) -> "GuardVector":
        _check_lengths(self, "dt_s", "readings", "positions_m", "test_um", "expected", "sensors")
        for field in ("standstill_s", "is_ready", "is_wanted", "mode"):
            if len(getattr(self, field)) != len(self.dt_s):
                refuse((field,), f"{len(getattr(self, field))} values", f"{len(self.dt_s)}, as many as dt_s has")
        return self


def _check_lengths(of: Any, by: str, *tables: str) -> None:
    n = len(getattr(of, by))
    for field in tables:
        for name, series in (getattr(of, field) or {}).items():
            if len(series) != n:
                refuse((field, name), f"{len(series)} values", f"{n}, as many as {by} has")
