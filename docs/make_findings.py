"""Writes docs/reference/findings.md from the tables of findings that stand beside the code that makes them."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

from selector.findings import Kind, Kinds

DOCS = Path(__file__).parent
PAGE = DOCS / "reference" / "findings.md"

HEAD = """# Findings: what the tool says about data and models

Written by the program (`make reference`); do not edit. A finding has an `id`, a level, a statement with the numbers, a
place (channel, run, stretch), the evidence, a suggestion, and the action that was taken because of it
([contracts](contracts.md)). Here is every id by who says it: what it means, and what to do in general. What is left out
of the data is said in the finding itself.

Levels: `info` is good to know, `warning` can change what comes out, `error` makes data or a result unusable there.
"""
ROOMS = {
    "quality": ("Quality of recordings", "every command that reads recordings, above all `selector describe`"),
    "readers": ("Reading", "every command that reads recordings, above all `selector describe`"),
    "sensors": ("Sensors and groups", "`selector select` and the workbench"),
    "models": ("Fitting", "`selector select`"),
    "selection": ("Selection", "`selector select`"),
    "controllers": ("Model files and controls", "`selector export`, `selector apply`"),
    "physics": ("All simulations", "`selector simulate`, `selector diagnose --model`"),
    "physics.thermal": ("Thermal models", "`selector simulate thermal`, `selector predict`"),
    "physics.drive": ("Feed drives", "`selector simulate drive`"),
    "physics.vibration": ("Vibration", "`selector simulate vibration`"),
    "physics.gauging": ("Gauging", "`selector simulate gauging`"),
    "diagnosis": ("Diagnosis", "`selector diagnose`"),
    "adaptation": ("Touch-offs", "`selector adapt`"),
    "study": ("Models applied", "`selector apply`, `selector adapt`, `selector fleet watch`"),
    "cli.shared": ("Single commands", "the commands that the findings name"),
}
"""Room with a table of findings → its heading, and who says what is in it; in the order of the page.

A room comes after those whose findings it also makes.
"""


def tables() -> dict[str, Kinds]:
    """Room → the findings that it makes."""
    return {room: import_module(f"selector.{room}.finding_table").FINDINGS for room in ROOMS}


def page() -> str:
    """The page as Markdown."""
    lines, shown = [HEAD], dict[str, str]()
    for room, kinds in tables().items():
        title, said_by = ROOMS[room]
        lines += [f"## {title}\n", f"Said by {said_by}.\n"]
        lines += ["| id | level | what it means | what to do |", "|---|---|---|---|"]
        elsewhere = []
        for id_, kind in sorted(kinds.items()):
            if id_ in shown:
                elsewhere.append(f"`{id_}` ({shown[id_]})")
            else:
                shown[id_] = title
                lines.append(_row(id_, kind))
        lines += ["", f"Also: {', '.join(elsewhere)}.\n"] if elsewhere else [""]
    return "\n".join(lines).rstrip() + "\n"


def _row(id_: str, kind: Kind) -> str:
    cells = f"`{id_}`", ", ".join(kind.levels), _sentence(kind.title), _sentence(kind.advice) or "–"
    return "| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |"


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:].removesuffix(".")


def main() -> None:
    """Writes the page."""
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
    print(f"wrote {PAGE.relative_to(DOCS.parent)}")


if __name__ == "__main__":
    main()
