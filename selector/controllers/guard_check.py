"""Settings of a guard that are allowed, but make no sense together or on a machine."""

from __future__ import annotations

from collections.abc import Iterator

from selector.controllers.model_file import Input, ModelFile, OutputLimits
from selector.findings import Finding

DAY_S = 86_400.0
CLOCKS_END_S = 1e6
"""`LONGEST_S` of the guard, which itself stands on this check."""
COLDEST_DEGC, HOTTEST_DEGC = -30.0, 120.0
"""What a working machine can have anywhere."""


def guard_findings(model: ModelFile) -> tuple[Finding, ...]:
    """Settings that are allowed, but hardly meant.

    Findings ``break-code-in-valid-range``, ``dead-band-beyond-clamp``, ``slew-too-slow``, ``holds-too-long``,
    ``waits-too-long``.
    """
    return (
        *_break_codes(model),
        *(finding for limits in model.guard.limits for finding in _limits(limits)),
        *_hold(model),
        *_never(model),
    )


def _break_codes(model: ModelFile) -> Iterator[Finding]:
    for item in model.inputs:
        low, high = _plausible_degc(item)
        for code in model.guard.break_codes:
            if item.unit == "degC" and low <= code <= high:
                yield Finding(
                    "break-code-in-valid-range",
                    "warning",
                    f"{item.name}: {code:g} °C counts as a broken sensor, but is a temperature that it can have "
                    f"({low:g} … {high:g} °C).",
                    evidence={"input": item.name, "break_code": code, "from_degc": low, "to_degc": high},
                    suggestion="remove the code from guard.break_codes of the model file",
                )


def _plausible_degc(item: Input) -> tuple[float, float]:
    """Readings that are no fault otherwise."""
    low = COLDEST_DEGC if item.reading_min is None else max(COLDEST_DEGC, item.reading_min)
    high = HOTTEST_DEGC if item.reading_max is None else min(HOTTEST_DEGC, item.reading_max)
    if item.reference == "absolute":
        low, high = min(low, item.valid_min), max(high, item.valid_max)
    return low, high


def _limits(limits: OutputLimits) -> Iterator[Finding]:
    name, clamp_um, slew = limits.output, limits.clamp_um, limits.slew_um_per_s
    if clamp_um is not None and limits.dead_band_um >= clamp_um:
        yield Finding(
            "dead-band-beyond-clamp",
            "warning",
            f"{name}: changes below {limits.dead_band_um:g} µm are not passed on, and the correction is at most "
            f"±{clamp_um:g} µm: it moves from one end to the other, or not at all.",
            evidence={"output": name, "dead_band_um": limits.dead_band_um, "clamp_um": clamp_um},
            suggestion="make dead_band_um in guard.limits of the model file smaller than the error that matters",
        )
    if clamp_um is not None and slew is not None and clamp_um / slew > DAY_S:
        yield Finding(
            "slew-too-slow",
            "warning",
            f"{name}: at {slew:g} µm/s the correction takes {clamp_um / slew / DAY_S:.3g} days to {clamp_um:g} µm; "
            "machines warm up in hours.",
            evidence={"output": name, "slew_um_per_s": slew, "clamp_um": clamp_um},
            suggestion=f"choose a faster slew limit, e.g. --slew {name}=1",
        )


def _hold(model: ModelFile) -> Iterator[Finding]:
    hold = model.guard.hold_at_most_s
    if hold is not None and hold > DAY_S:
        yield Finding(
            "holds-too-long",
            "warning",
            f"A correction is held for {hold / DAY_S:.3g} days without sensors; by then the machine is at another "
            "temperature.",
            evidence={"hold_at_most_s": hold},
            suggestion="choose minutes to hours in guard.hold_at_most_s of the model file",
        )


def _never(model: ModelFile) -> Iterator[Finding]:
    """Times that a machine in use does not reach; clocks of programs stop at 10⁶ s."""
    guard = model.guard
    for field, value_s, longest_s, what in (
        ("recover_after_s", guard.recover_after_s, DAY_S, "no sensor is believed, and nothing corrected,"),
        ("stuck_after_s", guard.stuck_after_s, CLOCKS_END_S, "a sensor that stands still is not found"),
        ("new_start_after_s", guard.new_start_after_s, CLOCKS_END_S, "old start readings are kept"),
    ):
        if value_s is not None and value_s >= longest_s:
            yield Finding(
                "waits-too-long",
                "warning",
                f"guard.{field} is {value_s:g} s ({value_s / DAY_S:.3g} days): {what} for so long"
                + (", or for ever: programs count to 10⁶ s." if value_s >= CLOCKS_END_S else "."),
                evidence={"field": field, "seconds": value_s},
                suggestion=f"choose a shorter guard.{field} in the model file",
            )
