"""Which number of a model file has no machine, and in which other unit would it be usual: slips of units."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from selector.findings import Finding
from selector.physics.model_parameters import numbers_in, value_at
from selector.physics.model_text import key_text


@dataclass(frozen=True)
class UsualRange:
    """Between which numbers machines lie, and in which units people think beside that of the key.

    Attributes
    ----------
    low, high : float
        Least and most that is usual, in the unit of the key; 0 is always allowed: it switches something off.
    units : mapping of str to float
        Another unit → how many of the unit of the key it is; the likeliest first.
    """

    low: float
    high: float
    units: Mapping[str, float]


def unlikely_numbers(
    values: Mapping[str, Any], usual: Mapping[str, UsualRange], unit_of_key: Callable[[str], str]
) -> Iterator[Finding]:
    """Warnings on numbers of a model file that no machine has; each with the unit that was perhaps meant.

    Parameters
    ----------
    values : mapping
        The file's sections as plain values.
    usual : mapping of str to UsualRange
        Section and key, as in ``probe.mass_kg``, or a key of sections that the file names → what is usual.
    unit_of_key : callable
        Key → its unit; "1" for none.
    """
    for path in numbers_in(values, ()):
        names = [part for part in path if isinstance(part, str)]
        span = usual.get(".".join(names[-2:])) or usual.get(names[-1])
        value = float(value_at(values, path))
        if span is None or value == 0 or span.low <= abs(value) <= span.high:
            continue
        key, unit = key_text(path), unit_of_key(names[-1]).removeprefix("1")
        meant = next(
            (
                (name, value * times)
                for name, times in span.units.items()
                if span.low <= abs(value * times) <= span.high
            ),
            None,
        )
        most = f"up to {span.high:g}" if span.low == 0 else f"{span.low:g} to {span.high:g}"
        said = f"{key} is {value:.6g} {unit}".rstrip() + f"; machines have {most} {unit}".rstrip() + "."
        if meant is not None:
            said += f" {value:.6g} {meant[0]} would be {meant[1]:.6g} {unit}".rstrip() + "."
        yield Finding(
            "unlikely-value",
            "warning",
            said,
            evidence={"key": key, "value": value, "low": span.low, "high": span.high, "perhaps": meant and meant[1]},
            suggestion="correct it if it is a slip"
            if meant is None
            else f"write {key} = {meant[1]:.6g} if {meant[0]} was meant",
        )
