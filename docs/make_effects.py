"""Writes docs/reference/effects.md from the catalogue, and with `--pictures` a picture of each effect (minutes)."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from itertools import groupby
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from proving_ground.case import Case, Scenario
from proving_ground.scenarios import scenarios
from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.catalogue import catalogue
from selector.diagnosis.effects.effect import Effect
from selector.diagnosis.matching.alignment import comparison_of
from selector.diagnosis.shown_units import unit_words
from selector.figures.panels import shown_samples
from selector.figures.style import time_unit
from selector.number_text import number_text

Vector = NDArray[np.float64]
DOCS = Path(__file__).parent
PAGE = DOCS / "reference" / "effects.md"
PICTURES = DOCS / "images" / "effects"
STRENGTHS = (40.0, 20.0, 12.0)
"""Strengths d′ of the pictured effects, the first that a case can have: strong, so that they can be seen."""
SEED = 1

HEAD = """# Effects that a diagnosis can name

Written by the program (`make reference`); do not edit. The same on the screen: `selector effects`, and `selector
effects thermal.memory` for one of them. An effect of your own: [write an effect](../how-to/write-an-effect.md).

Each picture is a simulated case of the blind proof that conceals the effect, much stronger than it need be to be found.
Grey: recorded minus simulated, in the run that shows it best. Blue: the shape of the catalogue that fits it best.
"""
FAMILIES = {
    "data": "Faults of the data",
    "thermal": "Heat",
    "drive": "Feed drives",
    "vibration": "Vibration",
    "gauging": "Gauging",
    "flow": "Flow",
}
_WIDTH, _HEIGHT = 640, 190
_LEFT, _RIGHT, _TOP, _BOTTOM = 56, 12, 14, 30
_MOST_TURNS = 60
_SAME = 0.05


def shipped() -> list[Effect]:
    """The effects of this program, without those of other packages that are installed beside it."""
    return [effect for effect in catalogue() if effect.variants.__module__.startswith("selector.")]


def page() -> str:
    """The page as Markdown."""
    lines = [HEAD]
    for family, members in groupby(shipped(), key=lambda effect: effect.family):
        lines.append(f"## {FAMILIES.get(family, family)}\n")
        lines += [text for effect in members for text in _section(effect)]
    return "\n".join(lines).rstrip() + "\n"


def _section(effect: Effect) -> list[str]:
    facts = {
        "Enters": f"{effect.enters}; acts at: {effect.acts_at}",
        "Needs": effect.needs,
        "Resembles": ", ".join(f"[`{id_}`](#{_anchor(id_)})" for id_ in effect.confounders)
        or "nothing in the catalogue",
        "Refuted by": effect.refuted_by,
        "Shown by": effect.experiment,
        "Source": effect.reference,
    }
    lines = [f"### `{effect.id}`\n", f"**{effect.title[:1].upper()}{effect.title[1:]}.** {effect.physics}\n"]
    if (PICTURES / f"{effect.id}.svg").exists():
        lines.append(f"![{effect.title}](../images/effects/{effect.id}.svg)\n")
    lines += ["| | |", "|---|---|", *(f"| {name} | {_cell(text)} |" for name, text in facts.items()), ""]
    if effect.parameters:
        lines += ["| parameter | from | to | unit | meaning |", "|---|---|---|---|---|"]
        lines += [
            f"| `{one.name}` | {number_text(one.low)} | {number_text(one.high)} | {unit_words(one.unit) or '–'} | "
            f"{meaning} |"
            for one, meaning in ((one, _cell(one.meaning)) for one in effect.parameters)
        ]
        lines.append("")
    return lines


def picture(effect: Effect) -> str | None:
    """The effect's best shape on a case of the blind proof, as SVG; None where no case shows it."""
    for comparison, response in _cases(effect):
        fitted = _best_fit(comparison, response, effect)
        if fitted is not None:
            return _svg(comparison, response, *fitted, effect)
    return None


def _cases(effect: Effect) -> Iterator[tuple[Comparison, str]]:
    for scenario in scenarios():
        if scenario.name.startswith(f"{effect.id}/"):
            case = _built(scenario)
            if case is None:
                continue
            comparison = comparison_of(case.recording, case.simulation, responses=case.responses)
            for response in case.truth.effects[0].channels:
                if response in comparison.responses:
                    yield comparison, response


def _built(scenario: Scenario) -> Case | None:
    for strength in STRENGTHS:
        try:
            return scenario.build(SEED, strength)
        except ValueError:  # the effect cannot be as strong on this machine
            continue
    return None


def _best_fit(comparison: Comparison, response: str, effect: Effect) -> tuple[Vector, Vector] | None:
    """(recorded minus recalibrated simulation, fitted course) of the shape that leaves least; None without a shape."""
    target = comparison.difference(response)
    seen = np.isfinite(target)
    free = np.column_stack([np.ones(len(target)), comparison.simulated_course(response)])
    best, least = None, np.inf
    for variant in effect.variants(comparison, response):
        table = np.column_stack([free, variant.columns])
        size = np.maximum(np.linalg.norm(table[seen], axis=0), 1e-300)
        weights = np.linalg.lstsq(table[seen] / size, target[seen], rcond=1e-9)[0] / size
        left = float(np.sum((target[seen] - table[seen] @ weights) ** 2))
        if left < least:
            best, least = (target - free @ weights[:2], np.asarray(variant.columns @ weights[2:])), left
    return best


def _svg(comparison: Comparison, response: str, difference: Vector, course: Vector, effect: Effect) -> str:
    _, rows = max(
        comparison.rows_of_runs(), key=lambda run: float(np.sum((course[run[1]] - course[run[1]].mean()) ** 2))
    )
    time = comparison.time_s
    if np.var(course[rows]) < _SAME * np.var(course):
        # the same throughout a run: all runs, one after the other
        rows, time = slice(None), np.cumsum(np.maximum(np.diff(time, prepend=time[0]), 0.0))
    time, shape, left = time[rows] - time[rows][0], course[rows], difference[rows]
    turns = np.flatnonzero(np.diff(np.sign(shape - np.median(shape))))
    if len(turns) > 2 * _MOST_TURNS:
        # so quick that the run would be a band: the part around the largest reading
        middle = int(np.argmax(np.abs(shape)))
        half = (turns[-1] - turns[0]) * _MOST_TURNS // (2 * len(turns))
        part = slice(max(0, middle - half), middle + half)
        time, shape, left = time[part] - time[part][0], shape[part], left[part]
    width = max(1, len(left) // 300)
    left = np.convolve(np.pad(left, width // 2, mode="edge"), np.ones(width) / width, "valid")[: len(shape)]
    low, high = np.nanquantile(np.concatenate([shape, left]), (0.002, 0.998))
    low, high = min(low, float(shape.min())), max(high, float(shape.max()))
    unit, seconds = time_unit(float(time[-1]))
    inner = _HEIGHT - _TOP - _BOTTOM

    def points(values: Vector) -> str:
        kept = np.flatnonzero(np.isfinite(values))
        kept = kept[shown_samples(time[kept], values[kept], points=600)]
        x = _LEFT + (_WIDTH - _LEFT - _RIGHT) * time[kept] / max(float(time[-1]), 1e-300)
        y = _TOP + inner * (1.0 - (np.clip(values[kept], low, high) - low) / max(high - low, 1e-300))
        return " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))

    ends = f"{number_text(time[-1] / seconds)} {unit}"
    unit_y = unit_words(comparison.channel(response).unit)
    text = 'font-family="DejaVu Sans, Arial, sans-serif" font-size="11" fill="#555"'
    return "\n".join(
        [
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img">',
            f"<title>{effect.id}</title>",
            f'<rect width="{_WIDTH}" height="{_HEIGHT}" fill="#fff"/>',
            f'<path d="M{_LEFT} {_TOP}V{_TOP + inner}H{_WIDTH - _RIGHT}" fill="none" stroke="#8c8c8c"/>',
            f'<polyline points="{points(left)}" fill="none" stroke="#b5b5b5" stroke-width="1"/>',
            f'<polyline points="{points(shape)}" fill="none" stroke="#0072B2" stroke-width="2"/>',
            f'<text x="{_LEFT - 5}" y="{_TOP + 9}" text-anchor="end" {text}>{number_text(high, 2)}</text>',
            f'<text x="{_LEFT - 5}" y="{_TOP + inner}" text-anchor="end" {text}>{number_text(low, 2)}</text>',
            f'<text x="{_LEFT - 5}" y="{_TOP + inner / 2}" text-anchor="end" {text}>{unit_y}</text>',
            f'<text x="{_LEFT}" y="{_HEIGHT - 10}" {text}>0</text>',
            f'<text x="{_WIDTH - _RIGHT}" y="{_HEIGHT - 10}" text-anchor="end" {text}>{ends}</text>',
            "</svg>\n",
        ]
    )


def _anchor(id_: str) -> str:
    return id_.replace(".", "")


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def main() -> None:
    """Writes the page; with `--pictures` the pictures before it, of the effects named behind it or of all."""
    if "--pictures" in sys.argv:
        PICTURES.mkdir(parents=True, exist_ok=True)
        wanted = sys.argv[sys.argv.index("--pictures") + 1 :]
        for effect in shipped():
            drawn = picture(effect) if not wanted or effect.id in wanted else None
            if drawn is not None:
                (PICTURES / f"{effect.id}.svg").write_text(drawn, encoding="utf-8", newline="\n")
    PAGE.write_text(page(), encoding="utf-8", newline="\n")
    print(f"wrote {PAGE.relative_to(DOCS.parent)}")


if __name__ == "__main__":
    main()
