"""What every scenario has to keep, whatever its family: used by the tests of the families."""

from __future__ import annotations

import numpy as np
import pytest

from proving_ground.world import HIDDEN_FACTOR
from selector.diagnosis.effects.catalogue import catalogue

IDS = {effect.id for effect in catalogue()}
VERDICTS = {"missing-physics", "nothing-missing", "data-fault", "miscalibrated", "unexplained"}


def build(scenario, seed, wanted=6.0):
    return scenario.build(seed, wanted if scenario.has_strength else None)


def assert_whole(scenario, case):
    """A case with recordings and a simulation that a tool can read, and a truth that can be scored."""
    assert (case.name, case.family, case.kind) == (scenario.name, scenario.family, scenario.kind)
    for recording in (case.recording, case.simulation):
        assert np.isfinite(recording.frame.to_numpy()).all()
    assert case.recording.runs == case.simulation.runs
    assert set(case.responses) <= set(case.recording.names)
    assert tuple(name for name in case.simulation.names) == tuple(
        name for name in case.recording.names if name in case.responses
    )
    assert set(case.truth.verdicts) <= VERDICTS
    assert set(case.truth.tolerated) <= IDS
    assert set(case.truth.held_out) == set(case.responses)


def assert_labelled(scenario, case):
    """Effects are there exactly where something was put in, and name what the catalogue knows."""
    truth = case.truth
    if scenario.kind in ("clean", "miscalibrated"):
        assert truth.effects == ()
        return
    assert truth.effects
    spans = {run: case.recording.time_s(run) for run in case.recording.runs}
    for effect in truth.effects:
        assert set(effect.accept) <= (IDS | {effect.id} if effect.id.startswith("hidden.") else IDS)
        assert effect.id in effect.accept
        assert set(effect.channels) <= set(case.recording.names)
        for window in effect.windows:
            assert window.from_s < window.to_s
            assert window.from_s < spans[window.run][-1]
    if scenario.kind == "undecidable":
        assert len(truth.effects[0].accept) > 1 or len(truth.verdicts) > 1
    assert ("unexplained" in truth.verdicts) == (scenario.kind == "out-of-catalogue")


def assert_hidden(case):
    """Every number that is said to hide the effect does."""
    assert [hidden for hidden in case.truth.concealed if not hidden.holds] == []


def assert_strong(scenario, case, wanted=6.0):
    """The strength is what was asked for."""
    if not scenario.has_strength:
        return
    factor = {"out-of-catalogue": HIDDEN_FACTOR}.get(scenario.kind, 1.0)
    # what limits it: effects that set in all at once or freeze whole samples
    assert case.truth.d_prime == pytest.approx(wanted * factor, rel=0.05)


def assert_oracle_near_noise(case):
    """Whoever knows the effect leaves the noise, and little more."""
    # offset, gain and delay are fitted on other runs: up to a tenth of the noise where they have to be extrapolated;
    # noise that repeats with the cycle looks like them, since they repeat with it too
    most = 1.5 if case.name.endswith(("cycle-locked", "half-lead")) else 1.1
    for name, errors in case.truth.held_out.items():
        assert errors.oracle <= most * errors.noise_floor, name


def assert_same(one, other):
    assert one.recording.frame.equals(other.recording.frame)
    assert one.simulation.frame.equals(other.simulation.frame)
    assert one.truth == other.truth
