"""The report says first what to do, is complete without a network, and shows names as they are."""

from __future__ import annotations

import base64
import dataclasses
import hashlib
import html
import importlib
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from selector.errors import OptionError
from selector.findings import Finding, Where
from selector.models.design import design_matrix
from selector.number_text import listed, number_text, span_text
from selector.quality.finding_table import FINDINGS as QUALITY
from selector.telling.numbers import beside_text, given_text, p_text, place_text, uncertain_text
from selector.telling.origin import label_of
from selector.telling.page import account_page
from selector.telling.selected import account
from selector.telling.selected.account import (
    coefficient_rows,
    formula_text,
    gain_table,
    selection_account,
    write_report,
)
from selector.telling.selected.advice import advice
from tests.report import studies

DESCRIPTION = {
    "schema": "selector.description/1",
    "runs": [
        {
            "run": "day 1",
            "file": "somewhere/deep/day 1.csv",
            "rows": 200,
            "duration_s": 11940.0,
            "period_s": 60.0,
            "start": None,
        }
    ],
    "channels": [
        {
            "name": "T3",
            "column": "PT03",
            "role": "temperature",
            "unit": "degC",
            "unit_in_file": "degF",
            "guessed": ["role"],
        }
    ],
    "reading": {"format": "delimited", "encoding": "gb18030", "separator": ";", "time": {"column": "t"}},
    "findings": [],
}
MEGABYTE = 1_000_000


class Page(HTMLParser):
    """Elements, attributes, scripts and text of a page."""

    def __init__(self, page: str) -> None:
        super().__init__(convert_charrefs=True)
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str, str]] = []
        self.scripts: list[tuple[str | None, str]] = []
        self.cells: list[str] = []
        self.text: list[str] = []
        self.policy = ""
        self._open: list[str] = []
        self._script: str | None = None
        self.feed(page)

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self._open.append(tag)
        self.attributes += [(tag, name, value or "") for name, value in attrs]
        values = dict(attrs)
        if tag == "script":
            self.scripts.append((values.get("type"), ""))
        if values.get("http-equiv") == "Content-Security-Policy":
            self.policy = values["content"]
        if tag in ("td", "th"):
            self.cells.append("")

    def handle_endtag(self, tag):
        while self._open and self._open.pop() != tag:
            pass

    def handle_data(self, data):
        if self._open and self._open[-1] == "script":
            kind, text = self.scripts[-1]
            self.scripts[-1] = (kind, text + data)
            return
        if self._open and self._open[-1] in ("td", "th"):
            self.cells[-1] += data
        self.text.append(data)


def selection_html(selection, description=None, date=None):
    return account_page(selection_account(selection, description, date=date, drawn=True))


@pytest.fixture(scope="module")
def page() -> Page:
    return Page(selection_html(studies.small(), DESCRIPTION, "2026-11-20"))


def test_every_unseen_error_says_which_one_it_is():
    page = html.unescape(selection_html(studies.small()))
    assert "unseen, whole procedure [µm]" in page
    assert "unseen, fixed set: rms [µm]" in page
    assert "(rms, whole procedure" in advice(studies.small())[1][0]
    for words in ("Whole procedure: ", "Best of each size: ", "Fixed set: "):
        assert words in page


def test_what_to_do_comes_first():
    selection = studies.small()
    verdict, said = advice(selection)
    assert verdict == "good"
    assert said[0].startswith(f"Keep sensors {listed(selection.chosen)}")
    for name in ("Z", "Y"):
        before, after = selection.proof.baselines_um[name]["none"], selection.proof.rmse_um(name)
        assert f"{name} from {number_text(before, 2)} to {number_text(after, 2)} µm" in said[0]
    worst = max(selection.faults, key=lambda gain: gain.worst_um)
    assert (
        f"worst single sensor fault {number_text(worst.worst_um, 2)} µm in {worst.response}, {worst.sensor}" in said[0]
    )


def test_one_displacement_is_said_in_the_singular():
    _, said = advice(studies.single_run())
    assert "On stretches of the only run that the model has not seen the Z error falls from " in said[0]
    assert "; worst single sensor fault " in said[0]


def test_many_displacements_are_said_by_their_span():
    selection = studies.small()
    names = ("Z", "Y", "Z2", "Y2")
    proof = dataclasses.replace(
        selection.proof,
        per_response={name: selection.proof.per_response[name[0]] for name in names},
        baselines_um={name: selection.proof.baselines_um[name[0]] for name in names},
    )
    _, said = advice(
        dataclasses.replace(selection, proof=proof, models={name: selection.models[name[0]] for name in names})
    )
    assert "the errors of 4 displacements fall from " in said[0]
    assert all(name not in said[0] for name in names[2:])


def test_how_well_an_error_is_known_stands_beside_it():
    selection = studies.small()
    factor, rmse = selection.known.factor, selection.proof.rmse_um("Z")
    (row,) = [row for row in gain_table(selection).rows if row[0] == "Z"]
    assert row[3] == f"{number_text(rmse / factor, 2)} to {number_text(rmse * factor, 2)}"
    assert f"known to a factor of {number_text(factor, 2)}" in advice(selection)[1][0]
    assert "factor" not in advice(dataclasses.replace(selection, known=None))[1][0]


def test_runs_that_get_worse_are_said():
    selection = studies.small()
    proofs = dict(selection.proof.per_response)
    proofs["Y"] = tuple(dataclasses.replace(part, before_rmse_um=0.1) for part in proofs["Y"][:1]) + proofs["Y"][1:]
    proof = dataclasses.replace(selection.proof, per_response=proofs)
    assert "The error is larger than without compensation: that of Y on 1 of 4." in " ".join(
        advice(dataclasses.replace(selection, proof=proof))[1]
    )
    assert "larger than without" not in " ".join(advice(selection)[1])


def test_a_model_that_is_no_better_than_nothing_is_not_to_be_used():
    selection = studies.useless()
    assert "no-better-than-nothing" in {finding.id for finding in selection.findings}
    text = "".join(Page(selection_html(selection)).text)
    assert advice(selection)[0] == "bad"
    assert advice(selection)[1][0] == "Do not use this model of Z."
    assert "Keep sensor" not in text
    assert text.index("Do not use this model of Z.") < text.index("Why: what unseen data say")


def test_one_useless_model_of_two_is_named():
    finding = Finding("no-better-than-nothing", "error", "The model of Y is useless.", Where(channel="Y"))
    verdict, said = advice(dataclasses.replace(studies.small(), findings=(finding,)))
    assert verdict == "bad"
    assert said[0].startswith("Do not use the model of Y; for Z, keep sensors")
    assert "the Y error is" in said[1]


def test_a_fault_that_outweighs_the_benefit_is_said():
    selection = studies.small()
    huge = tuple(dataclasses.replace(gain, open_um=1e4) for gain in selection.faults)
    assert any("must be noticed before" in text for text in advice(dataclasses.replace(selection, faults=huge))[1])
    small = tuple(dataclasses.replace(gain, open_um=0.0, stuck_um=1.0) for gain in selection.faults)
    assert not any("must be noticed before" in text for text in advice(dataclasses.replace(selection, faults=small))[1])


def test_errors_stand_before_warnings_and_what_they_advise_comes_first():
    findings = (
        Finding("one", "info", "An information."),
        Finding(
            "two", "warning", "A warning.", Where(run="day 2", from_s=60.0, to_s=3600.0), action="leave-out-stretch"
        ),
        Finding("three", "error", "An error.", suggestion="Do this."),
    )
    text = "".join(Page(selection_html(dataclasses.replace(studies.small(), findings=findings))).text)
    reasons, sets = "Why: what unseen data say", "Sets that were compared"
    told = ("An error. Do this.", reasons, "A warning.", "An information.", sets)
    places = [text.index(part) for part in told]
    assert places == sorted(places)
    assert text.index(reasons) < text.index("An error.", text.index(reasons)) < text.index("A warning.")
    assert "day 2, 1 min to 1 h" in text
    assert "What is done: this stretch is left out." in text


def test_a_sensor_between_two_groups_concerns_the_groups():
    between = Finding("between-groups", "info", "T2 stands between two groups.")
    told = selection_account(dataclasses.replace(studies.small(), findings=(between,)))
    parts = {section.id for section in told.sections if "between two groups" in str(section.blocks)}
    assert parts == {"groups", "findings"}


def test_every_finding_of_a_selection_has_its_part_of_the_page():
    tables = [importlib.import_module(f"selector.{room}.finding_table") for room in ("sensors", "models", "selection")]
    own = {id_ for one in tables for id_ in one.FINDINGS} - set(QUALITY)
    assert own - set(account._CONCERNS) == set()


def test_nothing_is_loaded_from_anywhere(page):
    for tag, name, value in page.attributes:
        if name in ("src", "href", "action", "data", "poster", "srcset", "background", "formaction", "ping"):
            assert (tag, name, value[:1]) == ("a", "href", "#"), (tag, name, value)
    assert not {"link", "iframe", "object", "embed", "base", "form", "img"} & set(page.tags)
    assert "default-src 'none'" in page.policy
    assert "base-uri 'none'" in page.policy
    sources = re.findall(r"(\w+-src) ([^;]*)", page.policy)
    assert not [source for _, source in sources if "http" in source or "*" in source or "'self'" in source]


def test_styles_load_nothing():
    source = selection_html(studies.small())
    style = source[source.index("<style>") : source.index("</style>")]
    assert "url(" not in style
    assert "@import" not in style


def test_only_the_two_programs_of_the_report_may_run(page):
    programs = [text for kind, text in page.scripts if kind is None]
    assert len(programs) == 2
    hashes = [base64.b64encode(hashlib.sha256(text.encode("utf-8")).digest()).decode("ascii") for text in programs]
    assert re.search(r"script-src ([^;]*)$", page.policy)[1].split() == [f"'sha256-{value}'" for value in hashes]
    assert not [name for _, name, _ in page.attributes if name.startswith("on")]


def test_hostile_names_are_shown_and_never_obeyed(page):
    data = [json.loads(text) for kind, text in page.scripts if kind == "application/json"]
    assert len(data) == page.tags.count("figure") > 8
    assert {kind for kind, _ in page.scripts} == {None, "application/json"}
    assert not [text for kind, text in page.scripts if kind == "application/json" and "<" in text]
    for name in studies.HOSTILE:
        assert name in page.cells
    # the template engine has not filled in what a name asks for
    assert "</b> 49" not in "".join([*page.cells, *page.text, *data_texts(data)])
    # a name that had ended its element would have left one of these behind
    assert page.tags.count("b") == 0


def data_texts(data: list[dict]) -> list[str]:
    return [json.dumps(one, ensure_ascii=False) for one in data]


def test_every_figure_has_its_place_and_a_caption_that_can_be_found(page):
    ids = [value for tag, name, value in page.attributes if (tag, name) == ("div", "id")]
    sources = [value for tag, name, value in page.attributes if (tag, name) == ("script", "id")]
    assert sources == [f"{place}-data" for place in ids]
    text = "".join(page.text)
    assert "Z: " in text
    assert f"against {number_text(studies.small().proof.baselines_um['Z']['none'])} µm without compensation" in text
    for kind, source in page.scripts:
        if kind == "application/json":
            assert "title" not in json.loads(source)["layout"]
            assert "width" not in json.loads(source)["layout"]


def test_all_that_is_known_is_in_the_tables(page):
    selection = studies.small()
    for combination in selection.combinations[:5]:
        assert ", ".join(combination.sensors) in page.cells
        assert f"{combination.adjusted_r2:.5f}" in page.cells
    for reason in selection.reasons.values():
        assert reason in page.cells
    for part in selection.proof.per_response["Z"]:
        assert part.name in page.cells
        assert number_text(part.max_um) in page.cells
    for entry in selection.provenance["runs"].values():
        assert entry["sha256"] in page.cells
    for cell in ("PT03", "°F", "gb18030", "time: column", "3 h 19 min", "Bench 6 (simulated)", "SHA-256"):
        assert cell in page.cells
    assert "2026-11-20" in "".join(page.text)


def test_a_report_says_which_file_and_not_where_it_is_kept(page):
    assert page.cells.count("day 1.csv") == 2  # as read, and with its hash
    assert "somewhere" not in "".join([*page.cells, *page.text])
    assert place_text(Where(file="C:\\data\\runs\\r1.csv", channel="T1")) == "r1.csv, T1"


def test_simulated_data_are_labelled(page):
    assert "Simulated data" in "".join(page.text)
    assert "Simulated data" not in selection_html(studies.single_run())


@pytest.mark.parametrize(
    ("provenance", "title", "label"),
    [
        ({"machine": "VMC (simulated)"}, "", "simulated"),
        ({"note": "a reconstruction of printed results"}, "", "reconstructed"),
        ({}, "Synthetic runs", "simulated"),
        ({"runs": {"r1": {"file": "simulation.csv"}}}, "", None),
        ({"machine": "VMC-850"}, "Simultaneous axes", None),
        ({"findings": [{"statement": "simulated"}]}, "", None),
    ],
)
def test_labels_of_data(provenance, title, label):
    assert label_of(title, provenance) == label


def test_the_same_results_give_the_same_bytes(tmp_path):
    again = studies.select(studies.recording(), studies.small().options, provenance=studies.small().provenance)
    first = write_report(studies.small(), tmp_path / "a.html", title="Study", description=DESCRIPTION)
    second = write_report([again], tmp_path / "b.html", title="Study", description=[DESCRIPTION])
    assert first.read_bytes() == second.read_bytes()
    assert first.stat().st_size < 8 * MEGABYTE


def test_several_studies_share_a_page(tmp_path):
    both = [studies.small(), studies.single_run()]
    path = write_report(both, tmp_path / "both.html", description=[DESCRIPTION, None])
    source = path.read_text(encoding="utf-8")
    page = Page(source)
    ids = [value for _, name, value in page.attributes if name == "id"]
    assert len(ids) == len(set(ids))
    links = [value[1:] for tag, name, value in page.attributes if (tag, name) == ("a", "href")]
    assert links
    assert set(links) <= set(ids)
    assert len([text for kind, text in page.scripts if kind is None]) == 2


def test_a_report_is_written_whole_or_not_at_all(tmp_path):
    folder = tmp_path / "report.html"
    folder.mkdir()
    with pytest.raises(OptionError):
        write_report(studies.small(), folder)
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


def test_the_formula_is_the_model():
    selection = studies.small()
    model = selection.models["Z"]
    text = formula_text(selection, "Z")
    assert text.startswith("Z = (")
    rng = np.random.default_rng(1)
    low, high = np.array(model.valid_range).T
    x = rng.uniform(low, high, (50, len(low)))
    terms, _, _ = model.physical()
    factors = [float(part.replace("−", "-")) for part in re.findall(r"\((−?[\d.]+) ± [\d.]+\)", text)]
    assert len(factors) == 1 + len(terms)
    columns = design_matrix(x, model.scaling.variables, terms)
    # four digits are printed, so that each part may be wrong by half of the fourth
    rounding = 5e-4 * (abs(factors[0]) + np.abs(columns) @ np.abs(factors[1:]))
    assert (np.abs(columns @ factors[1:] + factors[0] - model.predicted(x)) <= rounding).all()
    assert [row[2] for row in coefficient_rows(selection, "Z")][:2] == ["µm", "µm/K"]


def test_lags_and_readings_are_named_as_such():
    selection = studies.select(
        studies.recording(4, 4, 200, slow=True),
        studies.Options(responses=("Y",), memory=True, reference="absolute", max_sensors=1),
    )
    text = formula_text(selection, "Y")
    assert "Δ" not in text
    assert selection.recipe.design.lags
    assert "lag(" in text
    assert "Y error falls" in advice(selection)[1][0]
    assert "[°C], lagged with" in "".join(Page(selection_html(selection)).text)


def test_of_many_runs_the_worst_are_drawn():
    selection = studies.select(studies.recording(4, 14, 60), studies.Options(responses=("Z",), max_sensors=2))
    page = Page(selection_html(selection))
    text = "".join(page.text)
    assert "12 of 14 are drawn" in text
    drawn = "".join(source for kind, source in page.scripts if kind == "application/json" and '"residual"' in source)
    parts = sorted(selection.proof.per_response["Z"], key=lambda part: -part.rmse_um)
    assert all(f"{part.name}\\u003c/b\\u003e" in drawn for part in parts[:6])


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [
        (-83.64, 3, "−83.6"),
        (9.9996, 3, "10.0"),
        (0.0, 3, "0"),
        (None, 3, "–"),
        (float("inf"), 3, "–"),
        (226.4, 2, "226"),
        (1.5e-7, 3, "1.50·10⁻⁷"),
    ],
)
def test_numbers(value, digits, text):
    assert number_text(value, digits) == text


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (6.04762, 0.0312, "6.048 ± 0.031"),
        (-1.871, 0.12, "−1.871 ± 0.12"),
        (1234.5, 67.8, "1234 ± 68"),
        (0.0, 0.5, "0.00 ± 0.50"),
        (2.5, 0.0, "2.500"),
        (1.2345e-5, 6.7e-7, "(1.234 ± 0.067)·10⁻⁵"),
        (float("nan"), 1.0, "–"),
    ],
)
def test_values_with_their_errors(value, error, text):
    assert uncertain_text(value, error) == text


@pytest.mark.parametrize(
    ("value", "error", "text"),
    [
        (-0.5908, 0.204, "−0.59 ± 0.20"),
        (6.04762, 0.0312, "6.048 ± 0.031"),
        (0.0559, 0.076, "0.056 ± 0.076"),
        (1234.5, 67.8, "1234 ± 68"),
        (-1.868e-4, 4.4e-5, "(−1.87 ± 0.44)·10⁻⁴"),
        (-0.0087, 0.28, "−0.01 ± 0.28"),
        (-0.001, 0.28, "0.00 ± 0.28"),
    ],
)
def test_coefficients_have_no_more_digits_than_their_errors(value, error, text):
    assert uncertain_text(value, error, least=0) == text


def test_small_values_beside_large_ones_have_their_decimals():
    told = [(-0.0441, 0.773), (-0.0389, 17.0), (0.249, 13.8), (12.3, 12.3), (float("nan"), 1.0), (0.0, 0.0)]
    assert [beside_text(*pair) for pair in told] == ["−0.044", "0.0", "0.2", "12.3", "–", "0"]


def test_given_numbers_have_no_empty_digits():
    given = [0.9950, 20.0, -0.0053, 1.5e-7, 6.9459612e-5, 123456.0]
    assert [given_text(v) for v in given] == ["0.995", "20", "−0.0053", "1.5·10⁻⁷", "6.94596·10⁻⁵", "123456"]


def test_a_probability_too_small_to_be_computed_is_not_nothing():
    assert [p_text(p) for p in (0.0, 4.5e-17, 0.0321, float("nan"))] == ["below 10⁻³⁰⁰", "4.5·10⁻¹⁷", "0.032", "–"]


def test_the_table_of_coefficients_has_the_digits_of_their_errors():
    for name in ("Z", "Y"):
        for _, text, _, _ in coefficient_rows(studies.small(), name):
            value, error = re.findall(r"[\d.]+", text.replace("10⁻", ""))[:2]
            assert len(value.partition(".")[2]) == len(error.partition(".")[2])


def test_options_have_no_empty_digits():
    selection = studies.select(studies.recording(4, 4, 120), studies.Options(level=(0.995,), tolerance=0.001))
    cells = Page(selection_html(selection)).cells
    assert {"0.995", "0.001"} <= set(cells)


def test_places_and_spans():
    assert place_text(Where(channel="T1", run="r1", from_s=5400.0)) == "r1, T1, from 1 h 30 min"
    assert place_text(Where()) == ""
    told = [span_text(t) for t in (5.0, 90.0, 1800.0, 3600.0, 7000.0, None)]
    assert told == ["5 s", "1.5 min", "30 min", "1 h", "1 h 57 min", "–"]
