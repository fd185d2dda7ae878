"""How values get from the PLC of a SINUMERIK into setting data of its NC, and who notices that the other stands still.

Both written files are executed here: the SCL by a parser of Structured Text, the synchronised actions by the small NC
below, an action at a time, so that the PLC may come between any two of them.
"""

from __future__ import annotations

import csv
import io
import re

import numpy as np
import pytest

from selector.controllers import read_model
from selector.controllers.replay.structured_text_executed import executable
from selector.controllers.writers.exported import ExportRefusedError
from selector.controllers.writers.sinumerik import ACTIONS, FIRST_VALUE, HANDOVER, SETTINGS, STALE_S, sinumerik_export
from tests.controllers import hostile
from tests.controllers.model_builders import PATENT
from tests.controllers.test_sinumerik import needs_parser, with_outputs

IPO_S = 0.012
CALL_S = 42 * IPO_S
_WORD = r"\$\$?A?_?\w+\[\w+\]"
_ACTION = re.compile(r"IDS=(\d+) WHENEVER (.+?) DO (.+)")
_ASSIGNED = re.compile(rf"({_WORD})=({_WORD}|-?[0-9.]+)")


class Nc:
    """An NC that has run the subprogram: its words, timers and setting data by their names."""

    def __init__(self, text: str) -> None:
        lines = [line for line in text.splitlines() if not line.startswith(";")]
        assert lines.pop() == "M17"
        self.values: dict[str, float] = {"$A_DBW[0]": 0, "$AC_TIMER[0]": 0.0}
        self.actions = []
        for line in lines:
            if found := _ACTION.fullmatch(line):
                comparisons = [part.strip("()").strip() for part in found[2].split(" AND ")]
                self.actions.append((int(found[1]), comparisons, self._assignments(found[3])))
            else:
                self._do(self._assignments(line))
        assert [number for number, _, _ in self.actions] == list(range(101, 101 + len(self.actions)))

    @staticmethod
    def _assignments(text: str) -> list[tuple[str, str]]:
        found = _ASSIGNED.findall(text)
        # nothing is left that is not understood
        assert " ".join(f"{to}={value}" for to, value in found) == text
        return found

    def cycle(self):
        """One interpolation cycle; what runs beside it may come at every yield."""
        if self.values["$A_DBW[4]"] == 1 or self.values["$AC_TIMER[0]"]:
            self.values["$AC_TIMER[0]"] += IPO_S
        for _, comparisons, assignments in self.actions:
            yield
            if all(map(self._holds, comparisons)):
                self._do(assignments)

    def _do(self, assignments) -> None:
        for to, value in assignments:
            self.values[to] = self.values[value] if value in self.values else float(value)

    def _holds(self, comparison: str) -> bool:
        name, sign, number = re.fullmatch(rf"({_WORD})(==|>|<)(-?[0-9.]+)", comparison).groups()
        value = self.values.get(name, 0.0)
        return {"==": value == float(number), ">": value > float(number), "<": value < float(number)}[sign]

    def setting(self, name: str, axis: str) -> float | None:
        return self.values.get(f"$$SA_TEMP_COMP_{name}[{axis}]")

    def all_at_once(self) -> tuple:
        return tuple(self.setting(name, axis) for axis in "ZY" for name in ("ABS_VALUE", "SLOPE"))


class Plc:
    """The handover block, and FC21 that does what the sheet says; `count` values were handed over."""

    def __init__(self, files, nc: Nc) -> None:
        self.block, self.nc = executable(files[HANDOVER]), nc
        self.count, self.is_failing, self.is_vanishing = 0, False, False
        self.values_of = lambda count: [1e-6 * (count % 7000), 0.0, -1e-6 * (count % 7000), 0.0]

    def call(self):
        block, words = self.block, self.nc.values
        block.v_dt_s, block.v_is_failed = np.float32(CALL_S), self.is_failing
        block.v_turn, block.v_nc_state = int(words["$A_DBW[0]"]), int(words["$A_DBW[4]"])
        block.call()
        if self.is_failing:
            return
        if block.v_is_withdrawn:
            words["$A_DBW[0]"] = 0
        if block.v_is_write and not self.is_vanishing:
            self.count += 1
            for k, value in enumerate(self.values_of(self.count)):
                yield
                # four bytes do not arrive whole: something else stands there in between
                words[f"$A_DBR[{FIRST_VALUE + 4 * k}]"] = float("nan") if k % 2 else 0.0
                yield
                words[f"$A_DBR[{FIRST_VALUE + 4 * k}]"] = value
            yield
            words["$A_DBW[0]"] = 1


def pair():
    files = sinumerik_export(hostile.model()).files
    nc = Nc(files[ACTIONS])
    return Plc(files, nc), nc


def run(plc: Plc, nc: Nc, seconds: float, *, is_plc_called=True, is_nc_running=True, rng=None) -> list[tuple]:
    """What stood in setting data after every cycle; a call of the PLC begins anywhere in a cycle."""
    stood = []
    per_call = round(CALL_S / IPO_S)
    calling = iter(())
    for number in range(round(seconds / IPO_S)):
        if is_plc_called and number % per_call == 0:
            calling = iter(plc.call())
        for _ in nc.cycle() if is_nc_running else range(10):
            for _ in range(1 if rng is None else rng.integers(0, 4)):
                next(calling, None)
        stood.append(nc.all_at_once())
    return stood


@needs_parser
def test_the_values_of_the_plc_arrive_whole_and_both_sides_know():
    for seed in range(8):
        plc, nc = pair()
        stood = run(plc, nc, 120 * CALL_S, rng=np.random.default_rng(seed))
        allowed = {tuple(plc.values_of(count)) for count in range(1, plc.count + 1)} | {(None,) * 4}
        assert set(stood) <= allowed
        assert plc.count == 120
        assert stood[-1] == tuple(plc.values_of(plc.count))
        assert plc.block.v_nc_takes_values
        assert nc.values["$A_DBW[4]"] == 1
        assert (nc.setting("REF_POSITION", "Z"), nc.setting("REF_POSITION", "Y")) == (100.0, 0.0)


@needs_parser
def test_an_nc_notices_that_the_plc_no_longer_hands_over_and_holds():
    plc, nc = pair()
    run(plc, nc, 10.0)
    held = nc.all_at_once()
    run(plc, nc, STALE_S - 2 * CALL_S, is_plc_called=False)
    assert nc.values["$A_DBW[4]"] == 1
    run(plc, nc, 3 * CALL_S, is_plc_called=False)
    assert nc.values["$A_DBW[4]"] == 2
    assert nc.all_at_once() == held
    run(plc, nc, 2.0)
    assert nc.values["$A_DBW[4]"] == 1
    assert plc.block.v_nc_takes_values


@needs_parser
def test_a_plc_notices_that_the_nc_takes_nothing_and_comes_back():
    plc, nc = pair()
    run(plc, nc, 10.0)
    run(plc, nc, STALE_S - CALL_S, is_nc_running=False)
    assert plc.block.v_nc_takes_values
    # the state that the NC has left says that values come
    for _ in range(30):
        run(plc, nc, 3 * CALL_S, is_nc_running=False)
        assert nc.values["$A_DBW[4]"] == 1
        assert not plc.block.v_nc_takes_values
    run(plc, nc, 3.0)
    assert plc.block.v_nc_takes_values
    assert nc.all_at_once() == tuple(plc.values_of(plc.count))


@needs_parser
def test_an_nc_that_has_never_run_the_subprogram_takes_nothing():
    plc, nc = pair()
    nc.values |= {"$A_DBW[4]": 0, "$A_DBW[2]": 0}
    run(plc, nc, 20.0, is_nc_running=False)
    assert not plc.block.v_nc_takes_values


@needs_parser
def test_a_failing_transfer_is_noticed():
    plc, nc = pair()
    run(plc, nc, 10.0)
    plc.is_failing = True
    run(plc, nc, 2 * CALL_S)
    assert not plc.block.v_nc_takes_values
    run(plc, nc, 10.0)
    assert nc.values["$A_DBW[4]"] == 2
    plc.is_failing = False
    run(plc, nc, 3.0)
    assert plc.block.v_nc_takes_values


@needs_parser
def test_values_that_vanish_without_an_error_are_noticed():
    plc, nc = pair()
    run(plc, nc, 10.0)
    plc.is_vanishing = True
    run(plc, nc, STALE_S + 2 * CALL_S)
    assert not plc.block.v_nc_takes_values


@needs_parser
@pytest.mark.parametrize("value", [0.02003, -1.0, 1e30, float("nan"), float("-inf")])
@pytest.mark.parametrize("place", range(4))
def test_what_the_guard_cannot_have_given_is_not_taken_over(value, place):
    plc, nc = pair()
    run(plc, nc, 10.0)
    held = nc.all_at_once()
    good = plc.values_of
    plc.values_of = lambda count: [value if k == place else one for k, one in enumerate(good(count))]
    run(plc, nc, 20.0)
    assert nc.all_at_once()[place] != value
    assert abs(nc.all_at_once()[0] - held[0]) <= 1e-6, "all axes or none; one good sample may have been on its way"
    assert nc.values["$A_DBW[4]"] == 2
    assert not plc.block.v_nc_takes_values
    plc.values_of = good
    run(plc, nc, 5.0)
    assert nc.all_at_once() == tuple(good(plc.count))
    assert plc.block.v_nc_takes_values


def test_the_limits_of_the_guard_pass_as_the_plc_rounds_them():
    nc = Nc(sinumerik_export(hostile.model()).files[ACTIONS])
    # clamps of 20 and 8 um, 25 um/m, in binary32
    for sign in (1.0, -1.0):
        ends = [float(np.float32(sign * value)) for value in (0.02, 25e-6, 0.008, 0.0)]
        nc.values |= {f"$A_DBR[{FIRST_VALUE + 4 * k}]": value for k, value in enumerate(ends)} | {"$A_DBW[0]": 1}
        for _ in nc.cycle():
            pass
        assert nc.all_at_once() == tuple(ends)


@pytest.mark.parametrize("model", [hostile.model(), with_outputs(hostile.model(), axis="X"), read_model(PATENT)])
def test_table_actions_and_block_are_of_the_same_axes_and_places(model):
    files = sinumerik_export(model).files
    table = [
        (row["axis"], row["datum"].split()[0], row["value"]) for row in csv.DictReader(io.StringIO(files[SETTINGS]))
    ]
    for name, number in (("ABS_VALUE", "SD43900"), ("SLOPE", "SD43910"), ("REF_POSITION", "SD43920")):
        taken = re.findall(rf"\$\$SA_TEMP_COMP_{name}\[(\w+)\]=(\S+)", files[ACTIONS])
        of_table = [(axis, value) for axis, datum, value in table if datum == number]
        assert [axis for axis, _ in taken] == [axis for axis, _ in of_table]
        if name == "REF_POSITION":
            assert [float(value) for _, value in taken] == [float(value) for _, value in of_table]
            continue
        for k, ((axis, place), (_, variable)) in enumerate(zip(taken, of_table, strict=True), 1):
            assert variable == f"{number.lower()}_{k}"
            assert re.search(rf"^; +{re.escape(place)} +{variable} ", files[ACTIONS], re.MULTILINE)
            assert f"{variable} : REAL := 0.0; (* axis {axis}:" in files["thermal_to_sd.scl"]


@pytest.mark.parametrize("axis", ["=1+1", "Z]=9 $A_DBW[0", "Z\nM30", "1Z", "Ä", " Z", "Z" * 32, "Z;"])
def test_an_axis_that_no_nc_can_have_is_refused(axis):
    with pytest.raises(ExportRefusedError, match="the name of an axis as the NC has it") as refused:
        sinumerik_export(with_outputs(hostile.model(), axis=axis, position=None))
    assert "outputs.axis" in str(refused.value)


def test_hostile_names_stay_in_comments():
    model = hostile.model().model_copy(
        update={"name": 'M30\nIDS=1 DO $$SA_TEMP_COMP_ABS_VALUE[Z]=1 *) "; ' + "x" * 400}
    )
    text = sinumerik_export(model).files[ACTIONS]
    assert text.isascii()
    assert Nc(text).actions == Nc(sinumerik_export(hostile.model()).files[ACTIONS]).actions


def test_the_sheet_says_who_writes_who_notices_and_that_no_control_has_run_it():
    exported = sinumerik_export(hostile.model())
    told = " ".join((*exported.install, *exported.silently))
    for word in (
        "FC21",
        "IVAR1",
        "THERMAL_SD",
        "MD28258",
        "nc_takes_values",
        "alarm 2000",
        "5 s",
        "No control has run",
    ):
        assert word in told
    assert "FB3 PUT" not in told


def test_both_files_say_that_the_sign_is_unverified_until_somebody_verified_it():
    for verified in (False, True):
        files = sinumerik_export(hostile.model(), is_sign_verified=verified).files
        assert all(("SIGN UNVERIFIED" in files[name]) is not verified for name in (HANDOVER, ACTIONS))
