"""Rivals and oracle: each finds what is plain to see, and what it is known for shows."""

from __future__ import annotations

import numpy as np
import pytest

from proving_ground.case import detection_probability
from proving_ground.rivals import RIVALS, Candidates, Rival, candidates, rivals
from selector.diagnosis.matching.alignment import comparison_of
from selector.errors import OptionError
from tests.proving_ground.tiny_cases import SINGLE

HERE = [rival for rival in RIVALS if rival.is_here]
NAMING = [rival for rival in HERE if rival.choose is not None]


def offered(weights: dict[str, float], *, n: int = 600, noise: float = 1.0, seed: int = 0) -> Candidates:
    """Ten effects with a random column each; the residual is noise and some of them."""
    draw = np.random.default_rng(seed)
    owners = tuple(f"thermal.e{k}" for k in range(10))
    columns = draw.normal(size=(n, 10))
    columns /= np.sqrt(np.mean(columns**2, axis=0))
    recorded = noise * draw.normal(size=n) + columns @ [weights.get(owner, 0.0) for owner in owners]
    residual = recorded / np.sqrt(np.mean(recorded**2))
    fitted = np.arange(n) < 400
    none = np.zeros(n)
    return Candidates(
        "Z", residual, columns, owners, np.ones((n, 3)), columns, recorded, none, fitted, ~fitted
    )  # fmt: skip


@pytest.mark.parametrize("rival", NAMING, ids=lambda rival: rival.name)
def test_each_finds_an_effect_as_large_as_the_noise(rival):
    found = offered({"thermal.e3": 1.0})
    assert found.owners.index("thermal.e3") in rival.choose(found, 0)


@pytest.mark.parametrize("rival", [r for r in NAMING if r.name in ("f-test", "frols")], ids=lambda rival: rival.name)
def test_in_white_noise_the_careful_ones_name_nothing(rival):
    """F-test at 1 % and BIC (6.4 nats for 600 rows): 20 draws with a false name would be rarer than 1 in 10 000."""
    named = sum(bool(rival.choose(offered({}, seed=seed), 0)) for seed in range(20))
    assert named <= 4


def test_without_noise_of_their_own_kind_the_others_name_something_false():
    """The reason for all this: cross-validated lasso keeps chance columns in most white-noise residuals."""
    (lasso,) = [rival for rival in NAMING if rival.name == "lasso"]
    extra = [len(lasso.choose(offered({"thermal.e3": 0.5}, seed=seed), 0)) > 1 for seed in range(10)]
    assert sum(extra) >= 5


def test_all_chosen_effects_are_fitted_together_for_the_held_out_rows():
    found = offered({"thermal.e3": 2.0}, noise=0.5)
    left = found.left(["thermal.e3"])
    assert np.sqrt(np.mean(left[found.held_out] ** 2)) == pytest.approx(0.5, rel=0.15)  # 200 rows: 5 %, three times
    assert np.sqrt(np.mean(found.left([])[found.held_out] ** 2)) > 1.5


@pytest.mark.parametrize("rival", HERE, ids=lambda rival: rival.name)
def test_answers_to_a_whole_case(rival):
    case = SINGLE.build(0, 60.0)
    comparison = comparison_of(case.recording, case.simulation, responses=case.responses)
    answer = rival.answer(comparison, 0)
    named = {effect["id"] for effect in answer["effects"]}
    before, after = (answer["fit"]["Z"]["heldout"][key] for key in ("rmse_before", "rmse_after"))
    if rival.choose is None:
        assert not named
        assert answer["verdict"] == "unexplained"
    else:
        assert answer["verdict"] == "missing-physics"
    assert np.isfinite([before, after]).all()
    if rival.name in ("aic", "gp"):
        # a column or a smooth surface follows growth of four times the noise; the others take many columns, which may
        # fail on a run that they have not seen
        assert after < 0.8 * before
    assert rival.answer(comparison, 0) == answer


def test_columns_are_free_of_what_recalibration_takes():
    case = SINGLE.build(1, 12.0)
    comparison = comparison_of(case.recording, case.simulation, responses=case.responses)
    found = candidates(comparison, "Z")
    rows = np.flatnonzero(found.fitted)
    nuisances = found.nuisances[rows] / np.linalg.norm(found.nuisances[rows], axis=0)
    # projections of unit columns, to rounding
    assert np.abs(nuisances.T @ found.columns).max() < 1e-8 * len(rows)
    assert np.allclose(np.mean(found.columns**2, axis=0), 1.0)


def test_unknown_and_absent_rivals_are_refused(monkeypatch):
    with pytest.raises(OptionError, match="--rivals"):
        rivals(("no such",))
    gone = Rival("gone", "not installed", "no_such_package_anywhere", None)
    monkeypatch.setattr("proving_ground.rivals.RIVALS", (*RIVALS, gone))
    with pytest.raises(OptionError, match="benchmarks"):
        rivals(("gone",))
    assert "gone" not in {one.name for one in rivals(("all",))}
    assert not gone.is_here


def test_the_oracle_finds_nothing_more_often_than_its_false_alarms_allow():
    assert float(detection_probability(0.0, false_alarm=0.01)) == pytest.approx(0.01)


def test_the_oracle_by_simulation():
    """A matched filter's statistic is normal around d′; 200 000 draws know the share to 0.1 %, three times that."""
    draw = np.random.default_rng(0)
    for d_prime in (1.0, 3.0):
        hits = np.abs(d_prime + draw.normal(size=200_000)) > 2.5758293
        assert float(detection_probability(d_prime)) == pytest.approx(hits.mean(), abs=0.0035)
    many = detection_probability(np.array([3.0, 6.0]), n_looks=40)
    assert many[0] < detection_probability(3.0)
    assert many[1] > 0.98
