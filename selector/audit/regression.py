"""Whether the printed models and pairs of R² follow from one recording."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from selector.audit.printed import (
    ENTRY_HALF_UNIT,
    PAIRS,
    Y_THREE_SENSORS,
    Y_TWO_SENSORS,
    Z_THREE_SENSORS,
    Z_TWO_SENSORS,
    AuditLine,
    PrintedPair,
    judged,
)
from selector.types import Vector

_PAIR = "R² and adjusted R²"
_MODELS = "models"


def r2_lines(rises: Mapping[str, Vector], responses: Mapping[str, Vector]) -> list[AuditLine]:
    """Printed pairs of R² on the reconstruction; contradictions (b) and (d). Rises [K], responses [µm]."""
    lines = []
    for pair in PAIRS:
        sensors = " & ".join("Δ" + name for name in pair.sensors)
        found = {name: r2_pair([rises[s] for s in pair.sensors], values) for name, values in responses.items()}
        for position, (label, printed) in enumerate((("R²", pair.r2), ("adjusted R²", pair.adjusted_r2))):
            values = {name: both[position] for name, both in found.items()}
            lines.append(
                judged(
                    _PAIR,
                    f"{label} of {sensors}",
                    f"{printed:.4f}",
                    ", ".join(f"{value:.4f} ({name})" for name, value in values.items()),
                    all(abs(value - printed) <= ENTRY_HALF_UNIT for value in values.values()),
                    "linear regression on the reconstruction, built to have it for both displacements because the "
                    "patent does not say for which one its table is",
                )
            )
    two, three = PAIRS
    smallest = [fewest_samples(pair, len(pair.sensors)) for pair in PAIRS]
    with_products = [fewest_samples(three, len(m.terms) - 1) for m in (Z_THREE_SENSORS, Y_THREE_SENSORS)]
    return [
        *lines,
        judged(
            _PAIR,
            "(b) what adding ΔT5 does to adjusted R²",
            f'it "falls" to {three.adjusted_r2}',
            f"it rises from {two.adjusted_r2} to {three.adjusted_r2}",
            three.adjusted_r2 < two.adjusted_r2,
            "the printed numbers themselves; by adjusted R² the three sensors win, and taking two is parsimony",
        ),
        AuditLine(
            _PAIR,
            "(d) number of observations m",
            "not printed",
            f"m ≥ {max(smallest)}",
            "cannot be checked",
            f"1 − R'² = (m−1)/(m−p−1)·(1 − R²) with four decimals needs m ≥ {smallest[0]} for the pair of two sensors "
            f"and m ≥ {smallest[1]} for that of three; there is no upper limit. If the second pair belonged to the "
            f"models with products, m ≥ {with_products[0]} (Z, 4 terms) and {with_products[1]} (Y, 6 terms). The "
            f"reconstruction has {len(next(iter(responses.values())))}",
        ),
        _m_is_observations(two),
    ]


def model_lines(rises: Mapping[str, Vector], z: Vector, y: Vector, z_second: Vector) -> list[AuditLine]:
    """Every printed coefficient against a regression on the reconstruction, and the four models against each other.

    Raises KeyError: `rises` lacks T1, T3 or T5.
    """
    key = (rises["T1"], rises["T3"], rises["T5"])
    lines = []
    for model, values, column in (
        (Z_TWO_SENSORS, z, "Z"),
        (Y_TWO_SENSORS, y, "Y"),
        (Z_THREE_SENSORS, z_second, "Z_embodiment2"),
        (Y_THREE_SENSORS, y, "Y"),
    ):
        found = _coefficients(model.columns(*key), values)
        for term, text, ours in zip(model.terms, model.printed, found, strict=True):
            decimals = len(text.split(".")[1])
            lines.append(
                judged(
                    _MODELS,
                    f"{model.name}: {'·'.join(f'Δ{name}' for name in term) or 'constant'}",
                    text.replace("-", "−"),
                    f"{ours:.{decimals}f}".replace("-", "−"),
                    abs(float(text) - ours) <= 0.5 * 10.0**-decimals,
                    f"least squares on the reconstruction, response {column}, which was solved for to have it",
                )
            )
    joint = _coefficients(Z_THREE_SENSORS.columns(*key), z)
    gap = (Z_THREE_SENSORS.columns(*key) @ Z_THREE_SENSORS.coefficients) - (
        Z_TWO_SENSORS.columns(*key) @ Z_TWO_SENSORS.coefficients
    )
    return [
        *lines,
        judged(
            _MODELS,
            "both models of Z from the recording that gives both models of Y",
            ", ".join(text.replace("-", "−") for text in Z_THREE_SENSORS.printed),
            ", ".join(f"{value:.4f}".replace("-", "−") for value in joint),
            bool(np.abs(joint - Z_THREE_SENSORS.coefficients).max() <= ENTRY_HALF_UNIT),
            "three-sensor fit to the same Z as the two-sensor model. A recording that starts at rest was found for R, "
            "the pairs, both two-sensor models and either three-sensor model, but none for all four models; on this "
            f"one the two models of Z differ by {gap.std():.1f} µm (standard deviation). The patent records anew for "
            "its second embodiment, so the four need not share a recording; ours has a second Z for it",
        ),
        _at_rest(),
    ]


def fewest_samples(pair: PrintedPair, n_terms: int) -> int:
    """Smallest m for which some R² and its adjusted R² round to the printed pair, P eq. 2."""
    low, high = 1 - pair.r2 - ENTRY_HALF_UNIT, 1 - pair.r2 + ENTRY_HALF_UNIT
    low_adjusted, high_adjusted = 1 - pair.adjusted_r2 - ENTRY_HALF_UNIT, 1 - pair.adjusted_r2 + ENTRY_HALF_UNIT
    m = n_terms + 2
    while True:
        factor = (m - 1) / (m - n_terms - 1)
        if factor * low < high_adjusted and factor * high > low_adjusted:
            return m
        m += 1


def r2_pair(regressors: list[Vector], response: Vector) -> tuple[float, float]:
    """(R², adjusted R²) of a linear regression with intercept, P eq. 2."""
    columns = np.column_stack([np.ones(len(response)), *regressors])
    residual = response - columns @ _coefficients(columns, response)
    share = float(residual @ residual / ((response - response.mean()) ** 2).sum())
    m, p = len(response), len(regressors)
    return 1 - share, 1 - (m - 1) / (m - p - 1) * share


def _coefficients(columns: NDArray[np.float64], response: Vector) -> Vector:
    scale = np.linalg.norm(columns, axis=0)
    return np.asarray(np.linalg.lstsq(columns / scale, response, rcond=None)[0] / scale, dtype=np.float64)


def _m_is_observations(pair: PrintedPair) -> AuditLine:
    p = len(pair.sensors)
    with_sensors = 1 - (8 - 1) / (8 - p - 1) * (1 - pair.r2)
    return judged(
        _PAIR,
        "(c) m is the number of temperature variables",
        f"m variables x_j, j = 1…m; adjusted R² {pair.adjusted_r2}",
        f"{with_sensors:.4f} with m = 8",
        math.isclose(with_sensors, pair.adjusted_r2, abs_tol=ENTRY_HALF_UNIT),
        "the text uses m for the candidate variables (2^m − 1 combinations) and in eq. 2 for the number of "
        "observations; only the latter gives the printed values",
    )


def _at_rest() -> AuditLine:
    constants = ", ".join(
        f"{m.name} {m.printed[0].replace('-', '−')} µm"
        for m in (Z_TWO_SENSORS, Y_TWO_SENSORS, Z_THREE_SENSORS, Y_THREE_SENSORS)
    )
    return judged(
        _MODELS,
        "displacement at rest, all rises 0",
        "0 (gauges are set to zero at the start)",
        constants,
        False,
        "the constants are the models' own error in the first sample: they are fitted, not physics",
    )
