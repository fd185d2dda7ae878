"""What a guarded program says about its sensors and about itself, and the numbers that are the same everywhere."""

from __future__ import annotations

from enum import IntEnum

LARGEST_NUMBER = 1e9
"""What is beyond it, in whatever unit, is no reading, no position and no correction."""

LONGEST_S = 1e6
"""Clocks stop there: what is added to a larger one is lost in single precision. A longer time between calls is none."""

LONGEST_STEP_S = 10.0
"""Of time since the last call, for the slew limit: a program that was held up does not catch up in one jump."""

SAMPLE_S = 1.0
"""Readings are looked at so often at most: filled every millisecond, memory of hours stands still in binary32."""

ANCHOR_S = 60.0
"""The rate of a reading is judged over a minute, so that noise and resolution are no jumps."""

LEAST_GOOD_SAMPLES = 6
"""Of the time that a reading has to be good, one sample counts for this part at most: one wrong time proves nothing."""

TEST_S = 600.0
"""A sign test that goes on for longer, its way not counted, was forgotten: the correction goes to zero."""

FORGIVEN_S = 600.0
"""A changed reading is believed again when it could have got there within this time; what jumped further never is."""

GAP_STEPS_LOG2 = 4
"""Over a standstill a memory is filled in 2^4 equal steps: one step would keep a fifth of it where 2 % are left."""


class SensorCode(IntEnum):
    """State of one sensor; up to LIMITED its reading is used."""

    OK = 0
    LIMITED = 1
    """Beyond what the model has seen, used as if at the end of its valid range."""
    RECOVERING = 2
    """Good again, but not yet for long enough."""
    MISSING = 3
    BREAK_CODE = 4
    OUT_OF_LIMITS = 5
    JUMP = 6
    STUCK = 7
    OUTSIDE_VALID_RANGE = 8


class Mode(IntEnum):
    """What the correction follows; FALLBACK + k: the k-th fallback model (from 0)."""

    OFF = 0
    """The axis is not ready: no correction, at once."""
    MODEL = 1
    HOLD = 2
    RAMP_TO_ZERO = 3
    SWITCHED_OFF = 4
    """The operator does not want the correction, or has forgotten a test value: ramped to zero."""
    TEST = 5
    """A value is commanded by hand, for the sign test: the program goes there, its other outputs to zero."""
    FALLBACK = 10
