"""The findings of a selection: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds
from selector.quality.finding_table import FINDINGS as QUALITY
from selector.sensors.finding_table import CONSTANT_SENSOR
from selector.sensors.finding_table import FINDINGS as SENSORS

FEW_RUNS = "few-runs"
SENSOR_MISSING = "sensor-missing"

FINDINGS = Kinds.of(
    """
regimes [warning] the unseen error falls into regimes of consecutive runs: something changed that is not recorded
    → find out what differed (setup, tool, coolant, spindle programme, season) and record it as a channel, or build one
      model per regime
one-run-only [warning] there is one run: the error is that of parts of it left out in turn
    → record at least three runs on different days and duty cycles
few-runs [warning] the error on unseen runs rests on few runs, or on some that begin warm: it is known to a factor only
    → record more runs, with other speeds and another season
runs-left-out-in-groups [info] there are many runs: they are left out in groups of whole runs, not one by one; the error
    of each run is that of a model without its group
no-better-than-nothing [error] on unseen data the model is no better than no model: do not use it
    → look for a condition that the recording does not hold (see the regimes, if any were found), record it, or try
      --memory
one-part-unlike-the-others [warning] one run (or stretch) is predicted much worse than the others
    → look at this run: another setup, a moved gauge, coolant, an open door?
runs-not-proved [warning] runs in which a sensor of the model has no reading prove nothing: the error is that of the
    others
    → repair the runs ([runs.NAME] in the machine file), or leave the sensor out with --never and compare
memory-goes-on [info] by their clocks runs follow one another: memory goes on from the run before, as on a control
    that stays on
samples-thinned [info] sensors are chosen on all samples, final coefficients and errors come from a part of them
choice-at-limit [info] as many sensors are chosen as --max-sensors allows: more might predict better
    → See whether more are worth their cost: a larger --max-sensors.
target-missed [warning] the model does not reach the error of --target on unseen data
    → allow more sensors (--max-sensors), offer memory or products, record more runs, or ask for less
terms-that-help [info] richer terms (squares, products, memory) predict unseen data better; the model uses them
terms-not-used [info] richer terms (squares, products, memory) do not predict unseen data better; the model does without
    → More runs, longer and with heating and cooling, would let richer terms prove themselves.
collinear-terms [warning] the terms of the model move together: single coefficients are uncertain
    → Do not read single coefficients; a smaller --max-sensors gives terms that are less alike.
correlated-residuals [info] residuals follow each other: the machine remembers something that the model does not
    → Try --memory: lagged temperatures follow slow parts.
influential-sample [warning] one sample bends the model by itself
    → look for a spike in the recordings
ridge [info] the ridge penalty that predicts unseen data best
runs-outside-the-others [info] runs lie beyond what the other runs cover: their unseen error is that of an extrapolation
    → more runs of this kind would prove the model there
unstable-choice [warning] a sensor is chosen in few resamples of the runs
    → the runs do not agree on this sensor: record more, or compare the sets beside the chosen one
sensor-missing [warning] a sensor is missing too often where the displacement is known; it is not a candidate
    → Check its wiring; if it must be kept at the price of those samples: --must.
samples-lost [warning] a sensor is missing in part of the samples and none can stand in for it; those samples are not
    used
    → Repair it and record again, or use --never; --reference absolute needs no start reading.
run-without-displacement [warning] a run has no samples of the displacement; it is left out
    → check the displacement column of this file, or choose another --response
"""
)
FINDINGS["gauge-not-zeroed"] = QUALITY["gauge-not-zeroed"]
FINDINGS["constant-sensor"] = SENSORS[CONSTANT_SENSOR]
