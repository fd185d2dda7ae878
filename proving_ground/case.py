"""What a case of the blind proof is, how its truth is kept apart, and what could be reached at best."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import chi2, ncx2

from selector.diagnosis.open_model.runnable import Runnable
from selector.recording import Recording
from selector.types import Vector

Kind = Literal["single", "several", "clean", "miscalibrated", "data", "out-of-catalogue", "undecidable", "decoy"]


@dataclass(frozen=True)
class Window:
    """A stretch of a run in which an effect acts [s from its start]."""

    run: str
    from_s: float
    to_s: float


@dataclass(frozen=True)
class TrueEffect:
    """One concealed effect and what counts as right."""

    id: str  #: What was put in; of the catalogue, or ``"hidden.…"``
    accept: tuple[str, ...]  #: Ids that are right
    channels: tuple[str, ...]  #: Responses in which it shows
    place: str | None = None
    windows: tuple[Window, ...] = ()  #: When it acts, where that is not always


@dataclass(frozen=True)
class Concealment:
    """One way in which the effect is hidden, the number that shows it, and the limit that it keeps."""

    kind: str
    measured: float
    limit: float
    holds: bool


@dataclass(frozen=True)
class HeldOut:
    """Held-out RMS errors of one response [its unit]: as given, recalibrated, by the oracle, noise alone."""

    before: float
    recalibrated: float
    oracle: float
    noise_floor: float


@dataclass(frozen=True)
class Truth:
    """The sealed answer of a case."""

    verdicts: tuple[str, ...]  #: Verdicts that are right
    effects: tuple[TrueEffect, ...] = ()  #: What was put in
    tolerated: tuple[str, ...] = ()  #: Ids that may stand in the answer without being counted for or against it
    #: Norm of the whitened effect in the fitted rows, recalibration projected off, all responses together; of several
    #: effects that of the least clear one, the courses of the others projected off as well
    d_prime: float | None = None
    concealed: tuple[Concealment, ...] = ()
    #: Response → errors; empty where the fit is not scored
    held_out: Mapping[str, HeldOut] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Case:
    """What the tool is given: recordings of runs, and a simulation of the same runs under the same channel names."""

    name: str
    family: str
    kind: Kind
    recording: Recording
    simulation: Recording
    responses: tuple[str, ...]
    truth: Truth
    model: Runnable | None = None  #: What made the simulation, where it can be run again
    #: (channel → course, its period [s], seed) -> Case: The same case with one more run, in which these channels are as
    #: told, in front of the last one, which is held out; ValueError if one cannot be set
    with_run: Callable[[Mapping[str, Vector], float, int], Case] | None = None


@dataclass(frozen=True)
class Scenario:
    """A kind of case, e.g. ``"thermal.memory/static"``, and the machine that makes one from a seed and a strength.

    `build` (seed, d_prime) gives a case; `d_prime` is None where there is no strength to choose (clean cases).
    `has_strength` and `has_seeds` are false where a real recording leaves no choice: it is then built once.
    """

    name: str
    family: str
    kind: Kind
    build: Callable[[int, float | None], Case]
    note: str = ""
    has_strength: bool = True
    has_seeds: bool = True


def sealed_text(answers: Mapping[str, Mapping[str, Any]]) -> str:
    """Answers by case as canonical JSON: sorted keys, so that equal answers have equal bytes and equal hashes."""

    def plain(value: np.generic) -> Any:
        return value.item()

    return json.dumps(answers, sort_keys=True, ensure_ascii=False, allow_nan=False, indent=1, default=plain) + "\n"


def sha256_of_text(text: str) -> str:
    """SHA-256 of a text in UTF-8."""
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


def sealed_sha256_of_case(case: Case) -> str:
    """SHA-256 of everything a case consists of: recordings, simulation, truth.

    It shows afterwards that neither data nor answers were changed once the hash was known. Numbers enter with all
    their bits, so that it also shows whether two machines make the same cases.
    """
    digest = hashlib.sha256()
    digest.update(
        sealed_text({case.name: {"truth": dataclasses.asdict(case.truth), "responses": list(case.responses)}}).encode()
    )
    for recording in (case.recording, case.simulation):
        _update(digest, recording)
    return digest.hexdigest()


def seal_of(seals: Iterable[str]) -> str:
    """One hash for many cases, whatever their order."""
    return sha256_of_text("\n".join(sorted(set(seals))))


def _update(digest: Any, recording: Recording) -> None:
    for channel in recording.channels:
        digest.update(repr(channel).encode())
    for run in recording.runs:
        digest.update(run.encode())
        for values in (recording.time_s(run), recording.values(run, recording.names)):
            digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())


def detection_probability(d_prime: ArrayLike, *, false_alarm: float = 0.01, n_looks: int = 1) -> NDArray[np.float64]:
    """Chance that a matched filter finds an effect of unknown size and sign.

    The squared statistic of the filter is χ² with one degree of freedom, non-central by d′² where the effect is there
    (S. M. Kay, Fundamentals of Statistical Signal Processing II, 1998, section 7.4.2). The false alarm is that of all
    `n_looks` together: effects that are tried, each with its own course (Bonferroni).
    """
    threshold = chi2.isf(false_alarm / n_looks, 1)
    return np.asarray(ncx2.sf(threshold, 1, np.square(np.asarray(d_prime, dtype=np.float64))))
