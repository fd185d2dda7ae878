"""The model as a person would write it: readings and rises, coefficients in physical units with their errors."""

from collections.abc import Iterator

from selector.models.design import Term
from selector.number_text import SUPERSCRIPTS, number_text, span_text
from selector.selection import Selection
from selector.telling.numbers import NONE, uncertain_text


def formula_text(selection: Selection, response: str) -> str:
    """One line, e.g. ``Z = (−1.871 ± 0.12) + (6.048 ± 0.031)·ΔT1``."""
    model = selection.models[response]
    terms, coefficients, errors = model.physical()
    parts = []
    if model.has_intercept:
        parts.append(f"({uncertain_text(float(coefficients[0]), float(errors[0]))})")
    for term, value, error in zip(terms, coefficients[1:], errors[1:], strict=True):
        parts.append(f"({uncertain_text(float(value), float(error))})·{term_text(selection, term)}")
    return f"{response} = {' + '.join(parts) or '0'}"


def legend_rows(selection: Selection) -> Iterator[tuple[str, str]]:
    """(symbol, meaning) of every variable in the formula."""
    for name in selection.recipe.design.variables:
        lag, source = selection.recipe.design.lag_and_source(name)
        if _is_rise(selection, source):
            meaning = f"rise of {source} since the start of the run [K]"
        else:
            meaning = f"reading of {source} [{unit_of(selection, name)}]"
        if lag:
            meaning += f", lagged with the time constant {lag.tau_s:.6g} s"
        yield variable_text(selection, name), meaning


def coefficient_rows(selection: Selection, response: str) -> Iterator[tuple[str, str, str, str]]:
    """(term, coefficient ± standard error, unit, VIF), the intercept first."""
    model = selection.models[response]
    terms, coefficients, errors = model.physical()
    vif = {tuple(sorted(term.powers)): float(value) for term, value in zip(model.terms, model.vif, strict=True)}
    if model.has_intercept:
        yield "intercept", uncertain_text(float(coefficients[0]), float(errors[0]), least=0), "µm", NONE
    for term, value, error in zip(terms, coefficients[1:], errors[1:], strict=True):
        inflation = vif.get(tuple(sorted(term.powers)))
        unit = _unit_of_term(selection, term)
        text = uncertain_text(float(value), float(error), least=0)
        yield term_text(selection, term), text, unit, number_text(inflation)


def term_text(selection: Selection, term: Term) -> str:
    """A term, e.g. ``ΔT1·ΔT3²``."""
    return "·".join(
        variable_text(selection, name) + (str(power).translate(SUPERSCRIPTS) if power > 1 else "")
        for name, power in term.powers
    )


def variable_text(selection: Selection, name: str) -> str:
    """The symbol of a variable: ``ΔT1`` for a rise, ``lag(ΔT1, 30 min)`` for its lag."""
    lag, source = selection.recipe.design.lag_and_source(name)
    # an operator or a blank inside a name would read as part of the formula
    plain = source if source.replace("_", "a").isalnum() else f"[{source}]"
    symbol = f"Δ{plain}" if _is_rise(selection, source) else plain
    return f"lag({symbol}, {span_text(lag.tau_s)})" if lag else symbol


def unit_of(selection: Selection, variable: str) -> str:
    """Unit of a variable: K for a rise, °C for a reading, rpm for a spindle speed."""
    _, source = selection.recipe.design.lag_and_source(variable)
    if source not in selection.recipe.sensors:
        return "rpm"
    return "K" if _is_rise(selection, source) else "°C"


def _unit_of_term(selection: Selection, term: Term) -> str:
    powers: dict[str, int] = {}
    for name, power in term.powers:
        # a coefficient is per difference, and a difference of °C is one of K
        unit = unit_of(selection, name).replace("°C", "K")
        powers[unit] = powers.get(unit, 0) + power
    below = "·".join(unit + (str(power).translate(SUPERSCRIPTS) if power > 1 else "") for unit, power in powers.items())
    return f"µm/{below}" if len(powers) < 2 else f"µm/({below})"


def _is_rise(selection: Selection, source: str) -> bool:
    return selection.options.reference == "rise" and source in selection.recipe.sensors
