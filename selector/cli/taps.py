"""`taps`: a model file and a measured tap test in, stiffness and ψ of the joints with their intervals out."""

from pathlib import Path
from typing import Annotated, Literal

from selector.cli.shared import showing
from selector.cli.shared.option_table import argument, option, unusable_option
from selector.cli.shared.progress import progress_bar
from selector.cli.shared.showing import AsJson, Everything, require_folder
from selector.cli.shared.simulation_files import named


def taps(
    model: Annotated[Path, argument("taps MODEL.toml")],
    files: Annotated[list[Path], argument("taps FILE...")],
    point: Annotated[list[str], option("taps --point")],
    axis: Annotated[Literal["X", "Y", "Z"] | None, option("taps --axis")] = None,
    unit: Annotated[str | None, option("taps --unit")] = None,
    window: Annotated[float | None, option("taps --window")] = None,
    band: Annotated[tuple[float, float] | None, option("taps --band")] = None,
    free: Annotated[list[str] | None, option("taps --free")] = None,
    out: Annotated[Path | None, option("taps --out")] = None,
    everything: Everything = False,
    as_json: AsJson = False,
) -> None:
    """Fits stiffness and damping of a machine's joints to a tap test: a hammer with a force cell, and accelerometers.

    The model file says which masses there are and what joins them. Intervals of 95 % come from how taps differ and from
    what the model leaves; what the taps cannot tell is said to be so.
    """
    from selector.physics.model_fields import model_file_text
    from selector.physics.model_text import plain_values
    from selector.physics.vibration.model_file import read_model_file
    from selector.physics.vibration.taps import tap_fit
    from selector.physics.vibration.vibration_model import vibration_model
    from selector.readers.uff_file import TapOptions, read_taps
    from selector.telling.simulated.taps import fit_head, tap_account

    require_folder(out, [model, *files], ("taps.json", "report.html", "model.toml"))
    if band is not None and not band[0] < band[1]:
        raise unusable_option(f"--band {band[0]:g} {band[1]:g}", "a lower and a higher frequency", "exchange them")
    if window is not None and not 1e-4 < window < 1e4:
        raise unusable_option(f"--window {window:g}", "a time constant from 0.0001 to 10000 s", "correct the option")
    motion, force = (None, None) if unit is None else _units(unit)
    points = dict(_point(one) for one in point)
    if len(points) < len(point):
        raise unusable_option("--point with a node twice", "every node once", "leave one of them out")
    asked = TapOptions(points, axis, motion, force, window)
    built = vibration_model(read_model_file(model))
    wrong = next((one for one in points.items() if one[1] and one[1] not in built.structure.names), None)
    if wrong is not None:
        raise unusable_option(
            f"--point {wrong[0]}={wrong[1]}", f"one of {', '.join(built.structure.names)}", "name its member"
        )
    responses, said = read_taps(files, asked)
    with progress_bar() as progress, named(model):
        progress("fitting", None)
        fit = tap_fit(built, responses, free=free or (), band_hz=band)
    findings = (*said, *fit.findings)
    account = tap_account(fit, findings, drawn=out is not None)
    beside = {"model.toml": model_file_text(plain_values(fit.after.file), head=fit_head(fit))}
    showing.give_answer(account, findings, out, "taps.json", beside=beside, everything=everything, as_json=as_json)


def _point(text: str) -> tuple[int, str]:
    node, is_there, member = text.partition("=")
    if not node.strip().isdecimal() or not is_there:
        raise unusable_option(f"--point {text}", "a node and the member that it is on", "e.g. --point 12=tool")
    return int(node), member.strip()


def _units(text: str) -> list[str | None]:
    """Units of motion and force."""
    from selector.units import parse_unit, same_dimension

    known = [parse_unit(one) for one in text.rsplit("/", maxsplit=1)]
    dimensions = [{si for si in ("m", "m/s", "m/s^2", "N") if one and same_dimension(one, si)} for one in known]
    if len(known) != 2 or dimensions[1] != {"N"} or not dimensions[0] - {"N"}:
        raise unusable_option(f"--unit {text}", "units of a motion and of a force", "e.g. --unit m/s^2/N, g/N or um/N")
    return known
