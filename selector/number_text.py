"""How numbers and lists are written for people, on the screen, in reports and in figures."""

import math
import re
from collections.abc import Sequence
from itertools import zip_longest

SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def round_below(value: float) -> float:
    """The largest of 1, 2, 5 times a power of ten that is not above a value, which is above 0."""
    power = 10.0 ** math.floor(math.log10(value))
    return next(times * power for times in (5.0, 2.0, 1.0) if times * power <= value * (1.0 + 1e-9))


def number_text(value: float | None, digits: int = 3) -> str:
    """A number with some significant digits, a true minus sign and powers of ten written out; a dash for none.

    >>> number_text(-83.64), number_text(1.5e-7), number_text(float("nan")), number_text(123456.0)
    ('−83.6', '1.50·10⁻⁷', '–', '123456')
    """
    if value is None or not math.isfinite(value):
        return "–"
    if value == 0:
        return "0"
    if not 1e-4 <= abs(value) < 1e7:
        mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
        return f"{mantissa}·10{str(int(exponent)).translate(SUPERSCRIPTS)}".replace("-", "−")
    rounded = float(f"{value:.{digits - 1}e}")
    decimals = max(0, digits - 1 - math.floor(math.log10(abs(rounded))))
    return f"{value:.{decimals}f}".replace("-", "−")


def span_text(seconds: float | None) -> str:
    """A time span in the unit that makes it readable, e.g. ``"1 h 30 min"``."""
    if seconds is None or not math.isfinite(seconds):
        return "–"
    if seconds < 0:
        return f"−{span_text(-seconds)}"
    if seconds < 60:
        return f"{seconds:.3g} s"
    minutes = round(seconds / 60)
    if minutes < 60:
        return f"{seconds / 60:.3g} min"
    return f"{minutes // 60} h {minutes % 60} min" if minutes % 60 else f"{minutes // 60} h"


def listed(names: Sequence[str], word: str = "and") -> str:
    """Names in a sentence."""
    return "".join(names) if len(names) < 2 else ", ".join(names[:-1]) + f" {word} " + names[-1]


def shortened(name: str, longest: int) -> str:
    """A name of so many letters at most, without its middle."""
    return name if len(name) <= longest else f"{name[: longest // 2]}…{name[(longest // 2) + 1 - longest :]}"


def told_apart(names: Sequence[str], longest: int) -> list[str]:
    """Names of so many letters at most, without their middle; of those that would be alike what differs is shown."""
    rest = {name: name for name in names}
    for _ in range(9):
        groups: dict[str, list[str]] = {}
        for name, text in rest.items():
            groups.setdefault(shortened(text, longest), []).append(name)
        for alike in [several for several in groups.values() if len(several) > 1]:
            letters = enumerate(zip_longest(*(rest[name] for name in alike)))
            differs = next((at for at, several in letters if len(set(several)) > 1), 0)
            start = max(rest[alike[0]].rfind(" ", 0, differs) + 1, differs - longest // 4, 1)
            rest.update({name: f"…{rest[name][start:]}" for name in alike})
    return [shortened(rest[name], longest) for name in names]


def natural_key(name: str) -> tuple[tuple[int, int, str], ...]:
    """Key under which ``r2`` sorts before ``r10``."""
    parts = re.split(r"(\d{1,18})", name.casefold())
    return tuple((1, int(part), "") if part.isascii() and part.isdigit() else (0, 0, part) for part in parts)
