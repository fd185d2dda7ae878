"""`fleet run`, `report` and `watch`: the same question to many machines, a page about all, and are they still true."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from selector.cli.shared import showing
from selector.cli.shared.progress import fleet_progress
from selector.cli.shared.showing import AsJson
from selector.errors import CancelledError, OptionError

if TYPE_CHECKING:
    from selector.fleet import Fleet, Workers

FleetPath = Annotated[
    Path, typer.Argument(metavar="FLEET.toml", help="The machines, what is asked of them, and the results folder.")
]


def run(
    fleet: FleetPath,
    jobs: Annotated[
        int | None, typer.Option("--jobs", metavar="N", min=1, help="Processes at a time. Default: one a processor.")
    ] = None,
    dask: Annotated[
        str | None, typer.Option("--dask", metavar="ADDRESS", help="Instead: the workers of this Dask scheduler.")
    ] = None,
    refit: Annotated[
        bool,
        typer.Option(
            "--refit",
            metavar="",
            help="Keep each model unless one from later recordings is better in still later ones.",
        ),
    ] = False,
    as_json: AsJson = False,
) -> None:
    """Does the study of every machine, and keeps each as soon as it is done.

    What was done before of the same recordings, options and version is not done again, so a run that was stopped or
    killed goes on where it was. A machine that fails is told with its reason, and the others go on.
    """
    from selector.fleet import read_fleet, run_fleet
    from selector.telling.fleet import fleet_account

    if jobs is not None and dask is not None:
        raise OptionError(
            f"--jobs {jobs} beside --dask {dask}",
            expected="processes of this computer, or a cluster",
            where="command line",
            advice="leave one of the two out",
        )
    asked = read_fleet(fleet)
    try:
        with fleet_progress() as tell:
            answer = run_fleet(asked, _workers(asked, jobs, dask), tell, refit=refit)
    except KeyboardInterrupt:
        raise CancelledError(
            f"stopped. What is done is kept in {asked.results}; the same command goes on from there."
        ) from None
    if as_json:
        showing.print_json(answer.model_dump(by_alias=True))
    else:
        showing.show_account(showing.screen(), fleet_account(answer, title=_title(asked)))


def watch(
    fleet: FleetPath,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FILE.html", help="Also make a page of it.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Applies every machine's model to the recordings that came after it, and says where it is no longer true.

    A cumulative sum of the errors, one run after the other, is compared with those of unseen runs when the model was
    made. Nothing is fitted again and nothing is written to a control.
    """
    from selector.fleet import read_fleet, watch_fleet
    from selector.telling import write_account
    from selector.telling.fleet import watch_account

    asked = read_fleet(fleet)
    with fleet_progress() as tell:
        account = watch_account(watch_fleet(asked, tell), title=_title(asked))
    if out is not None:
        write_account(account, out)
    if as_json:
        showing.print_json(account.data)
    else:
        showing.show_account(showing.screen(), account)
    if out is not None:
        showing.show_written(showing.screen(as_json), out)


def report(
    fleet: FleetPath,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="FILE.html", help="The page. Default: fleet.html in the results folder."),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Makes one page about all machines from the results folder: errors, sensors, reasons, the worst first."""
    from selector.fleet import read_answer, read_fleet
    from selector.telling import write_account
    from selector.telling.fleet import fleet_account

    asked = read_fleet(fleet)
    answer = read_answer(asked.results)
    missing = [name for name in asked.studies if name not in answer.machines]
    account = fleet_account(answer, missing, title=_title(asked))
    page = write_account(account, out or asked.results / "fleet.html")
    if as_json:
        showing.print_json(account.data)
    else:
        showing.show_account(showing.screen(), account)
    showing.show_written(showing.screen(as_json), page)


def _title(asked: Fleet) -> str:
    return f"Fleet: {asked.place.absolute().parent.name}"


def _workers(asked: Fleet, jobs: int | None, dask: str | None) -> Workers:
    from selector.fleet import Cluster, Processes

    if dask is not None:
        return Cluster(dask)
    return Processes(min(jobs or os.cpu_count() or 1, len(asked.studies)))
