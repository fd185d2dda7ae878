"""What touch-offs add to the displacement of one output, touch by touch, in the arithmetic of a control.

The same filter as `selector.adaptation.drift.tracked`; here with the limits of a program that runs for years.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from selector.controllers.adaptation_block import Adaptation, OutputAdaptation
from selector.controllers.guard.decided import LARGEST_NUMBER, LONGEST_S, TouchCode

Number = Callable[[float], Any]


class Adapted:
    """State of one output. All numbers are of the type `number`; displacements in µm."""

    def __init__(self, of: OutputAdaptation, block: Adaptation, number: Number) -> None:
        self._zero = number(0.0)
        self._walk, self._walk_of_gain = number(of.offset_um2_per_s), number(of.gain_per_s)
        self._start, self._start_of_gain = number(of.offset_start_um2), number(of.gain_start)
        self._noise = number(of.noise_um2)
        self._offset_limit, self._gain_limit = number(of.offset_limit_um), number(of.gain_limit)
        self._far = number(of.offset_limit_um * of.offset_limit_um)
        self._gate, self._agreeing = number(block.gate * block.gate), number(block.agreeing * block.agreeing)
        self._largest, self._longest_s = number(LARGEST_NUMBER), number(LONGEST_S)
        self._has_gain = of.gain_limit > 0.0
        self.code = TouchCode.NONE
        self._waits = False
        self._was_touch = False
        self._shown = self._shown_at = self._zero
        self.begin()

    def begin(self) -> None:
        """A new start: nothing is known of offset and gain."""
        self.offset = self.gain = self._covariance = self._age_s = self._doubted = self._zero
        self._variance, self._variance_of_gain = self._start, self._start_of_gain
        self._has_doubt = self._has_two = False

    def passed(self, seconds: Any) -> None:
        """Time went by."""
        self._age_s = min(self._age_s + seconds, self._longest_s)

    def stopped(self) -> None:
        """The control was off: a touch-off that waited is gone."""
        self._waits = False

    def take(self, is_touch: bool, is_number: bool, displacement: Any, place: Any) -> None:
        """A touch-off is taken with the call in which it becomes valid; what is no number is none.

        `displacement` is what the probe shows without the correction; `place` the position of the axis then [m].
        """
        if is_touch and not self._was_touch and is_number:
            self._waits = True
            self._shown, self._shown_at = displacement, place
        self._was_touch = is_touch

    def added(self, modelled: Any, slope: Any, reference: Any) -> Any:
        """The displacement of the model with offset and gain, after the touch-off that waits for it.

        `slope` is the model's position-dependent part [µm/m] about `reference`; 0 where it has none.
        """
        if self._waits and -self._largest <= modelled <= self._largest and -self._largest <= slope <= self._largest:
            self._waits = False
            self._touched(self._shown - slope * (self._shown_at - reference) - modelled, modelled)
        if self._has_gain:
            return modelled + self.offset + self.gain * modelled
        return modelled + self.offset

    def drop(self) -> None:
        """A touch-off that nothing could be compared with."""
        if self._waits:
            self._waits = False
            self.code = TouchCode.UNUSED

    def _touched(self, error: Any, m: Any) -> None:
        self._variance = min(self._variance + self._walk * self._age_s, self._largest)
        surprise = error - self.offset
        of_offset, variance = self._variance, self._variance + self._noise
        of_gain = self._zero
        if self._has_gain:
            self._variance_of_gain = min(self._variance_of_gain + self._walk_of_gain * self._age_s, self._largest)
            surprise = surprise - self.gain * m
            of_offset = self._variance + self._covariance * m
            of_gain = self._covariance + self._variance_of_gain * m
            variance = max(of_offset + of_gain * m + self._noise, self._noise)
        self._age_s = self._zero
        square = surprise * surprise
        if square > self._gate * variance:
            away = error - self._doubted
            agrees = bool(self._has_doubt and away * away <= self._agreeing * square)
            if not (agrees and (self._has_two or error * error <= self._far)):
                self._doubted, self._has_doubt, self._has_two = error, True, agrees
                self.code = TouchCode.DOUBTED
                return
            self._variance = self._variance + square
            of_offset = of_offset + square
            variance = variance + square
        self._has_doubt = self._has_two = False
        self.code = TouchCode.BELIEVED
        share = of_offset / variance
        self.offset = self._limited(self.offset + share * surprise, self._offset_limit)
        self._variance = self._limited(self._variance - share * of_offset, self._largest, self._zero)
        if self._has_gain:
            of = of_gain / variance
            self.gain = self._limited(self.gain + of * surprise, self._gain_limit)
            self._covariance = self._limited(self._covariance - share * of_gain, self._largest)
            self._variance_of_gain = self._limited(self._variance_of_gain - of * of_gain, self._largest, self._zero)

    @staticmethod
    def _limited(value: Any, high: Any, low: Any = None) -> Any:
        return min(max(value, -high if low is None else low), high)
