"""What pages show at this moment without a command: work in a thread, and the λ or the set that is looked at."""

import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

from selector.errors import InputError
from selector.findings import Finding
from selector.models.least_squares import FaultGain
from selector.quality import bridged, without_faults
from selector.recording import Recording
from selector.selection import Exploration, Options
from selector.selection.exploration import Cut, FixedSet, plain_level
from selector.workbench.access import defect
from selector.workbench.readable import Inspection

_Made = TypeVar("_Made")


class Latest(Generic[_Made]):
    """Work that is done in a thread, one after the other; of what is asked meanwhile only the last counts.

    `on_ready` is called when what was asked for last is there, or cannot be made.
    """

    def __init__(self, on_ready: Callable[[], None]) -> None:
        self._on_ready = on_ready
        self._lock = threading.Lock()
        self._asked: object = None
        self._work: Callable[[], _Made] | None = None
        self.is_working = False  #: Whether something is being made
        self._made: _Made | None = None
        self._problem: InputError | None = None

    def of(self, asked: object, work: Callable[[], _Made]) -> _Made | None:
        """What `work` makes of what is `asked`; None: it is being made. Raises InputError: it cannot be made."""
        with self._lock:
            if asked != self._asked:
                self._asked, self._work, self._made, self._problem = asked, work, None, None
                if not self.is_working:
                    self.is_working = True
                    threading.Thread(target=self._make, name="selector-live", daemon=True).start()
            if self._problem is not None:
                raise self._problem.with_traceback(None)
            return self._made

    def _make(self) -> None:
        while True:
            with self._lock:
                asked, work, self._work = self._asked, self._work, None
                if work is None:
                    self.is_working = False
                    return
            made, problem = None, None
            try:
                made = work()
            except InputError as refused:
                problem = refused
            except Exception as error:  # the page must not wait for ever
                problem = defect("work for a page", error)
            with self._lock:
                is_wanted = asked == self._asked
                if is_wanted:
                    self._made, self._problem = made, problem
            if is_wanted:
                self._on_ready()


@dataclass(frozen=True)
class View:
    """One look at a study."""

    exploration: Exploration
    level: float  #: λ, as it was typed, or with the fewest digits that give this cut
    cut: Cut
    fixed: FixedSet  #: The set that is shown: of the cut, or one that was taken by hand
    is_taken: bool  #: Whether it was taken by hand
    response: str
    target_um: float | None = None  #: The error that is to be reached
    looks: int = 0  #: How often it had been looked elsewhere before

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
    """The exploration of the recordings on the bench; it is made in a thread, and kept until they change."""

    def __init__(self, on_ready: Callable[[], None]) -> None:
        self._lock = threading.RLock()
        self.latest: Latest[Exploration] = Latest(on_ready)  #: Makes the exploration
        self._as_wished: tuple[Exploration, Exploration] | None = None
        self._level: float | None = None
        self._taken: tuple[str, ...] = ()
        self._response: str | None = None
        self._looks = 0

    def exploration(self, inspection: Inspection, options: Options) -> Exploration | None:
        """The exploration of these recordings with these wishes; None: it is being made, or there is nothing to read.

        Raises InputError: the recordings cannot be explored, or the wishes cannot be had.
        """
        if (reading := inspection.reading) is None:
            return None
        similarity = (options.reference, options.absolute_similarity, tuple(options.conditions.items()))
        plain = replace(options, must=(), never=(), cost={})
        asked = (inspection.number, options.responses, *similarity)
        made = self.latest.of(asked, lambda: _explored(reading.recording, plain, inspection.findings))
        if made is None:
            return None
        with self._lock:
            first, found = self._as_wished or (made, made)
            found = found if first is made else made
            now = found.question.options
            wishes = (options.must, options.never, dict(options.cost), options.max_sensors)
            if wishes != (now.must, now.never, dict(now.cost), now.max_sensors):
                found = found.asking(options)
            self._as_wished = made, found
            return found

    def view(self, exploration: Exploration, options: Options | None = None) -> View:
        """What is looked at now; the first time at the λ of the options."""
        asked = options or Options()
        with self._lock:
            responses = exploration.question.responses
            response = self._response if self._response in responses else responses[0]
            level = self._level
            if level is None:
                chosen = exploration.axis.at(exploration.grouping.chosen.level)
                level = asked.level if isinstance(asked.level, float) else plain_level(chosen)
            cut = exploration.cut(level)
            taken = tuple(name for name in self._taken if name in exploration.available)
            fixed = exploration.fixed(taken or cut.taken)
            return View(exploration, level, cut, fixed, bool(taken), response, asked.target, self._looks)

    def asked(self, options: Options) -> Options:
        """What a selection of what is looked at now asks; the options where nothing is."""
        found = self._as_wished
        return options if found is None else self.view(found[1], options).options(options)

    def look_at(
        self, *, level: float | None = None, taken: Sequence[str] | None = None, response: str | None = None
    ) -> None:
        """Looks at another λ (which lets a taken set go), another set (none: that of the cut), another displacement."""
        with self._lock:
            self._looks += 1
            if level is not None:
                self._level, self._taken = level, ()
            if taken is not None:
                self._taken = tuple(taken)
            if response is not None:
                self._response = response


def _explored(raw: Recording, options: Options, faults: Sequence[Finding]) -> Exploration:
    found = Exploration.of(bridged(without_faults(raw, faults), raw)[0], options)
    # the first search loads its compiled kernels
    found.cut(found.grouping.chosen.level)
    return found
