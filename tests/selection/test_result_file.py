"""A selection comes back from its JSON: the same document, and the same report to the byte."""

from __future__ import annotations

import dataclasses
import json

import pytest
from pydantic import ValidationError

from selector.errors import InputError
from selector.readers import read
from selector.selection import Options, Selection, select
from selector.selection.result_file import selection_of
from selector.shipped import shipped
from tests.report.test_selection_report import selection_html

NOT_HELD = ("fallbacks",)


def held(document: dict) -> dict:
    return {name: value for name, value in document.items() if name not in NOT_HELD}


@pytest.fixture(scope="module", params=["patent8", "vmc37", "fuzzy"])
def selection(request) -> Selection:
    recording = read([shipped({"fuzzy": "vmc37"}.get(request.param, request.param))]).recording
    options = {
        "patent8": Options(level=(0.999, 0.99), rounds=2, degree=2, interactions=True, cost={"T3": 2.0}),
        "vmc37": Options(responses=("Z",), memory=True, max_sensors=3),
        "fuzzy": Options(responses=("Z",), grouping="cmeans", max_sensors=2),
    }
    return select(recording, options[request.param], provenance={"machine": "M", "runs": {"r1": {"file": "r1.csv"}}})


def test_document_and_report_come_back(selection):
    document = json.loads(json.dumps(selection.as_dict()))
    again = selection_of(document)
    assert held(json.loads(json.dumps(again.as_dict()))) == held(document)
    assert selection_html(again) == selection_html(selection)


def test_what_is_not_a_number_comes_back_as_that(selection):
    worse = dataclasses.replace(selection, stability={name: float("nan") for name in selection.sensors})
    again = selection_of(json.loads(json.dumps(worse.as_dict())))
    assert all(share != share for share in again.stability.values())


def test_a_result_of_an_earlier_version_is_read(selection):
    document = json.loads(json.dumps(selection.as_dict()))
    document.pop("hull")
    document["readings"] = [{"run": "r1", "time_s": [0.0]}]
    assert selection_html(selection_of(document)) == selection_html(selection)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda d: d.pop("sensors"),
        lambda d: d["chosen"].update(sensors=[]),
        lambda d: d["models"].clear(),
        lambda d: d["similarity"][0].__setitem__(0, "1"),
        lambda d: d["proof"]["curve"][0].update(n_sensors=-1),
        lambda d: next(iter(d["models"].values()))["scaled"].update(terms=[{"T1": 99}]),
        lambda d: d["hull"]["scale"].__setitem__(0, 0.0),
    ],
)
def test_a_field_of_the_wrong_kind_is_refused(selection, spoil):
    document = json.loads(json.dumps(selection.as_dict()))
    spoil(document)
    with pytest.raises(ValidationError):
        selection_of(document)


@pytest.mark.parametrize(
    "spoil",
    [
        lambda d: d["similarity"].pop(),
        lambda d: d["proof"]["traces"][0]["time_s"].pop(),
        lambda d: d["rounds"][0]["groups"].append(["nobody"]),
        lambda d: d.update(screenings=[]),
        lambda d: d["valid_range"].clear(),
        lambda d: d["proof"]["baselines_um"].clear(),
        lambda d: d["hull"]["scale"].append(1.0),
    ],
)
def test_fields_that_contradict_each_other_are_refused(selection, spoil):
    document = json.loads(json.dumps(selection.as_dict()))
    spoil(document)
    with pytest.raises((InputError, ValueError, KeyError, IndexError)):
        selection_html(selection_of(document))


@pytest.mark.parametrize("selection", ["fuzzy"], indirect=True)
@pytest.mark.parametrize("factor", [-1.0, 2.0])
def test_memberships_that_are_no_shares_are_refused(selection, factor):
    document = json.loads(json.dumps(selection.as_dict()))
    rows = document["fuzzy"]["memberships"]
    rows[0] = [factor * share for share in rows[0]]
    with pytest.raises(ValueError, match="add up to 1"):
        selection_of(document)
