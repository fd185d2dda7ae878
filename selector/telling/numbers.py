"""Numbers, spans and places as a person reads them."""

import math
import re
from collections.abc import Iterable

from selector.findings import Where
from selector.number_text import SUPERSCRIPTS, number_text, span_text

NONE = "–"


def uncertain_text(value: float, error: float, least: int = 4) -> str:
    """A value ± its standard error: the error with two digits, the value with at least so many.

    Four are for formulas that are computed with: terms that move together need more digits than their errors say.

    >>> uncertain_text(6.04762, 0.312), uncertain_text(6.04762, 0.312, least=0)
    ('6.048 ± 0.31', '6.05 ± 0.31')
    """
    if not math.isfinite(value):
        return NONE
    if not math.isfinite(error) or error <= 0:
        return number_text(value, 4)
    if max(abs(value), error) < 1e-3 or max(abs(value), error) >= 1e7:
        power = math.floor(math.log10(max(abs(value), error)))
        inner = uncertain_text(value / 10.0**power, error / 10.0**power, least)
        return f"({inner})·10{str(power).translate(SUPERSCRIPTS)}"
    wanted = [1 - math.floor(math.log10(error))]
    if value and least:
        wanted.append(least - 1 - math.floor(math.log10(abs(value))))
    decimals = min(max(0, *wanted), 9)
    # plus 0.0: no minus sign before zeros
    told = round(value, decimals) + 0.0
    return f"{told:.{decimals}f} ± {error:.{max(0, min(wanted[0], 9))}f}".replace("-", "−")


def given_text(value: float) -> str:
    """A number that somebody gave, as it was given: up to six digits, without those that say nothing.

    >>> given_text(0.9950), given_text(20.0), given_text(-0.0053), given_text(1.5e-7)
    ('0.995', '20', '−0.0053', '1.5·10⁻⁷')
    """
    mantissa, times, power = number_text(value, 6).partition("·")
    return (mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa) + times + power


def p_text(value: float) -> str:
    """A probability; one that is too small to be computed is not nothing.

    >>> p_text(0.0), p_text(0.0321)
    ('below 10⁻³⁰⁰', '0.032')
    """
    return f"below 10{'-300'.translate(SUPERSCRIPTS)}" if value < 1e-300 else number_text(value, 2)


def beside_text(value: float, scale: float) -> str:
    """A value with the decimals that a larger one beside it has when it is told with three digits.

    >>> beside_text(-0.0441, 0.773), beside_text(-0.0389, 17.0), beside_text(0.249, 13.8)
    ('−0.044', '0.0', '0.2')
    """
    most = max(abs(value), abs(scale))
    if not math.isfinite(value) or not 1e-4 <= most < 1e7:
        return number_text(value)
    text = f"{value:.{max(0, 2 - math.floor(math.log10(most)))}f}"
    return text.replace("-", "−") if float(text) else text.replace("-", "")


def share_text(value: float) -> str:
    """A share as a percentage."""
    return f"{100 * value:.0f} %" if math.isfinite(value) else NONE


def span_range(seconds: Iterable[float]) -> str:
    """The shortest and the longest of some time spans, or the one that all of them are."""
    told = list(dict.fromkeys(span_text(one) for one in sorted(seconds)))
    return NONE if not told else told[0] if len(told) == 1 else f"{told[0]} to {told[-1]}"


def ms_text(seconds: float) -> str:
    """A short time in milliseconds."""
    return f"{number_text(1e3 * seconds)} ms"


def place_text(where: Where) -> str:
    """The place of a finding in a few words, empty when it speaks of everything."""
    parts = [part for part in (file_name(where.file or ""), where.run, where.channel) if part]
    if where.from_s is not None or where.to_s is not None:
        start, end = ("" if t is None else span_text(t) for t in (where.from_s, where.to_s))
        parts.append(f"at {start}" if start == end else f"{start} to {end}" if end else f"from {start}")
    return ", ".join(parts)


def file_name(path: str) -> str:
    """The last part of a path of any system: a report says which file, not where somebody keeps it."""
    return re.split(r"[\\/]", path.rstrip("\\/"))[-1]
