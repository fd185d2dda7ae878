"""Many machines, the same question: studies in processes or on a cluster, and what is done is not done again."""

from selector.fleet.fleet_file import Fleet as Fleet
from selector.fleet.fleet_file import read_fleet as read_fleet
from selector.fleet.machine_study import Answer as Answer
from selector.fleet.machine_study import answered as answered
from selector.fleet.overview import Overview as Overview
from selector.fleet.overview import overview as overview
from selector.fleet.running import RESULT_FILE as RESULT_FILE
from selector.fleet.running import FleetAnswer as FleetAnswer
from selector.fleet.running import read_answer as read_answer
from selector.fleet.running import run_fleet as run_fleet
from selector.fleet.sisters import SistersAnswer as SistersAnswer
from selector.fleet.sisters import sisters_in as sisters_in
from selector.fleet.watching import FleetWatch as FleetWatch
from selector.fleet.watching import WatchedMachine as WatchedMachine
from selector.fleet.watching import watch_fleet as watch_fleet
from selector.fleet.workers import Cluster as Cluster
from selector.fleet.workers import Processes as Processes
