"""The report of a selection: first what to do, then why, then everything."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from selector import __version__, figures
from selector.atomic_file import write_whole
from selector.report import origin, readings_part, tables
from selector.report.formula import formula_text, legend_rows
from selector.report.page import Picture, Pictures, rendered
from selector.report.wording import advice, data_label
from selector.selection import Selection
from selector.selection.unseen_words import FIXED_SET, told_apart

MOST_RUNS = 12
RUNS_PER_PICTURE = 6


Description = Mapping[str, Any]


def write_report(
    selections: Selection | Sequence[Selection],
    path: str | Path,
    *,
    title: str | None = None,
    description: Description | Sequence[Description | None] | None = None,
    date: str | None = None,
) -> Path:
    """Write the report of one or several selections as one HTML file that needs no network; whole or not at all.

    Parameters
    ----------
    selections : Selection or sequence of Selection
        Several stand one after the other.
    path : path
        The file; its folder must exist.
    title : str, optional
        The machine's name if nothing is given.
    description : mapping, or one per selection, optional
        How the recordings were read, as `selector describe` says it.
    date : str, optional
        Shown as it is; the clock is never read, so that equal results give equal bytes.

    Raises
    ------
    OptionError
        The file cannot be written; an old file of that name is untouched.
    """
    target = Path(path)
    page = selection_html(selections, title=title, description=description, date=date)
    # a lone surrogate in a name must not end the report
    write_whole(target, page.encode("utf-8", "replace"))
    return target


def selection_html(
    selections: Selection | Sequence[Selection],
    *,
    title: str | None = None,
    description: Description | Sequence[Description | None] | None = None,
    date: str | None = None,
) -> str:
    """The report as text, see `write_report`."""
    several = (selections,) if isinstance(selections, Selection) else tuple(selections)
    described = (description,) if description is None or isinstance(description, Mapping) else tuple(description)
    pictures = Pictures()
    studies = [
        _study(pictures, selection, described[i] if i < len(described) else None, title or "")
        for i, selection in enumerate(several)
    ]
    machines = dict.fromkeys(str(study["machine"]) for study in studies if study["machine"])
    heading = title or ": ".join(["Sensor selection", *([", ".join(machines)] if machines else [])])
    return rendered("selection.html", {"title": heading, "date": date, "version": __version__, "studies": studies})


def _study(pictures: Pictures, selection: Selection, description: Description | None, title: str) -> dict[str, Any]:
    """What the template shows of one selection, pictures in the order of the page."""
    names = tuple(selection.models)
    return {
        "machine": selection.provenance.get("machine"),
        "label": data_label(selection, description, title),
        "advice": advice(selection),
        "gain": tables.gain_table(selection),
        "urgent": tables.remarks(selection, "error", "warning"),
        "because": selection.because,
        "curves": [
            pictures.add(figures.error_against_sensors(selection, name), told_apart(selection.proof.left_out))
            for name in names
        ],
        "per_run": [pictures.add(figures.errors_per_run(selection, name), _PER_RUN) for name in names],
        "traces": [picture for name in names for picture in _traces(pictures, selection, name)],
        "loops": readings_part.loops(pictures, selection),
        "readings_told": "" if selection.readings else readings_part.NO_READINGS,
        "places": _places(pictures, selection, description or {}),
        "lambda_because": _sentence(selection.grouping.because),
        "groups": tables.groups_table(selection),
        "grouping": _grouping(pictures, selection),
        "fixed_set": FIXED_SET,
        "combinations": [(name, tables.combinations_table(selection, name)) for name in names],
        "shape": str(selection.recipe.shape),
        "models": [
            {
                "name": name,
                "formula": formula_text(selection, name),
                "coefficients": tables.coefficients_table(selection, name),
                "picture": pictures.add(figures.coefficient_intervals(selection, name), _COEFFICIENTS),
                "runs": tables.runs_table(selection, name),
            }
            for name in names
        ],
        "legend": legend_rows(selection),
        "quality": tables.quality_table(selection),
        "range": tables.range_table(selection),
        "validity": readings_part.validity(pictures, selection),
        "fault_picture": pictures.add(figures.fault_table(selection), _FAULTS) if selection.faults else None,
        "faults": tables.faults_table(selection),
        "sensors": tables.sensors_table(selection),
        "drift": origin.drift_table(description or {}),
        "remarks": tables.remarks(selection),
        "reading": origin.reading_tables(description or {}),
        "files": origin.files_table(selection.provenance),
        "origin": origin.remaining_table(selection.provenance),
        "options": origin.options_table(selection),
    }


def _sentence(text: str) -> str:
    """The text with a capital and a full stop; λ stays as it is."""
    first = text[:1] if text[:1] == "λ" else text[:1].upper()
    return f"{first}{text[1:].rstrip('.')}."


def _traces(pictures: Pictures, selection: Selection, response: str) -> list[Picture]:
    """Every left-out run, or of many the worst and some of all sorts."""
    runs = list(dict.fromkeys(trace.run for trace in selection.proof.traces))
    error = {part.name: part.rmse_um for part in selection.proof.per_response[response]}
    text = _TRACES
    if len(runs) > MOST_RUNS:
        ranked = sorted(runs, key=lambda run: -error.get(run, 0.0))
        worst, others = ranked[:RUNS_PER_PICTURE], ranked[RUNS_PER_PICTURE:]
        spaced = np.unique(np.linspace(0, len(others) - 1, MOST_RUNS - RUNS_PER_PICTURE).round().astype(int))
        wanted = {*worst, *(others[i] for i in spaced.tolist())}
        text += (
            f" {len(wanted)} of {len(runs)} runs are drawn: the {len(worst)} with the largest error, and "
            f"{len(wanted) - len(worst)} spread evenly over the others from bad to good."
        )
        runs = [run for run in runs if run in wanted]
    chunks = [runs[i : i + RUNS_PER_PICTURE] for i in range(0, len(runs), RUNS_PER_PICTURE)]
    found = []
    for i, chunk in enumerate(chunks):
        drawn = figures.measured_and_predicted(selection, response, chunk)
        found.append(
            pictures.add(
                drawn, text if i == 0 else "", title=f"{response} measured and predicted, continued" if i else ""
            )
        )
    return found


def _grouping(pictures: Pictures, selection: Selection) -> list[Picture]:
    if len(selection.sensors) < 2:
        return []
    return [
        pictures.add(figures.lambda_scan(selection), _SCAN),
        pictures.add(figures.sensor_tree(selection), _TREE),
        pictures.add(figures.similarity_and_closure(selection), _SIMILARITY),
    ]


def _places(pictures: Pictures, selection: Selection, description: Description) -> Picture | None:
    """The machine picture, if the machine file says where the sensors sit."""
    found = {
        str(channel["name"]): (float(x), float(y), float(z))
        for channel in description.get("channels", ())
        if channel.get("xyz") is not None and channel["name"] in selection.sensors
        for x, y, z in [channel["xyz"]]
    }
    return pictures.add(figures.sensor_places(selection, found), _PLACES) if found else None


_PLACES = "Where the sensors sit, as the machine file says. Sensors of one colour move together."
_PER_RUN = "Each of them was predicted by sensors, terms and coefficients that were chosen without it."
_TRACES = "The residual is measured minus predicted. All panels have the same scales."
_SCAN = (
    "Every level at which the groups change. The green band is the range of λ that gives the chosen groups. The "
    "held-out error is that of the best linear model of the representatives, relative to the spread of the "
    "displacement."
)
_TREE = (
    "Read from right to left: as λ falls, sensors merge into groups. Colours: groups at the chosen λ; grey: single "
    "sensors, and merges that the cut undoes. The axis stretches the levels close to 1."
)
_SIMILARITY = (
    "The stronger the colour, the more alike two sensors move. A cell above the diagonal that is stronger than its "
    "mirror image below says that the two are grouped through others, not by their own likeness. Bold: chosen."
)
_COEFFICIENTS = (
    "Per standard deviation of each centred variable, so that terms of different units can be compared; intervals "
    "allow for autocorrelation within runs. Dotted: variance inflation of 10."
)
_FAULTS = "Largest change of the prediction over the recorded samples; the table below says what each fault means."
