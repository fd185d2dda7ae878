"""Makes the picture of the colours: `python docs/images/make_colours.py` writes docs/images/colours.svg."""

from __future__ import annotations

from pathlib import Path

from selector.figures import style

PICTURE = Path(__file__).with_name("colours.svg")
ROLES = {
    "measured": style.MEASURED,
    "predicted, simulated": style.PREDICTED,
    "what is left: error, residual": style.RESIDUAL,
    "as it was, without": style.BEFORE,
    "chosen, named, corrected": style.CHOSEN,
    "beside it: the mean": style.BASELINES["mean"],
    "beside it: all sensors": style.BASELINES["all sensors"],
    "beside it: anything else": style.OTHER_BASELINE,
}
SCALES = {"alike": style.LIKENESS_SCALE, "harm": style.HARM_SCALE}
_ROW, _WIDTH = 26, 420


def picture() -> str:
    """The roles with their colours, below them the two scales, as SVG."""
    rows = []
    for number, (role, colour) in enumerate(ROLES.items()):
        y = _ROW * number + 14
        rows.append(f'<path d="M10 {y}H70" stroke="{colour}" stroke-width="4"/>')
        rows.append(_text(84, y, f"{role} · {colour}"))
    for number, (name, scale) in enumerate(SCALES.items(), start=len(ROLES)):
        y = _ROW * number + 14
        stops = "".join(f'<stop offset="{place}" stop-color="{colour}"/>' for place, colour in scale)
        rows.append(f'<linearGradient id="{name}">{stops}</linearGradient>')
        rows.append(f'<rect x="10" y="{y - 8}" width="60" height="16" fill="url(#{name})"/>')
        rows.append(_text(84, y, f"scale of {name}: from little to much"))
    height = _ROW * (len(ROLES) + len(SCALES)) + 4
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {_WIDTH} {height}" width="{_WIDTH}" role="img">'
    return "\n".join(
        [
            head,
            "<title>Colours by role</title>",
            f'<rect width="{_WIDTH}" height="{height}" fill="#fff"/>',
            *rows,
            "</svg>\n",
        ]
    )


def _text(x: float, y: float, text: str) -> str:
    font = 'font-family="DejaVu Sans, Arial, sans-serif" font-size="13"'
    return f'<text x="{x}" y="{y + 4}" {font} fill="{style.INK}">{text}</text>'


if __name__ == "__main__":
    PICTURE.write_text(picture(), encoding="utf-8", newline="\n")
