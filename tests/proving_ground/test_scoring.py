"""The score: what counts as right, in a set, false; windows, gaps, calibration; first bar and goal."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from proving_ground.case import TrueEffect, Truth, Window
from proving_ground.judging import Judged, Stated, judged, overlap, stated
from proving_ground.results import by_answerer, row_texts, score_object
from proving_ground.runner import Outcome
from proving_ground.scoring import (
    CLEAN,
    NOTHING_NAMED,
    ROWS,
    SET,
    bootstrapped,
    calibration,
    confusion,
    power,
    score_table,
    scores,
    share_measured,
)
from tests.proving_ground.tiny_cases import DOOR, EFFECT, GAP, answer, effect

SPANS = {"r1": (0.0, 7140.0), "r2": (0.0, 7140.0)}
SINGLE = Truth(("missing-physics",), (EFFECT,), held_out=GAP)
HIDDEN = Truth(("unexplained",), (DOOR,), tolerated=("thermal.ambient",))


def judge(truth: Truth, verdict: str, *effects, **more) -> Judged:
    return judged(stated(answer(verdict, *effects, **more)), truth, SPANS)


@pytest.mark.parametrize(
    ("effects", "credit", "false"),
    [
        ([effect("thermal.instant_speed")], "exact", ()),
        ([effect("thermal.instant_speed", "thermal.memory")], "first", ()),
        ([effect("thermal.memory", "thermal.instant_speed")], "set", ()),
        ([effect("thermal.memory")], "missed", ("thermal.memory",)),
        ([effect("thermal.instant_speed"), effect("thermal.ambient")], "exact", ("thermal.ambient",)),
        ([], "missed", ()),
    ],
)
def test_names_and_sets(effects, credit, false):
    one = judge(SINGLE, "missing-physics", *effects)
    assert one.credits == (credit,)
    assert one.false_names == false


def test_a_set_of_accepted_ids_is_exact():
    either = TrueEffect("thermal.memory", ("thermal.memory", "thermal.speed_heating"), ("Z",))
    truth = Truth(("missing-physics",), (either,))
    assert judge(truth, "missing-physics", effect("thermal.speed_heating", "thermal.memory")).credits == ("exact",)


def test_tolerated_names_count_neither_way():
    one = judge(HIDDEN, "unexplained", effect("thermal.ambient"))
    assert one.false_names == ()
    assert one.unexplained_right is True
    assert one.confidences == ()
    # the tolerated id with another verdict is not the answer that was asked for
    assert judge(HIDDEN, "missing-physics", effect("thermal.ambient")).unexplained_right is False


def test_outside_the_catalogue_a_wrong_name_is_wrong_whatever_the_verdict():
    assert judge(HIDDEN, "unexplained", effect("thermal.memory")).unexplained_right is False
    assert judge(HIDDEN, "nothing-missing").unexplained_right is False
    assert judge(SINGLE, "missing-physics").unexplained_right is None


def test_windows_are_those_of_the_channel_that_is_pointed_at_most():
    where = [
        {"channel": "Z", "run": "r1", "from_s": 0.0, "to_s": 1500.0, "share": 0.6},
        {"channel": "Z", "run": "r1", "from_s": 1000.0, "to_s": 2000.0, "share": 0.2},
        {"channel": "Y", "run": "r1", "from_s": 0.0, "to_s": 3000.0, "share": 0.1},
    ]
    assert judge(HIDDEN, "unexplained", where=where).window_iou == pytest.approx(2000 / 3000)
    assert judge(HIDDEN, "unexplained").window_iou == 0.0
    assert judge(SINGLE, "missing-physics", where=where).window_iou is None
    everywhere = [{"channel": "Z", "run": None, "from_s": None, "to_s": None, "share": 1.0}]
    assert judge(HIDDEN, "unexplained", where=everywhere).window_iou == pytest.approx(3000 / (2 * 7140))


def test_channel_is_that_of_the_effect_or_of_the_place():
    assert judge(SINGLE, "missing-physics", effect("thermal.instant_speed")).channel_right is True
    assert judge(SINGLE, "missing-physics", effect("thermal.instant_speed", channel="Y")).channel_right is False
    assert judge(HIDDEN, "unexplained", where=[{"channel": "Y", "share": 1.0}]).channel_right is False
    assert judge(HIDDEN, "nothing-missing").channel_right is None


@pytest.mark.parametrize(("after", "closed"), [(1.5, 0.0), (1.25, 0.5), (1.0, 1.0), (2.0, -1.0)])
def test_gap_closed_is_between_recalibrated_and_oracle(after, closed):
    fit = {"Z": {"heldout": {"rmse_before": 2.0, "rmse_after": after}}}
    assert judge(SINGLE, "missing-physics", fit=fit).gap_closed == pytest.approx(closed)


def test_a_response_without_a_fit_has_closed_nothing():
    assert judge(SINGLE, "nothing-missing").gap_closed == 0.0
    assert judge(Truth(("nothing-missing",)), "nothing-missing").gap_closed is None


WINDOWS = st.lists(
    st.builds(lambda run, a, b: Window(run, a, a + b), st.sampled_from("ab"), st.integers(0, 50), st.integers(0, 20)),
    max_size=6,
)


@given(WINDOWS, WINDOWS)
def test_overlap_equals_that_of_unit_steps(first, second):
    """Windows with whole bounds are sets of unit steps, of which the overlap is counted."""

    def steps(windows):
        return {(w.run, k) for w in windows for k in range(int(w.from_s), int(w.to_s))}

    a, b = steps(first), steps(second)
    expected = len(a & b) / len(a | b) if a | b else 0.0
    # sums of at most 12 whole numbers: exact, the division is the only rounding
    assert overlap(first, second) == pytest.approx(expected, abs=1e-15)


def outcome(truth: Truth, verdict: str, *effects, kind: str = "single", d_prime: float | None = 6.0, who="selector"):
    said: Stated = stated(answer(verdict, *effects))
    return Outcome("tiny", "thermal", kind, d_prime, 0, who, truth, said, judged(said, truth, SPANS), 2.0)


CASES = (
    outcome(SINGLE, "missing-physics", effect("thermal.instant_speed")),
    outcome(SINGLE, "missing-physics", effect("thermal.memory", "thermal.instant_speed")),
    outcome(SINGLE, "missing-physics", effect("thermal.memory")),
    outcome(SINGLE, "nothing-missing", d_prime=3.0),
    outcome(Truth(("nothing-missing",)), "nothing-missing", kind="clean", d_prime=None),
    outcome(Truth(("nothing-missing",)), "missing-physics", effect("data.zero"), kind="clean", d_prime=None),
    outcome(HIDDEN, "unexplained", kind="out-of-catalogue"),
)


def test_scores_are_shares_of_the_cases_they_speak_of():
    found = scores(CASES)
    expected = {
        "found_6": (2 / 3, 3),
        "exact_6": (1 / 3, 3),
        "first_6": (1 / 3, 3),
        "found_3": (0.0, 1),
        "found_12": (None, 0),
        "false_on_clean": (0.5, 2),
        "false_on_all": (2 / 7, 7),
        "unexplained": (1.0, 1),
        "verdict": (5 / 7, 7),
        "seconds": (2.0, 7),
        "failed": (0.0, 7),
    }
    assert {key: (found[key].value, found[key].n) for key in expected} == {
        key: (pytest.approx(value) if value is not None else None, n) for key, (value, n) in expected.items()
    }


def test_the_table_judges_against_bar_and_goal_and_says_nothing_without_cases():
    rows = {row.score.key: row for row in score_table(scores(CASES))}
    assert rows["found_6"].meets_bar is False
    assert rows["unexplained"].meets_goal is True
    assert rows["gap_closed"].meets_bar is False
    assert rows["found_12"].meets_bar is None
    assert rows["placebo"].meets_bar is None
    assert set(rows) == {score.key for score in ROWS}
    assert row_texts(rows["found_6"])[1] == "66.7 %"
    assert row_texts(rows["found_12"])[1] == "–"


def test_confusion_counts_every_case():
    matrix = confusion(CASES)
    counts = {(t, s): int(matrix.counts[i, j]) for i, t in enumerate(matrix.true) for j, s in enumerate(matrix.said)}
    assert {pair: n for pair, n in counts.items() if n} == {
        ("thermal.instant_speed", "thermal.instant_speed"): 1,
        ("thermal.instant_speed", SET): 1,
        ("thermal.instant_speed", "thermal.memory"): 1,
        ("thermal.instant_speed", NOTHING_NAMED): 1,
        (CLEAN, NOTHING_NAMED): 1,
        (CLEAN, "data.zero"): 1,
        ("hidden.door", "unexplained"): 1,
    }
    assert dict(zip(matrix.true, matrix.cases, strict=True))["thermal.instant_speed"] == 4


def test_power_is_by_id_and_strength():
    found = {(one.id, one.d_prime): (one.found.value, one.exact.value) for one in power(CASES)}
    assert found == {
        ("thermal.instant_speed", 3.0): (0.0, 0.0),
        ("thermal.instant_speed", 6.0): (pytest.approx(2 / 3), pytest.approx(1 / 3)),
    }


def test_calibration_error_of_answers_that_are_right_as_often_as_they_say():
    sure = [outcome(SINGLE, "missing-physics", effect("thermal.instant_speed", confidence=0.75))] * 3
    wrong = [outcome(SINGLE, "missing-physics", effect("thermal.memory", confidence=0.75))]
    assert scores([*sure, *wrong])["calibration"].value == pytest.approx(0.0)
    # all four are wrong now, at a confidence of 0.75
    assert scores(wrong * 4)["calibration"].value == pytest.approx(0.75)
    (one,) = calibration([*sure, *wrong])
    assert (one.confidence, one.right.value) == (pytest.approx(0.75), 0.75)


def test_binomial_intervals_are_those_of_clopper_and_pearson():
    # Clopper and Pearson (1934): 0 of 10 gives 0 … 1 − 0.025^(1/10)
    assert share_measured([False] * 10).high == pytest.approx(1 - 0.025**0.1)
    assert share_measured([True] * 10).low == pytest.approx(0.025**0.1)
    assert share_measured([]).value is None


def test_bootstrap_interval_of_a_mean_is_that_of_its_standard_error():
    values = np.random.default_rng(1).normal(3.0, 2.0, 400)
    found = bootstrapped(values, lambda x: float(x.mean()))
    half = 1.96 * values.std() / 20.0
    assert found.low is not None
    # 2000 resamples know a 2.5 % quantile to about 4 % of the half width; three times that
    assert found.low == pytest.approx(values.mean() - half, abs=0.12 * half)


def test_rivals_have_tables_of_their_own_and_this_program_comes_first():
    both = (outcome(SINGLE, "nothing-missing", who="lasso"), *CASES)
    assert list(by_answerer(both)) == ["selector", "lasso"]
    assert list(by_answerer(both)) == ["selector", "lasso"]
    result = score_object(both, is_exam=False)
    assert result["cases"] == len(CASES)
    assert list(result["rivals"]) == ["lasso"]


def test_numbers_that_are_none_are_not_read_as_numbers():
    said = stated(
        {
            "verdict": "missing-physics",
            "effects": [{"id": "a", "channel": "Z", "confidence": float("nan")}],
            "where": [{"channel": "Z", "from_s": None}],
            "fit": {"Z": {"heldout": {"rmse_after": None}, "placebo_gain": {"value": 0.1, "low": None, "high": 1.0}}},
        }
    )
    assert said.effects[0].confidence is None
    assert said.heldout_after == {}
    assert said.placebo == {}
