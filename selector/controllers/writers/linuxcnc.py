"""LinuxCNC 2.9: a HAL component with the generated C inside, its wiring, and what of it outlives a shutdown."""

from dataclasses import dataclass

from selector.controllers.evaluator import axes_of
from selector.controllers.finding_table import FINDINGS
from selector.controllers.guard.decided import Mode
from selector.controllers.model_file import ModelFile, Output, kept_sha256
from selector.controllers.program.guarded_program import guarded_program
from selector.controllers.program.language import Program, plain
from selector.controllers.writers.c99 import c_core, c_members
from selector.controllers.writers.exported import Exported, filled, heading, require_own_axes, sheet, sign_test
from selector.findings import Finding

NAME = "thermcorr"

COUNTS_PER_UM = 10  #: ``axis.L.eoffset-counts`` are tenths of a micrometre; ``axis.L.eoffset-scale`` is this in mm.
#: So many calls nothing is corrected after machine on and homed: LinuxCNC adds up differences of counts since then.
READY_PERIODS = 10
#: What an input for a reading has while nothing is wired to it: no reading, and so the sensor is missing.
UNWIRED = 1e30
_LINEAR_AXES, _AXES = "xyzuvw", "xyzabcuvw"
_HAL_TYPES = {"real": "float", "flag": "bit", "code": "s32"}


def memory_files(model: ModelFile) -> dict[str, str]:
    """``thermcorr_memory.sh`` and ``thermcorr_shutdown.hal``.

    What was saved for another model is left alone: its first sensor may be another one.
    """
    parameters = " ".join(one.name.replace("_", "-") for one in guarded_program(model).of("retained"))
    script = filled("linuxcnc_memory.txt", name=NAME, model=kept_sha256(model), parameters=parameters)
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
    install, silently = sheet(
        "linuxcnc",
        name=NAME,
        sections=axes or " [AXIS_...]",
        inputs=inputs,
        inch=0.0001 / 25.4,
        shown=f", and {', '.join(offsets.values())} the same in mm." if offsets else "; no axis is wired.",
        periods=READY_PERIODS,
    )
    return Exported(
        files={
            f"{NAME}.comp": component(model, is_sign_verified=is_sign_verified),
            f"{NAME}.hal": _wiring(model, wired, is_sign_verified=is_sign_verified),
            **memory_files(model),
        },
        install=install,
        sign_test=sign_test(
            model,
            f"Machine on, homed, tool at rest; {_switched(0)}; wait until correction-1 ... are 0. No sensor is needed.",
            lambda k, um: f"halcmd setp {NAME}.test-um-{k} {um:g}",
            lambda k, um: (
                f"halcmd getp {NAME}.mode: {Mode.TEST:d}, {NAME}.counts-{k}: {round(COUNTS_PER_UM * um)}"
                + (f"; {offsets[k]} {um / 1000:g} mm" if k in offsets else "; no axis is wired to it")
            ),
            f"halcmd setp {NAME}.test-um-1 0 ...; when the indicator is back at zero, {_switched(1)}.",
        ),
        silently=silently,
        findings=findings,
    )


def _switched(to: int) -> str:
    """The operator's switch by hand; halcmd refuses to set a linked pin, and a signal that a pin writes."""
    return (
        f"halcmd setp {NAME}.is-wanted {to} (where the line net {NAME}-wanted is in use, the switch that it names: "
        f"{'on' if to else 'off'}; halcmd refuses to set a pin that is linked)"
    )


def component(model: ModelFile, *, is_sign_verified: bool = False) -> str:
    """Source of the component for halcompile."""
    program = guarded_program(model)
    head = [f" * {line}" for line in heading(model, is_sign_verified=is_sign_verified)]
    # what has to outlive LinuxCNC; a change of `restart` takes it over
    said = "set it, with restart, before the thread starts"
    kept = [Pin(one.name, _HAL_TYPES[one.kind], f"{one.about}; {said}") for one in program.of("retained")]
    lines = [
        "/*",
        *head,
        f" * Install: sudo halcompile --install {NAME}.comp",
        " */",
        f'component {NAME} "Thermal correction of axes, by axis.L.eoffset-counts";',
        *(f"pin in {_declared(one)}" for one in input_pins(model)),
        *(f"pin out {_declared(one)}" for one in output_pins(model)),
        f'param rw s32 ready_after = {READY_PERIODS} "so many calls nothing is corrected after machine on and homed";',
        *(f"param rw {_declared(one)}" for one in kept),
        "option singleton yes;",
        "option extra_setup yes;",
        "option no_convenience_defines yes;",
        "function _ fp;",
        'license "Dual MIT/GPL";',
        'author "selector";',
        ";;",
        *_c_of(program, model, kept),
    ]
    return "\n".join(lines) + "\n"


def input_pins(model: ModelFile) -> list[Pin]:
    """In the order of the component."""
    program = guarded_program(model)
    known = {one.name: one for one in program.variables}
    pins = [
        Pin("dt", "float", "time since the last call [s]; 0: the period of the thread", 0.0),
        Pin("is_enabled", "bit", "wire motion.motion-enabled", 0),
        Pin("is_homed", "bit", "wire motion.is-all-homed", 0),
        Pin("is_wanted", "bit", "the operator's switch; false ramps the correction to zero", 1),
        Pin("restart", "s32", "every change of this number: the control was off for standstill seconds", 0),
        Pin("standstill", "float", "[s]", 0.0),
        Pin("new_start", "bit", "while true, start readings and memory are taken anew", 0),
    ]
    for k in range(1, len(model.inputs) + 1):
        pins.append(Pin(f"reading_{k}", "float", known[f"reading_{k}"].about, UNWIRED))
    for k, axis in enumerate(axes_of(model), start=1):
        pins.append(Pin(f"position_{k}", "float", f"position of axis {axis} [mm]", UNWIRED))
    for k in range(1, len(model.outputs) + 1):
        pins.append(Pin(f"test_um_{k}", "float", known[f"test_um_{k}"].about, 0.0))
    for name in _of_touch_offs(program):
        is_flag = known[name].kind == "flag"
        pins.append(Pin(name, _HAL_TYPES[known[name].kind], known[name].about, 0 if is_flag else UNWIRED))
    return pins


def _of_touch_offs(program: Program) -> list[str]:
    """Inputs that only a model with adaptation has."""
    return [one.name for one in program.of("input") if one.name == "is_touch_valid" or one.name.startswith("touch_um_")]


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


def _c_of(program: Program, model: ModelFile, kept: list[Pin]) -> list[str]:
    temporaries, initial, body = c_core(program, "double")
    at = "__comp_inst->"
    inputs = [f"    m->reading_{k} = *{at}reading_{k};" for k in range(1, len(model.inputs) + 1)]
    inputs += [f"    m->position_{k} = *{at}position_{k} / 1000.0;" for k in range(1, len(axes_of(model)) + 1)]
    inputs += [f"    m->test_um_{k} = *{at}test_um_{k};" for k in range(1, len(model.outputs) + 1)]
    inputs += [f"    m->{name} = *{at}{name};" for name in _of_touch_offs(program)]
    return [
        "/* a * b + c is rounded twice: what the model file means, to the last bit */",
        '#pragma GCC optimize ("fp-contract=off")',
        "",
        "struct correction {",
        *c_members(program, "double"),
        "};",
        "",
        "static struct correction memory;",
        "static int ready_for;",
        "static int last_restart;",
        "",
        "static void begin(struct correction *m)",
        "{",
        *initial,
        "}",
        "",
        "static void step(struct correction *m)",
        "{",
        *temporaries,
        *body,
        "}",
        "",
        "/* to the nearest count */",
        "static int counts_of(double correction_um)",
        "{",
        f"    double counts = correction_um * {COUNTS_PER_UM}.0;",
        "    if (counts > 2.0e9) counts = 2.0e9;",
        "    if (counts < -2.0e9) counts = -2.0e9;",
        "    return (int)(counts < 0.0 ? counts - 0.5 : counts + 0.5);",
        "}",
        "",
        "#define FUNCTION(name) static void name(struct __comp_state *__comp_inst, long period)",
        "",
        "static int extra_setup(struct __comp_state *inst, char *prefix, long extra_arg)",
        "{",
        "    (void)inst;",
        "    (void)prefix;",
        "    (void)extra_arg;",
        "    begin(&memory);",
        "    ready_for = 0;",
        "    last_restart = 0;",
        "    return 0;",
        "}",
        "",
        "FUNCTION(_) {",
        "    struct correction *m = &memory;",
        f"    m->dt_s = *{at}dt;",
        "    if (m->dt_s == 0.0) m->dt_s = period * 1e-9;",
        *inputs,
        "    /* LinuxCNC adds up differences of counts from machine on: they are 0 then, and some calls longer */",
        f"    if (ready_for <= {at}ready_after) ready_for++;",
        f"    if (!(*{at}is_enabled && *{at}is_homed)) ready_for = 0;",
        f"    m->is_ready = ready_for > {at}ready_after;",
        f"    m->is_wanted = *{at}is_wanted ? 1 : 0;",
        f"    m->is_restart = *{at}restart != last_restart;",
        f"    m->standstill_s = *{at}standstill;",
        f"    last_restart = *{at}restart;",
        *_given_back(kept, len(model.inputs), at),
        "    step(m);",
        *(f"    *{at}{one.name} = m->{one.name};" for one in program.of("output")),
        *(f"    *{at}counts_{k} = counts_of(m->correction_{k});" for k in range(1, len(model.outputs) + 1)),
        *(f"    {at}{one.name} = m->{one.name};" for one in kept),
        "}",
    ]


def _given_back(kept: list[Pin], inputs: int, at: str) -> list[str]:
    if not kept:
        return []
    lines = ["    if (m->is_restart) {", *(f"        m->{one.name} = {at}{one.name};" for one in kept), "    }"]
    flags = [f"        m->{one.name} = 0;" for one in kept if one.hal_type == "bit"]
    flags += [f"        m->good_for_{k} = -1.0;" for k in range(1, inputs + 1)]
    return [*lines, f"    if (*{at}new_start) {{", *flags, "    }"]


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
    lines = [f"# {line}" for line in heading(model, is_sign_verified=is_sign_verified)]
    lines += [
        "",
        "# After the HALFILE that adds motion-controller to servo-thread.",
        f"loadrt {NAME}",
        f"addf {NAME} servo-thread",
        "",
        "# Ready: machine on and all joints homed.",
        f"net {NAME}-enabled motion.motion-enabled => {NAME}.is-enabled",
        f"net {NAME}-homed motion.is-all-homed => {NAME}.is-homed",
        "",
        "# The operator's switch (default: on), e.g.",
        f"#net {NAME}-wanted pyvcp.thermal-correction => {NAME}.is-wanted",
    ]
    for k, item in enumerate(model.inputs, start=1):
        lines += [
            "",
            f"# >>>> WIRE THE SENSOR {plain(item.name)} [{plain(item.unit)}] HERE; until then it counts as missing.",
            f"#net {NAME}-reading-{k} PIN-OF-THE-SENSOR => {NAME}.reading-{k}",
        ]
    lines += [
        "",
        "# >>>> True until the driver of the sensors has read them once (a signal that nobody has written is 0.0, and",
        "# 0.0 would become the start reading); or a push button for a new start.",
        f"#net {NAME}-new-start PIN-OF-THE-DRIVER => {NAME}.new-start",
    ]
    for k, axis in enumerate(axes_of(model), start=1):
        mark, letter = ("", axis.lower()) if _is_axis(axis) else ("#", "L")
        lines += [
            "",
            f"# Position of axis {plain(axis)} [mm].",
            f"{mark}net {NAME}-position-{k} axis.{letter}.pos-cmd => {NAME}.position-{k}",
        ]
    for k, output in enumerate(model.outputs, start=1):
        if k in wired:
            lines += _offset_lines(k, output, wired[k])
        else:
            lines += ["", f"# >>>> NOT WIRED: correction for {plain(output.name)}, {NAME}.counts-{k} [0.1 um]"]
    lines += [
        "",
        "# Start readings and memory of the last time LinuxCNC ran.",
        f"loadusr -w sh {NAME}_memory.sh restore",
    ]
    return "\n".join(lines) + "\n"


def _offset_lines(k: int, output: Output, letter: str) -> list[str]:
    return [
        "",
        f"# Correction for {plain(output.name)}: [AXIS_{letter.upper()}]OFFSET_AV_RATIO = 0.1 in the INI.",
        f"setp axis.{letter}.eoffset-scale 0.0001",
        f"setp axis.{letter}.eoffset-enable 1",
        f"net {NAME}-counts-{k} {NAME}.counts-{k} => axis.{letter}.eoffset-counts",
    ]
