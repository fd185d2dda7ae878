"""Swaps among many channels: the same answers, at a cost that grows with the channels and not with their pairs."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

from selector.findings import Finding
from selector.quality import identity, inspect
from selector.quality import siblings as relations_module
from selector.quality.identity import swapped
from selector.quality.siblings import Relations
from selector.quality.survey import Survey
from selector.readers.roles.repairs import proposed
from selector.recording import Channel, Recording
from tests.quality.workshop import plain_recording, plain_tables

IDS = ("same-file-twice", "rows-in-two-runs")


def _wandering(sensors: int, runs: int = 3, samples: int = 200) -> Recording:
    """Sensors that follow nobody: in every run every one of them is off what its siblings say."""
    rng = np.random.default_rng(5)
    names = [f"T{k}" for k in range(sensors)]
    tables = {
        f"r{r}": pd.DataFrame(
            20 + np.cumsum(rng.normal(0, 0.2, (samples, sensors)), axis=0), np.arange(samples) * 20.0, names
        )
        for r in range(runs)
    }
    return Recording.from_runs(tables, [Channel(name, "temperature", "degC") for name in names])


def _systems(sensors: int, monkeypatch: pytest.MonkeyPatch) -> int:
    relations, solved, count = Relations(Survey(_wandering(sensors))), relations_module._solved, 0

    def counted(*arguments: object) -> object:
        nonlocal count
        count += 1
        return solved(*arguments)  # type: ignore[arg-type]

    with monkeypatch.context() as patch:
        patch.setattr(relations_module, "_solved", counted)
        list(swapped(relations))
    return count


def test_the_search_for_swaps_solves_small_systems_in_proportion_to_the_channels(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    # four times the channels, four times the systems; pair by pair it would be sixteen
    assert _systems(80, monkeypatch) < 6 * _systems(20, monkeypatch)


def test_siblings_without_some_are_what_a_recording_without_them_gives() -> None:
    tables = plain_tables(3, 240)
    relations = Relations(Survey(plain_recording(tables)))
    names = [relations.survey.channels[c].name for c in relations.columns]
    for own in range(len(names)):
        for gone in ([k] for k in range(len(names)) if k != own):
            fewer = {run: table.drop(columns=[names[k] for k in gone]) for run, table in tables.items()}
            fresh = Relations(Survey(plain_recording(fewer)))
            left = [fresh.survey.channels[c].name for c in fresh.columns]
            expected = [left[k] for k in fresh.siblings(left.index(names[own]))]
            assert [names[k] for k in relations.siblings(own, without=gone)] == expected


@pytest.mark.parametrize("runs", [4, 25])
def test_a_swap_is_found_in_the_run_it_is_in(runs: int) -> None:
    tables = plain_tables(runs, 120, dt=120.0)
    table = tables["r2"].copy()
    table["T1"], table["T4"] = tables["r2"]["T4"], tables["r2"]["T1"]
    tables["r2"] = table
    found = list(swapped(Relations(Survey(plain_recording(tables)))))
    assert sorted((f.where.channel, f.where.run, f.action) for f in found) == [
        ("T1", "r2", "leave-out-channel"),
        ("T4", "r2", "leave-out-channel"),
    ]


def _twins(runs: int = 5, beside: bool = True) -> dict[str, pd.DataFrame]:
    """Two pairs of thermometers at one place each; `beside`: others to which the heat of both comes."""
    tables = {}
    for r in range(runs):
        rng = np.random.default_rng(40 + r)
        heat = np.repeat(rng.uniform(0, 1, (8, 3)), 60, axis=0)
        fast = [lfilter([0.02], [1, -0.98], 10.0 * heat[:, k]) for k in range(3)]
        slow = [lfilter([0.01], [1, -0.99], course) for course in fast]
        courses = {"A1": fast[0], "A2": 0.9 * fast[0], "B1": fast[1], "B2": 0.9 * fast[1]}
        if beside:
            courses |= {"near A": 0.6 * fast[0] + 0.2 * slow[0], "near B": 0.6 * fast[1] + 0.2 * slow[1], "C": fast[2]}
        noisy = {name: 20 + course + rng.normal(0, 0.03, len(course)) for name, course in courses.items()}
        tables[f"r{r}"] = pd.DataFrame(noisy, index=60.0 * np.arange(480))
    return tables


def _swaps(tables: dict[str, pd.DataFrame]) -> list[Finding]:
    channels = [Channel(name, "temperature", "degC") for name in tables["r0"]]
    return list(swapped(Relations(Survey(Recording.from_runs(tables, channels)))))


@pytest.mark.parametrize("pair", [["A1", "B1"], ["A2", "B2"], ["A1", "B2"]])
def test_of_twins_those_are_named_that_changed_places(pair: list[str]) -> None:
    tables = _twins()
    tables["r3"][pair] = tables["r3"][pair[::-1]].to_numpy()
    found = _swaps(tables)
    assert sorted((one.where.channel, one.where.run, one.evidence["other"]) for one in found) == [
        (pair[0], "r3", pair[1]),
        (pair[1], "r3", pair[0]),
    ]


def test_where_nothing_tells_which_of_the_twins_changed_places_all_are_left_out_and_no_repair_is_proved() -> None:
    tables = _twins(beside=False)
    tables["r3"][["A1", "B1"]] = tables["r3"][["B1", "A1"]].to_numpy()
    found = _swaps(tables)
    assert sorted(one.where.channel for one in found) == ["A1", "A2", "B1", "B2"]
    assert {one.action for one in found} == {"leave-out-channel"}
    assert proposed({}, found) == {}


def _alike(sensors: int) -> Recording:
    """Sensors that all warm up alike for twenty samples, apart by noise; the last one is a copy of the first."""
    rng = np.random.default_rng(6)
    names = [f"T{k}" for k in range(sensors)]
    warming = np.linspace(0.0, 5.0, 20)[:, None] * rng.uniform(0.9, 1.1, sensors) + rng.normal(0, 0.02, (20, sensors))
    warming[:, -1] = warming[:, 0]
    table = pd.DataFrame(20 + np.round(warming, 3), np.arange(20) * 60.0, names)
    return Recording.from_runs({"r1": table}, [Channel(name, "temperature", "degC") for name in names])


def test_among_very_many_alike_the_nearest_are_compared_and_the_rest_is_told(monkeypatch):
    compared = []
    copy = identity._copy
    monkeypatch.setattr(identity, "_copy", lambda *of: compared.append(of[2:]) or copy(*of))
    recording = _alike(60)
    monkeypatch.setattr(identity, "MOST_PAIRS", 10)
    found = list(identity.duplicates(Survey(recording), Relations(Survey(recording))))
    assert len(compared) == 10
    (told,) = [one for one in found if one.id == "copies-not-looked-for"]
    assert told.evidence["compared"] == 10
    assert told.evidence["pairs"] > 1000
    assert [(one.where.channel, one.evidence["other"]) for one in found if one.id == "duplicate-channel"] == [
        ("T59", "T0")
    ]


def test_only_pairs_that_may_be_copies_are_compared(monkeypatch):
    compared = []
    copy = identity._copy
    monkeypatch.setattr(identity, "_copy", lambda *of: compared.append(of[2:]) or copy(*of))
    rng = np.random.default_rng(7)
    # 200 samples apart by noise of twenty times the resolution: alike in their block means, and no copies
    shape = np.cumsum(np.ones(400))[:, None] * 0.05
    values = np.round(20 + shape + rng.normal(0, 0.02, (400, 30)), 3)
    values[:, 29] = np.round(2.0 * values[:, 3] + 1.0, 3)
    names = [f"T{k}" for k in range(30)]
    table = pd.DataFrame(values, np.arange(400) * 60.0, names)
    recording = Recording.from_runs({"r1": table}, [Channel(name, "temperature", "degC") for name in names])
    found = list(identity.duplicates(Survey(recording), Relations(Survey(recording))))
    assert [(one.where.channel, one.evidence["other"]) for one in found] == [("T29", "T3")]
    assert len(compared) < 10  # of 435 pairs


def test_a_run_that_is_part_of_another_one_is_left_out_and_common_rows_are_told() -> None:
    tables = plain_tables()
    first, *others = tables
    rows = len(tables[first])
    given = {**tables, "again": tables[first].iloc[rows // 4 : rows // 2], "copy": tables[others[0]]}
    found = {(one.where.run, one.evidence["original"]): one for one in inspect(plain_recording(given)) if one.id in IDS}
    assert set(found) == {("again", first), ("copy", others[0])}
    assert all(one.action == "leave-out-run" for one in found.values())
    assert found["again", first].evidence["rows"] == rows // 2 - rows // 4
    halves = {**tables, first: tables[first].iloc[: rows // 2], "rest": tables[first].iloc[rows // 4 :]}
    (both,) = (one for one in inspect(plain_recording(halves)) if one.id in IDS)
    assert (both.id, both.where.run, both.action) == ("rows-in-two-runs", first, "none")
    assert both.evidence["rows"] == rows // 2 - rows // 4


def test_runs_that_stand_still_alike_share_no_rows() -> None:
    still = pd.DataFrame({"T1": 20.0, "Z": 0.0}, index=60.0 * np.arange(300))
    moving = still + np.random.default_rng(2).normal(0, 1, still.shape)
    channels = [Channel("T1", "temperature", "degC"), Channel("Z", "displacement", "um")]
    runs = {
        name: pd.concat([still, own.set_axis(18000.0 + own.index)]) for name, own in (("a", moving), ("b", -moving))
    }
    assert not [one for one in inspect(Recording.from_runs(runs, channels)) if one.id in IDS]
