"""The drawings of a selection: what unseen data say, which sensors move together, the model, its range and faults."""

from collections.abc import Iterator, Mapping
from typing import Any

from selector import figures
from selector.figures.proof import telling_runs
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
    runs, few = telling_runs({run: error.get(run, 0.0) for run in runs}, MOST_RUNS)
    chunks = [runs[i : i + RUNS_PER_PICTURE] for i in range(0, len(runs), RUNS_PER_PICTURE)]
    for i, chunk in enumerate(chunks):
        drawn = figures.measured_and_predicted(selection, response, chunk)
        title = f"{response} measured and predicted, continued" if i else ""
        yield Drawing(drawn, "" if i else legend("selected.traces") + (few and f" {few}."), title)


def _grouping(selection: Selection) -> list[Drawing]:
    if len(selection.sensors) < 2:
        return []
    return [
        Drawing(figures.sensor_tree(selection), legend("selected.tree")),
        Drawing(figures.similarity_and_closure(selection), legend("selected.similarity")),
    ]


def _places(selection: Selection, description: Mapping[str, Any]) -> list[Drawing]:
    """The machine picture, if the machine file says where the sensors sit."""
    found = {
        str(channel["name"]): (float(x), float(y), float(z))
        for channel in description.get("channels", ())
        if channel.get("xyz") is not None and channel["name"] in selection.sensors
        for x, y, z in [channel["xyz"]]
    }
    return [Drawing(figures.sensor_places(selection, found), legend("selected.places"))] if found else []
