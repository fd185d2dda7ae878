"""Runs that follow one another by their clocks: memory goes on, in the fit and where a model is applied."""

from __future__ import annotations

import dataclasses
import itertools
from datetime import datetime, timedelta

import numpy as np
import pytest
from scipy import stats

from selector.controllers.application import apply_model
from selector.controllers.from_selection import model_file_of
from selector.models.design import Design, Lag, datum_of
from selector.models.run_before import runs_before
from selector.recording import Recording
from selector.selection import Options, select
from tests.models.runs import recording
from tests.selection.machines import PERIOD_S, found_ids, linear, machine

CUTS = (0, 200, 420, 640, 900, 1100, 1300)


@pytest.fixture(scope="module")
def cut() -> tuple[Recording, Recording]:
    """A long run of a machine with a hidden body, whole, and cut into six runs with their clocks."""
    whole = machine(lambda truth: linear(truth) - 12.0 * truth["hidden"], n_runs=1, n=CUTS[-1], tau_hidden_s=9000.0)
    values, names = whole.values("day1", whole.names), whole.names
    runs, starts = {}, {}
    for k, (start, stop) in enumerate(itertools.pairwise(CUTS)):
        part = dict(zip(names, values[start:stop].T.copy(), strict=True))
        part["Z"] -= part["Z"][:3].mean()
        runs[f"r{k}"] = (np.arange(stop - start) * PERIOD_S, part)
        starts[f"r{k}"] = {"start": (datetime(2026, 3, 2, 8) + timedelta(seconds=start * PERIOD_S)).isoformat()}
    return whole, dataclasses.replace(recording(runs), provenance={"runs": starts})


def test_the_state_is_that_of_the_whole_record(cut):
    whole, parts = cut
    lags = (Lag("T1", 3000.0), Lag("T4", 9000.0))
    datum = dataclasses.replace(datum_of(parts, ("T1", "T4"), ("Z",), "rise"), follows=runs_before(parts, parts.runs))
    (all_of_it,) = Design(("T1", "T4"), ("Z",), datum_of(whole, ("T1", "T4"), ("Z",), "rise"), lags).pieces(
        whole, "day1"
    )
    for k in (1, 4, 5):
        (piece,) = Design(("T1", "T4"), ("Z",), datum, lags).pieces(parts, f"r{k}")
        expected = all_of_it.variables[CUTS[k] : CUTS[k + 1]]
        # both from their start; e⁻⁵ of what lies further back than five time constants is left out
        assert np.ptp(piece.variables - expected, axis=0) == pytest.approx(0.0, abs=0.05)


def test_clocks_that_overlap_or_are_not_known_tell_nothing(cut):
    _, parts = cut
    known = dict(parts.provenance["runs"])
    assert runs_before(parts, parts.runs)["r1"] == ("r0", 200 * PERIOD_S)
    assert runs_before(dataclasses.replace(parts, provenance={}), parts.runs) == {}
    known["r1"] = {"start": known["r0"]["start"]}
    assert "r1" not in runs_before(dataclasses.replace(parts, provenance={"runs": known}), parts.runs)


def test_a_machine_that_never_cools_is_predicted_better_than_from_its_temperatures_alone(cut):
    _, parts = cut
    errors = {}
    for clocks in (True, False):
        source = parts if clocks else dataclasses.replace(parts, provenance={})
        found = select(source, Options(memory=True, max_sensors=2))
        assert ("memory-goes-on" in found_ids(found)) == clocks
        errors[clocks] = found.proof.rmse_um("Z")
        (told,) = [finding for finding in found.findings if finding.id == "few-runs"]
        few = told.evidence
        assert ",," not in told.statement
        # five of six begin where another ended, and count half
        assert few["in_a_row"] == (5 if clocks else 0)
        logs = np.log([part.rmse_um for part in found.proof.per_response["Z"]])
        deviation = np.sqrt((3 * 0.35**2 + 5 * logs.var(ddof=1)) / 8 / (6 - 2.5 * clocks))
        assert few["factor"] == pytest.approx(np.exp(stats.t.ppf(0.975, 8) * 2.2 * deviation))
        if clocks:
            applied = apply_model(model_file_of(found, source.channels), source).overall["Z"]
            # in sample and with one reading for a start, the applied model is about as good as the proof said
            assert applied.rmse_um < 1.5 * errors[True]
    assert errors[True] < 0.7 * errors[False]
