"""How are cases handed out: folders of recordings and simulations that name nothing, and their answers apart."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from selector.proof.case import Case
from selector.proof.runner import Question, spans
from selector.proof.sealing import sealed_sha256_of_case, sealed_text, sha256_of_text, truth_as_dict
from selector.readers.writing import run_files, write_recording

ANSWERS, HASH, CASES = "answers.json", "answers.sha256", "cases"


def write_bundles(
    questions: Sequence[Question], folder: Path, *, progress: Callable[[float, float, str], None] | None = None
) -> str:
    """Write every case as ``cases/case-001/`` (runs, machine.toml, sim/) and all truths as answers.json beside them.

    The numbers are dealt out at random (always the same for the same questions), so that a folder's name tells
    nothing. Returns the SHA-256 of answers.json, which stands in answers.sha256 too: that can be published, and
    answers.json be kept away, before anybody answers.
    """
    order = np.random.default_rng(len(questions)).permutation(len(questions))
    answers: dict[str, dict[str, Any]] = {}
    width = max(3, len(str(len(questions))))
    for place, number in enumerate(order):
        question = questions[number]
        case = question.scenario.build(question.seed, question.d_prime)
        name = f"case-{place + 1:0{width}d}"
        write_case(case, folder / CASES / name)
        answers[name] = {
            "name": case.name,
            "family": case.family,
            "kind": case.kind,
            "responses": list(case.responses),
            "seed": question.seed,
            "d_prime_asked": question.d_prime,
            "spans_s": {run: list(span) for run, span in spans(case.recording).items()},
            "seal": sealed_sha256_of_case(case),
            "truth": truth_as_dict(case.truth),
        }
        if progress is not None:
            progress(place + 1, len(questions), name)
    text = sealed_text(answers)
    (folder / ANSWERS).write_text(text, encoding="utf-8", newline="\n")
    sealed = sha256_of_text(text)
    (folder / HASH).write_text(f"{sealed}  {ANSWERS}\n", encoding="utf-8", newline="\n")
    return sealed


def write_case(case: Case, folder: Path) -> None:
    """Write one case as `selector diagnose` reads it: a file a run, machine.toml, and sim/ with a file a run."""
    sim = folder / "sim"
    sim.mkdir(parents=True)
    write_recording(case.recording, run_files(case.recording.runs, folder, "csv"), folder / "machine.toml", "machine")
    write_recording(case.simulation, run_files(case.simulation.runs, sim, "csv"), sim / "machine.toml")
    # the simulation is read with the machine file of the recordings
    (sim / "machine.toml").unlink()


def read_answers(path: Path) -> dict[str, dict[str, Any]]:
    """The sealed answers as they were written: case → name, kind, responses, truth, …."""
    content: dict[str, dict[str, Any]] = json.loads(path.read_text(encoding="utf-8"))
    return content
