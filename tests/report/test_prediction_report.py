"""The page of a prediction says first what to correct when, is complete without a network, and shows names as text."""

from __future__ import annotations

import dataclasses
import json
import re

import numpy as np
import pytest

from selector.findings import Finding, Where
from selector.telling.page import account_page, write_account
from selector.telling.predicted import prediction_account, prediction_advice
from selector.telling.result_file import prediction_of
from tests.report import predictions
from tests.report.studies import HOSTILE
from tests.report.test_selection_report import DESCRIPTION, MEGABYTE, Page

PROVENANCE = {
    "machine": "Spindle <simulated>",
    "runs": {"<i>1</i>": {"file": "a&b.csv", "sha256": "ab" * 32}},
    "duty cycle": "<monday>.csv",
}


def prediction_html(prediction, description=None, provenance=None):
    return account_page(prediction_account(prediction, description, provenance, drawn=True))


@pytest.fixture(scope="module")
def page() -> Page:
    return Page(prediction_html(predictions.prediction(), description=DESCRIPTION, provenance=PROVENANCE))


def text_of(page: Page) -> str:
    return " ".join(" ".join(page.text).split())


def test_what_to_do_comes_first():
    prediction = predictions.prediction()
    verdict, said = prediction_advice(prediction)
    assert verdict == "good"
    program = prediction.programs[HOSTILE[0]]
    number, operation = next((k, one) for k, one in enumerate(program.operations, start=1) if len(one.times_s) > 1)
    count = len(operation.times_s) - 1
    times = {1: "once", 2: "twice"}.get(count, f"{count} times")
    assert said[0].startswith(f"Correct {HOSTILE[0]} {times} in operation {number} (by 10 µm after ")
    minutes = np.floor(10 * (operation.times_s[1] - operation.start_s) / 60) / 10
    assert f"after {minutes:g}" in said[0]
    # the second displacement grows to a few micrometres
    assert f"{HOSTILE[1]} needs no correction, it drifts by at most " in said[0]
    assert said[0].endswith("; the drift then stays within 10 µm.")
    assert "SUBTRACTED" not in said[0]
    assert "verify the sign" in said[2]


def test_many_corrections_are_counted_and_the_first_one_told():
    prediction = predictions.prediction(tolerance_um=1.0)
    _, said = prediction_advice(prediction)
    total = sum(len(operation.times_s) - 1 for operation in prediction.programs[HOSTILE[0]].operations)
    assert total > 8
    assert f"{HOSTILE[0]} {total} times as the program says, first by 1.00 µm after " in said[0]


def test_without_a_program_the_largest_displacement_is_told():
    prediction = predictions.prediction(tolerance_um=None)
    _, said = prediction_advice(prediction)
    k = int(np.argmax(np.abs(prediction.displacement_um[:, 0])))
    assert said[0].startswith(f"Expect {HOSTILE[0]} to move by up to {prediction.displacement_um[k, 0]:.3g} µm, after ")
    assert "--tolerance" in said[2]
    page = prediction_html(prediction)
    assert "The correction program" not in page
    assert "Timed offset blocks" not in page


def test_a_prediction_that_is_no_better_than_the_tolerance_is_not_to_be_used():
    verdict, said = prediction_advice(predictions.unsure())
    assert verdict == "bad"
    assert said[0].startswith(f"Do not correct {HOSTILE[0]}: the prediction is not good enough for 10 µm. ")
    both = dataclasses.replace(predictions.unsure(), heldout_um=np.array([7.0, 5.1]))
    assert prediction_advice(both)[0] == "bad"
    assert prediction_advice(both)[1][0].startswith("Do not use this program: ")
    just = dataclasses.replace(predictions.unsure(), heldout_um=np.array([5.0, 5.0]))
    assert prediction_advice(just)[0] == "good"


def test_the_page_holds_program_blocks_tests_cycle_findings_and_origin(page):
    text = text_of(page)
    prediction = predictions.prediction()
    for operation in prediction.programs[HOSTILE[0]].operations:
        for offset in operation.offsets_um[1:]:
            assert f"OFFSET {offset:+9.3f} µm" in "".join(page.text)
    assert "[T\"2' & <b>%{y}</b> {{7*7}}]" in text
    for one in prediction.repeats:
        assert f"{one.run}, single samples" in page.cells
    for where in ("said before </script>", "<monday>.csv", "a&b.csv", "ab" * 32, "day 1.csv", "x.csv"):
        assert where in text
    assert "some/where" not in text
    assert "Simulated data" in text
    assert {"0", "60", "120"} <= set(page.cells)
    assert "Thermal modes" not in text
    assert "The thermal modes" not in text


def test_modes_have_a_table_with_open_bounds_as_dashes():
    from selector.physics.thermal.prediction.answer import Mode

    prediction = dataclasses.replace(
        predictions.prediction(), method="modal", modes=(Mode(600.0, 540.0, 660.0), Mode(9000.0, 8000.0, None))
    )
    page = Page(prediction_html(prediction))
    at = page.cells.index("time constant [min]")
    assert page.cells[at + 3 : at + 11] == ["1", "10.0", "9.00", "11.0", "2", "150", "133", "–"]


def test_nothing_runs_and_nothing_is_loaded(page):
    assert not [tag for tag in page.tags if tag in ("link", "img", "iframe", "object", "embed", "base", "form", "i")]
    assert not [name for _, name, _ in page.attributes if name.startswith("on") or name in ("src", "srcset")]
    assert all(value.startswith("#") for _, name, value in page.attributes if name == "href")
    assert "default-src 'none'" in page.policy
    kinds = [kind for kind, _ in page.scripts]
    # two programs, and data that no browser runs: a figure of the cycle and one of the tests for each displacement
    assert kinds.count(None) == 2
    assert kinds.count("application/json") == 4


def test_equal_predictions_give_equal_bytes_and_the_page_is_light(tmp_path):
    def account():
        return prediction_account(predictions.prediction(), None, PROVENANCE, drawn=True)

    one = write_account(account(), tmp_path / "a.html").read_bytes()
    predictions.prediction.cache_clear()
    other = write_account(account(), tmp_path / "b.html").read_bytes()
    assert one == other
    # the drawing program alone has 4.8 MB
    assert len(one) < 5.3 * MEGABYTE


def test_a_reading_of_a_page_is_late_for_no_correction(page):
    program = predictions.prediction().programs[HOSTILE[0]]
    shown = [float(cell) for cell in page.cells if re.fullmatch(r"\d+\.\d", cell)]
    for operation in program.operations:
        for time_s in operation.times_s[1:]:
            # tenths of a minute, rounded down
            assert any(0 <= time_s / 60 - minutes < 0.1 + 1e-6 for minutes in shown)


def test_names_with_control_characters_are_shown_without_them():
    made = predictions.prediction()
    bad = "run\x1b[31m\x07"
    made = dataclasses.replace(
        made,
        repeats=tuple(dataclasses.replace(one, run=bad) for one in made.repeats),
        findings=(Finding("test-left-out", "warning", f"Run {bad} is left out.", Where(run=bad)),),
    )
    html = prediction_html(made, provenance={"runs": {bad: {"file": bad}}})
    assert "run [31m " in html
    assert not {"\x1b", "\x07"} & set(html)


@pytest.mark.parametrize("method", ["modal", "piecewise"])
def test_a_prediction_from_its_json_tells_the_same_but_for_what_the_json_lacks(method):
    made = predictions.prediction(method)
    again = prediction_of(json.loads(json.dumps(made.as_dict())))
    assert {**again.as_dict(), "kind": made.as_dict()["kind"]} == made.as_dict()
    told, whole = prediction_account(again, drawn=True), prediction_account(made, drawn=True)
    assert told.sentences[0] == whole.sentences[0]
    assert (told.sentences[1] == whole.sentences[1]) == (method == "modal")
    assert (told.verdict, whole.verdict) == ("good" if method == "modal" else "plain", "good")
    page = text_of(Page(account_page(told)))
    assert "What this page leaves out" in page
    assert "Timed offset blocks" in page
    assert "No test can be repeated" not in page
