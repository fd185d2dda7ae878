"""A file with pauses is, to every command, the runs that it would be as files of their own."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from selector.cli import exit_status

MACHINE = """
[time]
column = "time"
unit = "datetime"
[channels.T1]
role = "temperature"
[channels.T2]
role = "temperature"
[channels.T3]
role = "ambient"
[channels.n]
role = "spindle_speed"
unit = "rpm"
[channels.Z]
role = "displacement"
unit = "um"
axis = "Z"
"""
MORNINGS = {"first": ("2026-03-02 06:30", "2026-03-03 06:00", "2026-03-04 07:00"), "second": ("2026-03-05 06:10",)}


@pytest.fixture(scope="module")
def shop(tmp_path_factory) -> Path:
    """Days of five hours, the gauge set to zero every morning: in two files, and a file a day under the same names."""
    folder, rng = tmp_path_factory.mktemp("shop"), np.random.default_rng(8)
    mornings = MORNINGS | {"second": (*MORNINGS["second"], "2026-03-06 06:40"), "later": ("2026-03-09", "2026-03-10")}
    for name, starts in mornings.items():
        tables = []
        for k, start in enumerate(starts, 1):
            minutes = 2.0 * np.arange(150)
            speed = np.repeat(rng.choice([0.0, 1500.0, 3000.0, 4500.0], 10), 15)
            warm = np.zeros((150, 2))
            for i in range(1, 150):
                warm[i] = warm[i - 1] + np.array([2 / 30, 2 / 120]) * (speed[i] / 400.0 - warm[i - 1])
            hall = rng.uniform(19, 24) + 1e-3 * minutes * rng.normal()
            readings = np.column_stack([warm + hall[:, None], hall]) + rng.normal(0, 0.03, (150, 3))
            table = pd.DataFrame(readings.round(2), columns=["T1", "T2", "T3"])
            table.insert(0, "time", pd.Timestamp(start) + pd.to_timedelta(minutes, unit="min"))
            table["n"] = speed
            table["Z"] = (2.0 * warm[:, 0] - 1.5 * warm[:, 1] + rng.normal(0, 0.1, 150)).round(2)
            table.loc[0, "Z"] = 0.0
            tables.append(table)
            apart = folder / ("later apart" if name == "later" else "apart") / f"{name} {k}.csv"
            apart.parent.mkdir(exist_ok=True)
            table.to_csv(apart, index=False)
        whole = folder / ("later" if name == "later" else "whole") / f"{name}.csv"
        whole.parent.mkdir(exist_ok=True)
        pd.concat(tables).to_csv(whole, index=False)
    (folder / "machine.toml").write_text(MACHINE, encoding="utf-8")
    for name in ("whole", "apart"):
        words = ["select", folder / name, "--machine", folder / "machine.toml", "--out", folder / f"{name}.out"]
        assert exit_status([str(word) for word in (*words, "--memory", "--response", "Z")]) == 0
    return folder


def answer(shop: Path, capsys, *words: object) -> dict:
    capsys.readouterr()
    assert exit_status([str(word) for word in (*words, "--machine", shop / "machine.toml", "--json")]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_selection_is_that_of_files_of_their_own(shop):
    whole, apart = (json.loads((shop / f"{name}.out/selection.json").read_text("utf-8")) for name in ("whole", "apart"))
    assert whole["models"] == apart["models"]
    assert list(whole["models"]["Z"]["per_run"]) == ["first 1", "first 2", "first 3", "second 1", "second 2"]
    assert [one["where"]["run"] for one in whole["findings"] if one["id"] == "gap"] == ["first", "second"]
    assert not [one for one in whole["findings"] if one["id"] in ("one-run-only", "clock-jump")]


@pytest.mark.parametrize("name", ["later", "later apart"])
def test_apply_and_replay_measure_what_the_selection_told(shop, capsys, name):
    model = shop / "whole.out/model.json"
    told = json.loads((shop / "whole.out/selection.json").read_text("utf-8"))["models"]["Z"]["heldout_rmse_um"]
    left = answer(shop, capsys, "apply", model, shop / name, "--out", shop / f"{name}.csv")
    assert list(left["per_run"]) == ["later 1", "later 2"]
    assert left["overall"]["Z"]["rmse_um"] < 1.5 * told < 0.1 * left["overall"]["Z"]["before_rmse_um"]
    program = answer(shop, capsys, "export", model, "--for", "python", "--replay", shop / name, "--out", shop / "py")
    assert {one["run"]: one["apply_rmse_um"] for one in program["replay"]["runs"]} == {
        run: of["Z"]["rmse_um"] for run, of in left["per_run"].items()
    }


def test_the_same_is_predicted_from_both(shop, capsys):
    predicted = [shop / "later.csv", shop / "later apart.csv"]
    for file, name in zip(predicted, ["later", "later apart"], strict=True):
        answer(shop, capsys, "apply", shop / "whole.out/model.json", shop / name, "--out", file)
    assert predicted[0].read_bytes() == predicted[1].read_bytes()
    (shop / "cycle.csv").write_text("time_s,spindle_speed\n0,3000\n7200,0\n10800,0\n", encoding="utf-8")
    two_days = [[shop / "whole/second.csv"], [shop / f"apart/second {k}.csv" for k in (1, 2)]]
    days = [answer(shop, capsys, "predict", *files, "--cycle", shop / "cycle.csv") for files in two_days]
    assert days[0]["displacement_um"] == days[1]["displacement_um"]


def test_a_sensor_that_fails_in_a_part_is_told_once(shop, capsys):
    told = {}
    for name in ("later", "later apart"):
        broken = shop / f"{name} broken"
        broken.mkdir()
        for file in (shop / name).iterdir():
            table = pd.read_csv(file)
            table.loc[table["time"].str.startswith("2026-03-10"), "T1"] = 850.0
            table.to_csv(broken / file.name, index=False)
        found = answer(shop, capsys, "apply", shop / "whole.out/model.json", broken)["findings"]
        told[name] = [one["id"] for one in found if one["where"].get("channel") == "T1" and "unit" not in one["id"]]
    assert told["later"] == told["later apart"] == ["sensor-looks-broken"]


def test_touch_offs_count_on_the_clock_of_the_file(shop, capsys):
    of_day = {"later 1": 3600.0, "later 2": 7200.0}
    rows = [f"{run},{time_s},5.0" for run, time_s in of_day.items()]
    (shop / "apart.txt").write_text("\n".join(["run,time_s,Z", *rows]), encoding="utf-8")
    (shop / "whole.txt").write_text("run,time_s,Z\nlater,3600,5.0\nlater,93600,5.0\n", encoding="utf-8")
    model = shop / "whole.out/model.json"
    told = [
        answer(shop, capsys, "adapt", model, shop / name, "--touch-offs", shop / f"{rows}.txt")
        for name, rows in (("later", "whole"), ("later apart", "apart"))
    ]
    assert told[0]["per_run"] == told[1]["per_run"]
    assert [of["Z"]["touch_offs"] for of in told[0]["per_run"].values()] == [1, 1]


def test_a_condition_of_a_file_is_that_of_its_parts(shop, capsys):
    words = ["select", shop / "whole", "--response", "Z", "--condition"]
    found = answer(shop, capsys, *words, "first=winter", "--condition", "second=summer")
    proved = {run for run, of in found["models"]["Z"]["per_run"].items() if of.get("heldout_rmse_um")}
    assert proved == {"winter", "summer"}
