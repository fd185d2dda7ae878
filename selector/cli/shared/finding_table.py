"""The findings of single commands: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds

FINDINGS = Kinds.of(
    """
adaptation-not-applied [info] the model has an adaptation, but there are no touch-offs here: errors are those of the
    model alone
    → try touch-offs with `selector adapt`
recorded-only [info] a channel is recorded but not simulated, and is not compared
    → write it into the simulated files, under the name that the recorded channel has
simulated-time-unit [warning] the unit of the simulation's time was found from the length of its runs
    → Name it with --simulation-time-unit, or write it into the header of the time column.
"""
)
