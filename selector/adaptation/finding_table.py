"""The findings of an adaptation: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds

FINDINGS = Kinds.of(
    """
adaptation-not-judged [warning] fewer than two runs: what one run taught cannot be tried on another, so nothing is
    adapted
    → record a second run with touch-offs, best on another day
adaptation-few-runs [warning] few runs: drift and noise are learnt from hardly any days
    → record runs on more days; with four or more the intervals begin to mean something
adaptation-no-better [info] on runs that did not teach it, the adapted model is no better than the model alone
    → use the model as it is; probe more often if the error without adaptation is too large
interval-not-held [warning] the 90 % intervals held clearly more or less than 90 % of the samples of unseen runs
    → do not rely on the intervals: the days differ in a way that these runs do not teach; record more of them
no-touch-off [warning] no touch-off falls into a run: there the model works alone
    → probe more often than a run is long
touch-off-refused [info] touch-offs were not believed: they were far from what was expected, and no second one agreed
    → look for chips on the probe or the datum, and probe again at once
touch-off-without-prediction [warning] a touch-off falls where the model has no prediction, and is left out
    → look at the sensors of that run with `selector apply`
errors-at-touch-offs-only [warning] the displacement was not recorded: errors are counted at the touch-offs only, with
    what was known before
    → record the displacement in some runs, to see what happens between the touch-offs
offset-limit-reached [warning] the adapted offset is at its limit: the machine is farther from its model than in the
    other runs
    → look for a moved gauge, a changed tool or a crash; fit the model again if the machine has changed
adaptation-clamped [warning] the clamp of the model file cuts off part of what the adapted model wants to correct
    → decide on a larger clamp when exporting (--clamp)
within-not-reached [warning] no rate of probing holds the error within what was asked for 95 % of the time
    → ask for what is reached, or select a better model first: more runs, more sensors, --memory
within-without-probing [info] the model alone holds what was asked; it needs no touch-offs for it
"""
)
