"""The command line: read → call → write."""

import contextlib
import inspect
import os
import signal
import sys
import threading
import warnings
from collections.abc import Callable, Sequence
from typing import Annotated, Any

import typer

from selector import __version__
from selector.cli import (
    adapting,
    applying,
    ball_bar,
    demo,
    diagnosing,
    effects,
    exporting,
    fleets,
    live,
    models,
    predicting,
    proving,
    reading,
    reporting,
    selecting,
    simulating,
    taps,
    workbench,
)
from selector.cli.shared import running
from selector.cli.shared.option_table import option
from selector.errors import OptionError
from selector.physics.simulation_kind import own_kinds, simulation_kinds

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
    version: Annotated[bool, option("selector --version", callback=_print_version, is_eager=True)] = False,
) -> None:
    """Choose temperature sensors of a machine tool, prove the model on runs it has not seen, and hand it over."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


class _OnceEach(typer.core.TyperCommand):
    """A command that refuses an empty name, which would be the present folder, and an option given twice."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """The arguments that are left. Raises OptionError: one is empty, or an option with one value has two."""
        for before, word in zip([ctx.command_path, *args], args, strict=False):
            name, _, value = word.partition("=") if word.startswith("--") and "=" in word else (before, "", word)
            if not value.strip(" ") and name != "--separator":
                where = name if name.startswith("-") else f"behind {name}"
                raise OptionError(
                    "an empty name", expected="a name or a value", where=where,
                    advice="leave it out, or fill it in; a variable of your script may be empty",
                )  # fmt: skip
        _, _, given = self.make_parser(ctx).parse_args(args=list(args))
        for one in given:
            single = isinstance(one, typer.core.TyperOption) and not (one.multiple or one.is_flag)
            if single and given.count(one) > 1:
                name = max(one.opts, key=len)
                raise OptionError(
                    f"{name} {given.count(one)} times", expected="one value", where=name,
                    advice="leave all of them out but one",
                )  # fmt: skip
        return super().parse_args(ctx, args)


def _command(name: str, command: Callable[..., None], group: typer.Typer = app) -> None:
    """Adds a command; line breaks inside a paragraph of its docstring are not line breaks on the screen."""
    paragraphs = inspect.cleandoc(command.__doc__ or "").split("\n\n")
    told = "\n\n".join(" ".join(paragraph.split()) for paragraph in paragraphs)
    group.command(name, cls=_OnceEach, help=told)(command)


_command("describe", reading.describe)
_command("convert", reading.convert)
_command("select", selecting.select)
_command("demo", demo.demo)
_command("apply", applying.apply)
_command("adapt", adapting.adapt)
_command("export", exporting.export)
_command("collect", live.collect)
_command("compensate", live.compensate)
_command("predict", predicting.predict)


class _Kinds(typer.core.TyperGroup):
    """The kinds of simulation that are shipped, and those that were registered since."""

    def list_commands(self, ctx: Any) -> list[str]:
        """Names, those that were registered last."""
        return list(simulation_kinds())

    def get_command(self, ctx: Any, cmd_name: str) -> Any:
        """The command of a kind."""
        kind = simulation_kinds().get(cmd_name)
        if kind is None or cmd_name in self.commands:
            return super().get_command(ctx, cmd_name)
        alone = typer.Typer(add_completion=False, rich_markup_mode="rich")
        _command(cmd_name, simulating.simulate_command(kind), alone)
        return typer.main.get_command(alone)


_simulate = typer.Typer(help="Write a recording of a machine that a model file describes.", cls=_Kinds)
for _kind in own_kinds().values():
    _command(_kind.name, simulating.simulate_command(_kind), _simulate)
app.add_typer(_simulate, name="simulate")
_model = typer.Typer(help="Look at a model file.")
_command("show", models.show, _model)
_command("check", models.check, _model)
_command("card", models.card, _model)
app.add_typer(_model, name="model")
_command("diagnose", diagnosing.diagnose)
_fleet = typer.Typer(help="Ask many machines the same question.")
_command("run", fleets.run, _fleet)
_command("watch", fleets.watch, _fleet)
_command("report", fleets.report, _fleet)
_command("sisters", fleets.sisters, _fleet)
app.add_typer(_fleet, name="fleet")
_command("ballbar", ball_bar.ballbar)
_command("taps", taps.taps)
_command("report", reporting.report)
_command("effects", effects.effects)
_command("prove", proving.prove)
_command("workbench", workbench.workbench)
_command("audit-patent", demo.audit_patent)


def exit_status(arguments: Sequence[str] | None = None) -> int:
    """The exit code of one command line (default: that of this process), see `selector.cli.shared.running`."""
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
    if signal.getsignal(signal.SIGINT) is not signal.SIG_IGN:
        # who ends a process from outside is owed the same clean end as who presses Ctrl-C
        signal.signal(signal.SIGTERM, lambda *_: signal.raise_signal(signal.SIGINT))
    status = exit_status()
    # all is written and said: a Ctrl-C while the interpreter takes itself down must not turn success into a death
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if status == running.STOPPED or threading.active_count() > 1:
        # compiled code that was interrupted, or that a thread is still in, may abort the interpreter that takes
        # itself down: the workbench ends while it reads recordings
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError, ValueError):
                stream.flush()
        os._exit(status)
    sys.exit(status)
