"""The Sensors page without a browser: what a move answers, what it looks at, where pins are written."""

from __future__ import annotations

import csv
import dataclasses
import io
import threading
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from selector.errors import OptionError
from selector.figures import proof, style
from selector.readers import machine as machine_file
from selector.recording import Channel
from selector.selection import Exploration, Options
from selector.selection.exploration import HeldOutPart
from selector.workbench import live
from selector.workbench.access import Access
from selector.workbench.bench import Bench
from selector.workbench.page import page
from selector.workbench.pages import sensors
from selector.workbench.pages.sensors import machine, pictures, wishes
from tests.patience import wait_for
from tests.workbench import studies


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    return studies.written(tmp_path_factory.mktemp("recordings"))


@pytest.fixture
def bench(recordings, tmp_path):
    folder = tmp_path / "study"
    folder.mkdir()
    found = Bench(folder.resolve(), recordings, recordings[0].with_name("machine.toml"))
    found.read()
    wait_for(lambda: found.inspection.reading is not None)
    return found


@pytest.fixture
def client(bench):
    access = Access(8050)
    found = page(bench, access).server.test_client()
    found.set_cookie(access.cookie, access.token, domain="127.0.0.1")
    return found


def ready(bench) -> Exploration:
    found = []

    def is_there() -> bool:
        found[:] = [bench.live.exploration(bench.inspection, bench.options)]
        return found[0] is not None

    wait_for(is_there)
    return found[0]


def move(client, **asked):
    answer = client.post("/sensors/move", json=asked, base_url="http://127.0.0.1:8050")
    assert answer.status_code == 200
    return answer.get_json()


def test_the_bar_does_not_say_ready_while_samples_are_added_up(client, bench, monkeypatch):
    explored, is_let_go = live._explored, threading.Event()
    monkeypatch.setattr(live, "_explored", lambda *of: is_let_go.wait(60) and explored(*of))

    def said() -> str:
        return client.get("/beat", base_url="http://127.0.0.1:8050").json["status"]["said"]

    wait_for(lambda: said() == "Ready.")
    assert bench.live.exploration(bench.inspection, bench.options) is None
    assert said().startswith("Adding up")
    is_let_go.set()
    wait_for(lambda: said() == "Ready.")
    assert ready(bench).steps


def test_a_move_changes_everything_together(client, bench):
    explored = ready(bench)
    for step, _ in enumerate(explored.steps):
        told = move(client, step=step)
        cut = explored.cut(told["level"])
        assert told["step"] == step
        assert [group["sensors"] for group in told["groups"]] == [list(group.sensors) for group in cut.groups]
        assert [group["because"] for group in told["groups"]] == [group.because for group in cut.groups]
        facts = dict(told["facts"])
        assert facts["sensors shown"] == ", ".join(cut.taken)
        assert f"--lambda {told['level']!r} --out selection" in told["command"]
        changes = {name: {tuple(path): value for path, value in what} for name, what in told["changes"].items()}
        model = explored.fixed(cut.taken).models["Z"]
        assert changes["runs"]["data", 1, "x"] == [part.rmse_um for part in model.parts]
        assert changes["sets"]["data", 3, "y"] == [model.heldout_rmse_um]
        rings = changes["machine"]["data", 1, "x"]
        assert [name for name, x in zip(studies.SENSORS, rings, strict=True) if x is not None] == list(cut.taken)


def test_a_set_is_taken_and_let_go(client, bench):
    ready(bench)
    before = move(client, step=3)
    told = move(client, take=["T4", "T1"])
    assert told["is_taken"]
    assert dict(told["facts"])["sensors shown"] == "T1, T4"
    assert told["command"].endswith("--max-sensors 2 --must T1 --must T4 --out selection")
    said = {name: client.get(f"/command/{name}", base_url="http://127.0.0.1:8050").json for name in ("sensors", "none")}
    assert " ".join(said["sensors"]) == told["command"]
    assert said["none"][1] == "describe"  # the first page is shown where the address names none
    assert sensors.command(bench)[-8:] == ("--max-sensors", "2", "--must", "T1", "--must", "T4", "--out", "selection")
    back = move(client, take=[])
    assert back["facts"] == before["facts"]
    assert move(client, response="Y")["response"] == "Y"


def test_what_is_told_counts_as_of_the_look_that_it_shows(client, bench, monkeypatch):
    ready(bench)
    before, command = move(client, step=1)["looks"], sensors.command

    def looked_elsewhere_meanwhile(of):
        of.live.look_at(response="Y")
        return command(of)

    monkeypatch.setattr(sensors, "command", looked_elsewhere_meanwhile)
    # else the page would take old pictures for new ones, and not ask again
    assert move(client, step=2)["looks"] == before + 1


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"level": 1.5}, "λ: “1.5” was typed. Expected: a number from 0 to 1"),
        ({"take": ["T99"]}, "T99"),
        ({"level": "high"}, "λ: “high”"),
        ({"step": None}, "move"),
    ],
)
def test_what_cannot_be_looked_at_is_refused_and_nothing_moves(client, bench, asked, said):
    ready(bench)
    before = move(client, step=2)
    assert said in move(client, **asked)["refused"]
    assert move(client)["facts"] == before["facts"]


def test_a_stranger_moves_nothing(bench):
    client = page(bench, Access(8050)).server.test_client()
    assert client.post("/sensors/move", json={"step": 0}, base_url="http://127.0.0.1:8050").status_code == 403


def test_wishes_are_followed(client, bench):
    ready(bench)
    bench.choose(never=("T1",), must=("T5",), max_sensors=3)
    told = move(client, step=4)
    chosen = dict(told["facts"])["sensors shown"].split(", ")
    assert "T5" in chosen
    assert "T1" not in {name for group in told["groups"] for name in group["sensors"]}
    assert "--max-sensors 3 --must T5 --never T1" in told["command"]
    # a set that is taken by hand may hold a sensor of --never, which the command then does not name
    assert "--never" not in move(client, take=["T1"])["command"]


def test_recordings_that_cannot_be_explored_say_why(tmp_path):
    (tmp_path / "warm.csv").write_text("time_s,T1\n" + "".join(f"{k},{20 + k}\n" for k in range(60)), encoding="utf-8")
    bench = Bench(tmp_path, [tmp_path / "warm.csv"])
    bench.read()
    wait_for(lambda: bench.inspection.reading is not None)
    with pytest.raises(OptionError, match="displacement"):
        ready(bench)
    assert sensors.command(bench) is None


def test_pins_go_into_the_machine_file_and_nothing_is_read_again(client, bench):
    explored = ready(bench)
    number = bench.inspection.number
    bench.place({"T1": (0.5, -0.25, 1.0), "T7": (0.0, 0.0, 2.0)})
    written = machine_file(bench.folder / "machine.toml")
    assert written.channels["T1"].xyz == (0.5, -0.25, 1.0)
    assert written.channels["T7"].xyz == (0.0, 0.0, 2.0)
    assert written.channels["T2"].xyz == pytest.approx(studies.PLACES_M["T2"])
    assert bench.inspection.number == number
    assert ready(bench) is explored
    places = dict(zip((pins := machine.pins(bench)).names, pins.points_m.tolist(), strict=True))
    assert places["T1"] == [0.5, -0.25, 1.0]
    again = Bench(bench.folder, [one.path for one in bench.loaded])
    again.read()
    wait_for(lambda: again.inspection.reading is not None)
    assert again.inspection.reading.recording.channel("T7").xyz_m == (0.0, 0.0, 2.0)


@pytest.mark.parametrize("n", [1, 7, 37])
def test_pins_without_a_place_do_not_cover_each_other(bench, monkeypatch, n):
    sensors = [Channel(f"T{k}", "temperature", "degC") for k in range(n)]
    monkeypatch.setattr(machine, "sensors_of", lambda _: sensors)
    points = machine.pins(bench).points_m
    body = np.vstack(machine.pins(bench).outline_m)
    size = float(np.ptp(body, axis=0).max())
    assert (points[:, 2] < body[:, 2].min()).all()
    for view in ((0, 2), (1, 2)):
        # a pin is 9 px, a ring 17 px in a picture of about 400 px, of which the machine takes at least a third
        apart = np.linalg.norm(points[:, None, view] - points[None, :, view], axis=2)
        assert (apart[~np.eye(n, dtype=bool)] > 0.05 * size).all()


def test_long_names_have_room_beside_the_pictures(bench):
    explored = ready(bench)
    view = bench.live.view(explored)
    short = pictures.frames(view, machine.pins(bench), {})
    question = dataclasses.replace(
        explored.question, sensors=tuple(f"{name} Spindellager vorne links" for name in explored.question.sensors)
    )
    long = pictures._name_margins(dataclasses.replace(view, exploration=SimpleNamespace(question=question)))
    assert long["tree"]["r"] >= 6.5 * min(len(question.sensors[0]), 28)
    assert long["tree"]["r"] > short["tree"].layout.margin.r


def test_titles_are_text_and_long_names_of_runs_have_room(bench, monkeypatch):
    view = bench.live.view(ready(bench))
    monkeypatch.setattr(pictures, "_runs", lambda _: [HeldOutPart("Warmlauf auf 3 Wechsel", 10, 0.5, 1.0)])
    monkeypatch.setattr(proof, "run_errors_title", lambda *_: style.label("Run </script>"))
    assert pictures.titles(view)["runs"].startswith("Run </script>")
    assert pictures.frames(view, machine.pins(bench), {})["runs"].layout.margin.l > 140


def test_a_run_that_no_picture_is_of_is_named(tmp_path):
    """Sensors are compared where all of them are there."""
    files = studies.written(tmp_path)
    table = pd.read_csv(files[2])
    table["T3"] = float("nan")
    table.to_csv(files[2], index=False)
    bench = Bench(tmp_path, files, tmp_path / "machine.toml")
    bench.read()
    wait_for(lambda: bench.inspection.reading is not None)
    titles = pictures.titles(bench.live.view(ready(bench), bench.options))
    assert titles["runs"].endswith(f"on all 3 runs; not {files[2].stem}, where a sensor is missing")
    table["T3"] = pd.read_csv(files[1])["T3"]
    table.to_csv(files[2], index=False)
    bench.read()
    number = bench.inspection.number
    wait_for(lambda: bench.inspection.number > number)
    assert pictures.titles(bench.live.view(ready(bench), bench.options))["runs"].endswith("on all 4 runs")


def test_a_place_of_nothing_is_refused(bench):
    with pytest.raises(OptionError, match="T99"):
        bench.place({"T99": (0.0, 0.0, 0.0)})
    assert not (bench.folder / "machine.toml").exists()


def test_only_pictures_stand_behind_the_pins(bench):
    folder = bench.folder / "pictures"
    folder.mkdir()
    (folder / "front.png").write_bytes(b"\x89PNG\r\n\x1a\n" + b"0" * 20)
    (folder / "side.png").write_bytes(b"<svg onload=alert(1)>")
    assert list(machine.photos(bench)) == ["front view"]
    assert machine.photos(bench)["front view"].startswith("data:image/png;base64,")


def test_an_exploration_of_other_options_is_another_one(bench):
    explored = ready(bench)
    bench.choose(reference="absolute")
    other = ready(bench)
    assert other is not explored
    assert other.question.options.reference == "absolute"
    assert ready(bench) is other
    bench.choose(reference="rise", cost={"T1": 2.0})
    assert ready(bench).question.options.cost == {"T1": 2.0}
    assert Options().cost == {}


def test_tables_are_downloaded_as_csv_that_no_spreadsheet_runs(bench, client):
    reading = bench.inspection.reading
    channels = list(reading.recording.channels)
    hostile = dataclasses.replace(channels[0], place="=HYPERLINK(1)")
    recording = dataclasses.replace(reading.recording, channels=(hostile, *channels[1:]))
    bench.inspection = dataclasses.replace(bench.inspection, reading=dataclasses.replace(reading, recording=recording))
    bench.choose(must=(hostile.name,), cost={hostile.name: 2.5})
    answer = client.get("/tables/sensors.csv", base_url="http://127.0.0.1:8050")
    assert answer.headers["Content-Disposition"] == "attachment; filename=sensors.csv"
    rows = list(csv.DictReader(io.StringIO(answer.data.decode("utf-8-sig"))))
    assert [row["sensor"] for row in rows] == list(studies.SENSORS)
    assert rows[0]["place"] == "'=HYPERLINK(1)"
    assert (rows[0]["use"], rows[0]["cost"]) == (wishes.USES[1], "2.5")
    ready(bench)
    groups = client.get("/tables/groups.csv", base_url="http://127.0.0.1:8050").data.decode("utf-8-sig")
    rows = list(csv.DictReader(io.StringIO(groups)))
    assert {row["sensor"] for row in rows} == set(studies.SENSORS)
    assert any(row["represents"] == "True" for row in rows)
