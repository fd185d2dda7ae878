"""A model file that was changed is refused or told; benchmarks/bench_mutated_models.py has the counts."""

from __future__ import annotations

import pytest

from selector.controllers.self_check import model_findings, sealed
from tests.controllers import hostile, mutated

MODEL = sealed(hostile.model())
SEEDS = range(len(mutated.KINDS) * 4)


def test_the_file_itself_is_sound():
    assert [finding.id for finding in model_findings(MODEL) if finding.level == "error"] == []


@pytest.mark.parametrize("seed", SEEDS)
def test_a_change_is_refused_by_the_digest(seed):
    assert mutated.outcome(mutated.mutated(MODEL, seed)[1]) == "refused"


@pytest.mark.parametrize("seed", SEEDS)
def test_without_a_digest_a_change_is_refused_or_told(seed):
    assert mutated.outcome(mutated.without_digest(mutated.mutated(MODEL, seed)[1])) in ("refused", "told")


@pytest.mark.parametrize(
    "seed", [k for k in SEEDS if mutated.KINDS[k % len(mutated.KINDS)].__name__.startswith("fallback")]
)
def test_what_runs_when_a_sensor_fails_is_held_by_vectors_too(seed):
    assert mutated.outcome(mutated.forged(mutated.mutated(MODEL, seed)[1])) == "refused"
