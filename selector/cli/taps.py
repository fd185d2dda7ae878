"""`taps`: a model file and a measured tap test in, stiffness and ψ of the joints with their intervals out."""

from pathlib import Path
from typing import Annotated, Literal

import typer

from selector.atomic_file import folder_written_whole, require_writable_folder
from selector.cli.shared import showing
from selector.cli.shared.files import refuse_folder_of_inputs, written_folder
from selector.cli.shared.progress import progress_bar
from selector.cli.shared.showing import AsJson, Everything
from selector.cli.shared.simulation_files import named
from selector.errors import OptionError


def taps(
    model: Annotated[Path, typer.Argument(metavar="MODEL.toml", help="Model file of vibration, where the fit begins.")],
    files: Annotated[
        list[Path],
        typer.Argument(metavar="FILE...", help="UFF files: frequency responses, or hammer and motion over time."),
    ],
    point: Annotated[
        list[str],
        typer.Option("--point", metavar="NODE=MEMBER", help="Member that a node is on; empty: left out; repeat."),
    ],
    axis: Annotated[
        Literal["X", "Y", "Z"] | None,
        typer.Option("--axis", metavar="X|Y|Z", help="Direction of the files along which the model moves."),
    ] = None,
    unit: Annotated[
        str | None,
        typer.Option("--unit", metavar="MOTION/FORCE", help="Units, e.g. m/s^2/N; default: as the files say."),
    ] = None,
    window: Annotated[
        float | None,
        typer.Option(
            "--window", metavar="S", help="Time constant of an exponential window that the analyser laid over all."
        ),
    ] = None,
    band: Annotated[
        str | None,
        typer.Option("--band", metavar="HZ,HZ", help="Frequencies that count; default: all that are coherent."),
    ] = None,
    free: Annotated[
        list[str] | None,
        typer.Option(
            "--free", metavar="NAME", help="Number to fit, e.g. joints.3.dissipation; repeat. Default: all joints."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", metavar="DIR", parser=written_folder, help="Write taps.json, report.html and model.toml."
        ),
    ] = None,
    everything: Everything = False,
    as_json: AsJson = False,
) -> None:
    """Fits stiffness and damping of a machine's joints to a tap test: a hammer with a force cell, and accelerometers.

    The model file says which masses there are and what joins them. Intervals of 95 % come from how taps differ and from
    what the model leaves; what the taps cannot tell is said to be so.
    """
    from selector.physics.model_text import plain_values
    from selector.physics.model_values import model_file_text
    from selector.physics.vibration.model_file import read_model_file
    from selector.physics.vibration.taps.tap_fit import tap_fit
    from selector.physics.vibration.vibration_model import vibration_model
    from selector.readers.uff_file import TapOptions, read_taps
    from selector.telling.page import write_account
    from selector.telling.simulated.taps import fit_head, tap_account

    names = ("taps.json", "report.html", "model.toml")
    if out is not None:
        require_writable_folder(out, "--out", names)
        refuse_folder_of_inputs(out, [model, *files])
    if window is not None and not 1e-4 < window < 1e4:
        raise _option(f"--window {window:g}", "a time constant from 0.0001 to 10000 s", "correct the option")
    motion, force = _units(unit)
    points = dict(_point(one) for one in point)
    if len(points) < len(point):
        raise _option("--point with a node twice", "every node once", "leave one of them out")
    asked = TapOptions(points, axis, motion, force, window)
    band_hz, built = _band(band), vibration_model(read_model_file(model))
    wrong = next((one for one in points.items() if one[1] and one[1] not in built.structure.names), None)
    if wrong is not None:
        raise _option(f"--point {wrong[0]}={wrong[1]}", f"one of {', '.join(built.structure.names)}", "name its member")
    responses, said = read_taps(files, asked)
    with progress_bar() as progress, named(model):
        progress("fitting", None)
        fit = tap_fit(built, responses, free=free or (), band_hz=band_hz)
    account = tap_account(fit, (*said, *fit.findings), drawn=out is not None)
    if out is not None:
        with folder_written_whole(out) as folder:
            written = (
                showing.json_text(account.data),
                model_file_text(plain_values(fit.after.file), head=fit_head(fit)),
            )
            for name, text in zip((names[0], names[2]), written, strict=True):
                (folder / name).write_text(text.rstrip("\n") + "\n", encoding="utf-8", newline="\n")
            write_account(account, folder / names[1])
    console = showing.screen(as_json)
    if as_json:
        showing.print_json(account.data)
    else:
        showing.show_answer(console, account, (*said, *fit.findings), everything=everything)
    if out is not None:
        showing.show_written(console, out, names)


def _point(text: str) -> tuple[int, str]:
    node, is_there, member = text.partition("=")
    if not node.strip().isdecimal() or not is_there:
        raise _option(f"--point {text}", "a node and the member that it is on", "e.g. --point 12=tool")
    return int(node), member.strip()


def _units(text: str | None) -> tuple[str | None, str | None]:
    """Units of motion and force."""
    from selector.units import parse_unit, same_dimension

    if text is None:
        return None, None
    motion, _, force = text.rpartition("/")
    known = parse_unit(motion), parse_unit(force)
    is_motion = known[0] and any(same_dimension(known[0], si) for si in ("m", "m/s", "m/s^2"))
    if not is_motion or known[1] is None or not same_dimension(known[1], "N"):
        raise _option(f"--unit {text}", "units of a motion and of a force", "e.g. --unit m/s^2/N, g/N or um/N")
    return known


def _band(text: str | None) -> tuple[float, float]:
    try:
        low, high = (0.0, float("inf")) if text is None else map(float, text.split(","))
        if low < high:
            return low, high
    except ValueError:
        pass
    raise _option(f"--band {text}", "a lower and a higher frequency in Hz", "e.g. --band 20,400")


def _option(found: str, expected: str, advice: str) -> OptionError:
    return OptionError(found, expected=expected, where=found.split(" ")[0], advice=advice)
