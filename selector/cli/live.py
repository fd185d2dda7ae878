"""`collect` and `compensate`: live data into a lake, and the guarded model as a process beside the control."""

from __future__ import annotations

import asyncio
import contextlib
import signal
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from selector.atomic_file import require_writable_folder
from selector.cli.models import Model
from selector.cli.shared import showing
from selector.cli.shared.option_table import argument, option
from selector.cli.shared.showing import AsJson
from selector.errors import CancelledError, OptionError

if TYPE_CHECKING:
    from selector.live.collecting import Collection
    from selector.live.compensating import Compensation

Cycles = Annotated[int | None, option("live --cycles", min=1)]


def collect(
    io: Annotated[Path, argument("collect IO.toml")],
    out: Annotated[Path, option("collect --out")],
    cycles: Cycles = None,
    as_json: AsJson = False,
) -> None:
    """Keeps what a machine says: a row a period into Parquet files, `LAKE/machine=NAME/month=YYYY-MM`, one a day.

    A process that is killed loses 10 s at most and damages nothing. Gaps are filled from what servers still have: the
    buffer of an MTConnect agent, the history of an OPC UA server. `selector describe LAKE` reads it, and so does every
    command that reads recordings; a day is a run.
    """
    from selector.live.collecting import Collection
    from selector.live.io_file import read_io
    from selector.live.links import RealClock

    said = read_io(io)
    require_writable_folder(out, "--out")
    done = asyncio.run(_until_stopped(lambda: Collection(said, RealClock(), out), cycles))
    if as_json:
        showing.print_json(done)
    else:
        showing.screen().print(f"{done['rows']} rows, and {done['filled']} that were missed", markup=False)
        showing.show_written(showing.screen(), Path(done["folder"]))


def compensate(
    model: Model,
    io: Annotated[Path, option("compensate --io")],
    out: Annotated[Path, option("compensate --out")] = Path("live"),
    cycles: Cycles = None,
    fast: Annotated[bool, option("compensate --fast")] = False,
    as_json: AsJson = False,
) -> None:
    """Corrects a machine from a process beside its control: reads sensors, computes, writes, reads back.

    What is written is what the guard of the model gives, and zero while the control does not show that it lives and
    that it has what was written. Ctrl-C ramps to zero and ends, a second one ends at once. This is not a safety
    function.
    """
    from selector.controllers.self_check import usable_model
    from selector.live.compensating import Compensation
    from selector.live.io_file import read_io
    from selector.live.journal import status_words
    from selector.live.links import FastClock, RealClock

    read, _ = usable_model(model)
    said = read_io(io, read)
    if fast and any(one.kind != "file" for one in said.connections.values()):
        expected, advice = "connections of kind file only", "leave --fast out, or rehearse with files"
        raise OptionError("--fast with a server", expected=expected, where=str(io), advice=advice)
    require_writable_folder(out, "--out")
    clock = FastClock() if fast else RealClock()
    status = asyncio.run(_until_stopped(lambda: Compensation(read, said, clock, out), cycles))
    if as_json:
        showing.print_json(status)
        return
    console = showing.screen()
    console.print(showing.table("Process beside the control", ["what", "now"], status_words(status, read)))
    showing.show_written(console, out)


async def _until_stopped(made: Callable[[], Compensation | Collection], cycles: int | None) -> dict[str, Any]:
    """The first Ctrl-C (or SIGTERM) asks to stop, the second ends."""
    process, loop = made(), asyncio.get_running_loop()
    task = asyncio.ensure_future(process.run(cycles))

    def ask() -> None:
        if process.is_stopping:
            task.cancel()
        process.is_stopping = True

    for number in (signal.SIGINT, signal.SIGTERM):
        # not on Windows, where Ctrl-C ends at once
        with contextlib.suppress(NotImplementedError, RuntimeError, ValueError):
            loop.add_signal_handler(number, ask)
    try:
        return await task
    except asyncio.CancelledError:
        raise CancelledError("stopped at once. What was written until then stays, also at the control.") from None
