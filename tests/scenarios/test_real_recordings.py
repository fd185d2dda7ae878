"""The bench of published recordings: what is declared fits together, files of each kind are read as they are meant.

The recordings themselves are not part of the package; files of the same form are made up here.
"""

from __future__ import annotations

import subprocess
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from benchmarks.real.case import SIMULATED, RealCase, noise_of, noisy, pair
from benchmarks.real.collect import clone_of, collected
from benchmarks.real.cut import CUTS
from benchmarks.real.cut import written as cut_files
from benchmarks.real.rigs import CASES
from benchmarks.real.score import judged, sums, text_of
from benchmarks.real.sources import EIGHTH, EVERY, FIFTH, FOURTH, KNOWN, SECOND, SEVENTH, SIXTH, THIRD, halves
from selector.diagnosis.effects.catalogue import catalogue
from selector.diagnosis.matching.alignment import comparison_of
from selector.recording import Channel

APART = {
    *("f16", "ball_hoop", "odrive", "cart_pendulum", "probe_drift"),
    *("water_loop", "bottle_tank", "friction_damper", "heated_rod", "incubator", "two_pendulums"),
}
FOURTH_APART = {
    "micromouse", "rack_pinion", "thrust_stand", "rc_filter", "link_shield", "fermenter", "cell_18650",
}  # fmt: skip
FIFTH_APART = {"made_spring", "motor_kit", "hung_payload", "straw_house", "two_rooms", "water_cup"}
SIXTH_APART = {"hot_phone", "resonant_circuit", "winder", "speed_servo", "passive_house"}
SEVENTH_APART = {"double_pendulum", "two_capacitors", "direct_drive", "hot_water", "solar_plant"}
EIGHTH_APART = {"shaking_table", "magnet", "glass_furnace", "twisted_string", "heated_box", "brick_wall"}
VERDICTS = {"missing-physics", "nothing-missing", "data-fault", "miscalibrated", "unexplained"}
DRAW = np.random.default_rng(0)


def case(name: str) -> RealCase:
    return next(one for one in CASES if one.name == name)


def test_the_lot_is_the_one_that_was_drawn_before_anything_was_run():
    half_of = halves()
    assert {rig for rig, half in half_of.items() if half == "apart"} == APART
    assert set(half_of) == {source.rig for source in EVERY} | set(KNOWN)
    for half, declared in (("second", SECOND), ("third", THIRD)):
        assert {rig for rig, drawn in half_of.items() if drawn == half} == {source.rig for source in declared}
    assert {rig for rig, half in half_of.items() if half == "fourth-apart"} == FOURTH_APART
    assert {rig for rig, half in half_of.items() if half == "fourth"} == {one.rig for one in FOURTH} - FOURTH_APART
    assert {rig for rig, half in half_of.items() if half == "fifth-apart"} == FIFTH_APART
    assert {rig for rig, half in half_of.items() if half == "fifth"} == {one.rig for one in FIFTH} - FIFTH_APART
    assert {rig for rig, half in half_of.items() if half == "sixth-apart"} == SIXTH_APART
    assert {rig for rig, half in half_of.items() if half == "sixth"} == {one.rig for one in SIXTH} - SIXTH_APART
    assert {rig for rig, half in half_of.items() if half == "seventh-apart"} == SEVENTH_APART
    assert {rig for rig, half in half_of.items() if half == "seventh"} == {one.rig for one in SEVENTH} - SEVENTH_APART
    assert {rig for rig, half in half_of.items() if half == "eighth-apart"} == EIGHTH_APART
    assert {rig for rig, half in half_of.items() if half == "eighth"} == {one.rig for one in EIGHTH} - EIGHTH_APART


def test_a_clone_without_the_commit_is_told(tmp_path):
    subprocess.run(["git", "init", "-q", "--bare", str(tmp_path / "clone")], check=True)
    taken, absent = collected(EVERY[0], tmp_path / "clone", tmp_path / "rig")
    assert (taken, absent) == (0, [f"commit {EVERY[0].commit}"])


def test_every_case_says_what_is_right_in_ids_of_the_catalogue():
    ids = {effect.id for effect in catalogue()}
    assert len({one.name for one in CASES}) == len(CASES)
    for one in CASES:
        assert one.rig in halves(), one.name
        assert {*one.right, *one.tolerated} <= ids, one.name
        assert not set(one.right) & set(one.tolerated), one.name
        assert set(one.verdicts) <= VERDICTS, one.name
        assert one.truth, one.name
        assert one.model, one.name
        assert bool(one.right or one.verdicts), one.name
        assert one.kind == "positive" or not one.right, one.name


def test_there_are_enough_rigs_on_both_sides_of_the_lot():
    half_of = halves()
    least = (("development", 24, 5, 12), ("apart", 15, 5, 8), ("second", 15, 8, 8), ("third", 22, 10, 12),
             ("fourth", 10, 4, 7), ("fourth-apart", 10, 6, 7),
             ("fifth", 11, 5, 6), ("fifth-apart", 13, 5, 6), ("sixth", 11, 4, 7), ("sixth-apart", 8, 4, 5),
             ("seventh", 9, 4, 6), ("seventh-apart", 10, 4, 5),
             ("eighth", 9, 5, 6), ("eighth-apart", 9, 4, 6))  # fmt: skip
    for half, positives, controls, rigs in least:
        of = [one for one in CASES if half_of[one.rig] == half]
        assert sum(one.kind == "positive" for one in of) >= positives
        assert sum(one.kind == "control" for one in of) >= controls
        assert len({one.rig for one in of}) >= rigs


@pytest.mark.parametrize("inside", ["repo/.git", "repo", ".git", "."])
@pytest.mark.parametrize("folder", ["owner+name", "owner/name", "name"])
def test_a_clone_is_found_in_every_form_that_is_told(tmp_path, folder, inside):
    git = tmp_path / folder / inside
    source = replace(THIRD[0], repository="owner/name")
    assert clone_of(source, tmp_path) is None
    git.mkdir(parents=True)
    (git / "HEAD").write_text("ref: refs/heads/main\n", encoding="utf-8")
    assert clone_of(source, tmp_path) == git


def test_noise_that_is_added_is_as_large_as_that_of_the_channel_and_of_nothing_else():
    times = 0.01 * np.arange(4000)
    course = np.sin(2.0 * np.pi * times / 10.0)
    read = course + 0.02 * np.random.default_rng(3).standard_normal(len(times))
    # the median of 4000 second differences is right to 2 %; the course adds nothing that would be seen
    assert noise_of(read) == pytest.approx(0.02, rel=0.06)
    assert noise_of(np.round(course, 1)) == pytest.approx(0.1 / np.sqrt(12.0))
    assert noise_of(np.zeros(10)) == 0.0
    # differences of a noise that alternates are larger than the noise
    assert noise_of(np.tile([-0.1, 0.1], 100)) == pytest.approx(0.1)
    one = pd.DataFrame({"T": read, "T" + SIMULATED: course, "heat": course}, index=pd.Index(times, name="time_s"))
    channels = (Channel("T", "temperature", "degC"), Channel("heat", "state", "1"))
    given = pair({"r1": one, "r2": one}, channels)
    shaken = noisy(given, 1)
    added = shaken.recording.frame - given.recording.frame
    assert added["T"].std() == pytest.approx(noise_of(read), rel=0.05)
    assert not added["heat"].any()
    assert shaken.simulation is given.simulation
    pd.testing.assert_frame_equal(noisy(given, 1).recording.frame, shaken.recording.frame)
    assert (noisy(given, 2).recording.frame["T"] != shaken.recording.frame["T"]).any()


def written(folder: Path, name: str, text: str) -> None:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")


def test_a_guide_log_gives_the_error_that_the_pulses_took_away(tmp_path):
    amplitude, per_px, period_s = 6.0, 6.04, 598.4
    sessions = []
    for begin in ("2022-03-18 21:17:07", "2022-03-18 22:12:43"):
        seconds = 1.1 * np.arange(1, 1501)
        worm = amplitude / per_px * np.sin(2.0 * np.pi * seconds / period_s)
        moved, rows = 0.0, []
        for k, (at_s, error) in enumerate(zip(seconds, worm, strict=True)):
            seen = error - moved
            pulse_ms = round(abs(seen) / 0.4 * 1e3)
            rows.append(f'{k + 1},{at_s:.3f},"Mount",0,0,{seen:.5f},0,{seen:.5f},0,{pulse_ms},W,0,,,,1000,30,0')
            moved += np.sign(seen) * 0.4e-3 * pulse_ms
        head = f"Guiding Begins at {begin}\nMount = X, xRate = 0.400, yAngle = 2\nDec = 0.0 deg, Pier side = West"
        sessions.append("\n".join([head, "INFO: SETTLING STATE CHANGE", *rows, "Guiding Ends"]))
    text = "PHD2 version\n\n" + "\n\n".join(sessions) + "\n"
    written(tmp_path, "web/agp/public/data/PHD2_GuideLog_2022-03-18_210258.txt", text)
    recording, simulation, _ = case("telescope/worm").build(tmp_path)
    assert recording.runs == ("21.17", "22.12")
    for run in recording.runs:
        error = recording.values(run, ("error",))[:, 0]
        # an arc second is written as a micrometre; means over three rows
        assert np.ptp(error) == pytest.approx(2.0 * amplitude, rel=0.01)
        assert np.ptp(simulation.values(run, ("error",))) < amplitude
    turned = recording.values("22.12", ("hour_axis",))[:, 0]
    assert np.ptp(turned) == pytest.approx(15.041e-6 * recording.time_s("22.12")[-1])


def test_a_station_two_hours_behind_is_seen_as_such_and_put_right(tmp_path):
    day = "Sensor_Test/Temperatur_and_Humidity/Data"

    def air(minutes: np.ndarray) -> np.ndarray:
        return 10.0 + 5.0 * np.sin(2.0 * np.pi * (minutes - 480.0) / 1440.0)

    start = pd.Timestamp("2020-04-03")
    for number in (3, 4, 5, 6):
        minutes = 1440.0 * (number - 3) + np.arange(1440.0)
        stamps = start + pd.to_timedelta(minutes, unit="min")
        columns = {name: air(minutes) for name in ("1_BME680_Ta", "AM2320_Ta", "2_DHT22_Ta", "1_MCP9808", "2_MCP9808")}
        columns |= {name: air(minutes) - 0.9 for name in ("1_BME280_Ta", "2_BME280_Ta")}
        loggers = pd.DataFrame({"Time": stamps, **columns})
        station = pd.DataFrame({"TIMESTAMP": stamps, "MET_CS215_AirTemperature_degC_Avg": air(minutes + 120.0)})
        written(tmp_path, f"{day}/Ta_RH_Test-2020-04-0{number}.csv", loggers.to_csv(index=False))
        lines = station.to_csv(index=False).splitlines()
        text = "\n".join(['"TOA5","x"', lines[0], '"TS","degC"', '"","Avg"', *lines[1:]]) + "\n"
        written(tmp_path, f"{day}/FRWRTM_MET_1min_2020-04-0{number}.csv", text)
    left = {}
    for name in ("station/clock", "station/zero", "station/siblings"):
        recording, simulation, holdout = case(name).build(tmp_path)
        comparison = comparison_of(recording, simulation, holdout=holdout)
        # the first two hours of the first day lie before the station's
        inner = comparison.run_index > 0
        left[name] = comparison.difference(comparison.responses[0])[inner]
    assert np.std(left["station/clock"]) > 1.0
    assert left["station/zero"] == pytest.approx(-0.9, abs=1e-6)
    assert left["station/siblings"] == pytest.approx(0.0, abs=1e-6)


def bridge(folder: Path) -> Path:
    levels = {"ref_support_load_01": 0.0, "support_load_01": 34.0, "support_load_02": 86.0, "support_load_03": 130.0}
    stamps = ["2022-11-04 08:36:24.897"] * 5000
    for name, level in levels.items():
        strain = pd.DataFrame({"Time (-)": stamps, "DMS_CN (um/m)": level + 0.1 * DRAW.standard_normal(5000)})
        force = pd.DataFrame({"Time (-)": stamps, "FRC-01 [kN]": np.full(5000, 234.0), "FRC-02 [kN]": 230.0})
        for ending, table in (("DMS_CNAt100Hz", strain), ("ForceAt100Hz", force)):
            path = folder / "Settlements" / f"UniBw_2022-04-11_{name}{ending}.csv.zip"
            path.parent.mkdir(exist_ok=True)
            with zipfile.ZipFile(path, "w") as archive:
                archive.writestr(f"Settlements/{name}.csv", table.to_csv(index=False))
    written(folder, "LICENSE", "MIT License\n\nCopyright (c) 2022 imcs-compsim\n")
    return folder


def test_a_row_of_the_oven_with_a_wrong_time_stamp_is_left_out(tmp_path):
    rows = 100
    seconds = 12.0 * np.arange(rows)
    seconds[60] -= 500.0
    warm = 20.0 + 0.01 * seconds
    warm[60] = 300.0
    names = [*map(str, range(1, 16)), "Oven_Mon", "RT1", "RT2"]
    table = pd.DataFrame(dict.fromkeys(names, warm) | {"Time_(s)": seconds})
    written(tmp_path, "ovenData.csv", table.to_csv(index=False))
    recording, simulation, _ = case("loaded_oven/neighbours").build(tmp_path)
    assert recording.time_s("bake").tolist() == (12.0 * np.arange(rows - 1)).tolist()
    assert recording.values("bake", ("T",)).max() == warm[-1]
    np.testing.assert_allclose(simulation.values("bake", ("T",)), recording.values("bake", ("T",)), rtol=1e-9)


def test_strains_and_forces_are_counted_not_stamped(tmp_path):
    recording, simulation, _ = case("bridge/lowered").build(bridge(tmp_path))
    assert recording.time_s("reference")[-1] == pytest.approx(49.0)
    assert recording.values("lowered 3", ("F1",)) == pytest.approx(234e3)
    difference = recording.values("lowered 3", ("strain",)) - simulation.values("lowered 3", ("strain",))
    assert difference.mean() == pytest.approx(130.0, abs=0.1)


def test_a_cut_is_read_like_the_whole_and_says_where_it_comes_from(tmp_path):
    whole, out = tmp_path / "whole", tmp_path / "cut"
    whole.mkdir()
    cut = replace(next(cut for cut in CUTS if cut.rig == "bridge"), one_of=10)
    assert max(cut_files(cut, bridge(whole), out)) < 50_000
    recording, _, _ = case("bridge/lowered").build(out)
    assert len(recording.frame) == 4 * 5
    source = (out / "SOURCE.md").read_text(encoding="utf-8")
    for said in (
        "imcs-compsim/munich-bridge-data",
        "f1057c1",
        "MIT",
        "Copyright (c) 2022 imcs-compsim",
        "one row of 10",
    ):
        assert said in source
    assert {halves()[cut.rig] for cut in CUTS} == {"development"}


def effect(id_: str, confidence: float = 0.9, rivals: tuple[str, ...] = ()) -> dict:
    return {"id": id_, "confidence": confidence, "share": 0.5, "suspected": False, "cannot_be_told_from": list(rivals)}


def told(verdict: str, *effects: dict) -> dict:
    return {"rows": 10, "seconds": 1.0, "answer": {"verdict": verdict, "effects": list(effects), "fit": {}}}


@pytest.mark.parametrize(
    ("name", "answer", "credit"),
    [
        ("pneumatic/KDN", told("missing-physics", effect("drive.coulomb")), "right"),
        (
            "pneumatic/KDN",
            told("missing-physics", effect("drive.coulomb"), effect("drive.stribeck")),
            "right, tolerated",
        ),
        ("pneumatic/KDN", told("missing-physics", effect("drive.backlash", 0.9, ("drive.coulomb",))), "set"),
        ("pneumatic/KDN", told("missing-physics", effect("drive.coulomb"), effect("drive.mass")), "right and wrong"),
        ("pneumatic/KDN", told("missing-physics", effect("drive.mass")), "wrong"),
        ("pneumatic/KDN", told("missing-physics", effect("drive.stribeck")), "tolerated"),
        ("pneumatic/KDN", told("unexplained"), "unexplained"),
        ("pneumatic/KDN", told("nothing-missing"), "silent"),
        ("bridge/lowered", told("unexplained"), "right"),
        ("pneumatic/rerun", told("missing-physics", effect("drive.coulomb")), "wrong"),
    ],
)
def test_an_answer_has_the_credit_of_its_best_and_its_wrong_names(name, answer, credit):
    assert judged(case(name), answer)["credit"] == credit


def test_sums_count_names_once_and_leave_the_tolerated_out():
    rows = [
        judged(case("pneumatic/KDN"), told("missing-physics", effect("drive.coulomb", 0.8), effect("drive.stribeck"))),
        judged(case("heated_bar/air"), told("data-fault", *[effect("data.stuck", 0.6)] * 3)),
        judged(case("station/siblings"), told("nothing-missing")),
        judged(case("station/gain"), {"error": "no answer in 600 s"}),
    ]
    summed = sums(rows)
    assert summed["positives"] == 3
    assert summed["right or set, nothing wrong beside"] == 1
    assert summed["wrong"] == summed["failed"] == 1
    assert summed["names"] == 2
    assert summed["mean confidence of right names"] == pytest.approx(0.8)
    assert summed["largest confidence of a wrong name"] == pytest.approx(0.6)
    # one of a bin at 0.8 that is right, one of a bin at 0.6 that is wrong
    assert summed["calibration error (ECE)"] == pytest.approx(0.4)
    assert "-data.stuck x3 0.60" in text_of(rows, summed)
