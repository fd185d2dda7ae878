"""The findings of a selection: how much each matters, what it means and what to do about it."""

from selector.findings import Kinds
from selector.quality.finding_table import FINDINGS as QUALITY
from selector.sensors.finding_table import CONSTANT_SENSOR
from selector.sensors.finding_table import FINDINGS as SENSORS

FEW_RUNS = "few-runs"
SENSOR_MISSING = "sensor-missing"

FINDINGS = Kinds.beside(__file__)
FINDINGS["gauge-not-zeroed"] = QUALITY["gauge-not-zeroed"]
FINDINGS["constant-sensor"] = SENSORS[CONSTANT_SENSOR]
