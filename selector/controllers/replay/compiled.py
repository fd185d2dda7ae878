"""Generated C, compiled by the system's compiler, for LinuxCNC by halcompile, or in a unit that FMPy runs; Python."""

import ctypes
import importlib
import io
import os
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from itertools import islice
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selector.controllers.c_compiler import compiled, compiler, compiler_version
from selector.controllers.model_file import ModelFile
from selector.controllers.program.guarded_program import guarded_program
from selector.controllers.replay.parts import Answers, Rows, called
from selector.controllers.writers.c99 import NAME, Precision, c_files
from selector.controllers.writers.fmu import FILE, fmu_export
from selector.controllers.writers.linuxcnc import NAME as COMPONENT
from selector.controllers.writers.linuxcnc import Pin, component, input_pins, output_pins
from selector.controllers.writers.python_module import CLASS, MODULE_NAME, python_files
from selector.errors import NotExecutableError, OptionError
from selector.types import Array


def c_answers(
    model: ModelFile,
    rows: Rows,
    precision: Precision = "double",
    files: Mapping[str, str] | None = None,
    name: str = NAME,
) -> Answers:
    """What the generated C gives, ``<name>.c`` of `files`; default: as exported."""
    exported = files or c_files(model, precision=precision, name=name)
    into = rows.columns(model)
    out = [variable.name for variable in guarded_program(model).of("output")]
    return Answers.of_outputs(replayed_columns(exported, name, into, out), model)


def replayed_columns(
    files: Mapping[str, str], name: str, into: Mapping[str, NDArray[Any]], out: Sequence[str]
) -> dict[str, NDArray[Any]]:
    """Members of the struct ``<name>`` after its step, row by row."""
    driver = ("replay.c", _driver(name, list(into), out))
    given = np.column_stack(list(into.values())).astype(np.float64)
    found = np.zeros((len(given), len(out)))
    written = ((file, files[file]) for file in (f"{name}.h", f"{name}.c"))
    call = _library(compiler(), (driver, *written)).replay
    call.restype = None
    call(ctypes.c_long(len(given)), *(ctypes.c_void_p(table.ctypes.data) for table in (given, found)))
    return dict(zip(out, found.T, strict=True))


@lru_cache(maxsize=8)
def _library(cc: str | None, sources: tuple[tuple[str, str], ...]) -> ctypes.CDLL:
    """Once for all runs of a recording."""
    return compiled(cc, sources, lambda path: ctypes.CDLL(str(path)))


def _driver(name: str, inputs: Sequence[str], outputs: Sequence[str]) -> str:
    """A loop over rows; what goes into a `float` is rounded once, as a control's inputs are."""
    lines = [
        f'#include "{name}.c"',
        "void replay(long n, const double *in, double *out)",
        "{",
        f"    {name} m;",
        "    long k;",
        f"    {name}_init(&m);",
        "    for (k = 0; k < n; k++) {",
        *(f"        m.{one} = in[{len(inputs)} * k + {i}];" for i, one in enumerate(inputs)),
        f"        {name}_step(&m);",
        *(f"        out[{len(outputs)} * k + {i}] = m.{one};" for i, one in enumerate(outputs)),
        "    }",
        "}",
    ]
    return "\n".join(lines) + "\n"


def python_answers(model: ModelFile, rows: Rows, files: Mapping[str, str] | None = None) -> Answers:
    """What the generated module gives; default of the files: as exported."""
    names: dict[str, Any] = {}
    # our own text, made a line above from numbers and variable names; names of the model stand in remarks only
    exec(compile((files or python_files(model))[f"{MODULE_NAME}.py"], f"{MODULE_NAME}.py", "exec"), names)  # noqa: S102
    program = names[CLASS]()
    return called(program, program.step, model, rows, "", float)


INSTALL = "apt-get install -y --no-install-recommends linuxcnc-uspace linuxcnc-uspace-dev"
RESOLUTION_UM = 1e-6  #: halsampler prints so many digits.

LARGEST_REPLAY = 1_000_000  #: Rows of one session: all of them wait in shared memory.

_NAME = "thermcorr_replay"
_PERIOD_NS = 50_000
_PINS_OF_FIFO, _FIFOS = 20, 8  # of streamer and of sampler
_LETTERS = {"float": "f", "bit": "b", "s32": "s"}
_NOBODY = 65534


def missing_program() -> str | None:
    """The first program of LinuxCNC that is not on this machine."""
    return next((name for name in ("halrun", "halcompile", "halcmd") if shutil.which(name) is None), None)


def linuxcnc_version() -> str:
    """What the installed LinuxCNC says about itself."""
    if shutil.which("linuxcnc_var") is None:
        return "LinuxCNC"
    command = [_path_of("linuxcnc_var"), "LINUXCNCVERSION"]
    said = subprocess.run(command, capture_output=True, text=True, check=False).stdout  # noqa: S603
    return f"LinuxCNC {said.strip()}".strip()


def halrun_answers(model: ModelFile, rows: Rows, files: Mapping[str, str] | None = None) -> Answers:
    """What the component gives, in steps of `RESOLUTION_UM`."""
    return Answers.of_outputs(halrun_columns(model, rows, files=files), model)


def halrun_columns(
    model: ModelFile, rows: Rows, ready_after: int = 0, files: Mapping[str, str] | None = None
) -> dict[str, Array]:
    """Every output pin of the component, by its name in C; errors as `halrun_answers`.

    `ready_after` calls nothing is corrected after ready; on a machine it is `READY_PERIODS`.
    """
    missing = missing_program()
    if missing is not None:
        raise NotExecutableError(
            f"{missing} is not on this machine", expected="LinuxCNC 2.9", where="--replay",
            advice=f"install it (Debian 12: {INSTALL}), or export without --replay",
        )  # fmt: skip
    inputs, outputs = input_pins(model), output_pins(model)
    streamed = [one for one in inputs if one.name not in ("is_homed", "new_start")]
    if max(len(streamed), len(outputs)) > _PINS_OF_FIFO * _FIFOS or len(rows) > LARGEST_REPLAY:
        raise OptionError(
            f"{len(rows)} rows of {len(streamed)} inputs and {len(outputs)} outputs",
            expected=f"at most {LARGEST_REPLAY} rows, {_PINS_OF_FIFO * _FIFOS} inputs and as many outputs in a session",
            where="--replay",
            advice="replay a part of the recording, or export for c, which has the same arithmetic",
        )
    if len(rows) == 0:
        return {one.name: np.zeros(0) for one in outputs}
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name, single_session():
        folder = Path(name)
        folder.chmod(0o777)  # for root, the realtime part of LinuxCNC runs as nobody
        own = component(model) if files is None else files[f"{COMPONENT}.comp"]
        renamed = own.replace(f"\ncomponent {COMPONENT} ", f"\ncomponent {_NAME} ", 1)
        with installed(renamed, _NAME, folder):
            _write_streams(model, rows, streamed, folder)
            text = _session(streamed, outputs, len(rows), folder, ready_after)
            halrun(text, folder, timeout_s=60.0 + 1e-3 * len(rows))
            return _sampled(outputs, len(rows), folder)


@contextmanager
def single_session() -> Iterator[None]:
    """Waits until no other replay of this machine is in LinuxCNC, which runs once only."""
    import fcntl

    path = Path(tempfile.gettempdir()) / "selector-halrun.lock"
    # opened before it is created: where /tmp is protected, O_CREAT fails on a file of somebody else
    try:
        handle = os.open(path, os.O_RDONLY)
    except FileNotFoundError:
        handle = os.open(path, os.O_RDONLY | os.O_CREAT, 0o644)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX)
        yield
    finally:
        os.close(handle)


@contextmanager
def installed(source: str, name: str, folder: Path) -> Iterator[None]:
    """Compiles a component in `folder` and has it where halrun loads from; afterwards what was there before."""
    (folder / f"{name}.comp").write_text(source, encoding="ascii")
    command = [_path_of("halcompile"), "--compile", f"{name}.comp"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)  # noqa: S603
    if done.returncode != 0 or not (folder / f"{name}.so").exists():
        raise OptionError(
            f"halcompile refuses the component: {_last_line(done.stderr)}",
            expected="LinuxCNC 2.9 with linuxcnc-uspace-dev and a C compiler", where="--replay", advice=INSTALL,
        )  # fmt: skip
    modules = Path(command[0]).resolve().parents[1] / "lib/linuxcnc/modules"
    module = modules / f"{name}.so"
    former = module.read_bytes() if module.exists() else None
    try:
        shutil.copyfile(folder / f"{name}.so", module)
    except OSError as error:
        raise NotExecutableError(
            f"{modules} cannot be written: {error.strerror}",
            expected="the right to install a component for the time of the replay",
            where="--replay",
            advice="run the replay as root, or on another machine; or export without --replay",
        ) from error
    try:
        yield
    finally:
        if former is None:
            module.unlink(missing_ok=True)
        else:
            module.write_bytes(former)


def environment(folder: Path) -> dict[str, str]:
    """In which halrun and linuxcnc start for root, too, and do not meet the remains of an earlier session."""
    changes = {"RTAPI_FIFO_PATH": str(folder / "fifo"), "HOME": str(folder)}
    if os.geteuid() == 0:
        changes["RTAPI_UID"] = str(_NOBODY)
    return {**os.environ, **changes}


def halrun(text: str, folder: Path, timeout_s: float) -> str:
    """What halrun prints for a HAL file; errors as `halrun_answers`."""
    (folder / "session.hal").write_text(text, encoding="ascii")
    env = environment(folder)
    program = _path_of("halrun")
    # into a file: a realtime part that stays behind would keep a pipe open
    with (folder / "said.txt").open("w", encoding="utf-8") as out:
        process = subprocess.Popen(  # noqa: S603
            [program, "session.hal"], cwd=folder, env=env, start_new_session=True,
            stdin=subprocess.DEVNULL, stdout=out, stderr=subprocess.STDOUT,
        )  # fmt: skip
    try:
        process.wait(timeout=timeout_s)
    except subprocess.TimeoutExpired:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        # its realtime part is a process of its own; halrun -U ends the session that was started here
        subprocess.run([program, "-U"], env=env, capture_output=True, timeout=30, check=False)  # noqa: S603
        raise OptionError(
            f"LinuxCNC does not end after {timeout_s:.0f} s", expected="a few seconds for every 10000 rows",
            where="--replay", advice="replay a part of the recording, or export without --replay",
        ) from None  # fmt: skip
    said = (folder / "said.txt").read_text(encoding="utf-8", errors="replace")
    if process.returncode == 0:
        return said
    if "already running" in said:
        raise NotExecutableError(
            "LinuxCNC is running on this machine", expected="no other session: there can be one only",
            where="--replay", advice="close LinuxCNC, or replay on another machine",
        )  # fmt: skip
    raise OptionError(
        f"halrun: {_last_line(said)}", expected="a session that ends by itself", where="--replay",
        advice="export without --replay, and tell the authors of selector",
    )  # fmt: skip


def _path_of(program: str) -> str:
    return shutil.which(program) or program


def _last_line(text: str) -> str:
    told = [line for line in text.strip().splitlines() if "fallback_uid" not in line and "non-realtime" not in line]
    return (told or ["?"])[-1].strip()


def _chunks(pins: list[Pin]) -> list[list[Pin]]:
    left = iter(pins)
    return list(iter(lambda: list(islice(left, _PINS_OF_FIFO)), []))


def _write_streams(model: ModelFile, rows: Rows, streamed: list[Pin], folder: Path) -> None:
    columns = rows.columns(model)
    columns |= {"is_enabled": rows.is_ready, "restart": np.cumsum(rows.is_restart), "standstill": rows.standstill_s}
    columns |= {name: 1000.0 * column for name, column in columns.items() if name.startswith("position_")}
    # 0 on the pin dt means the period of the thread; time that does not go on is sent as negative time
    columns["dt"] = np.where(rows.dt_s == 0.0, -1.0, rows.dt_s)
    for k, pins in enumerate(_chunks(streamed)):
        whole = ((columns[one.name].astype(float if one.hal_type == "float" else int)).tolist() for one in pins)
        table = zip(*(map(repr, column) for column in whole), strict=True)
        (folder / f"in{k}.txt").write_text("\n".join(map(" ".join, table)) + "\n", encoding="ascii")


def _session(streamed: list[Pin], outputs: list[Pin], n: int, folder: Path, ready_after: int) -> str:
    into, out = _chunks(streamed), _chunks(outputs)
    lines = [
        f"loadrt streamer {_fifos(into, n)}",
        f"loadrt sampler {_fifos(out, n)}",
        f"loadrt {_NAME}",
        f"loadrt threads name1=t1 period1={_PERIOD_NS}",
        f"setp {_hal_name('ready_after')} {ready_after}",
        *(f"addf streamer.{k} t1" for k in range(len(into))),
        f"addf {_NAME.replace('_', '-')} t1",
        *(f"addf sampler.{k} t1" for k in range(len(out))),
    ]
    for k, pins in enumerate(into):
        for i, pin in enumerate(pins):
            to = [pin.name, "is_homed"] if pin.name == "is_enabled" else [pin.name]
            lines.append(f"net in-{k}-{i} streamer.{k}.pin.{i} => {' '.join(map(_hal_name, to))}")
    for k, pins in enumerate(out):
        lines += [f"net out-{k}-{i} {_hal_name(pin.name)} => sampler.{k}.pin.{i}" for i, pin in enumerate(pins)]
    # every FIFO is full before the thread starts, so that every call has its row
    lines += [f"loadusr -w halstreamer -c {k} {folder}/in{k}.txt" for k in range(len(into))]
    lines.append("start")
    lines += [f"loadusr -w halsampler -c {k} -n {n} {folder}/out{k}.txt" for k in range(len(out))]
    return "\n".join(lines) + "\n"


def _fifos(of: list[list[Pin]], n: int) -> str:
    letters = ("".join(_LETTERS[pin.hal_type] for pin in pins) for pins in of)
    return f"depth={','.join([str(n + 16)] * len(of))} cfg={','.join(letters)}"


def _hal_name(name: str) -> str:
    return f"{_NAME}.{name}".replace("_", "-")


def _sampled(outputs: list[Pin], n: int, folder: Path) -> dict[str, Array]:
    columns: dict[str, Array] = {}
    for k, pins in enumerate(_chunks(outputs)):
        words = (folder / f"out{k}.txt").read_text(encoding="ascii").split()
        if len(words) != n * len(pins) or "overrun" in words:
            raise OptionError(
                f"LinuxCNC sampled {len(words)} numbers", expected=f"{n * len(pins)}, {len(pins)} a row",
                where="--replay", advice="replay once more; this machine may have been too busy",
            )  # fmt: skip
        table = np.array(words, dtype=np.float64).reshape(n, len(pins))
        columns |= {pin.name: table[:, i] for i, pin in enumerate(pins)}
    return columns


TYPES = ("Float64", "Boolean", "Int32")


def fmpy_version() -> str:
    """What runs the unit, and what made its binary."""
    try:
        return f"FMPy {version('FMPy')}, {compiler_version(compiler())}"
    except PackageNotFoundError:
        return "no FMPy"


def fmu_answers(model: ModelFile, rows: Rows, files: Mapping[str, Any] | None = None) -> Answers:
    """What the unit gives; default: as exported."""
    try:
        fmpy = importlib.import_module("fmpy")
    except ImportError as error:
        raise NotExecutableError(
            "no FMPy",
            expected="the package FMPy, which runs functional mock-up units",
            where="--replay",
            advice="in the folder of selector: pip install '.[fmu]'; or export without --replay",
        ) from error
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        fmpy.extract(io.BytesIO((files or fmu_export(model).files)[FILE]), folder)
        if not (Path(folder) / "binaries" / fmpy.platform_tuple).is_dir():
            raise NotExecutableError(
                f"the unit has no binary for {fmpy.platform_tuple}",
                expected="one, which the C compiler makes when the unit is exported",
                where="--replay",
                advice="install a C compiler (Debian: apt install gcc) and export again, or export without --replay",
            )
        description = fmpy.read_model_description(folder)
        unit = fmpy.instantiate_fmu(folder, description, "CoSimulation")
        try:
            unit.enterInitializationMode()
            unit.exitInitializationMode()
            return _stepped(unit, description.modelVariables, model, rows)
        finally:
            unit.freeInstance()


def _stepped(unit: Any, variables: Any, model: ModelFile, rows: Rows) -> Answers:
    row, given = SimpleNamespace(at_s=0.0), rows.columns(model).keys()
    into = [[one for one in variables if one.type == kind and one.name in given] for kind in TYPES]
    out = [[one for one in variables if one.type == kind and one.causality == "output"] for kind in TYPES]

    def step() -> None:
        for kind, of in zip(TYPES, into, strict=True):
            values = [getattr(row, one.name) for one in of]
            getattr(unit, f"set{kind}")([one.valueReference for one in of], values)
        unit.doStep(row.at_s, row.dt_s)
        row.at_s += row.dt_s
        for kind, of in zip(TYPES, out, strict=True):
            found = getattr(unit, f"get{kind}")([one.valueReference for one in of])
            vars(row).update(zip((one.name for one in of), found, strict=True))

    return called(row, step, model, rows, "", float)
