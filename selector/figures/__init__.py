"""Results in, Plotly figures out: nothing is computed here, and a title says what the picture shows.

The visual language is in `selector.figures.style`: one colour a role, safe for colour-blind readers, units on every
axis.
"""

from selector.figures.grouping import sensor_places as sensor_places
from selector.figures.grouping import sensor_tree as sensor_tree
from selector.figures.grouping import similarity_and_closure as similarity_and_closure
from selector.figures.proof import error_against_sensors as error_against_sensors
from selector.figures.proof import errors_per_run as errors_per_run
from selector.figures.proof import measured_and_predicted as measured_and_predicted
