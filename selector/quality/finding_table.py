"""The findings about what is wrong with a recording: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds

CLOCK_JUMP = "clock-jump"
CONSTANT_CHANNEL = "constant-channel"
DUPLICATE_CHANNEL = "duplicate-channel"
DRIFTS_FROM_GROUP = "drifts-from-group"
OUT_OF_RANGE = "out-of-range"
RUN_STARTS_WARM = "run-starts-warm"
SATURATED = "saturated"
SENSOR_BREAK = "sensor-break"
STEP = "step"
STUCK = "stuck"
SWAPPED_CHANNELS = "swapped-channels"
WRONG_UNIT = "wrong-unit"

FINDINGS = Kinds.of(
    """
out-of-range [error] a temperature that cannot be on a machine tool
    → Check the sensor and the unit in the machine file. The stretch is left out.
sensor-break [warning, error] a channel holds the code that an input writes for a broken or open sensor
    → Check the sensor, its plug and its input.
short-run [info, warning] a run has too few samples to say much about a thermal process
    → Leave this run away, or check that the file is complete. Nothing is left out.
empty-channel [warning] a channel has no value in a run, or in any
    → Check the column's name in the machine file, or remove the channel from it.
constant-channel [info] a channel has the same value in every sample of every run
    → Check the sensor and its wiring. A constant is not used.
few-values [info, warning] a channel takes few different values: its resolution is coarse for how far it moves
    → Record it with a finer resolution.
run-starts-warm [info] a run does not start at the temperatures that the other runs start at
    → Rises count from the start of the run: say so when comparing runs, or start from a cold machine.
same-file-twice [warning] two runs are the same file
    → give every recording once
saturated [warning, error] a channel is pinned at the end of its range
    → The sensor or its input is at the end of its range: choose a wider range. The stretch is left out.
stuck [warning, error] a channel is frozen at one value although it has noise elsewhere, or the sensors near it move
    → Check the sensor, its cable and the logger. The stretch is left out.
clock-jump [warning] the clock of a run leaps forward: no reading moves as if that time had passed, or by a whole hour
    or day
    → If the clock was set, subtract the leap from the later time stamps; else split the run there.
gap [info, warning] the recording pauses for much longer than its sampling period
    → Nothing more is left out; memory models bridge the gap with what the sensors read after it.
duplicate-channel [warning] two channels hold the same measurement
    → Check the wiring and the logger's channel list; exclude one of the two with --never.
swapped-channels [warning, error] two channels have changed places in one run
    → Say so in the machine file: `swap` in [runs.NAME].
spike [warning] a channel has short outliers
    → Look for interference or a loose contact.
step [info, warning, error] a channel steps and stays there, as when a sensor or a gauge slips
    → Look for a sensor or gauge that slipped or was touched.
drifts-from-group [warning, error] a channel no longer moves with the sensors that it moved with, for good
    → Check whether the sensor came off or ages.
wrong-unit [warning, error] a channel's values look like those of another unit
    → Correct the unit in the machine file, for all runs or for that run.
gauge-not-zeroed [info] displacements do not start at zero; they count from the start of the run
    → use --reference absolute if these starts are real displacements and not the zero of the gauge
"""
)
