"""How is the exam held: every scenario at every strength and seed, in parallel, and cases handed out as folders."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from proving_ground.case import Case, Scenario, Truth, sealed_sha256_of_case, sealed_text, sha256_of_text
from proving_ground.judging import FAILED, Judged, Stated, judged, stated
from selector.diagnosis.comparison import Comparison
from selector.errors import OptionError
from selector.readers.writing import run_files, write_recording
from selector.recording import Recording

DEVELOPMENT_SEEDS = range(0, 1000)
EXAM_SEEDS = range(10_000, 1_000_000)
STRENGTHS = (3.0, 6.0, 12.0)
TOOL = "selector"
_WITHOUT_STRENGTH = ("clean", "miscalibrated")


@dataclass(frozen=True)
class Question:
    """A case before it is built: the scenario, the strength asked for (None: there is none to choose), the seed."""

    scenario: Scenario
    d_prime: float | None
    seed: int


@dataclass(frozen=True)
class Answerer:
    """Who sits the exam: a name, and what gives the JSON form of an answer to a comparison and a seed."""

    name: str
    answer: Callable[[Comparison, int], Mapping[str, Any]]


@dataclass(frozen=True)
class Outcome:
    """One case, answered by one answerer and judged."""

    scenario: str
    family: str
    kind: str
    d_prime_asked: float | None
    seed: int
    answerer: str
    truth: Truth | None  #: None where the case could not be built
    stated: Stated
    judged: Judged
    seconds: float  #: Wall time of the answer alone [s], one thread
    seal: str = ""  #: SHA-256 of the case's data and truth
    responses: tuple[str, ...] = ()

    @property
    def failed(self) -> bool:
        """Whether the case could not be built or not be answered."""
        return self.stated.verdict == FAILED


def questions(
    scenarios: Sequence[Scenario], strengths: Sequence[float] = STRENGTHS, seeds: Sequence[int] = range(5)
) -> tuple[Question, ...]:
    """Scenarios × strengths × seeds; those without a strength to choose are asked once a seed."""
    found = []
    for scenario in scenarios:
        has_strength = scenario.has_strength and scenario.kind not in _WITHOUT_STRENGTH
        for seed in seeds if scenario.has_seeds else seeds[:1]:
            found += [Question(scenario, d_prime, seed) for d_prime in (strengths if has_strength else (None,))]
    return tuple(found)


def require_seeds(seeds: Sequence[int], *, is_exam: bool) -> None:
    """Development and exam keep apart.

    Raises OptionError if a seed is of the other range, or of none.
    """
    allowed = EXAM_SEEDS if is_exam else DEVELOPMENT_SEEDS
    wrong = [seed for seed in seeds if seed not in allowed]
    if wrong or not seeds:
        raise OptionError(
            f"seed {wrong[0]}" if wrong else "no seed",
            expected=f"seeds from {allowed.start} to {allowed.stop - 1} for {'the exam' if is_exam else 'development'}",
            where="--seeds",
            advice="leave --exam out" if is_exam else "seeds from 10000 are kept for --exam",
        )


def answer_of_selector(comparison: Comparison, seed: int) -> Mapping[str, Any]:
    """What this program says, in the JSON form of the contract."""
    from selector.diagnosis.workflow import diagnosis

    return diagnosis(comparison, seed=seed).as_dict()


def outcomes(
    asked: Sequence[Question],
    answerers: Sequence[Answerer] = (),
    *,
    n_jobs: int = 1,
    progress: Callable[[int, int, Outcome], None] | None = None,
) -> tuple[Outcome, ...]:
    """Hold the exam: one outcome for every question and answerer (none: this program), in the order of the questions.

    The outcomes but for their `seconds` are the same for every number of processes (`n_jobs`; 1 = this one): a case
    depends on nothing but its question. A case that raises is an outcome with the verdict `FAILED`. Only judged
    outcomes come back from the processes, so that memory does not grow with their number. `progress` is called after
    every outcome, in the order in which they are ready: done, total, outcome.

    Raises OptionError if the system ends one of the processes.
    """
    results: dict[int, tuple[Outcome, ...]] = {}
    answerers = answerers or (Answerer(TOOL, answer_of_selector),)
    total, done = len(asked) * len(answerers), 0
    for number, answered in _answered(asked, answerers, n_jobs):
        results[number] = answered
        for outcome in answered:
            done += 1
            if progress is not None:
                progress(done, total, outcome)
    return tuple(outcome for number in sorted(results) for outcome in results[number])


def _answered(
    asked: Sequence[Question], answerers: Sequence[Answerer], n_jobs: int
) -> Iterator[tuple[int, tuple[Outcome, ...]]]:
    if n_jobs <= 1 or len(asked) < 2:
        for number, question in enumerate(asked):
            yield _case(number, question, answerers)
        return
    from joblib import Parallel, delayed
    from joblib.externals.loky.process_executor import TerminatedWorkerError

    work = Parallel(
        n_jobs=n_jobs, backend="loky", return_as="generator_unordered", batch_size=1, pre_dispatch="2*n_jobs"
    )
    cases = work(delayed(_case)(number, question, answerers) for number, question in enumerate(asked))
    try:
        yield from cases
    except TerminatedWorkerError as error:
        raise OptionError(
            "the system has ended one of the processes, most often because memory ran out",
            expected=f"memory for {n_jobs} cases at a time",
            where=f"--jobs {n_jobs}",
            advice="use fewer processes",
        ) from error


def _case(number: int, question: Question, answerers: Sequence[Answerer]) -> tuple[int, tuple[Outcome, ...]]:
    with threadpool_limits(1):
        try:
            case = question.scenario.build(question.seed, question.d_prime)
            seal = sealed_sha256_of_case(case)
        except Exception as error:
            said = Stated(FAILED, error="the case could not be built: " + _text(error))
            scenario, unjudged = question.scenario, Judged(verdict_right=False)
            about = (scenario.name, scenario.family, scenario.kind, question.d_prime, question.seed)
            return number, tuple(Outcome(*about, one.name, None, said, unjudged, seconds=0.0) for one in answerers)
        return number, tuple(_outcome(question, case, seal, one) for one in answerers)


def _outcome(question: Question, case: Case, seal: str, answerer: Answerer) -> Outcome:
    started = time.perf_counter()
    try:
        said = stated(_answer(case, answerer, question.seed))
    except Exception as error:
        said = Stated(FAILED, error=_text(error))
    seconds = time.perf_counter() - started
    verdict = judged(said, case.truth, spans(case.recording))
    about = (case.name, case.family, case.kind, question.d_prime, question.seed)
    return Outcome(*about, answerer.name, case.truth, said, verdict, seconds, seal, case.responses)


def _answer(case: Case, answerer: Answerer, seed: int) -> Mapping[str, Any]:
    """A model that can be run again is given to this program; others see what it simulates as it is."""
    if case.model is None or answerer.name != TOOL:
        return answerer.answer(blind(case), seed)
    from selector.diagnosis.open_model.modelled import diagnosis_of_model

    return diagnosis_of_model(case.model, case.recording, responses=case.responses, seed=seed).answer.as_dict()


def blind(case: Case) -> Comparison:
    """What an answerer sees: the recordings and the simulation, nothing of the truth."""
    from selector.diagnosis.matching.alignment import comparison_of

    return comparison_of(case.recording, case.simulation, responses=case.responses)


def spans(recording: Recording) -> dict[str, tuple[float, float]]:
    """First and last time of every run [s]."""
    return {run: (float(recording.time_s(run)[0]), float(recording.time_s(run)[-1])) for run in recording.runs}


def _text(error: Exception) -> str:
    """What was raised and where, without the paths of this machine."""
    frames = traceback.extract_tb(error.__traceback__)
    place = (
        f" ({frames[-1].name}, {frames[-1].filename.replace(chr(92), '/').split('/')[-1]}:{frames[-1].lineno})"
        if frames
        else ""
    )
    return f"{type(error).__name__}: {error}{place}"


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
            "truth": asdict(case.truth),
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
