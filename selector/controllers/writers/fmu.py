"""A functional mock-up unit (FMI 3.0, co-simulation): the generated C behind the functions of the standard, zipped."""

import io
import platform
import re
import zipfile
from collections.abc import Mapping
from functools import lru_cache
from html import escape
from pathlib import Path

from selector import __version__
from selector.controllers.c_compiler import compiled, compiler, compiler_version
from selector.controllers.finding_table import FINDINGS
from selector.controllers.model_file import ModelFile
from selector.controllers.program.guarded_program import guarded_program
from selector.controllers.program.language import Kind, Place, Variable, plain
from selector.controllers.program.statements import NO_READING
from selector.controllers.writers.c99 import NAME, c_files
from selector.controllers.writers.exported import Exported, filled, heading, with_sheet
from selector.controllers.writers.structured_text import guid
from selector.errors import NotExecutableError

FILE = f"{NAME}.fmu"
#: Kind → type in FMI, and its start value
_TYPES: Mapping[Kind, tuple[str, str]] = {
    "real": ("Float64", ' start="{!r}"'),
    "flag": ("Boolean", ' start="{:.0f}"'),
    "code": ("Int32", ' start="{:.0f}"'),
}
_ROLES: Mapping[Place, str] = {
    "input": 'causality="input" variability="discrete"',
    "output": 'causality="output" variability="discrete" initial="calculated"',
    "retained": 'causality="local" variability="discrete" initial="exact"',
}
_PARAMETER = 'causality="parameter" variability="tunable"'
_PERIOD = Variable(
    "period_s", "real", "input", "longest time between two calls of the program in a step; 0: one call [s]"
)
_SYSTEMS = {"Windows": ("windows", ".dll"), "Darwin": ("darwin", ".dylib")}
_MACHINES = {"AMD64": "x86_64", "arm64": "aarch64", "i686": "x86"}


def fmu_export(model: ModelFile, *, is_sign_verified: bool = False) -> Exported:
    """``thermal_correction.fmu``: description, C sources, and a binary for this platform where there is a compiler."""
    head, variables = heading(model, is_sign_verified=is_sign_verified), _variables(model)
    sources = {"fmi3.c": _functions(model, head, variables), **c_files(model, is_sign_verified=is_sign_verified)}
    files = {f"sources/{name}": text.encode("ascii") for name, text in sources.items()}
    files["sources/buildDescription.xml"] = filled("fmu_build", program=NAME).encode("ascii")
    files["modelDescription.xml"] = _description(model, head, variables).encode("ascii")
    system, ending = _SYSTEMS.get(platform.system(), ("linux", ".so"))
    own = f"{_MACHINES.get(platform.machine(), platform.machine())}-{system}"
    holds, findings = f"a binary for {own} ({compiler_version(compiler())}) and C sources for others", []
    try:
        files[f"binaries/{own}/{NAME}{ending}"] = _binary(compiler(), tuple(sources.items()))
    except NotExecutableError as error:
        holds = "C sources only, to be compiled where it is used"
        findings = [FINDINGS.finding("fmu-without-binary", f"The unit has no binary for {own}: {error.found}.")]
    return with_sheet("fmu", model, {FILE: _zipped(files)}, findings=findings, file=FILE, holds=holds)


@lru_cache(maxsize=8)
def _binary(cc: str | None, sources: tuple[tuple[str, str], ...]) -> bytes:
    return compiled(cc, sources, Path.read_bytes)


def _zipped(files: Mapping[str, bytes]) -> bytes:
    """The same files, the same bytes."""
    archive = io.BytesIO()
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as unit:
        for name, content in sorted(files.items()):
            unit.writestr(zipfile.ZipInfo(name, (1980, 1, 1, 0, 0, 0)), content, zipfile.ZIP_DEFLATED)
    return archive.getvalue()


def _variables(model: ModelFile) -> list[tuple[Variable, str]]:
    """What the unit shows, in the order of its value references, and where that is in its state."""
    found = [(_PERIOD, "period_s")]
    for one in guarded_program(model).variables:
        if reading := re.fullmatch(r"reading_(\d+)", one.name):
            k = int(reading[1])
            valid = Variable(f"is_valid_{k}", "flag", "input", f"false: reading_{k} counts as missing", 1.0)
            found += [(one, f"reading[{k - 1}]"), (valid, f"is_valid[{k - 1}]")]
        elif one.place in _ROLES and one.name != "dt_s":
            found.append((one, f"m.{one.name}"))
    return found


def _functions(model: ModelFile, head: list[str], variables: list[tuple[Variable, str]]) -> str:
    places = ["    {offsetof(struct state, time_s), 'r', 0},"]
    for one, at in variables:
        places.append(f"    {{offsetof(struct state, {at}), '{one.kind[0]}', {int(one.place != 'output')}}},")
    given = "    m->reading_{k} = now->is_valid[{i}] ? now->reading[{i}] : NO_READING;"
    return filled(
        "fmu_functions",
        head=[f" * {line}" for line in head],
        program=NAME,
        token=guid(model),
        no_reading=NO_READING,
        readings=len(model.inputs),
        variables=places,
        given=[given.format(k=i + 1, i=i) for i in range(len(model.inputs))],
    )


def _description(model: ModelFile, head: list[str], variables: list[tuple[Variable, str]]) -> str:
    outputs = [k for k, (one, _) in enumerate(variables, 1) if one.place == "output"]
    return filled(
        "fmu_description",
        model=escape(plain(model.name)),
        token=guid(model),
        description=escape("; ".join(head)),
        version=__version__,
        program=NAME,
        units=filled("fmu_units"),
        variables=[f"    {_declared(one, k)}" for k, (one, _) in enumerate(variables, 1)],
        structure=[f'    <{kind} valueReference="{k}"/>' for kind in ("Output", "InitialUnknown") for k in outputs],
    )


def _declared(one: Variable, reference: int) -> str:
    type_, start = _TYPES[one.kind]
    told = f'name="{one.name}" valueReference="{reference}" description="{escape(plain(one.about))}"'
    told += f" {_PARAMETER if one is _PERIOD else _ROLES[one.place]}"
    unit = re.search(r" \[([^][]+)\]$", one.about)
    # what is retained has names of the model at its end
    if unit and f'"{unit[1]}"' in filled("fmu_units") and one.kind == "real" and one.place != "retained":
        told += f' unit="{unit[1]}"'
    return f"<{type_} {told}{'' if one.place == 'output' else start.format(one.initial)}/>"
