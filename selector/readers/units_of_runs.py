"""Which unit a channel has in each run, when the headers of the files and the machine file say different things."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from selector.findings import Finding, Where
from selector.units import same_dimension

Ruling = Literal["header", "declared", "option", "each"]
"""Who was believed: the header of the run, the machine file, an option; or each header, where nothing is declared."""


@dataclass(frozen=True)
class Dispute:
    """One channel for which some runs print another unit than the machine file, an option, or the other runs.

    `printed` holds the runs in dispute and the unit in their headers; with ``"each"`` it holds all runs with their
    units. `declared` is what the machine file or the option says.
    """

    channel: str
    role: str
    ruling: Ruling
    printed: tuple[tuple[str, str], ...]
    declared: str | None = None


def believed(
    declared: str, printed: Mapping[str, str | None], *, by_option: bool
) -> tuple[dict[str, str], dict[str, str], Ruling]:
    """(unit of each run, what the headers in dispute print, who was believed in them).

    One line of a machine file holds for all runs. Where every run prints another unit, the line is the user's
    correction of the files. Where it holds for some runs, the others were recorded in another unit and say so: their
    headers count. An option is said for this very reading and counts always.

    Parameters
    ----------
    declared : str
        Unit of the machine file or the option.
    printed : mapping of run to unit or None
        Known unit in the header of each run; None or "1" where there is none.
    """
    other = {run: unit for run, unit in printed.items() if unit not in (None, "1", declared) and unit is not None}
    units = dict.fromkeys(printed, declared)
    if by_option:
        return units, other, "option"
    convertible = all(same_dimension(unit, declared) for unit in other.values())
    if len(other) == len(printed) or not convertible:
        return units, other, "declared"
    return {**units, **other}, other, "header"


def unit_findings(disputes: Iterable[Dispute]) -> list[Finding]:
    """One finding for all channels about which the same is to be said of the same runs."""
    alike: dict[tuple[object, ...], list[Dispute]] = {}
    for one in disputes:
        alike.setdefault((one.ruling, one.printed, one.declared), []).append(one)
    return [_finding(members) for members in alike.values()]


def _finding(members: Sequence[Dispute]) -> Finding:
    first = members[0]
    names = [one.channel for one in members]
    what = _named(names, {one.role for one in members})
    by_unit: dict[str, list[str]] = {}
    for run, unit in first.printed:
        by_unit.setdefault(unit, []).append(run)
    said = "; ".join(f"{unit} in {_listed(runs)}" for unit, runs in by_unit.items())
    where = Where(
        channel=names[0] if len(names) == 1 else None, run=first.printed[0][0] if len(first.printed) == 1 else None
    )
    evidence = {"channels": names, "in_file": by_unit, "asked": first.declared, "believed": first.ruling}
    each = "" if len(names) == 1 else ", and so for each of these channels"
    if first.ruling == "each":
        return Finding(
            "units-differ",
            "info",
            f"The runs have different units for {what}: {said}. Each run was read in its own.",
            where,
            {"channels": names, "in_file": by_unit},
            "nothing to do if the headers are right; a machine file need not name these units",
        )
    if first.ruling == "header":
        return Finding(
            "units-differ",
            "warning",
            f"The machine file says {first.declared} for {what}, but the headers say {said}. Other runs do not "
            "contradict the machine file, so these were read as their headers say.",
            where,
            evidence,
            "nothing to do if the headers are right; if they are wrong, correct them in the files or add "
            f"--unit {names[0]}={first.declared}{each}",
        )
    asked = "The option" if first.ruling == "option" else "The machine file"
    advice = (
        "leave the option out if the headers are right"
        if first.ruling == "option"
        else "nothing to do if the headers are wrong; if they are right, remove the line unit = … of "
        f"{'this channel' if len(names) == 1 else 'these channels'} from the machine file"
    )
    return Finding(
        "unit-conflict",
        "warning",
        f"{asked} says {first.declared} for {what}, but the headers say {said}; "
        f"{'it was' if len(names) == 1 else 'they were'} read in {first.declared}.",
        where,
        evidence,
        advice,
    )


def _named(names: Sequence[str], roles: set[str]) -> str:
    if len(names) == 1:
        return f"channel {names[0]!r}"
    kind = f"{next(iter(roles)).replace('_', ' ')} " if len(roles) == 1 else ""
    return f"{len(names)} {kind}channels ({_listed(names)})"


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:6]) + (" …" if len(names) > 6 else "")
