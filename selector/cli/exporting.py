"""`export`: a model file becomes the program of a control, with its commissioning sheet and the proof of it."""

from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import Annotated

from selector.cli.models import Model
from selector.cli.shared import showing
from selector.cli.shared.option_table import option
from selector.cli.shared.progress import counted_progress
from selector.cli.shared.showing import AsJson, Everything
from selector.cli.shared.source import Source, pairs, with_source

ReplayOf = Annotated[list[Path] | None, option("export --replay")]


@partial(with_source, runs=ReplayOf)
def export(
    source: Source,
    model: Model,
    target: Annotated[str, option("export --for")],
    out: Annotated[Path, option("export --out")],
    clamp: Annotated[list[str] | None, option("export --clamp")] = None,
    slew: Annotated[list[str] | None, option("export --slew")] = None,
    margin: Annotated[float, option("export --margin")] = 0.0,
    invert: Annotated[list[str] | None, option("export --invert")] = None,
    sign_verified: Annotated[bool, option("export --sign-verified")] = False,
    tested: Annotated[str | None, option("export --tested")] = None,
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
