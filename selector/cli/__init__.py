"""The command line: read → call → write."""

from __future__ import annotations

import contextlib
import inspect
import os
import signal
import sys
import warnings
from collections.abc import Callable, Sequence
from typing import Annotated

import typer

from selector import __version__
from selector.cli import (
    applying,
    demo,
    diagnosing,
    effects,
    exporting,
    models,
    patent,
    predicting,
    proving,
    reading,
    reporting,
    running,
    selecting,
    simulating_drive,
    simulating_gauging,
    simulating_thermal,
    simulating_vibration,
    workbench,
)

__all__ = ["app", "exit_status", "main"]

app = typer.Typer(
    name="selector",
    epilog="With --json only JSON goes to stdout. Exit codes: 0 done, 2 unusable input, 1 a defect, 130 stopped.",
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    invoke_without_command=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"selector {__version__}")
        raise typer.Exit


@app.callback()
def _selector(
    context: typer.Context,
    version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, metavar="", help="Print the version and stop."
        ),
    ] = False,
) -> None:
    """Choose temperature sensors of a machine tool, prove the model on runs it has not seen, and hand it over."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


def _command(name: str, command: Callable[..., None], group: typer.Typer = app) -> None:
    """Adds a command; line breaks inside a paragraph of its docstring are not line breaks on the screen."""
    paragraphs = inspect.cleandoc(command.__doc__ or "").split("\n\n")
    group.command(name, help="\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs))(command)


_command("describe", reading.describe)
_command("convert", reading.convert)
_command("select", selecting.select)
_command("demo", demo.demo)
_command("apply", applying.apply)
_command("export", exporting.export)
_command("predict", predicting.predict)
_simulate = typer.Typer(help="Write a recording of a machine that a model file describes.")
_command("thermal", simulating_thermal.thermal, _simulate)
_command("drive", simulating_drive.drive, _simulate)
_command("vibration", simulating_vibration.vibration, _simulate)
_command("gauging", simulating_gauging.gauging, _simulate)
app.add_typer(_simulate, name="simulate")
_model = typer.Typer(help="Look at a model file.")
_command("show", models.show, _model)
_command("check", models.check, _model)
_command("card", models.card, _model)
app.add_typer(_model, name="model")
_command("diagnose", diagnosing.diagnose)
_command("report", reporting.report)
_command("effects", effects.effects)
_command("prove", proving.prove)
_command("workbench", workbench.workbench)
_command("audit-patent", patent.audit_patent)


def exit_status(arguments: Sequence[str] | None = None) -> int:
    """The exit code of one command line (default: that of this process), see `selector.cli.running`."""
    return running.exit_status(app, arguments)


def main() -> None:
    """Runs the command line of this process and ends it."""
    if not os.environ.get("SELECTOR_DEBUG"):
        # what matters to the user is said as a finding; remarks of libraries about themselves are not
        warnings.simplefilter("ignore")
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            # closed by the caller (`>&-`), or a program without a console
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: PTH123, SIM115 (open for good)
    status = exit_status()
    # all is written and said: a Ctrl-C while the interpreter takes itself down must not turn success into a death
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if status == running.STOPPED:
        # compiled code that was interrupted may abort the interpreter while it takes itself down
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError, ValueError):
                stream.flush()
        os._exit(status)
    sys.exit(status)
