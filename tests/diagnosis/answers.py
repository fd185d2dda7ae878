"""Answers made by hand, one of each verdict, on a small comparison."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from selector.diagnosis.answer import Detectable, Diagnosis, Errors, Evidence, Fit, NamedEffect, NextRun, Place, Verdict
from selector.diagnosis.effects.effect import Quantity
from selector.findings import Finding, Where
from tests.diagnosis.made import coloured, comparison, door

N = 300
END_S = (N - 1) * 30.0


def memory_effect(course, names=("Z", "Y"), **changes) -> NamedEffect:
    made = NamedEffect(
        id="thermal.memory",
        channel=names[0],
        place="column",
        statement="Z follows T1 41 min late, worth 12 µm.",
        parameters={"tau_s": Quantity(2460.0, "s", 2100.0, 2900.0), "size_um": Quantity(12.0, "um")},
        confidence=0.97,
        p_value=2e-5,
        share=0.8,
        cannot_be_told_from=(),
        experiment="Heat for 4 h, then let it cool for 6 h.",
        channels=names,
        courses={names[0]: course, names[1]: 0.3 * course},
    )
    return replace(made, **changes)


def zero_effect(course) -> NamedEffect:
    return memory_effect(
        course,
        id="data.zero",
        place=None,
        statement="Z is recorded 3.65 µm too low in run r3.",
        parameters={"offset_um": Quantity(-3.65, "um", -3.9, -3.4)},
        channels=("Z",),
        courses={"Z": course},
        is_fitted=True,
        experiment="Read the reference point before and after every run.",
    )


def answer(verdict: Verdict = "missing-physics", names=("Z", "Y"), **changes) -> Diagnosis:
    """A diagnosis of this verdict with these two responses, with every part that it can have."""
    first, second = names
    rng = np.random.default_rng(4)
    course = 6.0 * np.concatenate(
        [door(N, ((60, 200),), 0.97), door(N, ((100, 240),), 0.97), door(N, ((30, 170),), 0.97)]
    )
    of = comparison({first: course + coloured("ar", 3 * N, rng), second: 0.3 * course + coloured("white", 3 * N, rng)})
    is_found = verdict in ("missing-physics", "data-fault")
    fit = {}
    for name, part in ((first, 1.0), (second, 0.3)):
        before = of.simulated[name]
        after = before + (part * course if is_found else 0.0)
        rmse = [float(np.sqrt(np.mean((of.recorded[name] - x)[of.held_out] ** 2))) for x in (before, after)]
        fit[name] = Fit(
            unit="um",
            train=Errors(*rmse, 1.0),
            heldout=Errors(*rmse, 1.0),
            recalibrated_heldout=0.9 * rmse[0],
            gap_closed=Quantity(0.91, "1", 0.8, 0.97) if is_found else None,
            placebo_gain=Quantity(0.01, "1", -0.02, 0.03) if is_found else None,
            before=before,
            recalibrated=before + 0.1,
            after=after,
        )
    effects = {"missing-physics": (memory_effect(course, names),), "data-fault": (zero_effect(course),)}.get(
        verdict, ()
    )
    windows = (("r1", 1800.0, 7000.0, 0.4), ("r2", 3000.0, 8000.0, 0.35), ("r3", 900.0, 6000.0, 0.25))
    places = tuple(Place(first, None, run, a, b, "spindle_speed > 1500 rpm", share) for run, a, b, share in windows)
    made = Diagnosis(
        comparison=of,
        verdict=verdict,
        headline="",
        where=places if is_found or verdict == "unexplained" else (),
        effects=effects,
        fit=fit,
        evidence=(
            Evidence("thermal.memory", first, 212.0, 1e-6, is_found, ""),
            Evidence("thermal.ambient", first, 31.0, 0.2, False, "no gain on rows that were not fitted"),
            Evidence("thermal.convection", second, 4.0, 0.7, False, ""),
            Evidence("drive.coulomb", first, 0.0, 1.0, False, "not testable here: no velocity is recorded"),
        ),
        detectable=(
            Detectable("thermal.ambient", first, 0.8, "um", 0.9),
            Detectable("data.clock", second, 0.3, "um", 0.9),
        ),
        next_runs=(NextRun("Heat for 4 h, then cool for 6 h", ("thermal.memory", "thermal.ambient"), 0.9, 36000.0),)
        if is_found
        else (),
        recalibration={first: {"offset": Quantity(3.1, "um", 2.9, 3.3), "gain": Quantity(1.01, "1", 0.98, 1.04)}},
        findings=(Finding("slow-clock", "warning", "The clock is slow.", Where(run="r1")),),
        seed=0,
    )
    return replace(made, **changes)
