"""Whether the claimed effects and the symbols of the patent hold together."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from selector.audit.printed import PAIRS, Y_TWO_SENSORS, Z_TWO_SENSORS, AuditLine, PrintedModel, judged
from selector.types import Vector

BEARING_RISE_K = (6.0, 10.0)

CLAIMED_PERCENT = (80.0, 90.0)


def effect_lines(rises: Mapping[str, Vector]) -> list[AuditLine]:
    """The claim "80–90 % less" against the printed micrometres, and the other printed effects; rises [K]."""
    section = "effects"
    low, high = CLAIMED_PERCENT
    lines = []
    for item, before, after in (
        ("Z, largest, compensated", 100.0, (10.0,)),
        ("Z, mean of the warm phase, compensated", 80.0, (6.0, 8.0)),
        ("Y, mean, compensated", 41.0, (8.0,)),
        ("Z, largest, oil cooler alone", 100.0, (70.0,)),
        ("Z, mean of the warm phase, oil cooler alone", 80.0, (65.0,)),
        ("Y, mean, oil cooler alone", 41.0, (19.0,)),
    ):
        less = sorted(100 * (1 - value / before) for value in after)
        ours = "–".join(f"{value:.1f}" for value in less) + " % less"
        micrometres = f"{before:g} → {'–'.join(f'{value:g}' for value in after)} µm"
        if "oil" in item:
            worse = less[-1] < low
            lines.append(
                judged(section, item, micrometres, ours, worse, "less than compensation reaches, as the patent says")
            )
            continue
        holds = low <= less[0] and less[-1] <= high + 1e-9
        lines.append(
            judged(
                section,
                item,
                f"{micrometres}, {low:g}–{high:g} % less",
                ours,
                holds,
                "within the claimed range" if holds else "the printed micrometres give more than the claim",
            )
        )
    residual = 50.0 * (1 - PAIRS[0].r2) ** 0.5
    return [
        *lines,
        *_reach_lines(),
        AuditLine(
            section,
            "Y, largest",
            "56 µm",
            f"at most {_reach(Y_TWO_SENSORS):.1f} µm for the mean of both gauges",
            "cannot be checked",
            "the printed model is for the mean; one gauge may reach 56 µm, and the patent speaks of 25–56 µm",
        ),
        AuditLine(
            section,
            "Z, mean, oil cooler alone",
            "65 µm",
            "40 µm in the background section",
            "cannot be checked",
            "65 µm is said of the warm phase, 40 µm of the whole curve; neither curve is printed",
        ),
        judged(
            section,
            "error after compensation against R² 0.9989",
            "6–8 µm on average",
            f"R² 0.9989 leaves at most {residual:.1f} µm rms",
            residual >= 6.0,
            "values between 0 and 100 µm have a standard deviation of at most 50 µm, and R² leaves √(1 − R²) of it. "
            "R² speaks of the data that it was fitted to; on the next run the error is several times larger",
        ),
        AuditLine(
            section,
            "X stays within 5 µm",
            "5 µm",
            "no model and no data of X",
            "cannot be checked",
            "plausible for a machine that is symmetric about its YZ plane",
        ),
        AuditLine(
            section,
            "protocol",
            "1500 → 3000 r/min in steps, feed 2000 mm/min, 6–8 h; bearings rise 6–10 K",
            f"bearings of the reconstruction rise {rises['T1'].max():.1f} and {rises['T3'].max():.1f} K",
            "cannot be checked",
            "the reconstruction follows it with four steps in 8 h; the steps and the sampling period are not printed",
        ),
    ]


def symbol_lines(rises: Mapping[str, Vector], z: Vector) -> list[AuditLine]:
    """Symbols that are used for other things than they are defined as, contradiction (c); rises [K], z [µm]."""
    section = "symbols"
    columns = np.column_stack([np.ones(len(z)), rises["T1"], rises["T3"]])
    fitted = columns @ np.linalg.lstsq(columns, z, rcond=None)[0]
    sst, ssr, sse = (float(v @ v) for v in (z - z.mean(), fitted - z.mean(), z - fitted))
    penalty = (len(z) - 1) / (len(z) - columns.shape[1])
    two_ways = 1 - penalty * sse / sst, 1 - penalty * (1 - ssr / sst)
    return [
        judged(
            section,
            "(c) SST",
            '"residual sum of squares SST", which never changes',
            "SST = Σ(y − ȳ)² is the total sum of squares",
            False,
            "the definition under eq. 2; the total never changes, the residual sum does",
        ),
        judged(
            section,
            "(c) SSE",
            '"corrected sum of squares SSE", which never grows',
            "SSE = Σ(y − ŷ)² is the residual sum of squares",
            False,
            "the definition under eq. 2; the two names are exchanged in the text, the formulas are right",
        ),
        judged(
            section,
            "(c) R²",
            '"ratio of the regression sum SSR to the residual sum SST"',
            "R² = SSR/SST, the share of the total",
            False,
            "a ratio to the residual sum would not be confined to [0, 1]",
        ),
        judged(
            section,
            "SSE = SST − SSR",
            "an identity",
            f"{sse:.4f} = {sst:.4f} − {ssr:.4f}",
            bool(np.isclose(sse, sst - ssr, rtol=1e-8)),
            "two-sensor fit of Z on the reconstruction; without an intercept the identity fails, and adjusted R² "
            "needs another definition",
        ),
        judged(
            section,
            "eq. 2: 1 − (m−1)/(m−p−1)·SSE/SST = 1 − (m−1)/(m−p−1)·(1 − R²)",
            "an identity",
            f"{two_ways[0]:.10f} and {two_ways[1]:.10f}",
            bool(np.isclose(*two_ways, rtol=0, atol=1e-10)),
            "the same fit, with m observations and p regressors beside the intercept",
        ),
        judged(
            section,
            "(c) ȳ",
            "mean of the measured x_i",
            "mean of the measured y_i",
            False,
            "the sums of squares are about the mean of the displacement",
        ),
    ]


def _reach_lines() -> list[AuditLine]:
    lines = []
    for item, printed_um, model in (
        ("Z, largest", 100.0, Z_TWO_SENSORS),
        ("Z, mean of the warm phase", 80.0, Z_TWO_SENSORS),
        ("Y, mean of the warm phase", 41.0, Y_TWO_SENSORS),
    ):
        reach = _reach(model)
        lines.append(
            judged(
                "effects",
                f"{item}, with bearings that rise 6–10 K",
                f"{printed_um:g} µm",
                f"at most {reach:.1f} µm",
                reach >= printed_um,
                f"the printed two-sensor model of {model.direction} at its best corner of 6–10 K"
                + ("" if reach >= printed_um else "; that run was warmer, or the model does not hold for it"),
            )
        )
    return lines


def _reach(model: PrintedModel) -> float:
    """Largest displacement [µm] that a two-sensor model gives while both bearings rise 6–10 K."""
    corners = np.array([[1.0, a, b] for a in BEARING_RISE_K for b in BEARING_RISE_K])
    return float((corners @ model.coefficients).max())
