"""The report of simulated gauging: which sizes come out, what other filters would do, parts in time, the gauge."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selector import __version__
from selector.atomic_file import write_whole
from selector.figures.gauged_sizes import filter_trade_off, size_histogram, sizes_over_parts
from selector.figures.gauging import chain_waveform, gauge_characteristic, part_in_time
from selector.findings import Finding
from selector.physics.channel_differences import ChannelDifference
from selector.physics.gauging.finished_sizes import FinishedSizes
from selector.physics.gauging.gauging_summary import GaugingSummary
from selector.physics.gauging.process import Tolerance
from selector.physics.gauging.size_distribution import SizeDistribution
from selector.physics.gauging.vibrating_contact import GaugeMotion
from selector.recording import Recording
from selector.report import origin
from selector.report.channels_part import channels_part, difference_sentence
from selector.report.gauging_wording import (
    capability_table,
    filter_title,
    gauge_tables,
    parts_title,
    size_sentences,
    sizes_table,
    sizes_title,
    trade_off_table,
    verdict,
)
from selector.report.numbers import NONE, given_text
from selector.report.page import Picture, Pictures, rendered
from selector.report.simulation_report import channels_table
from selector.report.tables import Table, remarks_of, table

Vector = NDArray[np.float64]
MOST_PARTS, MOST_RUNS = 1, 3
"""Parts that are drawn in time, as a whole and near the stop; recorded runs that are."""

MOST_PARAMETERS = 200
_BEFORE_S = 12.0
"""So many times T_Φ and delay before the stop, the end of a part is drawn once more, enlarged."""

_SHARE_OF_PART = 0.5
_STROKES_SHOWN = 6.0
_SMOOTHED, _SMOOTHED_TURNS, _DENSITY_POINTS = 0.15, 0.4, 161
"""Shares of the standard deviation by which densities by formula are smoothed: of whole surfaces; of grooves and
run-out, of which some dozens of turns and feeds are pooled."""


@dataclass(frozen=True, eq=False)
class PartOnPage:
    """A part, or a recorded run, over time.

    Attributes
    ----------
    name : str
    time_s : ndarray of shape (n_samples,)
        [s].
    allowance_um, measured_um, voltage_v : ndarray of shape (n_samples,)
        True and measured allowance [µm], voltage behind the filter [V].
    feed_um_per_s : ndarray of shape (n_samples,) or None
        Infeed [µm/s].
    ends_s : tuple of float
        When the stages ended [s].
    is_finished : bool
        Whether the gauge stopped it, so that its last allowance is a size.
    """

    name: str
    time_s: Vector
    allowance_um: Vector
    measured_um: Vector
    voltage_v: Vector
    feed_um_per_s: Vector | None = None
    ends_s: tuple[float, ...] = ()
    is_finished: bool = True


@dataclass(frozen=True, eq=False)
class GaugingPage:
    """What the report of gauging shows.

    Attributes
    ----------
    recording : Recording
        What was simulated.
    model : str
        Name of the model.
    summary : GaugingSummary
    linear : SizeDistribution
        Of sizes by G eq. 25, beside that of the summary.
    wanted_um : float
        x_k [µm].
    tolerance : Tolerance or None
    parts : tuple of PartOnPage
    ground : FinishedSizes or None
        Of the parts of the file, in the order of grinding; None of recorded runs.
    dress_every : int
        Parts between two dressings; 0: none.
    waveform : GaugeMotion or None
        Of the whole chain before a stop.
    rest_gap_m : float
        From the tip at rest to a part that is just to size [m].
    stroke_s : float
        Period of the probe [s].
    inputs : tuple of str
        Channels that act on the gauge.
    differences : tuple of ChannelDifference
        From the recordings that drove it, if any did.
    findings : tuple of Finding
    parameters : tuple of (name, value, unit, origin)
    told : mapping
        Facts about the origin: model file, its hash, seed.
    """

    recording: Recording
    model: str
    summary: GaugingSummary
    linear: SizeDistribution
    wanted_um: float
    tolerance: Tolerance | None = None
    parts: tuple[PartOnPage, ...] = ()
    ground: FinishedSizes | None = None
    dress_every: int = 0
    waveform: GaugeMotion | None = None
    rest_gap_m: float = 0.0
    stroke_s: float = 0.01
    inputs: tuple[str, ...] = ()
    differences: tuple[ChannelDifference, ...] = ()
    findings: tuple[Finding, ...] = ()
    parameters: tuple[tuple[str, float, str, str], ...] = ()
    told: Mapping[str, Any] = field(default_factory=dict)

    @property
    def limits_um(self) -> tuple[float, float] | None:
        """Lower and upper limit of the size [µm]."""
        return None if self.tolerance is None else (self.tolerance.lower_um, self.tolerance.upper_um)


def write_gauging_report(page: GaugingPage, path: str | Path) -> Path:
    """Write the report of gauging as one HTML file that needs no network; whole or not at all.

    Raises
    ------
    OptionError
        The file cannot be written; an old file of that name is untouched.
    """
    target = Path(path)
    # a lone surrogate in a name must not end the report
    write_whole(target, gauging_html(page).encode("utf-8", "replace"))
    return target


def gauging_html(page: GaugingPage) -> str:
    """The report as text, see `write_gauging_report`."""
    pictures, summary = Pictures(), page.summary
    shown = page.parts[: MOST_PARTS if page.ground is not None else MOST_RUNS]
    own = size_sentences(summary, page.wanted_um, page.tolerance, is_ground=page.ground is not None)
    compared = difference_sentence(page.differences)
    sentences = [compared, *own] if compared else own
    values: dict[str, Any] = {
        "title": f"Simulation: {page.model}",
        "version": __version__,
        "verdict": verdict(summary),
        "first": sentences[0],
        "more": sentences[1:],
        "comparison": channels_part(pictures, page.differences) if page.differences else None,
        "sizes": _sizes(pictures, page),
        "trade_off": _trade_off(pictures, page),
        "courses": [picture for part in shown for picture in _part(pictures, page, part)],
        "more_parts": len(page.recording.runs) - (page.waveform is not None) - len(shown),
        "gauge": _gauge(pictures, page),
        "remarks": remarks_of(page.findings),
        "channels": channels_table(page.recording, page.inputs),
        "parameters": _parameters(page),
        "origin": origin.remaining_table(page.told),
    }
    return rendered("gauging.html", values)


def _sizes(pictures: Pictures, page: GaugingPage) -> dict[str, Any]:
    summary = page.summary
    curves = {
        name: _density(one)
        for name, one in (("formula, early trips", summary.formula), ("eq. 25", page.linear))
        if one.sd_um > 0
    }
    histogram = size_histogram(summary.sizes.finished_um, curves, page.limits_um, page.wanted_um, sizes_title(summary))
    drawn = [pictures.add(histogram, _HISTOGRAM)]
    ground = page.ground if page.ground is not None and len(page.ground.size_um) > 1 else None
    if ground is not None:
        count = len(ground.size_um)
        dressed = range(page.dress_every + 1, count + 1, page.dress_every) if page.dress_every > 0 else ()
        chart = sizes_over_parts(ground.size_um, page.limits_um, page.wanted_um, dressed, parts_title(ground))
        drawn.append(pictures.add(chart, _CHART_DRESSED if dressed else _CHART))
    tables = [("Finished sizes", sizes_table(summary, page.linear, page.wanted_um))]
    if summary.capability is not None:
        tables.append(("Capability", capability_table(summary.capability)))
    return {"pictures": drawn, "tables": tables}


def _density(one: SizeDistribution) -> tuple[Vector, Vector]:
    """Sizes and density there [µm], [1/µm]: the quantiles, smoothed by a share of their spread that is not added to it.

    Quantiles of parts that are pooled stand in heaps, of which a difference quotient would show each one.
    """
    share_of_sd = _SMOOTHED_TURNS if one.ripple_rate > 0 else _SMOOTHED
    width = share_of_sd * one.sd_um
    shrunk = one.mean_um + (one.size_um - one.mean_um) / math.sqrt(1.0 + share_of_sd**2)
    middle, share = (shrunk[1:] + shrunk[:-1]) / 2.0, np.diff(one.probability)
    at = np.linspace(shrunk[0] - 3.0 * width, shrunk[-1] + 3.0 * width, _DENSITY_POINTS)
    kernels = np.exp(-0.5 * ((at[:, None] - middle) / width) ** 2) / (math.sqrt(2.0 * math.pi) * width)
    # no matrix product: its last digits depend on where the memory lies
    return at, (kernels * share).sum(axis=1)


def _trade_off(pictures: Pictures, page: GaugingPage) -> dict[str, Any]:
    one = page.summary.trade_off
    picture = filter_trade_off(
        one.time_constant_s,
        one.bias_um,
        one.sd_um,
        (one.best_s, one.best_rms_um**2),
        (one.present_s, one.present_rms_um**2),
        filter_title(page.summary),
    )
    return {
        "pictures": [pictures.add(picture, _FILTER)],
        "tables": [("Filter and last threshold", trade_off_table(page.summary))],
    }


def _part(pictures: Pictures, page: GaugingPage, part: PartOnPage) -> list[Picture]:
    thresholds = [(stage.until_um, stage.threshold_v) for stage in page.summary.stages]
    courses = (part.time_s, part.allowance_um, part.measured_um, part.voltage_v, part.feed_um_per_s)
    name = part.name if len(page.parts) > 1 else ""
    whole = part_in_time(*courses, thresholds, part.ends_s, is_finished=part.is_finished, name=name)
    drawn = [pictures.add(whole, _PART)]
    if part.is_finished and part.ends_s:
        end = part.ends_s[-1]
        from_s = end - _BEFORE_S * page.summary.gauge.time_constant_s
        if from_s > _SHARE_OF_PART * end:
            near = part_in_time(*courses, thresholds, part.ends_s, from_s=from_s, name=name)
            drawn.append(pictures.add(near, _NEAR))
    return drawn


def _gauge(pictures: Pictures, page: GaugingPage) -> dict[str, Any]:
    summary = page.summary
    thresholds = [(stage.until_um, stage.threshold_v) for stage in summary.stages]
    curve = summary.characteristic
    drawn = []
    if curve is not None:
        picture = gauge_characteristic(
            curve.allowance_um, curve.voltage_v, summary.gauge, summary.linear_range_um, thresholds
        )
        drawn.append(pictures.add(picture, _CURVE))
    if page.waveform is not None:
        drawn.append(_waveform(pictures, page, page.waveform))
    return {"pictures": drawn, "tables": gauge_tables(summary)}


def _waveform(pictures: Pictures, page: GaugingPage, motion: GaugeMotion) -> Picture:
    kept = motion.time_s >= motion.time_s[-1] - _STROKES_SHOWN * page.stroke_s
    surface_um = 1e6 * page.rest_gap_m - motion.allowance_um
    picture = chain_waveform(
        motion.time_s[kept],
        1e6 * motion.probe_m[kept],
        surface_um[kept],
        motion.contact_n[kept],
        motion.generator_v[kept],
        motion.smoothed_v[kept],
    )
    return pictures.add(picture, _WAVEFORM)


def _parameters(page: GaugingPage) -> Table | None:
    if not page.parameters:
        return None
    rows = [
        (name, given_text(value), NONE if unit in ("", "1") else unit, said)
        for name, value, unit, said in page.parameters
    ]
    more = f"{len(rows) - MOST_PARAMETERS} more are in the model file." if len(rows) > MOST_PARAMETERS else ""
    return table(["parameter", ">value", "unit", "from"], rows[:MOST_PARAMETERS], more)


_HISTOGRAM = (
    "Bars: parts of the Monte Carlo calculation that the gauge has stopped. Lines: formulas. Eq. 25 lets the reading "
    "pass its threshold once; the other counts that noise reaches it early."
)
_CHART = "In the order of grinding."
_CHART_DRESSED = "In the order of grinding. Dotted: the wheel is dressed."
_FILTER = (
    "By formula: error of the size against the wanted one, with thresholds calculated for each filter (eq. 23); the "
    "present one with the threshold that it has. A longer filter quiets the noise, but makes the gauge late, and how "
    "much that is in size depends on the feed of the part."
)
_PART = (
    "Allowance counts from the nominal size; where the feed stands it is the size of the part. Dotted: thresholds of "
    "the relay, and when the stages ended. Long courses are drawn with the lowest and highest sample of each of 300 "
    "stretches."
)
_NEAR = "The gauge reads more than is there: it is late by the filter. The threshold is set ahead by that much."
_CURVE = (
    "Grinding goes from right to left. Shaded: where the line holds. Points: where the voltage of a stage's threshold "
    "lies, ahead of the allowance that is wanted by what the filter is late. Below: what the line reads less what is "
    "there."
)
_WAVEFORM = "The last strokes before the feed stops. The tip is pressed back where it meets the workpiece."
