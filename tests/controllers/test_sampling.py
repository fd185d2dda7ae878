"""A recording on another clock than the one that the model was fitted on is told, the worse the more depends on it."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from selector.controllers import Guard, Input, ModelFile, Output, OutputLimits, State, Term
from selector.controllers.application import apply_model, other_sampling, period_of
from selector.controllers.model_file import Provenance
from selector.recording import Recording
from tests.selection.machines import recording


def model(period_s: float | None = 60.0, tau_s: float | None = None, slew: float | None = None) -> ModelFile:
    states = () if tau_s is None else (State(name="T1 late", source="T1", tau_s=tau_s),)
    return ModelFile(
        name="m",
        inputs=(Input(name="T1", reference="absolute", valid_min=0.0, valid_max=50.0),),
        states=states,
        outputs=(Output(name="Z", intercept=0.0, terms=(Term(powers={"T1": 1}, coefficient=1.0),)),),
        guard=Guard(limits=(OutputLimits(output="Z", clamp_um=9.0, slew_um_per_s=slew),)),
        provenance=Provenance(period_s=period_s),
    )


def sampled(period_s: float, *, is_guessed: bool = False) -> Recording:
    runs = {"r1": (period_s * np.arange(50), {"T1": np.linspace(20.0, 30.0, 50), "Z": np.linspace(0.0, 5.0, 50)})}
    guessed = ["column", "unit"] if is_guessed else ["column"]
    return dataclasses.replace(recording(runs), provenance={"runs": {"r1": {"time_guessed": guessed}}})


def test_the_period_of_recordings():
    assert period_of(sampled(60.0)) == 60.0


@pytest.mark.parametrize(
    ("of", "period_s", "is_guessed", "is_guarded", "level"),
    [
        (model(tau_s=600.0), 60.0, True, True, None),
        (model(tau_s=600.0), 30.0, True, True, None),
        (model(period_s=None, tau_s=600.0), 1.0, True, True, None),
        (model(tau_s=600.0), 1.0, True, False, "error"),
        (model(tau_s=600.0), 1.0, False, False, "warning"),
        (model(tau_s=600.0), 10.0, True, False, "warning"),
        (model(), 1.0, True, False, "info"),
        (model(), 3600.0, True, True, "info"),
        (model(slew=1.0), 1.0, True, False, "info"),
        (model(slew=1.0), 3600.0, True, True, "error"),
    ],
)
def test_how_bad_it_is(of, period_s, is_guessed, is_guarded, level):
    found = list(other_sampling(of, sampled(period_s, is_guessed=is_guessed), is_guarded=is_guarded))
    assert [finding.level for finding in found] == ([] if level is None else [level])
    if level == "error":
        assert "guessed" in found[0].statement
        assert found[0].evidence["looks_like_unit"]
    if level == "info":
        assert "clock" in found[0].statement


def test_applying_tells_it():
    found = apply_model(model(tau_s=600.0), sampled(1.0)).findings
    assert [finding.id for finding in found if finding.level == "warning"][:1] == ["other-sampling"]
