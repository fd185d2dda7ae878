"""The loop beside a control that fails: what arrives there, what is told, what is kept."""

from __future__ import annotations

import asyncio
import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from selector.controllers.guard.guarded_model import GuardedModel
from selector.controllers.model_file import kept_sha256
from selector.live.compensating import Compensation
from selector.live.io_file import read_io
from selector.live.journal import status_words
from selector.live.links import FastClock
from tests.live.plants import CLAMP_UM, beyond_the_guard, model, plant, run


def journal(folder):
    lines = (folder / "out" / "journal.jsonl").read_text("ascii").splitlines()
    return [json.loads(line) for line in lines]


def test_a_warming_machine_is_corrected_and_the_clamp_holds(tmp_path):
    process, link, clock = plant(tmp_path)

    def warm(second):
        link.values["T1"] = 20.0 + min(0.1 * second, 8.0)

    run(process, clock, 150, warm)
    assert link.arrived[-1][1] == -CLAMP_UM  # 2 um/K · 8 K = 16
    assert beyond_the_guard(link.arrived) == []
    status = process.status()
    assert (status["rows_in"], status["rows_out"], status["rows_confirmed"]) == (150, 150, 150)
    assert status["mismatches"] == 0
    assert status["ready"] == 1


def test_a_connection_that_the_end_closes_was_not_lost(tmp_path):
    process, _, _ = plant(tmp_path)
    assert set(asyncio.run(process.run(3))["connections"].values()) == {"closed"}


def warmed(tmp_path, **options):
    process, link, clock = plant(tmp_path, **options)
    link.values |= {"ready": True, "beat": 0, "T2": 20.0}

    def beat(second):
        link.values["beat"] = second

    run(process, clock, 10, beat)
    link.values["T1"] = 24.0
    run(process, clock, 40, lambda second: beat(second + 10))
    assert link.arrived[-1][1] == pytest.approx(-8.0)
    return process, link, clock


@pytest.mark.parametrize("value", [float("nan"), float("inf"), "x" * 10_000, [20.0], None, 1e300, "2_0"])
def test_what_is_no_number_is_a_missing_sensor(tmp_path, value):
    process, link, clock = warmed(tmp_path)
    link.values["T1"] = value
    run(process, clock, 30)
    assert process.status()["sensors"] == {"T1": "MISSING"}
    assert link.arrived[-1][1] == 0.0
    assert beyond_the_guard(link.arrived) == []


def test_bad_quality_is_a_missing_sensor(tmp_path):
    process, link, clock = warmed(tmp_path)
    link.quality["T1"] = "BadSensorFailure"
    run(process, clock, 30)
    assert process.status()["sensors"] == {"T1": "MISSING"}
    assert link.arrived[-1][1] == 0.0


def test_a_short_cut_is_ridden_out_and_a_long_one_ends_at_zero(tmp_path):
    process, link, clock = warmed(tmp_path)

    def cut(second):
        link.is_cut = 2 <= second < 4

    run(process, clock, 20, cut)
    assert link.arrived[-1][1] == pytest.approx(-8.0)
    assert all(value != 0.0 for moment, value in link.arrived if moment > 40.0)

    def cut_for_long(second):
        link.is_cut = second < 30

    count = len(link.arrived)
    run(process, clock, 45, cut_for_long)
    assert link.arrived[count][1] == 0.0
    events = [line["event"] for line in journal(tmp_path)]
    assert events.count("connection-lost") == 2
    assert beyond_the_guard(link.arrived) == []


def test_a_refused_write_is_told_and_the_guard_gives_nothing(tmp_path):
    process, link, clock = warmed(tmp_path)
    link.is_refusing = True
    run(process, clock, 15)
    assert process.given.correction_um == {"Z": 0.0}
    assert any("BadNotWritable" in line.get("error", "") for line in journal(tmp_path))


def test_a_control_that_shows_something_else_is_mistrusted_and_tried_again(tmp_path):
    process, link, clock = warmed(tmp_path)
    link.is_lying = True
    run(process, clock, 3)
    assert [value for _, value in link.arrived[-2:]] == [0.0, 0.0]
    assert process.status()["mismatches"] == 1
    run(process, clock, 200)
    # tried again after 20 s, found out at the first value other than zero
    assert 5 <= process.status()["mismatches"] <= 11
    assert beyond_the_guard(link.arrived) == []
    told = next(line for line in journal(tmp_path) if line.get("now") == "something else")
    assert "REAL" in told["advice"]
    link.is_lying = False
    run(process, clock, 60)
    assert link.arrived[-1][1] == pytest.approx(-8.0)


def test_a_single_precision_control_is_trusted(tmp_path):
    process, link, clock = plant(tmp_path)
    write = link.write

    async def rounded(values):
        await write({name: float(np.float32(value)) for name, value in values.items()})

    link.write = rounded
    run(process, clock, 5)
    link.values["T1"] = 21.7
    run(process, clock, 30)
    assert process.status()["mismatches"] == 0
    assert link.arrived[-1][1] == pytest.approx(-3.4)


def test_without_heartbeat_of_the_control_there_is_no_correction(tmp_path):
    control = """
[channels.beat]
at = "plc"
address = "beat"
role = "state"
[channels.ready]
at = "plc"
address = "ready"
role = "state"
[control]
alive = "beat"
ready = "ready"
heartbeat = { at = "plc", address = "ours" }
"""
    process, link, clock = warmed(tmp_path, control=control)
    assert link.values["ours"] == 50
    run(process, clock, 10)
    assert link.arrived[-1][1] == 0.0

    def beat(second):
        link.values["beat"] = second

    run(process, clock, 40, beat)
    assert link.arrived[-1][1] == pytest.approx(-8.0)
    link.values["ready"] = False
    run(process, clock, 2, beat)
    assert link.arrived[-1][1] == 0.0


def test_an_echo_may_come_a_scan_later_but_not_never(tmp_path):
    process, link, clock = plant(tmp_path, output='read_back = "echo"')
    scans = [0.0, 0.0]

    def scan(second):
        scans.append(link.values.get("Z", 0.0))
        link.values["echo"] = scans[-2] if second < 40 else 3.0
        link.values["T1"] = 20.0 + min(0.2 * second, 4.0)

    run(process, clock, 40, scan)
    assert link.arrived[-1][1] == pytest.approx(-8.0)
    run(process, clock, 20, lambda second: scan(second + 40))
    assert link.arrived[-1][1] == 0.0
    assert process.status()["mismatches"] > 0


def test_a_restart_keeps_the_start_readings(tmp_path):
    process, _, _ = warmed(tmp_path)
    process._keep()
    again, other, later = plant(tmp_path)
    other.values["T1"] = 24.0
    run(again, later, 40)
    # as much as before the restart: 24 is a rise of 4 K, not a new start
    assert other.arrived[-1][1] == pytest.approx(-8.0)


@pytest.mark.parametrize(("later_s", "standstill_s"), [(600.0, 600.0), (0.0, 0.0), (-3600.0, 1e6)])
def test_a_clock_that_was_put_back_counts_as_a_long_standstill(tmp_path, monkeypatch, later_s, standstill_s):
    process, _, clock = warmed(tmp_path)
    process._keep()
    told = []
    monkeypatch.setattr(GuardedModel, "restart", lambda _, seconds: told.append(seconds))
    Compensation(model(), read_io(tmp_path / "io.toml", model()), FastClock(clock.wall() + later_s), tmp_path / "out")
    assert told == [standstill_s]


TOO_LARGE = f'{{"model": "SHA", "time_s": {10**400}, "values": {{}}}}'
TEXTS = ["{", "[]", '{"model": 1}', "\x00", '{"model": null, "time_s": "x", "values": {}}', "[" * 99_999, TOO_LARGE]


@pytest.mark.parametrize("text", TEXTS, ids=range(len(TEXTS)))
def test_what_was_kept_may_be_broken(tmp_path, text):
    (tmp_path / "out").mkdir()
    process, _, _ = plant(tmp_path)
    values = f'"values": {json.dumps(process._guard.retained)}'
    kept = text.replace("SHA", kept_sha256(model())).replace('"values": {}', values)
    (tmp_path / "out" / "kept.json").write_text(kept, "utf-8")
    process, link, clock = plant(tmp_path)
    run(process, clock, 3)
    assert link.arrived[-1][1] == 0.0
    assert journal(tmp_path)[0]["event"].startswith("kept-")


def test_files_that_cannot_be_written_are_told_where_the_process_ends(tmp_path):
    process, _, clock = plant(tmp_path)
    (tmp_path / "out" / "status.html").mkdir(parents=True)
    run(process, clock, 3)
    status = asyncio.run(process.run(cycles=1))
    assert "status.html" in status["not_written"]
    assert any("status.html" in now for what, now in status_words(status, model()) if what == "files not written")


def test_a_clock_that_is_put_changes_nothing_but_the_journal(tmp_path):
    process, link, clock = warmed(tmp_path)
    clock.begun_s -= 3600.0
    run(process, clock, 5)
    assert link.arrived[-1][1] == pytest.approx(-8.0)
    assert any(line["event"] == "clock-jump" and line["by_s"] == -3600.0 for line in journal(tmp_path))


def test_what_the_operator_does_not_want_is_ramped_to_zero(tmp_path):
    control = '[channels.want]\nat = "plc"\naddress = "want"\nrole = "state"\n[control]\nwanted = "want"'
    process, link, clock = plant(tmp_path, control=control)
    link.values["want"] = 1
    run(process, clock, 10)
    link.values["T1"] = 24.0
    run(process, clock, 30)
    link.values["want"] = False
    run(process, clock, 20)
    values = [value for _, value in link.arrived]
    assert values[39] == pytest.approx(-8.0)
    assert values[40:57] == pytest.approx([*np.arange(-7.5, 0.5, 0.5), 0.0])


EVENTS = st.sampled_from(
    ["cut", "refuse", "lie", "deaf", "bad", "nan", "text", "jump", "warm", "cold", "held-up", "clock", "well"]
)


@given(st.lists(st.tuples(EVENTS, st.integers(1, 25)), max_size=25))
def test_nothing_beyond_clamp_and_slew_ever_arrives(tmp_path_factory, events):
    process, link, clock = plant(tmp_path_factory.mktemp("plant"))
    run(process, clock, 12)
    given_um = []
    step = process.step

    async def noted():
        given = await step()
        given_um.append(given.correction_um["Z"])

    process.step = noted
    before = len(link.arrived)
    for event, seconds in events:
        link.is_cut, link.is_refusing = event == "cut", event == "refuse"
        link.is_lying, link.is_deaf = event == "lie", event == "deaf"
        link.quality = {"T1": "Bad"} if event == "bad" else {}
        link.values["T1"] = {"nan": float("nan"), "text": "hot", "jump": 9e9, "warm": 29.0, "cold": 20.0}.get(
            event, 24.0
        )
        clock.begun_s += -4000.0 if event == "clock" else 0.0
        if event == "held-up":
            clock._now_s += 40.0
        run(process, clock, seconds)
    assert beyond_the_guard(link.arrived) == []
    assert {value for _, value in link.arrived[before:]} <= set(given_um)
