"""A model with narrow limits, a control in memory that fails as told, and what may arrive there."""

from __future__ import annotations

import asyncio
import math
from pathlib import Path

from selector.controllers.model_file import Guard, Input, ModelFile, Output, OutputLimits, Term
from selector.live.compensating import Compensation
from selector.live.io_file import read_io
from selector.live.links import FastClock, Sample, number_in

CLAMP_UM, SLEW_UM_PER_S = 12.0, 0.5
ROUNDING = 1e-9  # of sums of differences of numbers up to 12


def model() -> ModelFile:
    """Z = 2 um/K of the rise of T1, + 1 um/K of T2 above 20; clamp and slew that are reached."""
    return ModelFile(
        name="two sensors",
        inputs=(
            Input(name="T1", valid_min=0.0, valid_max=10.0),
            Input(name="T2", reference="absolute", centre=20.0, valid_min=15.0, valid_max=25.0),
        ),
        outputs=(
            Output(
                name="Z",
                intercept=0.0,
                terms=(Term(powers={"T1": 1}, coefficient=2.0), Term(powers={"T2": 1}, coefficient=1.0)),
            ),
        ),
        guard=Guard(
            limits=(OutputLimits(output="Z", clamp_um=CLAMP_UM, slew_um_per_s=SLEW_UM_PER_S),),
            on_fault="ramp-to-zero",
            recover_after_s=5.0,
        ),
    )


def io_text(connection: str, *, control: str = "", output: str = "", addresses=("T1", "T2", "Z")) -> str:
    """An IO file with one connection, called plc."""
    t1, t2, z = addresses
    return f"""
machine = "lathe-3"
period_s = 1.0
mistrust_s = 20
[connections.plc]
{connection}
[channels.T1]
at = "plc"
address = "{t1}"
unit = "degC"
[channels.T2]
at = "plc"
address = "{t2}"
unit = "degC"
[outputs.Z]
at = "plc"
address = "{z}"
{output}
{control}
"""


class MemoryLink:
    """A control whose values are those of a dictionary; `arrived` has every correction that it took, and when."""

    def __init__(self, clock: FastClock) -> None:
        self.clock = clock
        self.values: dict[str, object] = {"T1": 20.0, "T2": 20.0}
        self.quality: dict[str, str] = {}
        self.arrived: list[tuple[float, float]] = []
        self.is_cut = self.is_refusing = self.is_lying = self.is_deaf = False

    async def open(self) -> None:
        if self.is_cut:
            raise ConnectionRefusedError("cut")

    async def read(self, addresses):
        await self.open()
        return {
            name: Sample(number_in(self.values[name]), self.quality.get(name, "good"))
            for name in addresses
            if name in self.values
        }

    async def write(self, values):
        await self.open()
        if self.is_refusing:
            raise PermissionError("BadNotWritable")
        for name, value in values.items():
            if name == "Z":
                self.arrived.append((self.clock.monotonic(), value))
            self.values[name] = value if not (self.is_lying and value) else 5e-324 + 3.1e17
        if self.is_deaf:
            # it arrived, and the answer did not
            raise TimeoutError

    async def history(self, addresses, since_s, until_s):
        return {}

    async def close(self) -> None:
        pass


def plant(folder: Path, *, control: str = "", output: str = "") -> tuple[Compensation, MemoryLink, FastClock]:
    """The process beside a control in memory, on a clock that passes as told."""
    path = folder / "io.toml"
    path.write_text(io_text('kind = "file"\nurl = "nowhere.csv"', control=control, output=output), "utf-8")
    clock = FastClock(1_700_000_000.0)
    process = Compensation(model(), read_io(path, model()), clock, folder / "out")
    link = MemoryLink(clock)
    process.links["plc"].link = link
    return process, link, clock


def run(process: Compensation, clock: FastClock, seconds: int, each=lambda second: None) -> None:
    """So many periods of a second."""

    async def work() -> None:
        for second in range(seconds):
            each(second)
            await process.step()
            await clock.sleep_until(clock.monotonic() + 1.0)

    asyncio.run(work())


def beyond_the_guard(
    arrived: list[tuple[float, float]],
    unit: float = 1.0,
    late_s: float = 0.0,
    before: tuple[float, float] = (-math.inf, 0.0),
) -> list[str]:
    """What must not have arrived: more than the clamp, or a step beyond the slew limit that does not end at zero.

    A gap counts for 10 s at most, as in the guard. `late_s`: so much later it may have been noted than it arrived.
    """
    wrong, before_s, last = [], *before
    for moment_s, value in arrived:
        value_um = value / unit
        allowed = SLEW_UM_PER_S * min(moment_s - before_s + late_s, 10.0) + ROUNDING
        if not abs(value_um) <= CLAMP_UM + ROUNDING:
            wrong.append(f"{value_um} at {moment_s}")
        if value_um != 0.0 and not abs(value_um - last) <= allowed:
            wrong.append(f"from {last} to {value_um} at {moment_s}")
        before_s, last = moment_s, value_um
    return wrong
