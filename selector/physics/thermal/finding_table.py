"""The findings of thermal models: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds
from selector.physics.finding_table import FINDINGS as SHARED_FINDINGS

ONE_TESTED_SPEED = "one-tested-speed"

FINDINGS = Kinds.of(
    """
start-differs [warning] runs do not begin at the temperature at which the model starts
    → compare the later hours only, or set start_degc under [run]
no-way-for-heat [warning] nodes lack a film or a link: heat that enters stays there, or nothing changes their
    temperatures
    → give the node a link to its neighbour or a film to the hall in the model file
cooling-grows-with-speed [warning] the machine cools better while the spindle turns
    → add a test in which the spindle turns and rests by turns
hall-temperature-drives-displacement [info, warning] a temperature around the machine moved during the tests and moves
    the displacements
    → add a column with its name to the duty cycle, or keep it constant
record-cut-into-tests [info] a long run was cut into tests where the spindle turned after a rest
start-of-the-duty-cycle [info, warning] how the duty cycle is taken to begin, and what would differ otherwise
    → give --start cold or --start tests
unmeasured-drift [info, warning] something that nobody measured moves the displacements slowly; it is part of the
    claimed error
    → record more temperatures around the machine (hall, coolant, foundation) with the role ambient
claimed-error-unknown [warning] no test can be left out and predicted by the others: no error is claimed
    → record two or three heating and cooling tests one after the other in one record
few-tests [warning] the claimed error rests on few tests that were left out: it is known to a factor only
    → record more heating and cooling tests, at speeds between those tested
gain-uncertain [warning] the error may be as large as the movement predicted: a correction may leave more than none
    → leave this displacement uncorrected, or record more tests that begin as the duty cycle does
ambient-not-used [info] the duty cycle has a temperature of which the tests do not show that it drives a displacement
unplanned-stop [warning] by the thermometers of the day the spindle stood when the plan says that it turns
    → correct by the course of the readings, not by the plan
day-begins-late [warning] the day's clock does not begin at 0; its first reading was taken as the start of the cycle
    → cut the recording where the duty cycle begins
readings-off-plan [warning] no stop makes the readings of the day fit the plan
    → check speeds, hall and thermometers of that day; do not correct by it
start-not-at-rest [info, warning] a run does not begin at rest and cold; the state at its start is fitted too
    → Let the machine rest until it is cold before a heating test.
modes-leave-structure [warning] the thermal modes leave more than noise: something else moves the displacement
    → record the hall temperature with the tests, and look at the runs for steps
modes-at-most [info] as many modes are supported as are tried
    → look at the residuals: a continuum of modes, or something that is no thermal mode
no-further-mode [info] how many modes the tests support, and why no more
time-constant-unbounded [warning] the tests do not bound a time constant
    → run the tests longer, until the displacement stands still
one-tested-speed [warning] only one speed was tested: how heat grows with the speed is assumed
    → test at two or more further speeds below it
two-tested-speeds [info] only two speeds were tested: speeds far from both are less certain
    → test at further speeds
last-speed-held [info] the operations are longer than the duty cycle: its last speed is held to their end
last-row-is-the-end [warning] the last row of a duty cycle is its end: the speed in it is not reached
    → add a row with a later time to hold that speed
test-left-out [warning] a test has too few readings of a displacement; it is left out
    → check the gauge in that run, or predict that displacement alone
longer-than-tests [warning] the duty cycle is longer than the longest test
    → record a longer heating test
usual-tolerance [info] no tolerance was given; the usual one is taken
    → give --tolerance
one-operation [info] no operations were given; the whole duty cycle is one, with one zero
    → give --operations with the minutes of each
operations-end-early [info] the operations end before the duty cycle: there are no corrections after them
sign-not-verified [warning] corrections are counted as the gauge counted in the tests
    → verify the sign on the machine before the first part
drift-beyond-tolerance [info, warning] the program keeps the predicted displacement within the tolerance; the true one
    leaves it by the error of the prediction
    → Record one run like the duty cycle and compare.
no-thermal-movement [warning] no thermal movement was found above the noise: what is predicted is noise
    → check the gauge, or leave this displacement out
run-begins-warm [warning] a test did not begin cold, or something else moves it: predictions are too small
    → let the machine rest until it is cold before a heating test
one-speed-tested [warning] one speed was tested, and the duty cycle has others
    → test at two or more further speeds below it
slower-than-tests [info] the duty cycle has a speed less than half of the slowest tested one
    → test at a slow speed too
run-contradicts-others [warning] a test contradicts the others
    → check the sign of the gauge in that run, or leave the run out
unlikely-temperature [warning] simulated temperatures are ones that no machine tool survives
    → check heat capacities, films and sources in the model file; its keys carry their units
additional-operation [info] a displacement is beyond all of its characteristic; the steady level is approached along a
    cooling curve
    → expect more error there; the modal method carries the state through a change of speed
displacement-on-other-side [warning] a displacement is on the other side of zero than its characteristic; what is left
    of it fades along a cooling curve
    → use the modal method for this displacement
entry-not-unique [warning] a characteristic turns back and has the present displacement more than once; it is entered
    where it has it first
    → use the modal method for this displacement; the source of the piecewise method gives such axes up
cooling-scaled [info] a displacement is beyond the beginning of every recorded cooling; the largest is scaled
    → record the cooling after the longest heating at the fastest speed
cooling-assumed [warning] no recorded cooling can be followed; the heating at the fastest speed is taken upside down
    → record the machine cooling after a heating test
characteristic-extended [warning] a displacement is followed further than the test at that speed lasted
    → record longer heating tests
"""
)
FINDINGS["input-not-recorded"] = SHARED_FINDINGS["input-not-recorded"]
FINDINGS["output-not-recorded"] = SHARED_FINDINGS["output-not-recorded"]
