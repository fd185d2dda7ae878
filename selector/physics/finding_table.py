"""The findings that several simulations can make: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds

FINDINGS = Kinds.of(
    """
unlikely-value [warning] a number of a model file is one that no machine has; perhaps another unit was meant
    → Correct it if it is a slip.
channel-undecided [warning] several channels could each be the same thing, so none of them is taken
    → Say which it is in the recorded part of the model file.
input-not-recorded [info, warning] an input was not recorded; what the model file says acts instead
    → Record it, or name its channel in the model file.
output-not-recorded [info, warning] what the simulation says has no recorded channel: it cannot be compared
    → Name its channels in the recorded part of the model file, or call them as the model file does.
recorded-gap [warning] a recorded input has gaps or missing values; it is taken to go straight across
    → Do not trust what follows a gap, or cut the run to the stretch that is complete.
recorded-clock-jitter [info, warning] recorded times stray from an even clock
    → If the true clock is even, give its times.
"""
)
