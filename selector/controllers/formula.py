"""A model as a person would write it: in readings and rises, without centres and scales.

The polynomial is expanded in exact rational arithmetic; each coefficient is rounded once, at the end.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from fractions import Fraction

from selector.controllers.evaluator import Equations
from selector.controllers.model_file import Input, State, Term

Powers = tuple[tuple[str, int], ...]
Polynomial = tuple[float, dict[Powers, float]]
"""Intercept, and coefficient per product of powers; () is never a key."""

SIGNIFICANT_DIGITS = 5

# A coefficient that contributes less than this share of the largest contribution is left from cancelling rounding
# errors of the fit; float64 itself resolves 1e-16 of it.
_NEGLIGIBLE = 1e-12

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def physical_coefficients(model: Equations) -> dict[str, Polynomial]:
    """Per output, the polynomial [µm] in rises, readings and their lags instead of scaled values.

    The key ``(("T1", 1), ("T3", 1))`` is ΔT1·ΔT3 (a rise) or T1·T3 (absolute); names are in the model's order.
    """
    return {output.name: _expanded(model, output.intercept, output.terms) for output in model.outputs}


def physical_slopes(model: Equations) -> dict[str, Polynomial]:
    """As `physical_coefficients`, for the position-dependent parts [µm/m]; outputs without one are left out."""
    return {
        output.name: _expanded(model, output.position.intercept, output.position.terms)
        for output in model.outputs
        if output.position is not None
    }


def formula_text(model: Equations) -> str:
    """One line per output, e.g. ``Z = −1.871 + 6.0476·ΔT1 + 2.6667·ΔT3``; ends without a line end."""
    slopes = physical_slopes(model)
    lines = []
    for output, (intercept, terms) in zip(model.outputs, physical_coefficients(model).values(), strict=True):
        line = f"{output.name} = {_sum(model, intercept, terms)}"
        if output.position is not None:
            at = f"P{output.position.axis} − {_number(output.position.reference_m)} m"
            at = at.replace("− −", "+ ")
            line += f" + ({_sum(model, *slopes[output.name])})·({at})"
        lines.append(line)
    return "\n".join(lines)


def legend_text(model: Equations) -> str:
    """One line per input: its symbol, what it is, its unit and the range that the model has seen."""
    lines = []
    for item in model.inputs:
        unit = "K" if item.unit == "degC" and item.reference == "rise" else item.unit.replace("degC", "°C")
        meaning = "rise against the start" if item.reference == "rise" else "reading"
        place = f" ({item.place})" if item.place else ""
        low, high = _number(item.valid_min), _number(item.valid_max)
        lines.append(f"{_symbol(item)}: {item.role} {item.name}{place}, {meaning}, {low} … {high} {unit}")
    return "\n".join(lines)


def _expanded(model: Equations, intercept: float, terms: Iterable[Term]) -> Polynomial:
    variables: list[Input | State] = [*model.inputs, *model.states]
    order = {item.name: i for i, item in enumerate(variables)}
    scaling = {item.name: (Fraction(item.centre), Fraction(item.scale)) for item in variables}
    total: dict[Powers, Fraction] = {(): Fraction(intercept)}
    for term in terms:
        product: dict[Powers, Fraction] = {(): Fraction(term.coefficient)}
        for name in sorted(term.powers, key=order.__getitem__):
            power, (centre, scale) = term.powers[name], scaling[name]
            factor = {
                k: math.comb(power, k) * (-centre) ** (power - k) / scale**power for k in range(power + 1)
            }  # ((v − c) / s)^p by the binomial theorem
            product = {
                key + (((name, k),) if k else ()): value * weight
                for key, value in product.items()
                for k, weight in factor.items()
                if weight
            }
        for key, value in product.items():
            total[key] = total.get(key, Fraction(0)) + value
    constant = _rounded(total.pop(()))
    ranked = sorted(total.items(), key=lambda item: (sum(p for _, p in item[0]), [(order[n], p) for n, p in item[0]]))
    return constant, {key: _rounded(value) for key, value in ranked if value}


def _rounded(value: Fraction) -> float:
    try:
        return float(value)
    except OverflowError:
        return math.inf if value > 0 else -math.inf


def _sum(model: Equations, intercept: float, terms: Mapping[Powers, float]) -> str:
    symbols = {item.name: _symbol(item) for item in model.inputs}
    reach = {item.name: max(abs(item.valid_min), abs(item.valid_max)) for item in model.inputs}
    for state in model.states:
        symbols[state.name] = f"lag({symbols[state.source]}, {_number(state.tau_s)} s)"
        reach[state.name] = reach[state.source]
    sizes = {key: abs(value) * math.prod(reach[name] ** power for name, power in key) for key, value in terms.items()}
    largest = max(sizes.values(), default=0.0)
    parts = []
    if intercept != 0.0 or not terms:
        parts.append((intercept, _number(abs(intercept))))
    for key, value in terms.items():
        if largest > 0.0 and sizes[key] < _NEGLIGIBLE * largest:
            continue
        product = "·".join(
            symbols[name] + (str(power).translate(_SUPERSCRIPTS) if power > 1 else "") for name, power in key
        )
        parts.append((value, f"{_number(abs(value))}·{product}"))
    text = ("−" if parts[0][0] < 0 else "") + parts[0][1]
    return text + "".join(f" {'−' if value < 0 else '+'} {part}" for value, part in parts[1:])


def _symbol(item: Input) -> str:
    # an operator or a blank inside a name would read as part of the formula
    name = item.name if item.name.replace("_", "a").isalnum() else f"[{item.name}]"
    return f"Δ{name}" if item.reference == "rise" else name


def _number(value: float) -> str:
    """Five significant digits, as in print: a true minus sign, powers of ten written out."""
    text = f"{value:.{SIGNIFICANT_DIGITS}g}"
    if "e" in text:
        digits, exponent = text.split("e")
        text = f"{digits}·10{str(int(exponent)).translate(_SUPERSCRIPTS)}"
    return text.replace("-", "−")
