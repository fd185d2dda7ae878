"""Many machines, the same question: studies in processes or on a cluster, and what is done is not done again."""

from selector.fleet.fleet_file import Fleet, read_fleet
from selector.fleet.machine_study import Answer, Refit, answered, key_of
from selector.fleet.overview import Overview, overview
from selector.fleet.running import RESULT_FILE, FleetAnswer, read_answer, run_fleet
from selector.fleet.sisters import SistersAnswer, sisters_in
from selector.fleet.watching import FleetWatch, WatchedMachine, watch_fleet
from selector.fleet.workers import Cluster, Processes, Workers

__all__ = [
    "RESULT_FILE",
    "Answer",
    "Cluster",
    "Fleet",
    "FleetAnswer",
    "FleetWatch",
    "Overview",
    "Processes",
    "Refit",
    "SistersAnswer",
    "WatchedMachine",
    "Workers",
    "answered",
    "key_of",
    "overview",
    "read_answer",
    "read_fleet",
    "run_fleet",
    "sisters_in",
    "watch_fleet",
]
