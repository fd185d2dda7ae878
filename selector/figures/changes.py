"""What of a picture is different for other results: the paths of the values that change, and the values.

A picture that follows a slider is drawn once; after that only these values travel.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import plotly.graph_objects as go

Changes = Mapping[tuple[str | int, ...], Any]
"""Path in the figure, e.g. ("data", 0, "x") → the value that stands there now."""


def changed(drawn: go.Figure, changes: Changes) -> go.Figure:
    """The same figure, with the changes made in it."""
    for path, value in changes.items():
        place: Any = drawn
        for key in path[:-1]:
            place = place[key]
        place[path[-1]] = value
    return drawn
