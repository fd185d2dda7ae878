"""The findings of a diagnosis: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds
from selector.quality.finding_table import FINDINGS as QUALITY

BEYOND_MEASURE = "beyond-measure"
NOT_COMPARED = "not-compared"
SLOW_REMAINDER = "slow-remainder"
UNRECORDED_SWITCH = "unrecorded-switch"

FINDINGS = Kinds.of(
    """
not-compared [warning] a response is not compared: too few usable values, or no movement
    → check the recording and the file
differs-held-out [warning] a simulation is the recording where it is fitted, and differs on what is held out
    → hold out another part of the recording, with --holdout
coarse-simulation [warning] the simulation has fewer values than the recording; only readings at its times are compared
    → write the simulation as often as the machine was recorded
partly-simulated [warning] the simulation covers a part of the recorded rows; only these are compared
    → simulate the whole run, or check the unit of time in both
simulated-only [info] runs are simulated but not recorded
    → give the recordings of these runs too
clocks-with-other-zeros [info] the recorded and the simulated clock have other zeros; both are counted from their first
    sample
    → give both the same zero of time if this is not what is meant
run-not-compared [warning] a run is not compared: it is not simulated, or does not meet the simulation
    → simulate this run too
runs-exchanged [warning] simulated runs may stand under each other's names
    → name every simulated file like the recording that it was computed for
read-seldom [info, warning] responses are read in few rows and compared there only
    → Diagnose the other responses by themselves, with --response, to use all their rows.
beyond-measure [warning] values are too large to be meant; they count as missing
    → correct or remove these values, or the unit
input-of-simulation [info, warning] a response is in the simulation as it was recorded: the simulation was given it
    → check the recording and the file
simulation-stands-still [warning] a simulated response never moves: all that was recorded counts as left out
    → check that the column holds what was simulated
simulation-is-recording [warning] a simulated response is the recorded one to within its rounding
    → check that the simulation is not a copy of the recording
slow-remainder [info] what is left wanders slowly: it may be noise or a slow effect
    → Repeat one run with the machine idle: if the reading wanders as much, it is the gauge.
unrecorded-switch [warning] a response changes its level at moments at which nothing that was recorded changes
    → Look up what was switched, opened or set at these moments, and record it as a channel of role state.
small-misfit [info] what is left is no noise, but too little of the movement to be called missing physics
    → Use the simulation as it is, unless a few hundredths of the movement matter to you.
mode [info] how the runnable model was used, and how often it was simulated
not-in-model [warning] the model file cannot express an effect that was found
    → use the correction, or describe the machine in more detail (a screw with its springs, more nodes)
parameter-pulled [warning] a parameter was pulled far to fit the recordings: it may stand in for something else
    → check it against the name plate; the effects below are tested beside it
parameters-left-alone [info] the recordings say little of parameters; they stay near what the model says
"""
)
FINDINGS["short-run"] = QUALITY["short-run"]
