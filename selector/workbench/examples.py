"""Studies that come with the package, to be opened on the first page."""

from dataclasses import dataclass

from selector.shipped import shipped
from selector.workbench.bench import Bench
from selector.workbench.cycle import cycle_in
from selector.workbench.study_folder import SIMULATION


@dataclass(frozen=True)
class Example:
    """A folder of shipped recordings, and which of its files are which."""

    folder: str
    title: str
    runs: str
    simulated: str = ""
    cycle: str = ""


EXAMPLES = (
    Example("spindle46", "Measured: a spindle, 46 hours, 16 thermometers", "*.parquet", cycle="staircase.csv"),
    Example("vmc37", "Simulated: a machining centre, 8 runs, 37 thermometers", "*.csv"),
    Example("diagnosis", "Simulated: 3 runs, and a simulation that leaves something out", "r*.csv", "sim/*.csv"),
)


def open_example(bench: Bench, name: str) -> None:
    """Takes the recordings of an example up where they are, and copies what a study folder holds of it."""
    one = next(example for example in EXAMPLES if example.folder == name)
    place = shipped(one.folder)
    for path in sorted(place.glob(one.simulated)) if one.simulated else ():
        target = bench.folder / SIMULATION / path.name
        target.parent.mkdir(exist_ok=True)
        target.write_bytes(path.read_bytes())
    if one.cycle:
        cycle = cycle_in(place / one.cycle)
        bench.choose_cycle(cycle.steps, cycle.hall)
    bench.add(*sorted(place.glob(one.runs)), machine=place / "machine.toml")
