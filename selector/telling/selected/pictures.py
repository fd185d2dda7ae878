"""The drawings of a selection: what unseen data say, which sensors move together, the model, its range and faults."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from selector import figures
from selector.selection import Selection
from selector.telling.account import Block, Drawing, legend

MOST_RUNS = 12
RUNS_PER_PICTURE = 6


def drawings(selection: Selection, description: Mapping[str, Any]) -> dict[str, list[Block]]:
    """Place in the account → its drawings."""
    names = tuple(selection.models)
    return {
        "curve": [Drawing(figures.error_against_sensors(selection, name)) for name in names],
        "proof": [
            *(Drawing(figures.errors_per_run(selection, name), legend("selected.per-run")) for name in names),
            *(drawing for name in names for drawing in _traces(selection, name)),
        ],
        "groups": [*_places(selection, description), *_grouping(selection)],
    }


def _traces(selection: Selection, response: str) -> Iterator[Drawing]:
    """Every left-out run, or of many the worst and some of all sorts."""
    runs = list(dict.fromkeys(trace.run for trace in selection.proof.traces))
    error = {part.name: part.rmse_um for part in selection.proof.per_response[response]}
    text = legend("selected.traces")
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
    for i, chunk in enumerate(chunks):
        drawn = figures.measured_and_predicted(selection, response, chunk)
        title = f"{response} measured and predicted, continued" if i else ""
        yield Drawing(drawn, "" if i else text, title)


def _grouping(selection: Selection) -> list[Drawing]:
    if len(selection.sensors) < 2:
        return []
    drawn = (
        (figures.sensor_tree(selection), legend("selected.tree")),
        (figures.similarity_and_closure(selection), legend("selected.similarity")),
    )
    return [Drawing(figure, text) for figure, text in drawn]


def _places(selection: Selection, description: Mapping[str, Any]) -> list[Drawing]:
    """The machine picture, if the machine file says where the sensors sit."""
    found = {
        str(channel["name"]): (float(x), float(y), float(z))
        for channel in description.get("channels", ())
        if channel.get("xyz") is not None and channel["name"] in selection.sensors
        for x, y, z in [channel["xyz"]]
    }
    return [Drawing(figures.sensor_places(selection, found), legend("selected.places"))] if found else []
