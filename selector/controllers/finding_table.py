"""The findings about model files and programs: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds

SENSOR_LOOKS_BROKEN = "sensor-looks-broken"
OUTSIDE_VALID_RANGE = "outside-valid-range"

FINDINGS = Kinds.of(
    """
other-sampling [info, warning, error] a run is sampled much faster or slower than the recordings of the model
    → Check the unit of the time; if the logger was set otherwise, all is well.
no-prediction [warning] part of a run has no prediction, for want of readings
    → see the findings about its sensors; errors are counted over the other samples
no-displacement [info] no displacement is recorded; there are predictions, but no errors
worse-than-nothing [error] the error with compensation is larger than without
    → Do not use it like this; check the sign, the start readings and the sensors.
correction-not-in-model-file [warning] a correction of a diagnosis cannot be written as readings and lags
    → use the course in correction.json, or put the effect into the simulation
correction-of-recalibrated [warning] the model file is to be added to the recalibrated simulation, not to the simulation
    as it is
    → give the simulation this gain and delay, or use correction.json, which holds them
limit-not-decided [warning] nobody has decided how far and how fast an output may be corrected
    → Decide both with the options that the finding names.
replay-differs [error] an executed program and the reference differ by more than its numbers explain
    → do not use this file: other rules of arithmetic were at work, a sensor was judged otherwise at the very edge of a
      limit, or it is a defect of ours
guard-differs [warning] what the program's guard gives and what the whole guard would give differ
    → see in the sheet which run it is, and whether a sensor failed there or a limit acted
program-leaves-more [warning]
    a program leaves clearly more of the error than the model alone does
    → record runs like this one and make the model again; see --margin and --clamp for what they cost
margin-extrapolates [warning] a program follows its sensors beyond what the model has seen
    → record runs like these and make the model again, rather than trust the margin
fault-costs [info, warning] what the worst of the rehearsed faults leaves
    → see the table of faults in the sheet: other sensors, fallbacks or limits make it smaller
not-the-whole-model [warning] a sensor was not to be believed in part of a replayed run
    → see `selector apply` for the sensor, and the sheet for what the correction did there
outside-valid-range [info, warning] an input leaves the range in which the model has seen it: the model extrapolates
    → add a run like this one to the recordings that the model is built from
break-code-in-valid-range [warning] a code of a broken sensor is a temperature that the sensor can have
    → remove the code from guard.break_codes of the model file
slew-too-slow [warning] the slew limit is so slow that the correction takes days
    → Choose a faster slew limit (--slew).
no-test-vectors [warning] the model file has no test vectors: a program cannot check itself against it
    → export the model again with selector
test-vector-mismatch [error] the coefficients do not give the outputs that the model file expects: it was changed
    → do not use this file; export the model again
test-vectors-agree [info] the expected outputs of the model file were recomputed and agree
digest-mismatch [error] the model file was changed after it was written
    → take an intact copy; if it was changed on purpose, `selector model check --accept`
guard-vector-mismatch [error] the guard does not do what the model file expects of it: it was changed
    → if somebody changed it on purpose, `selector model check --accept` writes what it does now; else do not use it
not-sealed [info] the model file lacks something by which changes of it are noticed
    → make it again with this version of selector; `selector model check --accept` adds what an older file lacks
fallback-contradicts [warning] a fallback is farther from the model than no correction at all
    → look at its terms with `selector model show`; make the model again, or take this fallback out
limits-never-met [warning, error] limits of readings that a working sensor cannot meet
    → correct reading_min, reading_max or rate_limit_per_min of the input in the model file
proof-against-it [warning] on unseen data an output of the model was no better than no model
    → do not hand it to a control: leave this response out of `selector select`, or record what it lacks
clamp-reached [warning] the clamp cuts off part of the correction
    → choose a larger clamp (--clamp), if the machine may be corrected so far
output-not-finite [error] an output can overflow while every input is in its valid range
    → do not use this file; a coefficient is far too large or a scale far too small
valid-range-empty [warning] an input never changed: the model does not know what a change of it does
    → leave the sensor out, or record a run in which it changes
sensor-looks-broken [error] a sensor holds a break code, reads what it cannot, or has no readings
    → check the sensor and its wiring, or leave the run out
missing-readings [info] a sensor has single readings missing
single-precision-bound [info, warning] by how much single precision can differ from the model
    → Use double precision where there is one; centres far from the valid range, terms that cancel each other and memory
      of many hours make it large.
no-single-precision [warning] there is no single-precision program of this model
    → Use the double-precision program.
guard-reduced [warning] a program has a smaller guard than the model file asks for
    → Let the program that feeds the temperatures watch the sensors, or use a program with the whole guard.
position-part-left-out [warning] a control cannot follow the position: part of the correction is left out
    → use the offset near the reference position only, or a control with a slope of its own
adaptation-not-exported [warning] a program cannot take touch-offs: it has the model without its adaptation
    → use c, st, tcpou, beckhoff, sinumerik, linuxcnc or python where touch-offs are wanted
position-not-wired [warning] LinuxCNC has no such axis: the position stays at its reference
    → Wire the pin of the position in the HAL file by hand.
axis-not-wired [warning] a correction is on a pin that moves nothing
    → Name one of X Y Z U V W as its axis in the model file, or wire the pin by hand.
guard-missing [warning] the drive has nothing of the guard
    → watch the temperature in the control and pass on the reference temperature when it is bad
reference-is-start-reading [warning] a reference temperature of the drive has to be written anew at every cold start
    → let the control write P-0-0402, or fit a model of absolute readings
step-spread-silently [warning] a correction may change faster than the control passes on; it spreads the rest without an
    alarm
    → Decide with --slew below it; a thermal correction needs about 1 um/s.
slope-clipped-silently [warning] the slope of a correction may be steeper than the control passes on; it clips without
    an alarm
    → decide slope_clamp_um_per_m in guard.limits of the model file, or raise MD32760 (to 0.1 at most)
axis-not-named [warning] the model file does not say which axis a displacement belongs to
    → name the axis in the model file
position-of-another-axis [warning] a correction depends on the position of another axis, which the control's straight
    line does not know
    → use a sag compensation table (CEC) for this part
replay-not-run [warning] the program was not executed
    → Install what the finding names, and export again.
sign-unverified [warning] nobody has said that the sign test was passed
    → Do the sign test of the commissioning sheet, then export again with --sign-verified and --tested.
sign-taken-on-trust [info] the sign is said to be verified, but not which program was tested
    → compare it with the head of the program that passed the sign test, or say --tested with the digits from there
sign-turned [info] a correction is turned round, for a control that counts the axis the other way
    → do the sign test of the sheet with this program
model-not-of-program [warning] the model file beside a program does not have the limits of the program
    → export into a folder of its own; the model with these limits is then written there, too
other-target-in-folder [warning] the folder also holds programs of other controls
    → delete them with what was copied from them, or export again with an --out of its own for each control
"""
)
