"""What a case of the blind proof is: recordings and a simulation on one side, the sealed truth on the other."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

from selector.recording import Recording

Kind = Literal["single", "several", "clean", "miscalibrated", "data", "out-of-catalogue", "undecidable", "decoy"]


@dataclass(frozen=True)
class Window:
    """A stretch of a run in which an effect acts [s from its start]."""

    run: str
    from_s: float
    to_s: float


@dataclass(frozen=True)
class TrueEffect:
    """One concealed effect and what counts as right.

    Attributes
    ----------
    id : str
        What was put in; of the catalogue, or ``"hidden.…"``.
    accept : tuple of str
        Ids that are right.
    channels : tuple of str
        Responses in which it shows.
    place : str or None
    windows : tuple of Window
        When it acts, where that is not always.
    """

    id: str
    accept: tuple[str, ...]
    channels: tuple[str, ...]
    place: str | None = None
    windows: tuple[Window, ...] = ()


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
    """The sealed answer of a case.

    Attributes
    ----------
    verdicts : tuple of str
        Verdicts that are right.
    effects : tuple of TrueEffect
        What was put in.
    tolerated : tuple of str
        Ids that may stand in the answer without being counted for or against it.
    d_prime : float or None
        Norm of the whitened effect in the fitted rows, recalibration projected off, all responses together; of several
        effects that of the least clear one, the courses of the others projected off as well.
    concealed : tuple of Concealment
    held_out : mapping of str to HeldOut
        Response → errors; empty where the fit is not scored.
    """

    verdicts: tuple[str, ...]
    effects: tuple[TrueEffect, ...] = ()
    tolerated: tuple[str, ...] = ()
    d_prime: float | None = None
    concealed: tuple[Concealment, ...] = ()
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
