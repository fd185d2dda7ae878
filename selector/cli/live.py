"""`compensate`: the guarded model as a process beside the control."""

from __future__ import annotations

import asyncio
import contextlib
import signal
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Annotated, Any

import typer

from selector.atomic_file import require_writable_folder
from selector.cli.models import Model
from selector.cli.shared import showing
from selector.cli.shared.files import written_folder
from selector.cli.shared.showing import AsJson
from selector.errors import OptionError

Io = Annotated[Path, typer.Option("--io", metavar="IO.toml", help="Servers, channels, outputs, heartbeats.")]
Cycles = Annotated[int | None, typer.Option("--cycles", metavar="N", min=1, help="Stop after so many periods.")]


def compensate(
    model: Model,
    io: Io,
    out: Annotated[
        Path, typer.Option("--out", metavar="DIR", parser=written_folder, help="Journal, status page, start readings.")
    ] = Path("live"),
    cycles: Cycles = None,
    fast: Annotated[
        bool, typer.Option("--fast", metavar="", help="A rehearsal with files only: as fast as it can be computed.")
    ] = False,
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
    from selector.live.links import FastClock, RealClock

    read, _ = usable_model(model)
    said = read_io(io, read)
    if fast and any(one.kind != "file" for one in said.connections.values()):
        raise OptionError(
            "--fast with a server",
            expected="connections of kind file only",
            where=str(io),
            advice="leave --fast out, or rehearse with files",
        )
    require_writable_folder(out, "--out")

    async def work() -> dict[str, Any]:
        process = Compensation(read, said, FastClock() if fast else RealClock(), out)

        def stop() -> None:
            process.is_stopping = True

        return await _until_stopped(process.run(cycles), stop)

    status = asyncio.run(work())
    if as_json:
        showing.print_json(status)
        return
    console = showing.screen()
    rows = [(key, str(value)) for key, value in status.items() if key != "schema"]
    console.print(showing.table("Process beside the control", ["what", "value"], rows))
    showing.show_written(console, out)


async def _until_stopped(work: Coroutine[Any, Any, dict[str, Any]], stop: Callable[[], None]) -> dict[str, Any]:
    """The first Ctrl-C (or SIGTERM) asks to stop, the second ends."""
    task, loop = asyncio.ensure_future(work), asyncio.get_running_loop()
    asked: list[bool] = []

    def ask() -> None:
        if asked:
            task.cancel()
        asked.append(True)
        stop()

    for number in (signal.SIGINT, signal.SIGTERM):
        # not on Windows, where Ctrl-C ends at once
        with contextlib.suppress(NotImplementedError, RuntimeError, ValueError):
            loop.add_signal_handler(number, ask)
    try:
        return await task
    except asyncio.CancelledError:
        raise KeyboardInterrupt from None
