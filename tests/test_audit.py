"""The audit of the patent: every printed number, the four known contradictions, and no verdict without its ground."""

import csv
import json

import numpy as np
import pytest

from selector.audit import audit_patent, audit_table_text, checks
from selector.audit.checks import fewest_samples, r2_pair
from selector.errors import InputError
from selector.shipped import shipped


@pytest.fixture(scope="module")
def lines():
    return audit_patent()


def verdicts(lines, start):
    return [line.verdict for line in lines if line.item.startswith(start)]


def test_every_printed_entry_has_a_line(lines):
    assert len([line for line in lines if line.item.startswith("r(")]) == 28
    assert len([line for line in lines if line.item.startswith("t(")]) == 28
    assert verdicts(lines, "row ") == ["agrees independently"] * 8
    for model in (checks.Z_TWO_SENSORS, checks.Y_TWO_SENSORS, checks.Z_THREE_SENSORS, checks.Y_THREE_SENSORS):
        shown = [line.printed for line in lines if line.item.startswith(f"{model.name}:")]
        assert [text.replace("−", "-") for text in shown] == list(model.printed)
    for pair in checks.PAIRS:
        assert any(line.printed == f"{pair.r2:.4f}" for line in lines if line.item.startswith("R² of"))
        assert any(
            line.printed == f"{pair.adjusted_r2:.4f}" for line in lines if line.item.startswith("adjusted R² of")
        )


def test_known_contradictions(lines):
    assert verdicts(lines, "(a)") == ["contradicts"] * 3
    assert verdicts(lines, "(b)") == ["contradicts"]
    assert set(verdicts(lines, "(c)")) == {"contradicts"}
    (samples,) = [line for line in lines if line.item.startswith("(d)")]
    assert samples.ours == "m ≥ 19"
    by_item = {line.item: line for line in lines}
    assert by_item["(a) number of groups at λ = 0.995"].ours == "2 groups: {1,2,4,8} {3,5,6,7}"
    assert (
        "(0.9980, 0.9984] with 4 groups {1,4} {2,8} {3,6,7} {5}" in by_item["(a) λ at which 1, 3 and 5 are apart"].ours
    )
    assert by_item["Z, mean of the warm phase, compensated"].ours == "90.0–92.5 % less"


def test_closure_and_cut_agree_independently(lines):
    for start in ("t(", "row"):
        assert set(verdicts(lines, start)) == {"agrees independently"}, start


def test_what_the_reconstruction_was_solved_for_agrees_by_construction_only(lines):
    starts = ("r(", "R² of", "adjusted R² of", "Z, two", "Y, two", "Z, three", "Y, three")
    by_construction = [line for line in lines if line.verdict == "agrees by construction"]
    assert all(line.item.startswith(starts) for line in by_construction)
    assert [sum(line.item.startswith(start) for line in by_construction) for start in starts] == [28, 2, 2, 3, 3, 5, 7]


def test_numbers_that_can_both_hold_are_in_tension(lines):
    assert [line.item for line in lines if line.verdict == "in tension"] == [
        "both models of Z from the recording that gives both models of Y",
        "displacement at rest, all rises 0",
        "Z, mean of the warm phase, compensated",
        "Z, largest, with bearings that rise 6–10 K",
        "error after compensation against R² 0.9989",
        "Y, mean of the warm phase, against both gauges",
    ]


def test_slips_of_the_equations_are_told_with_what_holds(lines):
    (tenth,) = [line for line in lines if line.item.startswith("(c) eq. 10")]
    # eq. 11 with the samples as first index gives the printed model of Z
    assert tenth.ours.endswith("b = 6.0476, 2.6667")
    assert {f"(c) eq. {number}" for number in (1, 7, 10)} <= {line.item.split(":")[0] for line in lines}


def test_smallest_eigenvalue_is_the_known_one(lines):
    (line,) = [line for line in lines if line.item == "R is a correlation matrix"]
    assert line.ours == "smallest eigenvalue 7.0e-05"


def test_a_wrong_printed_entry_is_found(monkeypatch):
    closure = checks.CLOSURE.copy()
    closure[2, 6] = 0.9988
    monkeypatch.setattr(checks, "CLOSURE", closure)
    wrong = [line for line in checks.closure_lines() if line.verdict == "contradicts"]
    assert [(line.item, line.printed, line.ours) for line in wrong] == [
        ("t(3,7) and t(7,3)", "0.9988 and 0.9992", "0.9992")
    ]


def test_a_disturbed_recording_is_found(tmp_path, lines):
    source = shipped("patent8") / "recording.csv"
    with source.open(encoding="utf-8", newline="") as stream:
        rows = list(csv.DictReader(stream))
    for k, row in enumerate(rows):
        row["T5"] = str(float(row["T5"]) + 0.3 * (k % 2))
    path = tmp_path / "recording.csv"
    with path.open("w", encoding="utf-8", newline="") as stream:
        writer = csv.DictWriter(stream, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    changed = [a.item for a, b in zip(audit_patent(path), lines, strict=True) if a.verdict != b.verdict]
    assert {"r(1,5) and r(5,1)", "r(3,5) and r(5,3)", "Y, three sensors: ΔT5"} <= set(changed)
    assert not any(item.startswith(("t(", "Z, two")) for item in changed)


@pytest.mark.parametrize("pair", checks.PAIRS)
def test_fewest_samples_by_brute_force(pair):
    p = len(pair.sensors)
    exact = np.linspace(pair.r2 - 0.5e-4, pair.r2 + 0.5e-4, 20001)[1:-1]

    def possible(m):
        adjusted = 1 - (m - 1) / (m - p - 1) * (1 - exact)
        return (np.abs(adjusted - pair.adjusted_r2) < 0.5e-4).any()

    found = fewest_samples(pair, p)
    assert found == {2: 14, 3: 19}[p]
    assert possible(found)
    assert not any(possible(m) for m in range(p + 2, found))


def test_r2_pair_of_a_known_case():
    x = np.array([0.0, 1.0, 2.0, 3.0])
    # residuals ±1, orthogonal to 1 and x: SSE = 4, SST = 5 + 4
    r2, adjusted = r2_pair([x], x + np.array([1.0, -1.0, -1.0, 1.0]))
    assert r2 == pytest.approx(5 / 9, abs=1e-12)  # a few roundings
    assert adjusted == pytest.approx(1 - 3 / 2 * 4 / 9, abs=1e-12)


def test_values_are_data_and_text(lines):
    assert json.loads(json.dumps([line.as_dict() for line in lines]))[0]["section"] == "similarity matrix R"
    text = audit_table_text(lines)
    assert all(line.item in text for line in lines)
    assert f"{sum(line.verdict == 'contradicts' for line in lines)} contradicts" in text.splitlines()[-1]


def test_damaged_or_missing_reconstruction_says_what_to_do(tmp_path):
    with pytest.raises(InputError, match="patent8"):
        audit_patent(tmp_path / "absent.csv")
    (tmp_path / "bad.csv").write_text("T1,T2\n1,x\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"bad\.csv"):
        audit_patent(tmp_path / "bad.csv")
    with pytest.raises(InputError, match="patent8"):
        shipped("no-such-recording")
    with pytest.raises(InputError, match="fixtures/patent8"):
        shipped("../fixtures/patent8")
