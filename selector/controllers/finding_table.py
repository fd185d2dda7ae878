"""The findings about model files and programs: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds

SENSOR_LOOKS_BROKEN = "sensor-looks-broken"
OUTSIDE_VALID_RANGE = "outside-valid-range"

FINDINGS = Kinds.beside(__file__)
