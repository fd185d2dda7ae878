"""The exported Structured Text through the compiler matiec, to C and by the C compiler: the guard, bit for bit.

matiec (github.com/beremiz/matiec) is no package of Debian: `MATIEC=folder` names one that was built from source, with
``iec2c`` and ``lib``. Its translation of the text is nothing of this project. With `BEREMIZ=folder`, a checkout of
github.com/beremiz/beremiz, the PLCopen XML goes its way there, too: schema, generator of Structured Text, matiec.
"""

from __future__ import annotations

import ctypes
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from selector.controllers.evaluator import axes_of
from selector.controllers.replay.parts import called, reference_answers
from selector.controllers.writers.structured_text import plcopen_export, st_text
from tests.controllers import hostile
from tests.controllers.test_adapted_programs import material
from tests.controllers.test_structured_text import KINDS, same

FOUND = shutil.which("iec2c")
FOLDER = Path(os.environ.get("MATIEC") or (Path(FOUND).parent if FOUND else "/usr/share/matiec"))
COMPILER = shutil.which("gcc") or shutil.which("cc")
pytestmark = pytest.mark.skipif(
    not (FOLDER / "iec2c").is_file() or COMPILER is None,
    reason="matiec is not there: build github.com/beremiz/matiec (autoreconf -i; ./configure; make), set MATIEC to it",
)


class Block:
    """The compiled function block: ``v_<name>`` for every variable."""

    def __init__(self, text: str, folder: Path) -> None:
        (folder / "block.st").write_text(text, encoding="ascii", errors="replace")
        command = [FOLDER / "iec2c", "-I", FOLDER / "lib", "-T", folder, folder / "block.st"]
        subprocess.run(command, check=True, capture_output=True, cwd=folder)
        head = (folder / "POUS.h").read_text(encoding="ascii")
        name = re.search(r"void (\w+)_init__\(", head).group(1)
        variables = re.findall(r"__DECLARE_VAR\(\w+,(\w+)\)", head)
        lines = ['#include "iec_std_lib.h"\n#include "POUS.h"\n#include "POUS.c"\nTIME __CURRENT_TIME;\nBOOL __DEBUG;']
        lines += [f"static {name} data;", f"void start(void) {{ {name}_init__(&data, 0); }}"]
        lines += [f"void run(void) {{ {name}_body__(&data); }}"]
        for one in variables:
            lines += [f"double get_{one}(void) {{ return (double) data.{one}.value; }}"]
            lines += [f"void set_{one}(double value) {{ data.{one}.value = value; }}"]
        (folder / "block.c").write_text("\n".join(lines), encoding="ascii")
        library = folder / "block.so"
        # a control fuses no multiplication with an addition either
        options = ["-O1", "-ffp-contract=off", "-w", "-shared", "-fPIC", "-I", FOLDER / "lib" / "C", "-I", folder]
        subprocess.run([COMPILER, *options, folder / "block.c", "-o", library, "-lm"], check=True, capture_output=True)
        self.__dict__["library"] = ctypes.CDLL(str(library))
        for one in variables:
            getattr(self.library, f"get_{one}").restype = ctypes.c_double
            getattr(self.library, f"set_{one}").argtypes = [ctypes.c_double]
        self.library.start()

    def call(self) -> None:
        self.library.run()

    def __getattr__(self, name: str) -> float:
        return getattr(self.library, f"get_{name.removeprefix('v_').upper()}")()

    def __setattr__(self, name: str, value: float) -> None:
        getattr(self.library, f"set_{name.removeprefix('v_').upper()}")(float(value))


@pytest.mark.parametrize("kind", KINDS)
def test_what_matiec_makes_of_the_text_is_the_guard(kind, tmp_path):
    model = hostile.model(**kind)
    rows = hostile.rows(4000, 31, len(axes_of(model)))
    block = Block(st_text(model), tmp_path)
    with np.errstate(all="ignore"):
        answers = called(block, block.call, model, rows, "v_", float)
    assert same(answers, reference_answers(model, rows))


def test_with_touch_offs_too(tmp_path):
    model, rows = material(KINDS[0], 4000)
    block = Block(st_text(model), tmp_path)
    with np.errstate(all="ignore"):
        answers = called(block, block.call, model, rows, "v_", float)
    assert same(answers, reference_answers(model, rows))


GENERATOR = """
import sys, types, builtins

# what its windows need, and its generator of text does not
builtins.__dict__["_"] = lambda text: text
for module, name in (("XSLTransform", "XSLTransform"), ("wx", "GetTranslation")):
    sys.modules[module] = types.ModuleType(module)
    setattr(sys.modules[module], name, lambda text: text)
sys.path.insert(0, sys.argv[1])
from plcopen import LoadProject
from PLCGenerator import GenerateCurrentProgram

project, error = LoadProject(sys.argv[2])
errors, warnings = [], []
elementary = types.SimpleNamespace(GetBaseType=lambda name: name)
text = GenerateCurrentProgram(elementary, project, errors, warnings)
if error or errors or warnings:
    sys.exit(str([error, errors, warnings]))
print("".join(str(part[0]) for part in text))
"""


@pytest.mark.skipif(not os.environ.get("BEREMIZ"), reason="Beremiz is not there: BEREMIZ=folder of its sources")
@pytest.mark.parametrize("is_adapted", [False, True])
def test_what_beremiz_makes_of_the_plcopen_xml_is_the_guard(is_adapted, tmp_path):
    from lxml import etree

    model, rows = material(KINDS[0], 2000) if is_adapted else (hostile.model(), hostile.rows(2000, 32, 1))
    project = tmp_path / "project.xml"
    project.write_text(*plcopen_export(model).files.values(), encoding="ascii")
    etree.XMLSchema(file=str(Path(os.environ["BEREMIZ"]) / "plcopen" / "tc6_xml_v201.xsd")).assertValid(
        etree.parse(project)
    )
    command = [sys.executable, "-c", GENERATOR, os.environ["BEREMIZ"], project]
    text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    assert "VAR RETAIN" in text
    block = Block(text, tmp_path)
    with np.errstate(all="ignore"):
        answers = called(block, block.call, model, rows, "v_", float)
    assert same(answers, reference_answers(model, rows))
