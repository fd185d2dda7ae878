"""What another program sends in place of the page is refused, and nothing of it is kept."""

from __future__ import annotations

import json

import pytest

from selector.readers import Overrides
from selector.selection import Options
from selector.study import DiagnoseSection
from selector.workbench.access import Access
from selector.workbench.bench import Bench
from selector.workbench.commands import Export
from selector.workbench.page import PAGES, page
from tests.patience import wait_for
from tests.workbench import studies

OWN = "http://127.0.0.1:8050"
WRONG = [None, True, 7, -1.5, "x", [7], [[None]], {"a": [1]}, {"number": 0, "at": ["x"]}, 1e999]
CELLS = {"use": "may be used", "cost": "1", "place": "", "role": "temperature", "unit": "degC", "axis": ""}
"""What stands in the cells of a table."""


@pytest.fixture
def bench(tmp_path):
    (tmp_path / "recordings").mkdir()
    (tmp_path / "study").mkdir()
    files = studies.written(tmp_path / "recordings")
    found = Bench((tmp_path / "study").resolve(), files, files[0].with_name("machine.toml"))
    found.read()
    wait_for(lambda: not found.is_reading)
    return found


@pytest.fixture
def app(bench, monkeypatch):
    monkeypatch.setattr(bench, "start", lambda *_: None)
    monkeypatch.setattr(bench.live, "exploration", lambda *_: None)
    return page(bench, Access(8050, "t"))


@pytest.fixture
def client(app):
    found = app.server.test_client()
    found.set_cookie("selector_8050", "t", domain="127.0.0.1")
    return found


def send(client, request: dict):
    text = json.dumps(request)
    return client.post("/_dash-update-component", base_url=OWN, data=text, content_type="application/json")


def asked(app, client, bench) -> list[dict]:
    """Every callback that the server runs: as the page asks it, in turn with one value that is wrong."""
    layouts = [app.layout(), *(one.layout(bench) for one in PAGES[1:])]
    components = [one for layout in layouts for one in layout._traverse()]
    fields = {one.id: one for one in components if isinstance(getattr(one, "id", None), str)}
    return [
        request
        for one in client.get("/_dash-dependencies", base_url=OWN).get_json()
        if not one["clientside_function"]
        for position in range(len(one["inputs"]) + len(one["state"]))
        for wrong in WRONG
        for request in [_request(one, position, wrong, fields)]
    ]


def _request(of: dict, position: int, wrong: object, fields: dict) -> dict:
    sent = []
    for number, place in enumerate([*of["inputs"], *of["state"]]):
        name, kind = place["id"], place["property"]
        if name.startswith("{"):
            parts = json.loads(name)
            row = "T1" if parts["type"].startswith("sensors") else "Z"
            own = {key: row if value == ["ALL"] else value for key, value in parts.items()}
            right = own if kind == "id" else 1 if kind == "n_clicks" else CELLS.get(parts["type"].partition("-")[2])
            value = wrong if number == position else right
            sent.append([{"id": own, "property": kind, "value": value}])
        else:
            right = 1 if kind == "n_clicks" else getattr(fields.get(name), kind, None)
            sent.append({"id": name, "property": kind, "value": wrong if number == position else right})
    first = sent[0][0] if isinstance(sent[0], list) else sent[0]
    name = first["id"] if isinstance(first["id"], str) else json.dumps(first["id"], sort_keys=True)
    given = of["output"]
    outputs = [dict(zip(("id", "property"), one.rsplit(".", 1), strict=True)) for one in given.strip(".").split("...")
               ] if "." in given else []  # fmt: skip
    return {
        "output": given,
        "outputs": outputs if given.startswith("..") else outputs[0] if outputs else [],
        "inputs": sent[: len(of["inputs"])],
        "state": sent[len(of["inputs"]) :],
        "changedPropIds": [f"{name.replace(' ', '')}.{first['property']}"],
    }


def kept(bench) -> list[object]:
    return [bench.options, bench.overrides, bench.diagnosis, bench.export, bench.used]


def of_right_kinds(bench) -> bool:
    """Whether all that is kept consists of texts, numbers and names that there are."""
    reading = bench.inspection.reading
    # asked as a text or a number that fits no file, the recordings cannot be read until they are asked otherwise
    names = [] if reading is None else reading.recording.names
    options, overrides = bench.options, bench.overrides
    texts = [
        *options.responses, *options.must, *options.never, *options.cost, bench.diagnosis.holdout,
        *bench.diagnosis.responses, bench.export.model, bench.export.target,
        *(getattr(overrides, name) or "" for name in ("encoding", "separator", "decimal", "sheet", "time_column")),
        *(getattr(overrides, name) or "" for name in ("time_unit", "date_order")),
    ]  # fmt: skip
    return all(type(text) is str for text in texts) and {*options.must, *options.never, *options.cost} <= {*names}


def test_values_of_wrong_kinds_are_neither_kept_nor_a_failure(app, client, bench):
    requests = asked(app, client, bench)
    assert len(requests) > 400
    for request in requests:
        answer = send(client, request)
        assert answer.status_code in (200, 204), (request, answer.text)
        wait_for(lambda: not bench.is_reading)
        assert of_right_kinds(bench), (request, kept(bench))
        assert not (bench.folder / "machine.toml").exists(), request
        bench.options, bench.overrides = Options(), Overrides()
        bench._diagnosis, bench.export = DiagnoseSection(), Export()
        if bench.inspection.reading is None:
            bench.read()
            wait_for(lambda: not bench.is_reading)


@pytest.mark.parametrize(
    ("page", "box", "text"),
    [
        ("selection", "selection-max_sensors", "drei"),
        ("selection", "selection-level", "98"),
        ("diagnosis", "diagnosis-false_alarm", "often"),
        ("export", "export-clamp", "twelve"),
        ("sensors", "sensors-cost", "-1"),
    ],
)
def test_what_was_refused_is_not_started_with_what_counted_before(app, client, bench, monkeypatch, page, box, text):
    """Whatever the server hears first, the end of typing or the click: the click brings what was typed along."""
    started = []
    monkeypatch.setattr(bench, "start", lambda *of: started.append(of))
    before = kept(bench)
    start = next(one for one in asked(app, client, bench) if one["changedPropIds"] == [f"{page}-start.n_clicks"])
    right = {"export-invert": [], "export-target": "c", "sensors-use": "may be used"}
    start["inputs"][0]["value"] = 1
    for said in start["state"]:
        one = said[0] if isinstance(said, list) else said
        name = one["id"] if isinstance(one["id"], str) else one["id"]["type"]
        value = one["value"] if one["property"] == "id" else right.get(name, one["value"])
        one["value"] = text if name == box and one["property"] == "value" else value
    answer = send(client, start).text
    # an export without a model is refused for that first
    refused = "No model in the study folder" if page == "export" else json.dumps(f"“{text}” was typed")[1:-1]
    assert refused in answer
    assert started == []
    assert kept(bench) == before


def test_a_value_of_a_wrong_kind_says_what_is_wrong(app, client, bench):
    body = next(one for one in asked(app, client, bench) if "selection-responses" in str(one["inputs"]))
    body["inputs"][0]["value"] = "Z"
    answer = send(client, body).text
    assert "a valid list" in answer
    assert "again" in answer
    assert "defect" not in answer


def test_a_page_that_is_behind_takes_no_chosen_machine_away(app, client, bench):
    bench.choose_simulation(kind="thermal", model="c-frame.toml")
    choice = next(one for one in asked(app, client, bench) if one["changedPropIds"] == ["simulation-kind.value"])
    for of, value in zip(choice["inputs"], ("thermal", None), strict=True):
        of["value"] = value
    assert send(client, choice).status_code in (200, 204)
    assert bench.simulation.model == "c-frame.toml"
