"""A whole LinuxCNC, without a machine and a screen, corrected by the generated component."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from selector.controllers import Fallback, Guard, Input, ModelFile, Output, OutputLimits, PositionPart, Term
from selector.controllers.guard.decided import Mode, SensorCode
from selector.controllers.guard.guarded_model import GuardedModel
from selector.controllers.replay.compiled import INSTALL, environment, installed, missing_program, single_session
from selector.controllers.writers.linuxcnc import NAME, linuxcnc_export
from selector.errors import NotExecutableError
from tests.patience import PATIENCE_S

CONFIGURATION = Path(__file__).parent / "linuxcnc_control"
COUNT_UM = 0.1
SLEW_UM_PER_S = 40.0

pytestmark = [
    pytest.mark.skipif(missing_program() is not None, reason=f"no LinuxCNC here: {INSTALL}"),
    pytest.mark.xdist_group("linuxcnc"),
]


def lathe_model() -> ModelFile:
    t1 = Input(name="T1", valid_min=-5.0, valid_max=20.0)
    t2 = Input(name="T2", reference="absolute", valid_min=10.0, valid_max=45.0, centre=25.0, scale=2.0)
    part = PositionPart(axis="Z", reference_m=-0.03, valid_min_m=-0.4, valid_max_m=0.0, intercept=10.0,
                        terms=(Term(powers={"T1": 1}, coefficient=25.0),))  # fmt: skip
    limits = {"clamp_um": 60.0, "slew_um_per_s": SLEW_UM_PER_S}
    return ModelFile(
        name="lathe",
        inputs=(t1, t2),
        outputs=(
            Output(name="Z growth", axis="Z", intercept=1.9, position=part,
                   terms=(Term(powers={"T1": 1}, coefficient=3.1), Term(powers={"T2": 1}, coefficient=1.37))),
            Output(name="X drift", axis="X", intercept=-0.7, terms=(Term(powers={"T2": 1}, coefficient=-2.4),)),
        ),
        guard=Guard(
            limits=(OutputLimits(output="Z growth", **limits), OutputLimits(output="X drift", **limits)),
            on_fault="fallback", without_fallback="hold", hold_at_most_s=2.0, recover_after_s=1.0,
        ),
        fallbacks=(
            Fallback(without=("T2",), inputs=(t1,), outputs=(
                Output(name="Z growth", axis="Z", intercept=2.3, position=part,
                       terms=(Term(powers={"T1": 1}, coefficient=4.4),)),
                Output(name="X drift", axis="X", intercept=-1.4),
            )),
        ),
    )  # fmt: skip


def expected_um(t1: float, t2: float, z_m: float = -0.03) -> tuple[float, float]:
    """Correction of Z and X when everything has settled, after a start at 22 and 25 degrees."""
    guarded = GuardedModel(lathe_model())
    guarded.step(1.0, {"T1": 22.0, "T2": 25.0}, {"Z": z_m})
    for _ in range(60):
        found = guarded.step(1.0, {"T1": t1, "T2": t2}, {"Z": z_m}).correction_um
    return found["Z growth"], found["X drift"]


@pytest.fixture(scope="module")
def days() -> Iterator[dict[str, Any]]:
    """What the operator saw on a whole day, and on the next one."""
    exported = linuxcnc_export(lathe_model())
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as name, single_session():
        folder = Path(name)
        shutil.copytree(CONFIGURATION, folder, dirs_exist_ok=True)
        for file, text in exported.files.items():
            (folder / file).write_text(text, encoding="ascii")
        for path in (folder, *folder.iterdir()):
            path.chmod(0o777)
        try:
            with installed(exported.files[f"{NAME}.comp"], NAME, folder):
                yield {job: _seen(job, folder) for job in ("whole day", "next day")}
        except NotExecutableError as refused:
            pytest.skip(str(refused))


def _seen(job: str, folder: Path) -> dict[str, Any]:
    (folder / "job.txt").write_text(job, encoding="ascii")
    (folder / "seen.json").unlink(missing_ok=True)
    with (folder / "said.txt").open("w") as said:
        process = subprocess.Popen(
            ["linuxcnc", "-r", "lathe.ini"], cwd=folder, env=environment(folder), start_new_session=True,
            stdin=subprocess.DEVNULL, stdout=said, stderr=subprocess.STDOUT,
        )  # fmt: skip
        try:
            process.wait(timeout=PATIENCE_S)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            subprocess.run(
                ["halrun", "-U"], env=environment(folder), capture_output=True, check=False, timeout=PATIENCE_S
            )
    log = (folder / "said.txt").read_text(errors="replace")
    assert (folder / "seen.json").exists(), log
    seen = json.loads((folder / "seen.json").read_text())
    assert "error" not in seen, (seen["error"], seen.get("messages"), log)
    seen["course"] = np.loadtxt(folder / "course.txt").tolist()
    return seen


@pytest.fixture
def day(days: dict[str, Any]) -> dict[str, Any]:
    return days["whole day"]


def _is_shifted(at: dict[str, Any], z_mm: float, correction_um: tuple[float, float]) -> None:
    # rounding to counts
    assert at["z_um"] - 1000.0 * z_mm == pytest.approx(correction_um[0], abs=0.5 * COUNT_UM + 1e-6)
    assert at["x_um"] - 50_000.0 == pytest.approx(correction_um[1], abs=0.5 * COUNT_UM + 1e-6)


@pytest.mark.parametrize("phase", ["off", "not homed"])
def test_nothing_is_corrected_until_the_machine_is_on_and_homed(day: dict[str, Any], phase: str) -> None:
    at = day[phase]
    assert (at["mode"], at["z_counts"], at["x_counts"], at["z_um_of_component"]) == (Mode.OFF, 0, 0, 0.0)
    # 1.2 s after the start they have not been good for recover_after_s + the second until the next sample
    assert {at["T1"], at["T2"]} <= {SensorCode.OK, SensorCode.RECOVERING}


@pytest.mark.parametrize(
    ("phase", "t1", "t2", "z_mm"),
    [
        ("cold", 22.0, 25.0, -30.0),
        ("warm", 26.0, 31.0, -30.0),
        ("far away", 26.0, 31.0, -130.0),
        ("back", 26.0, 31.0, -30.0),
    ],
)
def test_the_motors_are_shifted_by_the_correction(
    day: dict[str, Any], phase: str, t1: float, t2: float, z_mm: float
) -> None:
    correction = expected_um(t1, t2, z_mm / 1000.0)
    at = day[phase]
    _is_shifted(at, z_mm, correction)
    assert at["mode"] == Mode.MODEL
    assert at["z_um_of_component"] == pytest.approx(correction[0], abs=1e-6)


def test_the_tool_that_grows_towards_plus_is_moved_towards_minus(day: dict[str, Any]) -> None:
    # by hand: displacement of Z 1.9 + 3.1 * 4 + 1.37 * 3 = 18.41 um at the reference position, of X -0.7 - 2.4 * 3
    _is_shifted(day["warm"], -30.0, (-18.41, 7.9))
    # 100 mm further: slope 10 + 25 * 4 = 110 um/m
    _is_shifted(day["far away"], -130.0, (-18.41 + 11.0, 7.9))


def test_the_correction_is_no_faster_than_its_slew_limit(day: dict[str, Any]) -> None:
    motor_um, program_um = 1000.0 * np.array(day["course"]).T
    periods = 100
    stands = np.abs(program_um[periods:] - program_um[:-periods]) < 1e-3
    moved_um = np.abs(motor_um[periods:] - motor_um[:-periods])[stands]
    # servo periods of 1 ms; both ends are rounded to counts, and LinuxCNC runs after a count for a moment
    assert moved_um.max() < 0.1 * SLEW_UM_PER_S + 2.0 * COUNT_UM
    assert moved_um.max() > 0.1 * SLEW_UM_PER_S - COUNT_UM


def test_after_power_off_the_axis_moves_by_the_correction_and_is_right_from_the_next_move(day: dict[str, Any]) -> None:
    before, off, on = day["back"], day["power off"], day["power on"]
    z_um = expected_um(26.0, 31.0)[0]
    assert (off["mode"], off["z_counts"], off["x_counts"]) == (Mode.OFF, 0, 0)
    assert off["z_um"] == pytest.approx(before["z_um"], abs=1e-6)
    # no jump: just after power on the motor is where it was, give or take 0.2 s of slew
    assert on["z_um"] == pytest.approx(before["z_um"], abs=0.2 * SLEW_UM_PER_S)
    assert day["corrected again"]["z_um"] == pytest.approx(before["z_um"] + z_um, abs=COUNT_UM)
    # an axis is right from its own next absolute move on; the other one is not
    z_moved = day["Z moved again"]
    assert z_moved["z_um"] == pytest.approx(-31_000.0 + expected_um(26.0, 31.0, -0.031)[0], abs=COUNT_UM)
    assert z_moved["x_um"] == pytest.approx(50_000.0 + 2.0 * expected_um(26.0, 31.0)[1], abs=COUNT_UM)
    _is_shifted(day["both moved again"], -30.0, expected_um(26.0, 31.0))


def test_the_operators_switch(day: dict[str, Any]) -> None:
    assert day["switched off"]["mode"] == Mode.SWITCHED_OFF
    _is_shifted(day["switched off"], -30.0, (0.0, 0.0))
    _is_shifted(day["switched on"], -30.0, expected_um(26.0, 31.0))


def test_a_dead_sensor_leads_to_the_fallback_then_to_hold_then_to_zero(day: dict[str, Any]) -> None:
    fallback = day["T2 dead"]
    assert (fallback["mode"], fallback["T1"], fallback["T2"]) == (Mode.FALLBACK, SensorCode.OK, SensorCode.BREAK_CODE)
    # by hand: 2.3 + 4.4 * 4
    _is_shifted(fallback, -30.0, (-19.9, 1.4))
    held = day["both dead"]
    assert (held["mode"], held["T1"]) == (Mode.HOLD, SensorCode.MISSING)
    _is_shifted(held, -30.0, (-19.9, 1.4))
    assert day["dead for long"]["mode"] == Mode.RAMP_TO_ZERO
    _is_shifted(day["dead for long"], -30.0, (0.0, 0.0))
    _is_shifted(day["alive again"], -30.0, expected_um(26.0, 31.0))


def test_the_start_readings_outlive_linuxcnc(days: dict[str, Any]) -> None:
    _is_shifted(days["next day"]["next day"], -30.0, expected_um(26.0, 31.0))


def test_linuxcnc_has_nothing_to_complain_about(days: dict[str, Any]) -> None:
    assert [seen.get("messages", []) for seen in days.values()] == [[], []]
