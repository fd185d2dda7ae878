"""The exported macro with the firmware's own expression parser: its source, compiled for this computer.

`RRF=folder` names a folder with checkouts of github.com/Duet3D/RepRapFirmware and github.com/Duet3D/RRFLibraries
(tried: branch 3.5-dev of October 2024). ExpressionParser.cpp and what it needs of RRFLibraries, the conversion of
numbers among them, are compiled as they are; `reprapfirmware_board.h` stands for the board. Lines, blocks and commands
are those of `meta_commands`.
"""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from selector.controllers.replay.parts import reference_answers
from selector.controllers.writers.fanuc import macro_model
from tests.controllers import hostile, test_reprapfirmware
from tests.controllers.meta_commands import DateTime, Duet, Float, MetaError, Running, literal
from tests.controllers.test_reprapfirmware import in_the_interpreter, kept_of, memory_model, number, passed, warm
from tests.controllers.test_reprapfirmware import whole_seconds as in_whole_seconds

FOLDER, HERE = Path(os.environ.get("RRF") or "/nonexistent"), Path(__file__).parent
PARSER = FOLDER / "RepRapFirmware/src/GCodes/GCodeBuffer/ExpressionParser.cpp"
LIBRARIES = FOLDER / "RRFLibraries/src"
SOURCES = ("NumericConverter", "StringFunctions", "StringRef", "SafeVsnprintf", "NamedEnum", "SafeStrtod", "Strnlen")
#: Headers of the firmware for which the board stands.
HEADERS = (
    "RepRapFirmware.h", "GCodeBuffer.h", "ObjectModel/ObjectModel.h", "GCodes/GCodeException.h", "Platform/RepRap.h",
    "Platform/Platform.h", "Hardware/ExceptionHandlers.h",
)  # fmt: skip
LOOKUP = ctypes.CFUNCTYPE(
    ctypes.c_int, ctypes.c_char_p, ctypes.POINTER(ctypes.c_int), ctypes.c_int, ctypes.POINTER(ctypes.c_double),
    ctypes.POINTER(ctypes.c_char),
)  # fmt: skip

pytestmark = [
    pytest.mark.skipif(
        not (PARSER.is_file() and LIBRARIES.is_dir()),
        reason="RepRapFirmware is not there: fetch it and RRFLibraries, set RRF to the folder of both",
    ),
    pytest.mark.skipif(shutil.which("g++") is None, reason="no C++ compiler; Debian: apt install g++"),
]


@pytest.fixture(scope="module")
def firmware(tmp_path_factory) -> ctypes.CDLL:
    """The parser as a library."""
    folder = tmp_path_factory.mktemp("firmware")
    for name in HEADERS:
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text('#include "reprapfirmware_board.h"\n')
    for source in (PARSER, PARSER.with_suffix(".h"), *HERE.glob("reprapfirmware_board.*")):
        shutil.copy(source, folder)
    sources = [str(LIBRARIES / f"General/{name}.cpp") for name in SOURCES]
    # as the firmware is compiled; its assertions are about the width of long on its processor
    command = [
        "g++", "-std=gnu++17", "-O1", "-fPIC", "-shared", "-w", "-fpermissive", "-fsingle-precision-constant",
        "-Dstatic_assert(...)=", f"-I{folder}", f"-I{LIBRARIES}", "-include", "reprapfirmware_board.h",
        "-Wl,-z,defs", "ExpressionParser.cpp", "reprapfirmware_board.cpp", *sources, "-o", "parser.so",
    ]  # fmt: skip
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-3000:]
    return ctypes.CDLL(str(folder / "parser.so"))


def running_in(firmware: ctypes.CDLL, counted: list[int]) -> type[Running]:
    """Macros whose expressions the firmware evaluates."""

    class InFirmware(Running):
        def value(self, text: str) -> Any:
            value, said = (ctypes.c_double * 2)(), ctypes.create_string_buffer(256)

            def told(path: bytes, indices: Any, n: int, out: Any, text_out: Any) -> int:
                try:
                    found = self.asked(path.decode(), [indices[k] for k in range(n)])
                except MetaError:
                    return -1
                kind, numbers, words = _passed_on(found)
                for k, one in enumerate(numbers):
                    out[k] = one
                for k, one in enumerate(words.encode() + b"\0"):
                    text_out[k] = one
                return kind

            counted.append(1)
            kind = firmware.evaluate(text.encode(), LOOKUP(told), value, said)
            if kind < 0:
                raise MetaError(said.value.decode())
            if kind == 3:
                return Float(np.float32(value[0]), int(value[1]))
            if kind == 4:
                return said.value.decode()
            whole = int(value[0])
            return (None, bool(whole), whole)[kind] if kind <= 2 else DateTime(whole)

        def asked(self, path: str, indices: list[int]) -> Any:
            kind, _, name = path.partition("." if "file:" not in path else ":")
            if kind in ("global", "var"):
                known = self.duet.globals if kind == "global" else self.variables
                if name not in known:
                    raise MetaError(name)
                return known[name] if kind == "global" else known[name][1]
            if kind == "file":
                if name not in self.duet.files:
                    raise MetaError(name)
                return True
            at, parts = iter(indices), path.replace("^", ".^").split(".")
            return self.duet.of_model([next(at) if part == "^" else part for part in parts])

    return InFirmware


def _passed_on(value: Any) -> tuple[int, list[float], str]:
    if value is None:
        return 0, [], ""
    if isinstance(value, bool):
        return 1, [float(value)], ""
    if isinstance(value, int):
        return 2, [float(value)], ""
    if isinstance(value, Float):
        return 3, [float(value.value), float(value.digits)], ""
    return (5, [float(value.seconds)], "") if isinstance(value, DateTime) else (4, [], value)


@pytest.fixture
def in_firmware(firmware, monkeypatch) -> list[int]:
    """Every board of this test has the firmware's parser; how many expressions it was given."""
    counted: list[int] = []
    real = Duet.__init__

    def with_firmware(self: Duet, *arguments: Any, **named: Any) -> None:
        real(self, *arguments, **named)
        self.running = running_in(firmware, counted)

    monkeypatch.setattr(Duet, "__init__", with_firmware)
    return counted


@pytest.mark.parametrize("kind", test_reprapfirmware.KINDS)
def test_on_hostile_rows_the_firmware_gives_the_guard_in_32_bits_to_the_last_bit(kind, in_firmware):
    model = hostile.model(**kind)
    rows = in_whole_seconds(hostile.rows(700, 11), 3)
    found, babysteps = in_the_interpreter(model, rows)
    expected = reference_answers(macro_model(model), rows, np.float32)
    for name in ("k0_um", "correction_um", "mode", "sensors"):
        assert np.array_equal(getattr(found, name), getattr(expected, name)), name
    assert np.abs(babysteps - found.correction_um).max() <= 4e-6
    assert len(in_firmware) > 100_000


def test_what_is_kept_is_written_and_read_by_the_firmware(in_firmware):
    model = memory_model()
    was = warm(model)
    again = test_reprapfirmware.board(model, {kept_of(was): was.files[kept_of(was)]})
    again.time = DateTime(test_reprapfirmware.NOON + 1500)
    passed(again, 70, 23.0)
    assert number(again, "start_1") == pytest.approx(20.123456, abs=1e-5)
    assert in_firmware


def test_the_firmware_is_as_odd_as_the_interpreter_says(in_firmware):
    duet = Duet({})
    duet.globals |= {"nan": Float(np.float32(np.nan), 1), "x": Float(np.float32(1.0), 2), "is": False}
    duet.console("if global.nan <= 1.0\n  set global.is = true")
    assert duet.globals["is"] is True
    with pytest.raises(MetaError, match="expected numeric value after '-'"):
        duet.console("if global.x > 0.0 || global.x < -global.x\n  set global.is = true")
    duet.console('echo >"a" "x = "^{global.x}')
    duet.console('echo >"b" "x = "^{global.x / 1}')
    assert (duet.files["a"], duet.files["b"]) == ("x = 1.00\n", "x = 1.000000\n")


def test_every_number_of_a_macro_is_read_as_it_is_meant(in_firmware):
    rng = np.random.default_rng(0)
    values = np.abs(rng.normal(size=2000) * 10.0 ** rng.integers(-30, 30, 2000)).astype(np.float32)
    duet = Duet({})
    duet.globals["x"] = None
    for value in values:
        duet.console(f"set global.x = {value}")
        assert duet.globals["x"].value == literal(str(value)).value == value
