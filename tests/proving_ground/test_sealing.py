"""Seals: equal cases have equal hashes, any change shows, and what is handed out names nothing."""

from __future__ import annotations

import dataclasses
import json

import numpy as np

from proving_ground.case import HeldOut, Truth, seal_of, sealed_sha256_of_case, sealed_text, sha256_of_text
from proving_ground.runner import questions, write_bundles
from selector.readers import Overrides, read
from tests.proving_ground.tiny_cases import CLEAN, DOOR, SINGLE


def test_the_same_seed_gives_the_same_seal():
    assert sealed_sha256_of_case(SINGLE.build(3, 6.0)) == sealed_sha256_of_case(SINGLE.build(3, 6.0))
    assert len({sealed_sha256_of_case(SINGLE.build(seed, 6.0)) for seed in range(5)}) == 5


def test_any_change_of_truth_or_data_changes_the_seal():
    case = SINGLE.build(3, 6.0)
    frame = case.recording.frame.copy()
    # the last bit of one sample
    frame.iloc[17, 1] = np.nextafter(frame.iloc[17, 1], np.inf)
    changed = [
        dataclasses.replace(case, truth=dataclasses.replace(case.truth, tolerated=("data.zero",))),
        dataclasses.replace(case, recording=case.recording.with_values(frame)),
        dataclasses.replace(case, simulation=case.recording),
    ]
    assert len({sealed_sha256_of_case(one) for one in (case, *changed)}) == 4


def test_seal_of_many_knows_no_order():
    assert seal_of(["a", "b"]) == seal_of(["b", "a"]) != seal_of(["a"])


def test_truth_survives_its_text():
    truth = Truth(("unexplained",), (DOOR,), d_prime=np.float64(6.0), held_out={"Z": HeldOut(4.0, 3.0, 2.0, 1.0)})
    back = json.loads(sealed_text({"case": dataclasses.asdict(truth)}))["case"]
    assert back["effects"][0]["windows"] == [{"run": "r1", "from_s": 0.0, "to_s": 3000.0}]
    assert back["held_out"]["Z"]["oracle"] == 2.0
    assert back["d_prime"] == 6.0


def test_bundles_are_read_back_bit_by_bit_and_name_nothing(tmp_path):
    asked = questions((SINGLE, CLEAN), (6.0,), range(2))
    sealed = write_bundles(asked, tmp_path)
    text = (tmp_path / "answers.json").read_text(encoding="utf-8")
    assert sealed == sha256_of_text(text)
    assert (tmp_path / "answers.sha256").read_text(encoding="utf-8").split() == [sealed, "answers.json"]
    answers = json.loads((tmp_path / "answers.json").read_text(encoding="utf-8"))
    assert sorted(answers) == ["case-001", "case-002", "case-003", "case-004"]
    assert {one["kind"] for one in answers.values()} == {"single", "clean"}
    for name, one in answers.items():
        folder = tmp_path / "cases" / name
        scenario = SINGLE if one["kind"] == "single" else CLEAN
        case = scenario.build(one["seed"], one["d_prime_asked"])
        recording = read(sorted(folder.glob("*.csv")), machine=folder / "machine.toml").recording
        simulation = read(
            sorted((folder / "sim").glob("*.csv")), machine=folder / "machine.toml", overrides=Overrides(partial=True)
        ).recording
        assert np.array_equal(recording.frame.to_numpy(), case.recording.frame.to_numpy())
        assert np.array_equal(simulation.frame.to_numpy(), case.simulation.frame.to_numpy())
        written = "".join(path.read_text(encoding="utf-8") for path in folder.rglob("*") if path.is_file())
        assert not any(word in written for word in ("tiny", "single", "clean", "instant_speed", "truth"))


def test_the_numbers_of_folders_are_dealt_out(tmp_path):
    """That 12 stand in the order of their questions by chance is 1 in 12!."""
    write_bundles(questions((SINGLE,), (6.0,), range(12)), tmp_path)
    answers = json.loads((tmp_path / "answers.json").read_text(encoding="utf-8"))
    assert [answers[name]["seed"] for name in sorted(answers)] != list(range(12))
