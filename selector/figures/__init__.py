"""Results in, Plotly figures out: nothing is computed here, and a title says what the picture shows.

The visual language is in `selector.figures.style`: one colour a role, safe for colour-blind readers, units on every
axis.
"""

from selector.figures.grouping import lambda_scan, sensor_tree, similarity_and_closure
from selector.figures.loops import displacement_loops
from selector.figures.places import sensor_places
from selector.figures.proof import error_against_sensors, errors_per_run, measured_and_predicted

__all__ = [
    "displacement_loops",
    "error_against_sensors",
    "errors_per_run",
    "lambda_scan",
    "measured_and_predicted",
    "sensor_places",
    "sensor_tree",
    "similarity_and_closure",
]
