"""The findings of in-process gauging: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds
from selector.physics.finding_table import FINDINGS as SHARED_FINDINGS

FINDINGS = Kinds.of(
    """
irregular-swing [info] the impacts of the probe never repeat: the smoothed voltage wanders
    → damp the probe, or excite it nearer to its resonance
swing-of-several-rounds [info] the swing of the probe repeats only after several periods of the pull
    → damp the probe, or excite it nearer to its resonance
two-swings [warning] two swings of the probe can last: the voltage depends on where the allowance came from
    → excite the probe at or below its resonance, damp it, or gauge outside this range
start-from-gauge [info] no allowance was recorded: it begins as the gauge says at first
    → differences of the gauge count from there: an offset of the whole gauge does not show
start-from-file [warning] no allowance was recorded: it begins at the mean of the model file
    → a part that had another allowance is off by the difference all the way: set grinding.allowance_um to its own
allowance-beyond-reach [info] parts begin beyond the reach of the gauge
    → nothing, if the first stage ends within reach; else swing wider or set the gauge farther
wanted-size-at-the-end-of-reach [warning] wanted sizes are at the end of the reach of the gauge: a threshold may never
    be reached
    → set the gauge nearer: a smaller transducer.rest_gap_m
ripple-behind-filter [info] behind the filter the voltage still swings: the relay trips on the peaks
    → Set the last threshold so that it takes the ripple out, or give smoothing.time_constant_s more.
slow-for-the-stage [warning] the gauge is slower than the last stage lasts: it commands before the stage has settled
    → give the last stage more allowance or less feed, or correct the time if it is a slip
coarse-period [warning] samples are too far apart to show what happens
    → Take a smaller run.period_s, or leave it out.
noise-trips-early [info, warning] noise trips the relay early: parts are larger than the calculated threshold has it
    → Lower the noise, feed faster in the last stage, or move the last threshold.
surface-trips-early [warning] grooves and run-out move the reading behind the filter: the relay trips on the peaks
    → set the last threshold for this surface, and give the filter more time
formula-differs [info] the formula of the sizes and Monte Carlo differ; the latter counts
    → see docs/explanation/finished-sizes.md for what the formula leaves out
sizes-off-what-is-wanted [warning] parts come out larger or smaller than wanted, on average
    → Set the last threshold that the finding names.
low-capability [warning] the capability Cpk is low: parts are out of tolerance
    → Centre the sizes in the tolerance, take a better filter, or steady the process.
better-filter [info] another time constant of the filter gives better sizes
    → Take it, with the threshold that belongs to it.
threshold-never-reached [warning] parts never reach a threshold and are given up
    → set the thresholds within what the gauge shows, or leave them out: they follow from the sizes wanted
threshold-reached-at-once [warning] parts have passed a threshold already when its stage begins
    → start with more allowance, set the stages further apart, or shorten filter and delay
"""
)
for id_ in ("channel-undecided", "recorded-gap", "recorded-clock-jitter", "output-not-recorded"):
    FINDINGS[id_] = SHARED_FINDINGS[id_]
