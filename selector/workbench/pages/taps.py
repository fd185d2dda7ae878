"""Taps: a tap test and a model in, stiffness and damping of the joints out."""

from functools import partial
from typing import Any

from selector.errors import OptionError
from selector.workbench.bench import Bench
from selector.workbench.boxes import Box, Boxes, one_of, one_path, several
from selector.workbench.commands import TAPS, taps_command
from selector.workbench.measured import MeasuredPage
from selector.workbench.study_folder import TAP_TESTS, files_in
from selector.workbench.typed import FIELDS

ID, TITLE = "taps", "Taps"


def _boxes(bench: Bench) -> Boxes:
    def offered() -> list[Any]:
        return [path.name for path in files_in(bench.folder / TAP_TESTS)]

    about = "masses and joints, where the fit begins; drop a model file of your own on the page Simulate"
    boxes = (
        several("files", "Measured taps", "None: all that are here.", offered),
        one_path("model", "Machine", about, partial(bench.models, "vibration")),
        Box("point", FIELDS["--point"], "node=member, e.g. 1=tool 2=headstock; 3= leaves node 3 out"),
        one_of("axis", FIELDS["--axis"], ["", "X", "Y", "Z"]),
        Box("unit", "Units", "motion/force, e.g. m/s^2/N; empty: as the files say"),
    )
    return Boxes(ID, boxes, lambda: bench.taps, bench.choose_taps)


def command(bench: Bench) -> tuple[str, ...] | None:
    """`selector taps` of the files."""
    there = files_in(bench.folder / TAP_TESTS)
    asked = [path for path in there if path.name in bench.taps.files] or there
    if not asked or not bench.taps.point or bench.taps.model not in bench.models("vibration"):
        return None
    return taps_command(bench.folder, bench.taps, asked)


_PAGE = MeasuredPage(
    ID,
    TITLE,
    "A tap test: what the joints are like",
    TAP_TESTS,
    "Choose measured taps …",
    "UFF files with frequency responses, or with hammer and motion over time.",
    _boxes,
    command,
    TAPS,
    (("report.html", "Report"), ("model.toml", "Fitted model file"), ("taps.json", "All results (JSON)")),
    "Report of the tap test",
    OptionError(
        "no taps, no machine, or no node",
        expected="UFF files, the model file of the machine, and which member a node is on",
        where=TITLE,
        advice="choose them above",
    ),
)
layout, register = _PAGE.layout, _PAGE.register
