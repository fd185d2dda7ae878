"""Results in, Plotly figures out: nothing is computed here, and a title says what the picture shows.

The visual language is in `selector.figures.style`: one colour a role, safe for colour-blind readers, units on every
axis.
"""

from selector.figures.grouping import sensor_tree, similarity_and_closure
from selector.figures.places import sensor_places
from selector.figures.proof import error_against_sensors, errors_per_run, measured_and_predicted

__all__ = [
    "error_against_sensors",
    "errors_per_run",
    "measured_and_predicted",
    "sensor_places",
    "sensor_tree",
    "similarity_and_closure",
]
