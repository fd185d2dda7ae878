"""Findings of one cause agree: readings that are out of range because of their unit say so, and so does the unit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from selector.findings import Finding
from selector.quality.break_codes import PLAUSIBLE

_NOTHING = "Nothing is left out."


def agreed(findings: Sequence[Finding]) -> list[Finding]:
    """The findings in their order; those about a wrong unit and the readings out of range that it explains agree."""
    told = list(findings)
    for i, unit in enumerate(told):
        if unit.id != "wrong-unit" or unit.action != "none":
            continue
        explained = [k for k, other in enumerate(told) if other.id == "out-of-range" and _explains(unit, other)]
        for k in explained:
            advice = f"Its unit explains this ({unit.evidence['mistake']}): see wrong-unit. The stretch is left out."
            told[k] = replace(told[k], suggestion=advice)
        if explained:
            advice = unit.suggestion.replace(_NOTHING, "Until then the readings that are out of range are left out.")
            told[i] = replace(unit, suggestion=advice)
    return told


def _explains(unit: Finding, other: Finding) -> bool:
    """Whether the readings would be those of a machine tool in the other unit."""
    if unit.where.channel not in (None, other.where.channel) or unit.where.run not in (None, other.where.run):
        return False
    low, high = PLAUSIBLE["temperature"]
    gain, offset = unit.evidence["gain"], unit.evidence.get("offset", 0.0)
    return bool(low <= (other.evidence["value"] - offset) / gain <= high)
