"""What the Sensors page shows at this moment: the recordings added up once, the λ or the set that is looked at."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from selector.errors import InputError
from selector.findings import Finding
from selector.models.least_squares import FaultGain
from selector.quality import file_copies, without_faults
from selector.readers import Reading
from selector.selection import Exploration, Options
from selector.selection.exploration import Cut, FixedSet, plain_level


@dataclass(frozen=True)
class View:
    """One look at a study."""

    exploration: Exploration
    level: float  #: λ, as it was typed, or with the fewest digits that give this cut
    cut: Cut
    fixed: FixedSet  #: The set that is shown: of the cut, or one that was taken by hand
    is_taken: bool  #: Whether it was taken by hand
    response: str

    @property
    def step(self) -> int:
        """Number of the step of λ, from the coarsest groups (0) to the finest."""
        steps = self.exploration.steps
        return next(len(steps) - 1 - i for i, step in enumerate(steps) if step.high == self.cut.step.high)

    @property
    def faults(self) -> tuple[FaultGain, ...]:
        """What a fault of a sensor does to the displacement that is shown."""
        return tuple(one for one in self.fixed.faults if one.response == self.response)

    def options(self, asked: Options) -> Options:
        """What a selection must be asked to look only at what is shown here."""
        if not self.is_taken:
            return replace(asked, level=self.level, rounds=1)
        sensors = self.fixed.sensors
        never = tuple(name for name in asked.never if name not in sensors)
        return replace(asked, level=None, rounds=1, must=sensors, never=never, max_sensors=len(sensors))


class Live:
    """The exploration of the recordings on the bench; it is made in a thread, and kept until they change.

    `on_ready` is called when an exploration that was asked for is there, or cannot be made.
    """

    def __init__(self, on_ready: Callable[[], None]) -> None:
        self._on_ready = on_ready
        self._lock = threading.RLock()
        self._asked: tuple[object, ...] | None = None
        self._exploration: Exploration | None = None
        self._problem: InputError | None = None
        self._level: float | None = None
        self._taken: tuple[str, ...] = ()
        self._response: str | None = None

    def exploration(
        self, number: int, reading: Reading | None, options: Options, faults: Sequence[Finding] = ()
    ) -> Exploration | None:
        """The exploration of these recordings with these wishes; None: it is being made, or there is nothing to read.

        Each reading has another `number`; `faults` are left out.

        Raises InputError: the recordings cannot be explored, or the wishes cannot be had.
        """
        if reading is None:
            return None
        with self._lock:
            similarity = (options.reference, options.absolute_similarity, tuple(options.conditions.items()))
            asked = (number, options.responses, *similarity)
            if asked != self._asked:
                self._asked, self._exploration, self._problem = asked, None, None
                self._level, self._taken = None, ()
                plain = replace(options, must=(), never=(), cost={})
                work = (number, asked, reading, plain, faults)
                threading.Thread(target=self._explore, args=work, name="selector-explore", daemon=True).start()
                return None
            if self._problem is not None:
                raise self._problem
            found = self._exploration
            if found is None:
                return None
            wishes = (options.must, options.never, dict(options.cost), options.max_sensors)
            now = found.question.options
            if wishes != (now.must, now.never, dict(now.cost), now.max_sensors):
                found = self._exploration = found.asking(
                    must=options.must, never=options.never, cost=options.cost, max_sensors=options.max_sensors
                )
            return found

    def _explore(
        self, number: int, asked: tuple[object, ...], reading: Reading, options: Options, faults: Sequence[Finding]
    ) -> None:
        found: Exploration | None = None
        problem: InputError | None = None
        try:
            copies = tuple(file_copies({run.name: run.sha256 for run in reading.runs}))
            found = Exploration.of(without_faults(reading.recording, (*faults, *copies)), options)
            # the first search loads its compiled kernels
            found.cut(found.grouping.chosen.level)
        except InputError as refused:
            problem = refused
        except Exception as error:  # the page must not wait for ever
            problem = InputError(
                f"this is a defect of the workbench, not of your data: {type(error).__name__}: {error}",
                expected="",
                where=f"reading {number}",
                advice="report it; the Selection page works without this one",
            )
        with self._lock:
            if asked != self._asked:
                return
            self._exploration, self._problem = found, problem
        self._on_ready()

    def view(self, exploration: Exploration) -> View:
        """What is looked at now."""
        with self._lock:
            responses = exploration.question.responses
            response = self._response if self._response in responses else responses[0]
            level = self._level
            if level is None:
                chosen = exploration.axis.at(exploration.grouping.chosen.level)
                level = plain_level(chosen)
            cut = exploration.cut(level)
            taken = tuple(name for name in self._taken if name in exploration.available)
            fixed = exploration.fixed(taken or cut.taken)
            return View(exploration, level, cut, fixed, bool(taken), response)

    def look_at(
        self, *, level: float | None = None, taken: Sequence[str] | None = None, response: str | None = None
    ) -> None:
        """Looks at another λ (which lets a taken set go), another set (none: that of the cut), another displacement."""
        with self._lock:
            if level is not None:
                self._level, self._taken = level, ()
            if taken is not None:
                self._taken = tuple(taken)
            if response is not None:
                self._response = response
