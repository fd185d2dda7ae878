"""The part of a model file by which it is checked: readings and calls with what they must give."""

from typing import Any

from pydantic import Field, SerializerFunctionWrapHandler, model_serializer, model_validator

from selector.controllers.closed_values import Closed, Codes, Flags, Name, Number, Series, refuse


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
        default=(), max_length=500, description="of each fallback in their order, the outputs on the same readings"
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

    @model_serializer(mode="wrap")
    def _without_nothing(self, of_fields: SerializerFunctionWrapHandler) -> dict[str, Any]:
        return without(of_fields(self), "fallbacks")


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


def without(content: dict[str, Any], *fields: str) -> dict[str, Any]:
    """Content without these fields where they say nothing: it has the bytes from before there were any."""
    return {key: value for key, value in content.items() if value or key not in fields}
