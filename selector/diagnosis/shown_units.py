"""Units and small numbers as people write them: µm where a machine moves by µm, a very small p as a bound."""

import re

_WORDS = {r"\bum\b": "µm", r"\bdegC\b": "°C", r"\bdegF\b": "°F", r"\^2": "²", r"\^3": "³"}
_BOUNDS = ((1e-6, "10⁻⁶"), (1e-3, "0.001"))


def unit_words(unit: str) -> str:
    """A unit as people write it.

    >>> unit_words("um/K"), unit_words("m/s^2"), unit_words("1")
    ('µm/K', 'm/s²', '')
    """
    if unit == "1":
        return ""
    for sign, word in _WORDS.items():
        unit = re.sub(sign, word, unit)
    return unit


def displayed(unit: str, size: float) -> tuple[float, str]:
    """Factor and unit in which a number of this size is shown: lengths in metres as µm or mm where they are small.

    >>> displayed("m", 2e-6), displayed("m", 0.02), displayed("N", 2e-6)
    ((1000000.0, 'µm'), (1000.0, 'mm'), (1.0, 'N'))
    """
    if unit == "m" and 0.0 < abs(size) < 1e-3:
        return 1e6, "µm"
    if unit == "m" and 0.0 < abs(size) < 1.0:
        return 1e3, "mm"
    return 1.0, unit_words(unit)


def p_words(p: float, relation: str = "") -> str:
    """A probability of two digits; one that is too small to matter how small is a bound.

    >>> p_words(0.153), p_words(2e-5), p_words(1e-300, "p = ")
    ('0.15', '< 0.001', 'p < 10⁻⁶')
    """
    for bound, word in _BOUNDS:
        if p < bound:
            return f"{relation.replace('= ', '')}< {word}"
    return f"{relation}{p:.2g}"
