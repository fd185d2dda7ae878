"""The page of a diagnosis says first what was left out and what to do, is complete without a network, and is safe."""

from __future__ import annotations

import hashlib
from dataclasses import replace

import pytest

from selector.diagnosis.effects.effect import Quantity
from selector.diagnosis.wording import headline, what_to_do
from selector.telling.diagnosed import diagnosis_account
from selector.telling.page import account_page, write_account
from selector.telling.result_file import diagnosis_of
from tests.diagnosis.answers import answer, memory_effect
from tests.report.studies import HOSTILE
from tests.report.test_selection_report import MEGABYTE, Page

VERDICTS = ("missing-physics", "data-fault", "miscalibrated", "nothing-missing", "unexplained")
PROVENANCE = {"machine": "VMC <850>", "runs": {"<i>r1</i>": {"file": "a&b.csv", "sha256": "ab" * 32}}}


def diagnosis_html(found, **told) -> str:
    return account_page(diagnosis_account(found, drawn=True, **told))


def text_of(page: Page) -> str:
    return " ".join(" ".join(page.text).split())


@pytest.mark.parametrize("verdict", VERDICTS)
def test_the_answer_comes_first_and_then_what_to_do(verdict):
    found = answer(verdict)
    text = text_of(Page(diagnosis_html(found)))
    places = [text.index(sentence) for sentence in (headline(found), *what_to_do(found))]
    assert places == sorted(places)
    assert places[0] < text.index("Contents" if "Contents" in text else "Findings")


def test_the_page_holds_where_what_how_much_why_and_what_is_missed():
    page = Page(diagnosis_html(answer(), provenance=PROVENANCE))
    text = text_of(page)
    for heading in ("Where", "What was left out", "How much better it gets", "Why: the evidence", "would have missed"):
        assert heading in text
    for cell in ("41 min (35 min to 48.3 min)", "30 min", "91 % (80 to 97)", "1 % (−2 to 3)", "0.800 µm"):
        assert cell in page.cells
    assert "no velocity is recorded" in page.cells
    assert "Not testable with this record" in text
    figures = [one for tag, name, one in page.attributes if tag == "div" and name == "id" and one.startswith("figure-")]
    assert len(figures) == 3  # map, two responses


def test_numbers_that_were_put_into_a_model_file_are_shown_with_its_keys():
    found = answer()
    heat = {"speed_w": Quantity(185.0, "W", 167.0, 203.0), "exponent": Quantity(1.01, "1", 0.99, 1.03)}
    effect = replace(found.effects[0], id="thermal.speed_heating", parameters=heat)
    cells = Page(diagnosis_html(replace(found, effects=(effect,)))).cells
    assert {"speed_w", "185 W (167 to 203)", "exponent"} <= set(cells)


def test_a_set_is_shown_with_the_run_that_tells():
    found = answer()
    effect = memory_effect(found.effects[0].courses["Z"], cannot_be_told_from=("thermal.ambient",))
    text = text_of(Page(diagnosis_html(replace(found, effects=(effect,)))))
    assert "This record cannot tell it from the hall temperature." in text
    # as something to do, and not again in the answer and beside the effect
    assert text.count("Heat for 4 h, then let it cool for 6 h.") == 1
    assert "To tell whether it is" in text


def test_nothing_runs_that_was_not_written_here_and_nothing_is_loaded():
    page = Page(diagnosis_html(answer(names=HOSTILE), provenance={**PROVENANCE, "machine": HOSTILE[0]}))
    assert "default-src 'none'" in page.policy
    assert not [tag for tag in page.tags if tag in ("link", "iframe", "img", "object")]
    assert not [one for one in page.attributes if one[1] in ("src", "href") and not one[2].startswith("#")]
    assert not [text for kind, text in page.scripts if kind is None and "alert(1)" in text]
    assert HOSTILE[0] in text_of(page)


def test_equal_answers_give_equal_bytes_and_the_page_is_light(tmp_path):
    first = write_account(diagnosis_account(answer(), drawn=True), tmp_path / "one.html").read_bytes()
    second = write_account(diagnosis_account(answer(), drawn=True), tmp_path / "two.html").read_bytes()
    assert hashlib.sha256(first).digest() == hashlib.sha256(second).digest()
    assert len(first) < 7 * MEGABYTE  # the drawing program alone is 4.7


@pytest.mark.parametrize("verdict", VERDICTS)
def test_a_diagnosis_read_from_its_json_tells_the_same(verdict):
    found = answer(verdict)
    # what noise leaves of the fitted part is in no document
    fit = {name: replace(one, train=replace(one.train, noise_floor=None)) for name, one in found.fit.items()}
    found = replace(found, fit=fit, headline=headline(found))
    document = found.as_dict()
    again = diagnosis_of(document)
    assert diagnosis_of(again.as_dict()).as_dict() == again.as_dict()
    assert {**again.as_dict(), "recalibration": {}} == {**document, "recalibration": {}}
    for name, quantities in document["recalibration"].items():
        for key, one in quantities.items():
            assert again.as_dict()["recalibration"][name][key] == pytest.approx(one)
    whole = {one.id: one for one in diagnosis_account(found).sections}
    for part in diagnosis_account(again, is_alone=True).sections:
        # what it holds is told in the same words; evidence and what is missed are not in it
        assert part.id in ("left-out", "origin", "findings") or part.blocks == whole[part.id].blocks
