"""The findings about what is wrong with a recording: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds

CLOCK_JUMP = "clock-jump"
CONSTANT_CHANNEL = "constant-channel"
DUPLICATE_CHANNEL = "duplicate-channel"
DRIFTS_FROM_GROUP = "drifts-from-group"
GAUGE_BEGINS_LATE = "gauge-begins-late"
OUT_OF_RANGE = "out-of-range"
READINGS_LOST = "readings-lost"
ROWS_IN_TWO_RUNS = "rows-in-two-runs"
RUN_STARTS_WARM = "run-starts-warm"
SAME_FILE_TWICE = "same-file-twice"
SATURATED = "saturated"
SENSOR_BREAK = "sensor-break"
STEP = "step"
STUCK = "stuck"
SWAPPED_CHANNELS = "swapped-channels"
WRONG_UNIT = "wrong-unit"

FINDINGS = Kinds.beside(__file__)
