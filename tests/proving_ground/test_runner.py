"""The exam: which cases there are, the same answers for any number of processes, failures that are scored."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from proving_ground.judging import FAILED
from proving_ground.results import answers_sha256, cases_csv, line_of, score_object
from proving_ground.runner import Answerer, Outcome, outcomes, questions, require_seeds
from proving_ground.scenarios import scenarios
from proving_ground.scoring import scores
from selector.errors import OptionError
from tests.patience import PATIENCE_S, wait_for
from tests.proving_ground.tiny_cases import BROKEN, CLEAN, SINGLE, by_correlation, stumbling

ASKED = questions((SINGLE, CLEAN), (3.0, 12.0), range(4))
ROOT = Path(__file__).resolve().parents[2]


def test_clean_scenarios_have_no_strength():
    assert [(q.scenario.name, q.d_prime, q.seed) for q in questions((SINGLE, CLEAN), (3.0, 12.0), (0, 7))] == [
        ("tiny/single", 3.0, 0),
        ("tiny/single", 12.0, 0),
        ("tiny/single", 3.0, 7),
        ("tiny/single", 12.0, 7),
        ("tiny/clean", None, 0),
        ("tiny/clean", None, 7),
    ]


def test_answers_are_the_same_for_any_number_of_processes():
    answerers = (Answerer("selector", by_correlation),)
    alone, together = (outcomes(ASKED, answerers, n_jobs=n_jobs) for n_jobs in (1, 2))
    assert answers_sha256(alone) == answers_sha256(together)
    assert [(one.scenario, one.d_prime_asked, one.seed) for one in together] == [
        (q.scenario.name, q.d_prime, q.seed) for q in ASKED
    ]
    # they do differ between cases, so that the comparison above says something
    assert len({one.stated.effects for one in alone}) > 2


def test_progress_hears_of_every_outcome_once():
    heard: list[tuple[int, int, Outcome]] = []
    answerers = (Answerer("selector", by_correlation), Answerer("other", stumbling))
    found = outcomes(ASKED[:3], answerers, progress=lambda done, total, one: heard.append((done, total, one)))
    assert [done for done, _, _ in heard] == list(range(1, 7))
    assert {total for _, total, _ in heard} == {6}
    assert len(found) == 6


def test_a_case_that_raises_is_a_scored_failure_with_its_text():
    asked = questions((SINGLE, BROKEN), (12.0,), range(2))
    first, second, *broken = outcomes(asked, (Answerer("selector", stumbling),))
    assert not first.failed
    assert second.stated.verdict == FAILED
    assert second.judged.credits == ("missed",)
    assert "ZeroDivisionError: odd" in second.stated.error
    assert all("machine" in one.stated.error and one.truth is None for one in broken)
    assert scores((first, second, *broken))["failed"].value == 0.75
    assert "ZeroDivisionError" in line_of(second)
    result = score_object((first, second, *broken), is_exam=False)
    assert len(result["failures"]) == 3
    assert cases_csv((first, second, *broken)).count("\n") == 5


@pytest.mark.parametrize(("seeds", "is_exam"), [((0, 1000), False), ((10_000,), False), ((999,), True), ((), False)])
def test_development_and_exam_seeds_keep_apart(seeds, is_exam):
    with pytest.raises(OptionError, match="--seeds"):
        require_seeds(seeds, is_exam=is_exam)


def test_seeds_of_their_own_range_are_taken():
    require_seeds((0, 999), is_exam=False)
    require_seeds((10_000,), is_exam=True)


def test_unknown_families_and_patterns_are_refused():
    with pytest.raises(OptionError, match="hydraulic"):
        scenarios(("hydraulic",))
    with pytest.raises(OptionError, match="none of"):
        scenarios((), ("no such thing *",))


@pytest.mark.skipif(os.name == "nt", reason="Windows has no SIGINT for one process")
def test_ctrl_c_ends_at_once_and_leaves_no_process():
    """A Ctrl-C in the terminal reaches the parent and its workers alike."""
    program = (
        "import signal, time; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "from proving_ground.runner import *\n"
        "from tests.proving_ground.tiny_cases import SINGLE, answer\n"
        "def slow(comparison, seed):\n    time.sleep(0.5)\n    return answer('nothing-missing')\n"
        "asked = questions((SINGLE,), (3.0,), range(500))\n"
        "who = (Answerer('selector', slow),)\n"
        "outcomes(asked, who, n_jobs=2, progress=lambda done, total, one: print(done, flush=True))\n"
    )
    running = subprocess.Popen(
        [sys.executable, "-c", program], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        start_new_session=True,
    )  # fmt: skip
    assert running.stdout is not None
    assert running.stdout.readline().strip() == "1"
    os.killpg(running.pid, signal.SIGINT)
    done, said = running.communicate(timeout=PATIENCE_S)
    assert running.returncode != 0
    # 500 cases were to be done
    assert len(done.split()) < 100
    assert "KeyboardInterrupt" in said
    wait_for(lambda: _is_gone(running.pid))


def _is_gone(group: int) -> bool:
    """Whether no process of the group is left; the system takes a moment to bury them."""
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return True
    return False
