"""What does a simulated vibration amount to: modes, where every line goes, expected amplitudes, errors left behind."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from selector.errors import InputError
from selector.findings import Finding
from selector.physics.vibration.chain.chain_error import ChainAccuracy, chain_accuracy
from selector.physics.vibration.finding_table import FINDINGS
from selector.physics.vibration.model_findings import chain_findings, height_findings, model_findings
from selector.physics.vibration.motion.final_motion import FinalMotions
from selector.physics.vibration.motion.periodic_error import KindHeight, PeriodicError, kind_heights, periodic_errors
from selector.physics.vibration.motion.realisations import (
    are_countable,
    mean_square,
    realisation_amounts,
    section_times,
    source_motion,
)
from selector.physics.vibration.structure.modes import StructureModes, structure_modes
from selector.physics.vibration.structure.source import Excitation, excitation
from selector.physics.vibration.vibration_model import FINALS, RELATIVE, VibrationModel, VibrationSimulation

_UM = 1e6
_JUDGED, _FEWEST_JUDGED = 2_000, 100
"""Frequencies at which every chain is judged, as many a decade everywhere; fewer where chains and members are many."""
_JUDGED_AT_ONCE = 20_000_000
"""Motions of members that are held meanwhile (320 MB)."""
_LOWEST_JUDGED_HZ = 1.0
_BEYOND = 2.0
"""Times the highest line, or the frequency at which the high chains begin: so far chains are judged."""


@dataclass(frozen=True)
class LineSummary:
    """One line of the excitation, and what comes of it at every final.

    Mappings have the keys "tool", "workpiece" and `RELATIVE`; amplitudes of one sinusoid [µm].
    """

    frequency_hz: float  #: [Hz]
    source: str
    shaft: str | None  #: Shaft that the line follows
    order: float | None  #: Periods per revolution of that shaft
    force_n: float  #: Amplitude of the force [N]
    motion_um: Mapping[str, float]  #: By the method of ``run.method``
    coupled_um: Mapping[str, float]  #: By the coupled structure
    #: By the chains; None where no chain of the line's range leads from its source to the final (of `RELATIVE`: to
    #: neither of both), so that the method has nothing to say
    chains_um: Mapping[str, float | None]


@dataclass(frozen=True)
class AmplitudeSummary:
    """Amplitude of one final over all phase shifts of the sources and over time (V eq. 10, 11)."""

    expected_um: float  #: Expectation of the instantaneous amplitude, mean over the sections [µm]
    mean_abs_um: float  #: Expectation of the ordinate's amount, mean over the sections [µm]
    rms_um: float  #: Root of the mean square ordinate, in closed form [µm]
    largest_um: float  #: Largest instantaneous amplitude of any realisation at any section [µm]
    #: realisations and sections: How many of both; 0 where the realisations are too many and only `rms_um` is known
    #: (the others are 0 then)
    realisations: int
    sections: int


@dataclass(frozen=True)
class VibrationSummary:
    """What a simulation amounts to, at the mean speeds of its shafts."""

    modes: StructureModes  #: Of the coupled structure
    lines: tuple[LineSummary, ...]  #: By frequency; lines of different sources stay apart
    amplitudes: Mapping[str, AmplitudeSummary]  #: "tool", "workpiece" and `RELATIVE`, by the method of ``run.method``
    errors: tuple[PeriodicError, ...] = ()  #: What the motion leaves on the surface; empty without ``[cutting]``
    #: Kind of error (roughness, waviness, lobing, runout) → the height of all errors of the kind together
    heights: Mapping[str, KindHeight] = field(default_factory=dict)
    #: How good every chain is within the structure; empty without ``[[chains]]``
    accuracy: tuple[ChainAccuracy, ...] = ()
    split_hz: float | None = None  #: Below it the low chains hold, above it the high ones; None without ``[cutting]``
    shaft_rpm: Mapping[str, float] = field(default_factory=dict)  #: Speed that every shaft was taken at [r/min]
    findings: tuple[Finding, ...] = ()  #: What is odd about the model and about this simulation


def vibration_summary(model: VibrationModel, simulation: VibrationSimulation) -> VibrationSummary:
    """The summary of a simulation of this model: of the lines at its mean speeds, by both methods.

    InputError: a mode or a frequency that is beyond what numbers hold.
    """
    modes = structure_modes(model.structure)
    coupled, chains = simulation.motions["coupled"], simulation.motions.get("chains")
    motions = simulation.motions[model.file.run.method]
    findings = list(model_findings(model, modes))
    if chains is not None:
        findings += chain_findings(model, coupled, chains)
    amplitudes = {name: _amplitude(model, name, motions) for name in (*FINALS, RELATIVE)}
    cut, split_hz = model.cutting(simulation.shaft_rpm), model.split_hz(simulation.shaft_rpm)
    errors: tuple[PeriodicError, ...] = ()
    if cut is not None:
        errors = periodic_errors(motions, cut, surface=model.surface, phases=model.file.realisations.phases)
    heights = () if cut is None else kind_heights(errors, cut)
    findings += _too_many(model, amplitudes, errors)
    accuracy, said = _accuracy(model, motions.frequency_hz, split_hz)
    return VibrationSummary(
        modes=modes,
        lines=_lines(excitation(model.sources, simulation.shaft_rpm), motions, coupled, chains),
        amplitudes=amplitudes,
        errors=errors,
        heights={one.kind: one for one in heights},
        accuracy=accuracy,
        split_hz=split_hz,
        shaft_rpm=simulation.shaft_rpm,
        findings=(*findings, *height_findings(heights), *said, *_of_speeds(model, simulation)),
    )


def _lines(
    lines: Excitation, motions: FinalMotions, coupled: FinalMotions, chains: FinalMotions | None
) -> tuple[LineSummary, ...]:
    order = np.argsort(lines.frequency_hz, kind="stable")
    of = {name: (name,) if name != RELATIVE else FINALS for name in (*FINALS, RELATIVE)}
    sizes = {name: _UM * np.abs(motions.of(*sides)) for name, sides in of.items()}
    exact = {name: _UM * np.abs(coupled.of(*sides)) for name, sides in of.items()}
    published = {} if chains is None else {name: _UM * np.abs(chains.of(*sides)) for name, sides in of.items()}

    def by_chains(name: str, row: int) -> float | None:
        if chains is None or not any(chains.carried[chains.finals.index(side), row] for side in of[name]):
            return None
        return float(published[name][row])

    return tuple(
        LineSummary(
            frequency_hz=float(lines.frequency_hz[row]),
            source=lines.sources[int(lines.source[row])],
            shaft=lines.shaft[row],
            order=lines.order[row],
            force_n=float(abs(lines.force_n[row])),
            motion_um={name: float(size[row]) for name, size in sizes.items()},
            coupled_um={name: float(size[row]) for name, size in exact.items()},
            chains_um={name: by_chains(name, row) for name in of},
        )
        for row in order.tolist()
    )


def _amplitude(model: VibrationModel, name: str, motions: FinalMotions) -> AmplitudeSummary:
    """Over all realisations; where these are too many the mean square alone."""
    motion = motions.of(*(FINALS if name == RELATIVE else (name,)))
    wanted = model.file.realisations
    time_s = section_times(wanted.sections, model.file.run.duration_s)
    of_lines = (motion, motions.frequency_hz, motions.source, time_s)
    moving = len(set(motions.source[np.abs(motion) > 0].tolist()))
    if not are_countable(moving, sections=wanted.sections, phases=wanted.phases):
        z_m = source_motion(*of_lines, n_sources=len(motions.sources))
        rms_um = _UM * float(np.sqrt(np.mean(mean_square(z_m, phases=wanted.phases))))
        return AmplitudeSummary(0.0, 0.0, rms_um, 0.0, 0, 0)
    amounts = realisation_amounts(*of_lines, n_sources=len(motions.sources), phases=wanted.phases)
    return AmplitudeSummary(
        expected_um=_UM * amounts.expected_m,
        mean_abs_um=_UM * amounts.mean_abs_m,
        rms_um=_UM * amounts.rms_m,
        largest_um=_UM * amounts.largest_m,
        realisations=amounts.count,
        sections=wanted.sections,
    )


def _too_many(
    model: VibrationModel, amplitudes: Mapping[str, AmplitudeSummary], errors: tuple[PeriodicError, ...]
) -> Iterator[Finding]:
    """One finding of all that is not over the realisations because they are too many."""
    uncounted = [name for name, one in amplitudes.items() if not one.realisations]
    at_hz = [one.frequency_hz for one in errors if not one.realisations]
    if not uncounted and not at_hz:
        return
    wanted, said = model.file.realisations, []
    if uncounted:
        said.append("Of the motion only the mean square is given, which needs none.")
    if at_hz:
        listed = ", ".join(f"{one:.4g}" for one in at_hz[:6]) + (" …" if len(at_hz) > 6 else "")
        said.append(f"Periodic errors at {listed} Hz are expectations over phases that are anything, in closed form.")
    yield FINDINGS.finding(
        "too-many-realisations",
        f"{wanted.phases} phases of {len(model.sources)} sources at {wanted.sections} sections are too many to go "
        f"through. {' '.join(said)}",
        evidence={"motions": uncounted, "periodic_errors_hz": at_hz},
        suggestion="take fewer phases or sections to have the amplitudes too"
        if uncounted
        else "take fewer phases if those steps of a turn are meant",
    )


def judged_frequencies_hz(
    model: VibrationModel, lines_hz: NDArray[np.float64], split_hz: float | None
) -> NDArray[np.float64]:
    """Frequencies at which the chains of a model are judged [Hz]: as many a decade from 1 Hz to twice the highest line.

    If the high chains begin above the highest line, to twice the frequency where they do.
    """
    highest = _BEYOND * max(split_hz or 0.0, float(lines_hz.max(initial=_LOWEST_JUDGED_HZ)))
    motions = sum(len(chain.sources) for chain in model.chains) * len(model.structure.members)
    judged = min(max(_JUDGED_AT_ONCE // max(motions, 1), _FEWEST_JUDGED), _JUDGED)
    return np.geomspace(min(_LOWEST_JUDGED_HZ, highest / 10.0), highest, judged)


def _accuracy(
    model: VibrationModel, lines_hz: NDArray[np.float64], split_hz: float | None
) -> tuple[tuple[ChainAccuracy, ...], tuple[Finding, ...]]:
    """Every chain over its range; where it meets an undamped resonance there is none, and a finding."""
    if not model.chains:
        return (), ()
    judged_hz = judged_frequencies_hz(model, lines_hz, split_hz)
    try:
        return chain_accuracy(model.structure, model.chains, judged_hz, sources=model.sources, split_hz=split_hz), ()
    except InputError as error:
        said = FINDINGS.finding(
            "chains-not-judged",
            f"Chains cannot be judged over all frequencies: {error.found}.",
            suggestion=error.advice,
        )
        return (), (said,)


def _of_speeds(model: VibrationModel, simulation: VibrationSimulation) -> Iterator[Finding]:
    changing = [name for name, course in model.courses.items() if not course.is_level]
    used = [name for name in changing if any(source.shaft == name for source in model.sources)]
    if used:
        speeds = ", ".join(f"{name} {simulation.shaft_rpm[name]:.6g} r/min" for name in used)
        yield FINDINGS.finding(
            "lines-at-mean-speed",
            f"Lines, amplitudes and errors are those of the mean speed ({speeds}); the recording follows the course.",
            evidence={"shaft_rpm": {name: simulation.shaft_rpm[name] for name in used}},
        )
