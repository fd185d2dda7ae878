"""`ballbar`: measured circles in, how round they are and which causes are behind them out."""

from pathlib import Path
from typing import Annotated

from selector.cli.shared import showing
from selector.cli.shared.option_table import argument, option, unusable_option
from selector.cli.shared.progress import progress_bar
from selector.cli.shared.showing import AsJson, Everything, require_folder


def ballbar(
    files: Annotated[list[Path], argument("ballbar FILE...")],
    radius: Annotated[float | None, option("ballbar --radius")] = None,
    feed: Annotated[float | None, option("ballbar --feed")] = None,
    axes: Annotated[str | None, option("ballbar --axes")] = None,
    lead: Annotated[list[str] | None, option("ballbar --lead")] = None,
    reset_time: Annotated[list[str] | None, option("ballbar --reset-time")] = None,
    out: Annotated[Path | None, option("ballbar --out")] = None,
    everything: Everything = False,
    as_json: AsJson = False,
) -> None:
    """Says of a measured ball-bar test how round the circles are, after ISO 230-4, and which causes are behind it.

    Each circle is run in both directions, at one or better several feeds; the files are tables with the angle of the
    bar and its deviation, or with two positions over time.
    """
    from selector.physics.drive.ball_bar.causes import circle_causes, compensations
    from selector.physics.drive.ball_bar.circle import circle_quantities
    from selector.physics.drive.drive_summary import DriveSummary
    from selector.readers.ball_bar_file import CircleOptions, read_circles
    from selector.readers.roles.names import printable_name
    from selector.telling.simulated.ball_bar import measured_circles_account

    names = None if axes is None else tuple(name.strip().upper() for name in axes.split(","))
    if names is not None and (len(names) != 2 or "" in names or names[0] == names[1]):
        raise unusable_option(f"--axes {axes}", "two axes that differ", "e.g. --axes X,Y")
    for name, value in (("--radius", radius), ("--feed", feed)):
        if value is not None and not 0 < value < 1e6:
            raise unusable_option(f"{name} {value:g}", "a number above 0 and below 1e6", "correct the option")
    leads = dict(_of_axis("--lead", one, "the lead of its screw in mm", "X=10") for one in lead or ())
    resets = dict(_of_axis("--reset-time", one, "a time in ms", "X=20") for one in reset_time or ())
    for name, asked_for, known in (("--lead", lead, leads), ("--reset-time", reset_time, resets)):
        if len(known) < len(asked_for or ()):
            raise unusable_option(f"{name} of an axis twice", "every axis once", "leave one of them out")
    require_folder(out, files, ("ballbar.json", "report.html"))
    asked = CircleOptions(
        None if radius is None else radius / 1e3, feed, None if names is None else (names[0], names[1])
    )
    read, findings = read_circles(files, asked)
    traces = [one.trace for one in read]
    if unknown := sorted(set(resets) - set(traces[0].axes[:2])):
        raise unusable_option(
            f"--reset-time {unknown[0]}", f"an axis of the test, {' or '.join(traces[0].axes[:2])}", "correct the name"
        )
    with progress_bar() as progress:
        progress("causes of the deviation", None)
        quantities, causes = circle_quantities(traces), circle_causes(traces, lead_m=leads)
    told = [(one.trace, printable_name(one.file.name), one.columns, one.is_reversed) for one in read]
    found = (*findings, *causes.findings)
    needed = compensations(causes, traces[0].axes, traces[0].radius_m, resets)
    account = measured_circles_account(
        DriveSummary({}, {}, quantities, causes, None), needed, told, found, drawn=out is not None
    )
    showing.give_answer(account, found, out, "ballbar.json", everything=everything, as_json=as_json)


def _of_axis(option: str, text: str, what: str, example: str) -> tuple[str, float]:
    """Axis and a thousandth of its number: mm in m, ms in s."""
    name, _, number = text.partition("=")
    try:
        value = float(number) / 1e3
    except ValueError:
        value = 0.0
    if not 0 < value < 1e3:
        raise unusable_option(f"{option} {text}", f"an axis and {what}", f"e.g. {option} {example}")
    return name.strip().upper(), value
