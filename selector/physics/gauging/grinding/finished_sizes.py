"""Which sizes come out of a batch: many parts by Monte Carlo, each with its own noise, feed, wear and surface."""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError
from selector.findings import Finding
from selector.physics.gauging.finding_table import FINDINGS
from selector.physics.gauging.grinding._part_kernel import AT_ONCE, COLUMNS, NEVER, grind
from selector.physics.gauging.grinding.gauged_grinding import GaugedGrinding
from selector.physics.gauging.grinding.part_plan import part_plan, steps_per_part
from selector.types import Vector

_CHUNK, _STEPS_OF_CHUNK = 64, 2_000_000
"""Parts between two looks at Ctrl-C and progress, and about how many steps they may take: a fraction of a second."""


@dataclass(frozen=True)
class FinishedSizes:
    """What became of the parts, in the order in which they were ground."""

    #: (n_parts,): Allowance that is left when the feed stands and the springs have relaxed [µm]; of a part whose
    #: threshold was never reached, where it was given up
    size_um: Vector
    duration_s: Vector  #: (n_parts,): Until the feed stands [s]
    stage_end_s: NDArray[np.float64]  #: (n_parts, n_stages): When each feed ended [s]; 0 where it did not
    tripped: NDArray[np.bool_]  #: (n_parts,): False where a threshold was never reached
    at_once: NDArray[np.bool_]  #: (n_parts,): True where a threshold was already passed when its stage began

    def __post_init__(self) -> None:
        for values in vars(self).values():
            values.flags.writeable = False

    @property
    def finished_um(self) -> Vector:
        """Sizes of the parts that the gauge has stopped [µm]."""
        return self.size_um[self.tripped]

    @property
    def mean_um(self) -> float:
        """Of the parts that the gauge has stopped; InputError if there are none [µm]."""
        return float(np.mean(self._some(1)))

    @property
    def sd_um(self) -> float:
        """Standard deviation of those parts, with n − 1; of a single part 0 [µm]."""
        sizes = self._some(1)
        return float(np.std(sizes, ddof=1)) if len(sizes) > 1 else 0.0

    @property
    def mean_error_um(self) -> float:
        """Standard error of the mean [µm]."""
        return self.sd_um / math.sqrt(len(self._some(1)))

    @property
    def sd_error_um(self) -> float:
        """Standard error of the standard deviation, by the fourth moment: the sizes need not be normal [µm]."""
        sizes, sd = self._some(1), self.sd_um
        if sd == 0:
            return 0.0
        fourth = float(np.mean((sizes - sizes.mean()) ** 4))
        return math.sqrt(max(fourth - sd**4, 0.0) / len(sizes)) / (2.0 * sd)

    def findings(self) -> tuple[Finding, ...]:
        """Parts that no threshold stopped, and parts at which a stage had nothing to do."""
        found = []
        for name, concerned, statement in (
            ("threshold-never-reached", ~self.tripped, "never reached a threshold and were given up"),
            ("threshold-reached-at-once", self.at_once, "had passed a threshold already when its stage began"),
        ):
            count = int(concerned.sum())
            if count:
                evidence = {"parts": count, "of": len(self.size_um), "first_part": int(np.argmax(concerned)) + 1}
                text = f"{count} of {len(self.size_um)} parts {statement}."
                found.append(FINDINGS.finding(name, text, evidence=evidence))
        return tuple(found)

    def _some(self, least: int) -> Vector:
        sizes = self.finished_um
        if len(sizes) < least:
            raise InputError(
                f"{len(sizes)} of {len(self.size_um)} parts reached their thresholds",
                expected=f"at least {least}",
                where="thresholds_v",
                advice="set the thresholds within what the gauge shows; without sizes there is no mean or spread",
            )
        return sizes


def finished_sizes(
    setup: GaugedGrinding,
    parts: int,
    *,
    seed: int = 0,
    steps: int | None = None,
    threads: int = 1,
    progress: Callable[[int, int], None] | None = None,
) -> FinishedSizes:
    """Grinds `parts` parts one after the other and tells what became of them.

    The wheel is fresh and the probe unworn at the first. A part depends on seed and number alone, so that more parts or
    threads change none of them, and `part_course` shows the same. The relay compares all the time. Noise and filter
    go in exact steps, `steps` in T_Φ (None: as many as resolve 1/β, T_Φ, lag and run-out), crossings are located
    within them. `progress(done, parts)` is called now and then.

    Raises InputError for no parts, or more steps than can be waited for.
    """
    plan = part_plan(setup, parts, steps)
    seeds = part_seeds(seed, parts)
    numbers = np.arange(parts)
    size, duration, state = np.empty(parts), np.empty(parts), np.empty(parts, dtype=np.int64)
    ends = np.zeros((parts, len(plan.feed)))
    nothing = np.empty((0, COLUMNS))
    many = int(min(max(_STEPS_OF_CHUNK / steps_per_part(setup, steps), 1.0), _CHUNK))

    def chunk(first: int) -> None:
        own = slice(first, min(first + many, parts))
        grind(plan, numbers[own], seeds[own], size[own], duration[own], ends[own], state[own], nothing, 1.0)

    starts = range(0, parts, many)
    if threads > 1:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(chunk, starts))
    else:
        for first in starts:
            chunk(first)
            if progress is not None:
                progress(min(first + many, parts), parts)
    return FinishedSizes(size, duration, ends, state != NEVER, state == AT_ONCE)


def part_seeds(seed: int, parts: int) -> NDArray[np.uint32]:
    """A seed for every part; the first ones stay the same however many there are."""
    return np.asarray(np.random.SeedSequence(seed).generate_state(parts, np.uint32), dtype=np.uint32)
