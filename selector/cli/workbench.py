"""`workbench`: the local web page of a study."""

import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from selector.cli.shared.option_table import argument, option
from selector.cli.shared.source import MachineFile


def workbench(
    files: Annotated[list[Path] | None, argument("workbench FILE...")] = None,
    machine: MachineFile = None,
    folder: Annotated[Path | None, option("workbench --folder")] = None,
    port: Annotated[int, option("workbench --port", min=0, max=65535)] = 0,
    no_browser: Annotated[bool, option("workbench --no-browser")] = False,
) -> None:
    """Opens the workbench in the browser: load recordings, correct what was guessed, select, diagnose, export.

    Only this computer can open it, with the address that is printed. Everything it does is a command line, which it
    shows. Ctrl-C ends it.
    """
    from selector.workbench import serve

    def opened(address: str, opener: Path) -> None:
        typer.echo(f"The workbench is at {address}\nCtrl-C ends it.")
        if not no_browser:
            webbrowser.open(opener.as_uri())

    serve(files or (), machine=machine, folder=folder, port=port, when_ready=opened)
