"""LinuxCNC 2.9: a HAL component with the generated C inside, its wiring, and what of it outlives a shutdown."""

from dataclasses import dataclass

from selector.controllers.evaluator import axes_of
from selector.controllers.finding_table import FINDINGS
from selector.controllers.model_file import ModelFile, Output, kept_sha256
from selector.controllers.program.guarded_program import guarded_program
from selector.controllers.program.language import Program, Variable, plain
from selector.controllers.writers.c99 import c_parts
from selector.controllers.writers.exported import Exported, filled, heading, require_own_axes, with_sheet
from selector.findings import Finding

NAME = "thermcorr"

COUNTS_PER_UM = 10  #: ``axis.L.eoffset-counts`` are tenths of a micrometre; ``axis.L.eoffset-scale`` is this in mm.
#: So many calls nothing is corrected after machine on and homed: LinuxCNC adds up differences of counts since then.
READY_PERIODS = 10
_LINEAR_AXES, _AXES = "xyzuvw", "xyzabcuvw"
_HAL_TYPES = {"real": "float", "flag": "bit", "code": "s32"}


def memory_files(model: ModelFile) -> dict[str, str]:
    """``thermcorr_memory.sh`` and ``thermcorr_shutdown.hal``.

    What was saved for another model is left alone: its first sensor may be another one.
    """
    parameters = " ".join(one.name.replace("_", "-") for one in guarded_program(model).of("retained"))
    script = filled("linuxcnc_memory", name=NAME, model=kept_sha256(model), parameters=parameters)
    return {f"{NAME}_memory.sh": script, f"{NAME}_shutdown.hal": f"loadusr -w sh {NAME}_memory.sh save\n"}


@dataclass(frozen=True)
class Pin:
    """A pin or parameter of the component, as it is called in C; HAL has ``-`` for ``_``."""

    name: str
    hal_type: str
    about: str
    default: float | None = None


def linuxcnc_export(model: ModelFile, *, is_sign_verified: bool = False) -> Exported:
    """The component, its wiring, and two files that keep start readings while LinuxCNC is closed."""
    require_own_axes(model, "LinuxCNC axis offsets, outputs")
    wired, findings = _wired_axes(model)
    axes = "".join(f" [AXIS_{letter.upper()}]" for letter in wired.values())
    offsets = {k: f"axis.{letter}.eoffset" for k, letter in wired.items()}
    inputs = ", ".join(f"reading-{k}" for k in range(1, len(model.inputs) + 1))
    return with_sheet(
        "linuxcnc",
        model,
        {
            f"{NAME}.comp": component(model, is_sign_verified=is_sign_verified),
            f"{NAME}.hal": _wiring(model, wired, is_sign_verified=is_sign_verified),
            **memory_files(model),
        },
        findings,
        lambda k, um: {"wired": f"{offsets[k]} {um / 1000:g} mm" if k in offsets else "no axis is wired to it"},
        name=NAME,
        sections=axes or " [AXIS_...]",
        inputs=inputs,
        inch=0.0001 / 25.4,
        shown=f", and {', '.join(offsets.values())} the same in mm." if offsets else "; no axis is wired.",
        periods=READY_PERIODS,
    )


def component(model: ModelFile, *, is_sign_verified: bool = False) -> str:
    """Source of the component for halcompile."""
    program = guarded_program(model)
    # what has to outlive LinuxCNC; a change of `restart` takes it over
    said = "set it, with restart, before the thread starts"
    kept = [Pin(one.name, _HAL_TYPES[one.kind], f"{one.about}; {said}") for one in program.of("retained")]
    at, outputs = "__comp_inst->", range(1, len(model.outputs) + 1)
    return filled(
        "linuxcnc_component",
        **c_parts(program, "double"),
        head=[f" * {line}" for line in heading(model, is_sign_verified=is_sign_verified)],
        name=NAME,
        pins=[f"pin in {_declared(one)}" for one in input_pins(model)]
        + [f"pin out {_declared(one)}" for one in output_pins(model)],
        ready_after=READY_PERIODS,
        parameters=[f"param rw {_declared(one)}" for one in kept],
        counts_per_um=COUNTS_PER_UM,
        inputs=[f"    m->{one.name} = *{at}{one.name}{' / 1000.0' * _is_position(one)};" for one in _taken(program)],
        restored=[f"        m->{one.name} = {at}{one.name};" for one in kept],
        dropped=[f"        m->{one.name} = 0;" for one in kept if one.hal_type == "bit"]
        + [f"        m->good_for_{k} = -1.0;" for k in range(1, len(model.inputs) + 1)],
        outputs=[f"    *{at}{one.name} = m->{one.name};" for one in program.of("output")]
        + [f"    *{at}counts_{k} = counts_of(m->correction_{k});" for k in outputs],
        saved=[f"    {at}{one.name} = m->{one.name};" for one in kept],
    )


def input_pins(model: ModelFile) -> list[Pin]:
    """In the order of the component."""
    pins = [
        Pin("dt", "float", "time since the last call [s]; 0: the period of the thread", 0.0),
        Pin("is_enabled", "bit", "wire motion.motion-enabled", 0),
        Pin("is_homed", "bit", "wire motion.is-all-homed", 0),
        Pin("is_wanted", "bit", "the operator's switch; false ramps the correction to zero", 1),
        Pin("restart", "s32", "every change of this number: the control was off for standstill seconds", 0),
        Pin("standstill", "float", "[s]", 0.0),
        Pin("new_start", "bit", "while true, start readings and memory are taken anew", 0),
    ]
    for one in _taken(guarded_program(model)):
        about = one.about.replace("[m]", "[mm]") if _is_position(one) else one.about
        initial = int(one.initial) if one.kind == "flag" else one.initial
        pins.append(Pin(one.name, _HAL_TYPES[one.kind], about, initial))
    return pins


def _taken(program: Program) -> list[Variable]:
    """Inputs that are pins as they are, positions in mm; without touch-offs the last two kinds are not there."""
    kinds = ("reading_", "position_", "test_um_", "is_touch_valid", "touch_um_")
    return [one for kind in kinds for one in program.of("input") if one.name.startswith(kind)]


def _is_position(one: Variable) -> bool:
    return one.name.startswith("position_")


def output_pins(model: ModelFile) -> list[Pin]:
    """In the order of the component."""
    pins = [Pin(one.name, _HAL_TYPES[one.kind], one.about) for one in guarded_program(model).of("output")]
    for k, output in enumerate(model.outputs, start=1):
        pins.append(Pin(f"counts_{k}", "s32", f"for axis.L.eoffset-counts, {output.name} [0.1 um]"))
    return pins


def _declared(pin: Pin) -> str:
    about = plain(pin.about).replace('"', "'")
    default = "" if pin.default is None else f" = {pin.default!r}"
    return f'{pin.hal_type} {pin.name}{default} "{about}";'


def _wired_axes(model: ModelFile) -> tuple[dict[int, str], tuple[Finding, ...]]:
    """Number of the output → letter of its axis in LinuxCNC; a finding for each that is not wired."""
    letters = {k: (output.axis or "").lower() for k, output in enumerate(model.outputs, start=1)}
    wired, findings = {}, []
    for (k, letter), output in zip(letters.items(), model.outputs, strict=True):
        if len(letter) == 1 and letter in _LINEAR_AXES:
            wired[k] = letter
            continue
        findings.append(_not_wired(k, output))
    for k, axis in enumerate(axes_of(model), start=1):
        if not _is_axis(axis):
            findings.append(
                FINDINGS.finding(
                    "position-not-wired",
                    f"LinuxCNC has no axis {axis!r}: position-{k} is not wired and stays at its reference.",
                    evidence={"axis": axis},
                    suggestion=f"wire thermcorr.position-{k} [mm] in {NAME}.hal by hand",
                )
            )
    return wired, tuple(findings)


def _not_wired(k: int, output: Output) -> Finding:
    why = f"{output.axis!r} is no linear axis of LinuxCNC" if output.axis else "the model names no axis for it"
    return FINDINGS.finding(
        "axis-not-wired",
        f"The correction for {output.name} is on the pin correction-{k}, but moves nothing: {why}.",
        evidence={"output": output.name, "axis": output.axis},
        suggestion=f"name one of X Y Z U V W as its axis in the model file, or wire counts-{k} in {NAME}.hal by hand",
    )


def _is_axis(axis: str) -> bool:
    return len(axis) == 1 and axis.lower() in _AXES


def _wiring(model: ModelFile, wired: dict[int, str], *, is_sign_verified: bool) -> str:
    sensors: list[str] = []
    for k, item in enumerate(model.inputs, start=1):
        sensors += [
            "",
            f"# >>>> WIRE THE SENSOR {plain(item.name)} [{plain(item.unit)}] HERE; until then it counts as missing.",
            f"#net {NAME}-reading-{k} PIN-OF-THE-SENSOR => {NAME}.reading-{k}",
        ]
    axes: list[str] = []
    for k, axis in enumerate(axes_of(model), start=1):
        mark, letter = ("", axis.lower()) if _is_axis(axis) else ("#", "L")
        axes += [
            "",
            f"# Position of axis {plain(axis)} [mm].",
            f"{mark}net {NAME}-position-{k} axis.{letter}.pos-cmd => {NAME}.position-{k}",
        ]
    for k, output in enumerate(model.outputs, start=1):
        if k in wired:
            axes += _offset_lines(k, output, wired[k])
        else:
            axes += ["", f"# >>>> NOT WIRED: correction for {plain(output.name)}, {NAME}.counts-{k} [0.1 um]"]
    head = [f"# {line}" for line in heading(model, is_sign_verified=is_sign_verified)]
    return filled("linuxcnc_wiring", head=head, name=NAME, sensors=sensors, axes=axes)


def _offset_lines(k: int, output: Output, letter: str) -> list[str]:
    return [
        "",
        f"# Correction for {plain(output.name)}: [AXIS_{letter.upper()}]OFFSET_AV_RATIO = 0.1 in the INI.",
        f"setp axis.{letter}.eoffset-scale 0.0001",
        f"setp axis.{letter}.eoffset-enable 1",
        f"net {NAME}-counts-{k} {NAME}.counts-{k} => axis.{letter}.eoffset-counts",
    ]
