"""Is an answer to a real recording right? A case's row, the sums of many, and the table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from benchmarks.real.case import RealCase

Row = dict[str, Any]
FOUND = ("right", "right, tolerated", "set")
"""Credits of positives that count as found."""
_BINS = np.linspace(0.0, 1.0, 6)


def judged(case: RealCase, told: Mapping[str, Any]) -> Row:
    """The row of a case: what the tool said beside what is right."""
    row: Row = {"case": case.name, "kind": case.kind, "right": list(case.right), "verdicts": list(case.verdicts)}
    if "error" in told:
        failed = {"credit": "failed", "verdict": "", "names": told["error"], "named": [], "fit": {}, "evidence": []}
        return row | failed | {"seconds": None, "rows": None}
    answer = told["answer"]
    named = _once([_name(case, effect) for effect in answer["effects"]])
    return row | {
        "credit": _credit(case, answer["verdict"], named),
        "verdict": answer["verdict"],
        "names": ", ".join(_shown(one) for one in named),
        "named": named,
        "fit": {name: _errors(fit) for name, fit in answer["fit"].items()},
        "evidence": [_evidence(one) for one in told.get("evidence", ()) if not one["named"]],
        "rows": told["rows"],
        "seconds": told["seconds"],
    }


def _name(case: RealCase, effect: Mapping[str, Any]) -> dict[str, Any]:
    others = list(effect.get("cannot_be_told_from") or ())
    if effect["id"] in case.right:
        credit = "right"
    elif effect["id"] in case.tolerated:
        credit = "tolerated"
    else:
        credit = "set" if set(others) & set(case.right) else "wrong"
    return {
        "id": effect["id"],
        "credit": credit,
        "or": others,
        "confidence": effect["confidence"],
        "share": effect["share"],
        "suspected": effect["suspected"],
    }


def _once(named: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """An id that is named several times, once: with its largest confidence and share, and how often."""
    found: dict[str, dict[str, Any]] = {}
    for one in named:
        known = found.setdefault(one["id"], one | {"times": 0})
        known["times"] += 1
        for key in ("confidence", "share"):
            known[key] = max(known[key], one[key])
    return list(found.values())


def _evidence(one: Mapping[str, Any]) -> str:
    """How an id that is right stood, where it was not named."""
    return f"{one['id']} in {one['channel']}: " + (one["note"] or f"score {one['gain']:.3g}, p {one['p_value']:.2g}")


def _credit(case: RealCase, verdict: str, named: Sequence[Mapping[str, Any]]) -> str:
    said = {one["credit"] for one in named}
    if "wrong" in said:
        return "right and wrong" if said & {"right", "set"} else "wrong"
    if not named:
        return "right" if verdict in case.verdicts else "unexplained" if verdict == "unexplained" else "silent"
    if "right" in said:
        return "right, tolerated" if "tolerated" in said else "right"
    return "set" if "set" in said else "tolerated"


def _shown(one: Mapping[str, Any]) -> str:
    mark = {"right": "+", "set": "+", "tolerated": "~", "wrong": "-"}[one["credit"]]
    doubt = "?" if one["suspected"] else ""
    times = f" x{one['times']}" if one["times"] > 1 else ""
    rivals = "/" + "/".join(one["or"]) if one["or"] else ""
    return f"{mark}{one['id']}{rivals}{times}{doubt} {one['confidence']:.2f} ({one['share']:.2f})"


def _errors(fit: Mapping[str, Any]) -> dict[str, Any]:
    held = fit["heldout"]
    return {
        "simulated": held["rmse_before"],
        "recalibrated": fit["recalibrated_heldout_rmse"],
        "after": held["rmse_after"],
        "floor": held["noise_floor"],
        "unit": fit["unit"],
    }


def sums(rows: Sequence[Row]) -> dict[str, Any]:
    """Counts and calibration over many cases; a name that is tolerated counts in none."""
    positives = [row for row in rows if row["kind"] == "positive"]
    controls = [row for row in rows if row["kind"] == "control"]
    counted = [one for row in rows for one in row["named"] if one["credit"] != "tolerated"]
    confidence = np.array([one["confidence"] for one in counted], dtype=np.float64)
    is_right = np.array([one["credit"] != "wrong" for one in counted], dtype=bool)
    seconds = [row["seconds"] for row in rows if row["seconds"] is not None]
    return {
        "positives": len(positives),
        "right or set, nothing wrong beside": sum(row["credit"] in FOUND for row in positives),
        "right or set, something wrong beside": sum(row["credit"] == "right and wrong" for row in positives),
        "wrong": sum(row["credit"] == "wrong" for row in positives),
        "tolerated only": sum(row["credit"] == "tolerated" for row in positives),
        "silent": sum(row["credit"] in ("silent", "unexplained") for row in positives),
        "controls": len(controls),
        "controls with a wrong name": sum("wrong" in row["credit"] for row in controls),
        "controls with a tolerated name": sum(row["credit"] == "tolerated" for row in controls),
        "controls unexplained": sum(row["credit"] == "unexplained" for row in controls),
        "failed": sum(row["credit"] == "failed" for row in rows),
        "names": len(counted),
        "mean confidence of right names": _mean(confidence[is_right]),
        "mean confidence of wrong names": _mean(confidence[~is_right]),
        "largest confidence of a wrong name": float(confidence[~is_right].max()) if (~is_right).any() else None,
        "calibration error (ECE)": _calibration_error(confidence, is_right),
        "median seconds": float(np.median(seconds)) if seconds else None,
    }


def _mean(values: np.ndarray) -> float | None:
    return float(values.mean()) if len(values) else None


def _calibration_error(confidence: np.ndarray, is_right: np.ndarray) -> float | None:
    """Mean distance of confidence and share right, over bins of a fifth."""
    if not len(confidence):
        return None
    bins = np.clip(np.digitize(confidence, _BINS) - 1, 0, len(_BINS) - 2)
    parts = [bins == k for k in np.unique(bins)]
    return float(sum(part.mean() * abs(confidence[part].mean() - is_right[part].mean()) for part in parts))


def text_of(rows: Sequence[Row], summed: Mapping[str, Any]) -> str:
    """The table as text: + right, ~ tolerated, - wrong, ? suspected; confidence and share behind a name."""
    lines = [f"{'case':26s} {'kind':9s} {'credit':17s} {'verdict':17s} {'rows':>6s} {'s':>6s}  names"]
    for row in rows:
        size = "     -      -" if row["seconds"] is None else f"{row['rows']:6d} {row['seconds']:6.1f}"
        lines.append(
            f"{row['case']:26s} {row['kind']:9s} {row['credit']:17s} {row['verdict']:17s} {size}  {row['names']}"
        )
        lines += [f"{'':28s}{name}: {_course(fit)}" for name, fit in row["fit"].items()]
        lines += [f"{'':28s}not named: {one}" for one in row["evidence"]]
    lines.append("")
    lines += [f"{name:40s} {_number(value)}" for name, value in summed.items()]
    return "\n".join(lines) + "\n"


def _course(fit: Mapping[str, Any]) -> str:
    steps = " -> ".join(_number(fit[key]) for key in ("simulated", "recalibrated", "after"))
    floor = "" if fit["floor"] is None else f", floor {_number(fit['floor'])}"
    return f"{steps} {fit['unit']}{floor}"


def _number(value: Any) -> str:
    return "-" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)
