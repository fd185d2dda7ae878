"""`fleet run`, `report`, `watch` and `sisters`: the same question to many machines, and what these tell of another."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from selector.atomic_file import require_writable_folder
from selector.cli.shared import showing
from selector.cli.shared.option_table import argument, option, unusable_option
from selector.cli.shared.progress import fleet_progress, progress_bar
from selector.cli.shared.showing import AsJson
from selector.cli.shared.simulation_files import require_page_place
from selector.errors import CancelledError

if TYPE_CHECKING:
    from selector.fleet import Fleet
    from selector.fleet.workers import Workers
    from selector.telling.account import Account

PAGE = "fleet.html"
FleetPath = Annotated[Path, argument("fleet FLEET.toml")]
Jobs = Annotated[int | None, option("fleet --jobs", min=1)]
Dask = Annotated[str | None, option("fleet --dask")]


def run(
    fleet: FleetPath,
    jobs: Jobs = None,
    dask: Dask = None,
    refit: Annotated[bool, option("fleet run --refit")] = False,
    as_json: AsJson = False,
) -> None:
    """Does the study of every machine, and keeps each as soon as it is done.

    What was done before of the same recordings, options and version is not done again, so a run that was stopped or
    killed goes on where it was. A machine that fails is told with its reason, and the others go on.
    """
    from selector.fleet import RESULT_FILE, read_fleet, run_fleet
    from selector.telling.fleet import fleet_account

    asked = read_fleet(fleet)
    require_writable_folder(asked.results, "results", (RESULT_FILE,))
    workers = _workers(jobs, dask, asked)
    try:
        with fleet_progress() as tell:
            answer = run_fleet(asked, workers, tell, refit=refit)
    except KeyboardInterrupt:
        told = f"stopped. What is done is kept in {asked.results}; the same command goes on from there."
        raise CancelledError(told) from None
    _show(fleet_account(answer, title=_title(asked)), "the page of `selector fleet report`", as_json=as_json)


def watch(
    fleet: FleetPath,
    jobs: Jobs = None,
    dask: Dask = None,
    out: Annotated[Path | None, option("fleet watch --out")] = None,
    as_json: AsJson = False,
) -> None:
    """Applies every machine's model to the recordings that came after it, and says where it is no longer true.

    A cumulative sum of the errors, one run after the other, is compared with those of unseen runs when the model was
    made. Nothing is fitted again and nothing is written to a control.
    """
    from selector.fleet import read_fleet, watch_fleet
    from selector.fleet.watching import WATCH_FILE
    from selector.telling.fleet import watch_account

    _require_page(out)
    asked = read_fleet(fleet)
    require_writable_folder(asked.results, "results", (WATCH_FILE,))
    workers = _workers(jobs, dask, asked)
    with fleet_progress() as tell:
        account = watch_account(watch_fleet(asked, tell, workers), title=_title(asked))
    _show(account, "the page of --out", out, as_json=as_json)


def report(
    fleet: FleetPath,
    jobs: Jobs = None,
    dask: Dask = None,
    out: Annotated[Path | None, option("fleet report --out")] = None,
    as_json: AsJson = False,
) -> None:
    """Makes one page from the results folder: what to do this week, all machines, sensor places that serve all.

    It reads what is there: --jobs and --dask are taken as by the other commands, and make no difference.
    """
    from selector.fleet import overview, read_answer, read_fleet
    from selector.telling.fleet import fleet_account

    _require_page(out)
    asked = read_fleet(fleet)
    _require_one(jobs, dask)
    if out is None:
        require_writable_folder(asked.results, "results", (PAGE,))
    answer = read_answer(asked.results)
    missing = [name for name in asked.studies if name not in answer.machines]
    account = fleet_account(answer, missing, title=_title(asked), beside=overview(asked.results, answer))
    _show(account, "the page", out or asked.results / PAGE, as_json=as_json)


def sisters(
    fleet: FleetPath,
    machine: Annotated[str, option("fleet sisters --machine")],
    runs: Annotated[int | None, option("fleet sisters --runs", min=1)] = None,
    out: Annotated[Path | None, option("fleet sisters --out")] = None,
    as_json: AsJson = False,
) -> None:
    """Makes a model for a machine with one to three runs from what the other machines of its type share.

    Each of the others is left out in turn, and predicted from as many runs of its own and from the rest. Where that is
    no better than what these runs tell alone, sisters are none: this is said, and no model is made.
    """
    from selector.controllers.model_file import write_model
    from selector.fleet import read_fleet, sisters_in
    from selector.telling.fleet import sisters_account

    if out is not None:
        require_writable_folder(out.parent, "--out", (out.name,))
    asked = read_fleet(fleet)
    with progress_bar(spoken=True) as say:
        answer, model = sisters_in(asked, machine, runs, say)
    _show(sisters_account(answer, title=_title(asked)), "--json", as_json=as_json)
    if out is not None and model is not None:
        write_model(model, out)
        showing.show_written(showing.screen(as_json), out)
    elif out is not None:
        told = f"{out} was not written: there is no model"
        if out.is_file():
            older = out.with_name(f"{out.name}.old")
            out.replace(older)
            told += f"; the older one that lay there is {older.name} now"
        showing.screen(as_json).print(told, markup=False)


def _show(account: Account, rest: str, page: Path | None = None, *, as_json: bool) -> None:
    from selector.telling import write_account

    if as_json:
        showing.print_json(account.data)
    elif not showing.show_account(console := showing.screen(), account, most_lines=showing.MOST_LINES):
        console.print(f"Everything else that is known is in {rest}.", markup=False)
    if page is not None:
        showing.show_written(showing.screen(as_json), write_account(account, page))


def _require_page(out: Path | None) -> None:
    if out is not None:
        require_page_place(out, "--out")
        require_writable_folder(out.parent, "--out", (out.name,))


def _workers(jobs: int | None, dask: str | None, asked: Fleet) -> Workers:
    from selector.fleet import Cluster, Processes

    _require_one(jobs, dask)
    return Processes(min(jobs or os.cpu_count() or 1, len(asked.studies))) if dask is None else Cluster(dask)


def _require_one(jobs: int | None, dask: str | None) -> None:
    if jobs is not None and dask is not None:
        expected = "processes of this computer, or a cluster"
        raise unusable_option(f"--jobs {jobs} beside --dask {dask}", expected, "leave one of the two out")


def _title(asked: Fleet) -> str:
    return f"Fleet: {asked.place.absolute().parent.name}"
