"""The part of a selection's report that shows readings: loops against each sensor, and the range that was learnt."""

from __future__ import annotations

import numpy as np

from selector import figures
from selector.figures.loops import MOST_SENSORS, LoopShown
from selector.figures.validity import MOST_PAIRS
from selector.report.formula import unit_of, variable_text
from selector.report.numbers import listed, span_text
from selector.report.page import Picture, Pictures
from selector.selection import Selection

NO_READINGS = (
    "Not drawn: loops of the displacement over each temperature, and the range of the inputs. An earlier version of "
    "selector wrote this result, without readings; `selector select` on the same recordings writes it with them."
)
_LOOPS = (
    "A temperature that tells all gives one line, the same on the way up and on the way down. A loop says that the "
    "displacement lags behind this temperature, or runs ahead of it: the machine remembers, and no coefficient of this "
    "reading closes the loop; another sensor, or a memory term (the same reading, lagged), can. Above each panel: the "
    "widest loop, and what the fitted model leaves of such loops."
)
_HULL = (
    "Green: the range of the inputs from which the model was learnt; outside it the model extrapolates, also where "
    "each input alone is in its range. Points: how far a sample lies beyond all that was left for learning when its "
    "{part} was left out, in standard deviations of the inputs together; the farther, the more its unseen error is "
    "that of an extrapolation."
)


def loops(pictures: Pictures, selection: Selection) -> list[Picture]:
    """Each displacement over the readings of the chosen sensors, with what the model leaves of the loops."""
    if not selection.readings:
        return []
    text = [_LOOPS, _memory(selection), _thinning(selection)]
    if len(selection.chosen) > MOST_SENSORS:
        text.append(f"The first {MOST_SENSORS} of {len(selection.chosen)} sensors are drawn.")
    rise = selection.options.reference == "rise"
    return [
        pictures.add(
            figures.displacement_loops(selection.chosen, name, _loops(selection, at), rise=rise),
            " ".join(filter(None, text)) if at == 0 else "",
        )
        for at, name in enumerate(selection.models)
    ]


def _loops(selection: Selection, at: int) -> list[LoopShown]:
    variables = selection.recipe.design.variables
    column = [variables.index(name) for name in selection.chosen]
    model = list(selection.models.values())[at]
    return [
        LoopShown(
            one.run,
            one.variables[:, column],
            one.displacement_um[:, at],
            one.displacement_um[:, at] - model.predicted(one.variables),
        )
        for one in selection.readings
    ]


def validity(pictures: Pictures, selection: Selection) -> Picture | None:
    """Where the inputs were, and which samples lie beyond what was left when theirs were left out."""
    variables = selection.recipe.design.variables
    if not selection.readings or len(variables) < 2:
        return None
    beyond = np.concatenate([one.beyond_others for one in selection.readings])
    samples = np.concatenate([one.variables for one in selection.readings])[np.isfinite(beyond)]
    axes = [(variable_text(selection, name), unit_of(selection, name)) for name in variables]
    part = selection.proof.left_out
    drawn = figures.validity_pairs(
        selection.hull, axes, samples, beyond[np.isfinite(beyond)], f"what the other {part}s cover"
    )
    text = f"{_HULL.format(part=part)} {len(samples)} samples were judged, evenly spaced in time."
    all_pairs = len(axes) * (len(axes) - 1) // 2
    if all_pairs > MOST_PAIRS:
        text += f" {MOST_PAIRS} of {all_pairs} pairs of inputs are drawn; all inputs count."
    return pictures.add(drawn, text)


def _memory(selection: Selection) -> str:
    lags = selection.recipe.design.lags
    if not lags:
        offered = "they were offered and did not pay" if selection.options.memory else "--memory offers them"
        return f"This model has no memory terms; {offered}."
    taus = list(dict.fromkeys(span_text(lag.tau_s) for lag in lags))
    constants = "a time constant" if len(taus) == 1 else "time constants"
    return f"This model has memory terms with {constants} of {listed(taus)}."


def _thinning(selection: Selection) -> str:
    """How many of the samples are drawn."""
    shown, all_runs = selection.readings, {run for runs in selection.fit_per_run.values() for run in runs}
    samples = sum(len(one.time_s) for one in shown), sum(one.n_samples for one in shown)
    text = ""
    if samples[0] < samples[1]:
        text = (
            f"Drawn are {samples[0]} of {samples[1]} samples, evenly spaced, with the extremes of every reading and "
            "displacement."
        )
    if len(shown) < len(all_runs):
        text += (
            f" {len(shown)} of {len(all_runs)} runs are drawn: those with an extreme, and others evenly between them."
        )
    return text.strip()
