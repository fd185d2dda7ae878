"""`export`: a model file becomes the program of a control, with its commissioning sheet and the proof of it."""

from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from selector.cli.models import Model
from selector.cli.shared import showing
from selector.cli.shared.files import out_folder
from selector.cli.shared.progress import counted_progress
from selector.cli.shared.showing import AsJson, Everything
from selector.cli.shared.source import Source, pairs, with_source

ReplayOf = Annotated[
    list[Path] | None,
    typer.Option("--replay", metavar="PATH", help="Run recordings through the generated program; repeat."),
]


@partial(with_source, runs=ReplayOf)
def export(
    source: Source,
    model: Model,
    target: Annotated[
        str,
        typer.Option(
            "--for",
            metavar="TARGET",
            help="c, st, tcpou, linuxcnc, klipper, sinumerik, beckhoff, fanuc, rexroth, python.",
        ),
    ],
    out: Annotated[Path, out_folder(help="Folder for the files.")],
    clamp: Annotated[
        list[str] | None, typer.Option("--clamp", metavar="OUTPUT=µm", help="Largest correction of an output; repeat.")
    ] = None,
    slew: Annotated[
        list[str] | None, typer.Option("--slew", metavar="OUTPUT=µm/s", help="Largest change of a correction; repeat.")
    ] = None,
    margin: Annotated[
        float,
        typer.Option(
            "--margin", metavar="%", help="Follow sensors so far beyond their recorded range, in % of its width."
        ),
    ] = 0.0,
    invert: Annotated[
        list[str] | None,
        typer.Option("--invert", metavar="OUTPUT", help="The control counts this output's axis the other way; repeat."),
    ] = None,
    sign_verified: Annotated[
        bool,
        typer.Option("--sign-verified", metavar="", help="You have done the sign test of the commissioning sheet."),
    ] = False,
    tested: Annotated[
        str | None,
        typer.Option(
            "--tested",
            metavar="TARGET:SHA-256",
            help="With --sign-verified: target and equations SHA-256 of the program that passed (its head has it), "
            "e.g. st:1a2b3c4d; another program is refused.",
        ),
    ] = None,
    everything: Everything = False,
    as_json: AsJson = False,
) -> None:
    """Writes the program of a model for a control, guarded against broken sensors, and a commissioning sheet.

    With --replay the generated program is executed on recordings and compared with the model, sample by sample.
    """
    from selector.exporting import ExportOptions, export_model

    if not source.runs:
        source.refuse_unread("--replay")
    options = ExportOptions(
        clamp_um=pairs(clamp, "--clamp"),
        slew_um_per_s=pairs(slew, "--slew"),
        margin_percent=margin,
        invert=invert or (),
        is_sign_verified=sign_verified,
        tested=tested,
        replay=source.runs,
        machine=source.machine,
        overrides=source.overrides(),
    )
    with counted_progress("replaying") if source.runs else nullcontext() as progress:
        exported = export_model(model, target, out, options, progress)
    if as_json:
        showing.print_json(exported.as_dict())
        return
    console = showing.screen()
    showing.show_answer(console, exported.sheet, exported.findings, everything=everything)
    showing.show_written(console, exported.folder, exported.files)
