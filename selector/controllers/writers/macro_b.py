"""Words of FANUC custom macro B: numbers without an exponent, comments that nothing can end, short blocks."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from textwrap import wrap

from selector.controllers.program.text_of_program import plain
from selector.controllers.writers.refused import ExportRefusedError

LONGEST_BLOCK = 72
SIGNIFICANT_DIGITS = 12
"""Of a literal; the model has its inputs centred and scaled, so that 12 digits cost 1e-10 µm at 100 µm."""


LITERAL_ROUNDOFF = 5e-12
"""Largest relative rounding of a literal."""


def literal(value: float) -> str:
    """A number without an exponent, in `SIGNIFICANT_DIGITS`: ``6.0476``, ``10.``, ``[1.5/100000.]``.

    Raises
    ------
    ExportRefusedError
        It is too large or too small to be written.
    """
    if value == 0.0:
        return "0."
    if not 1e-20 <= abs(value) < 1e20:
        raise ExportRefusedError(
            f"the number {value:g}",
            expected="magnitudes from 1e-20 to 1e20",
            where="FANUC custom macro B",
            advice="find out which coefficient, centre or scale of the model file is so large or small",
        )
    if 0.1 <= abs(value) < 1e9:
        return _with_point(f"{value:.{SIGNIFICANT_DIGITS}g}")
    mantissa, exponent = f"{value:.{SIGNIFICANT_DIGITS - 1}e}".split("e")
    mantissa = _with_point(mantissa.rstrip("0"))
    power, sign = abs(int(exponent)), "/" if int(exponent) < 0 else "*"
    steps = [min(10, power - done) for done in range(0, power, 10)]
    return f"[{mantissa}{''.join(f'{sign}1{0:0{step}d}.' for step in steps)}]"


def minus(value: float) -> str:
    """What is appended to subtract a number: ``-6.5``, or ``+6.5`` for −6.5."""
    return f"-{literal(value)}" if value >= 0.0 else f"+{literal(-value)}"


def remarks(text: str) -> Iterator[str]:
    """Comment blocks: capital letters, digits, few signs, [ ] for ( ), so that nothing can end a comment or a block."""
    bracketed = plain(text).upper().translate(str.maketrans("():;", "[],,"))
    harmless = re.sub(r"[^A-Z0-9 .,+\-*/=\[\]]", " ", bracketed)
    yield from (f"({line})" for line in wrap(harmless, LONGEST_BLOCK - 2))


def limited(variable: int, low: str, high: str) -> Iterator[str]:
    """The variable becomes low if below it, high if above it."""
    yield f"IF[#{variable}LT{low}]THEN#{variable}={low}"
    yield f"IF[#{variable}GT{high}]THEN#{variable}={high}"


def product(to: int, coefficient: float, factors: Sequence[int]) -> Iterator[str]:
    """A coefficient times variables, in blocks that are not too long."""
    block = f"#{to}={literal(coefficient)}"
    for variable in factors:
        factor = f"*#{variable}"
        if len(block) + len(factor) > LONGEST_BLOCK:
            yield block
            block = f"#{to}=#{to}"
        block += factor
    yield block


def _with_point(text: str) -> str:
    return text if "." in text else f"{text}."
