"""Fills the marked block of docs/explanation/blind-proof.md from the score.json of a `selector prove`.

selector prove --out proof && python docs/make_proof_tables.py proof/score.json
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

PAGE = Path(__file__).parent / "explanation" / "blind-proof.md"
BEGIN = "<!-- from here: python docs/make_proof_tables.py score.json -->"
END = "<!-- up to here -->"
IN_A_SET = "right, in a set"


def filled(page: str, score: dict[str, Any]) -> str:
    """The page with the tables of this score between its marks.

    Raises
    ------
    ValueError
        The page has no such marks.
    """
    if page.count(BEGIN) != 1 or page.count(END) != 1:
        raise ValueError(f"{PAGE.name} has to hold {BEGIN!r} and {END!r} once each")
    before, rest = page.split(BEGIN)
    return before + "\n".join([BEGIN, "", *_tables(score), "", END]) + rest.split(END)[1]


def _tables(score: dict[str, Any]) -> Iterator[str]:
    seeds = score["seeds"]
    said = f"seeds {min(seeds)} to {max(seeds)}" if len(seeds) > 1 else f"seed {seeds[0]}"
    kind = "exam" if score["exam"] else "development"
    seals = f"seal of the cases `{score['seal'][:16]}…`, of the answers `{score['answers_sha256'][:16]}…`"
    yield f"{score['cases']} cases of {score['scenarios']} scenarios, {kind} {said}, version {score['version']};"
    yield f"{seals}. {len(score['failures'])} failed."
    yield ""
    rivals = score["rivals"]
    yield from _row("score", "this tool", "95 % interval", "cases", "first bar", "goal", "met", *rivals)
    yield from _row("---", "---:", "---", "---:", "---:", "---:", "---", *("---:" for _ in rivals))
    for row in (row for row in score["scores"] if row["n"]):
        other = [_of(table, row["score"]) for table in rivals.values()]
        yield from _row(
            row["score"],
            _value(row["value"], row["unit"]),
            "" if row["low"] is None else f"{_value(row['low'], row['unit'])} … {_value(row['high'], row['unit'])}",
            row["n"],
            "" if row["first_bar"] is None else _value(row["first_bar"], row["unit"]),
            "" if row["goal"] is None else _value(row["goal"], row["unit"]),
            "goal" if row["meets_goal"] else "first bar" if row["meets_first_bar"] else _missed(row),
            *other,
        )
    yield ""
    yield from _confusion(score["confusion"])


def _confusion(table: dict[str, Any]) -> Iterator[str]:
    yield f"What is taken for what, d′ ≥ {table['least_d_prime']:g}; numbers are cases:"
    yield ""
    yield from _row("true", "cases", "named", "in a set", "unexplained", "nothing", "taken for")
    yield from _row("---", "---:", "---:", "---:", "---:", "---:", "---")
    for true, counts, cases in zip(table["true"], table["counts"], table["cases"], strict=True):
        by = {said: n for said, n in zip(table["said"], counts, strict=True) if n}
        right = by.pop(true, 0)
        in_a_set = by.pop(IN_A_SET, 0)
        silent = [by.pop(said, 0) for said in ("unexplained", "nothing")]
        others = sorted(by.items(), key=lambda item: (-item[1], item[0]))
        taken = ", ".join(f"{said} {n}" if n > 1 else said for said, n in others)
        yield from _row(f"`{true}`", cases, *(n or "" for n in (right, in_a_set, *silent)), taken)


def _of(table: list[dict[str, Any]], title: str) -> str:
    row = next((row for row in table if row["score"] == title), None)
    return "" if row is None else _value(row["value"], row["unit"])


def _missed(row: dict[str, Any]) -> str:
    return "**no**" if row["meets_first_bar"] is False else ""


def _value(value: float | None, unit: str) -> str:
    if value is None:
        return "–"
    text = {"share": f"{100.0 * value:.1f} %", "s": f"{value:.3g} s"}.get(unit, f"{value:.3f}")
    return text.replace("-", "−")


def _row(*cells: object) -> Iterator[str]:
    yield "| " + " | ".join(str(cell) for cell in cells) + " |"


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    read = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    PAGE.write_text(filled(PAGE.read_text(encoding="utf-8"), read), encoding="utf-8")
