"""What does a simulated vibration amount to: modes, where every line goes, what it leaves behind, and what is odd."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from selector.errors import InputError
from selector.findings import Finding, Level
from selector.physics.model_fields import unlikely_values
from selector.physics.vibration import structure as structures
from selector.physics.vibration.chains import ChainAccuracy, chain_accuracy
from selector.physics.vibration.final_motion import FinalMotions
from selector.physics.vibration.finding_table import FINDINGS
from selector.physics.vibration.periodic_error import (
    LEAST_LOSS,
    KindHeight,
    PeriodicError,
    StabilityLimit,
    kind_heights,
    least_loss,
    periodic_errors,
    realisation_amounts,
    section_times,
    stability_limit,
)
from selector.physics.vibration.vibration_model import FINALS, RELATIVE, VibrationModel, VibrationSimulation
from selector.types import Array, Complex, Mask

SHARP = 30.0  #: Amplification of a line by a mode above which a part of a percent in frequency decides its size.
CHAINS_OFF = 0.1  #: Share by which the chains may differ from the coupled structure before it is said.
MORE_THAN_MOVED = 10.0  #: Published height over the height that a copied motion leaves, from which on it is said.
#: Between them lie the eigenfrequencies of machines that are described by masses and joints.
LOWEST_HZ, HIGHEST_HZ = 1.0, 20e3
_WORDS = {RELATIVE: "the tool against the workpiece"}


def model_findings(model: VibrationModel, modes: structures.StructureModes) -> tuple[Finding, ...]:
    """What is odd before it runs: numbers and eigenfrequencies that no machine has, lines in sharp resonances."""
    found = list(unlikely_values(model.file))
    found += _odd_frequencies(model.structure, modes)
    found += _sharp(model, modes)
    return tuple(found)


def _odd_frequencies(structure: structures.Structure, modes: structures.StructureModes) -> Iterator[Finding]:
    for number in (0, -1):
        frequency = float(modes.frequency_hz[number])
        if LOWEST_HZ <= frequency <= HIGHEST_HZ:
            continue
        member = modes.members[int(np.argmax(np.abs(modes.shapes[:, number])))]
        joint = _strained(structure, modes, number)
        yield FINDINGS.finding(
            "unlikely-eigenfrequency",
            f"The {'lowest' if number == 0 else 'highest'} eigenfrequency is {frequency:.4g} Hz, in which "
            f"{member!r} moves most; machines have {LOWEST_HZ:g} Hz to {HIGHEST_HZ / 1e3:g} kHz.",
            evidence={"frequency_hz": frequency, "member": member, "joint": joint},
            suggestion=f"check the mass of {member!r} (kg, not g) and the stiffness of {joint} (N/m, not N/µm)",
        )


def _sharp(model: VibrationModel, modes: structures.StructureModes) -> Iterator[Finding]:
    """Of every mode the line that it amplifies most, if that is much."""
    for number, eigenvalue in enumerate(modes.eigenvalues_per_s2):
        amplified = []
        for source, low, high in model.line_ranges_hz:
            frequency = min(max(float(modes.frequency_hz[number]), low), high)
            beside = abs(eigenvalue - (2.0 * math.pi * frequency) ** 2)
            amplified.append((abs(eigenvalue) / beside if beside > 0 else math.inf, frequency, source))
        largest, frequency, source = max(amplified)
        if largest <= SHARP or not math.isfinite(largest):
            continue
        resonance, joint = float(modes.frequency_hz[number]), _strained(model.structure, modes, number)
        yield FINDINGS.finding(
            "sharp-resonance",
            f"{source} shakes at {frequency:.5g} Hz, and the structure rings at {resonance:.5g} Hz, so little damped "
            f"that it makes {largest:.3g} times as much of it; {joint} is strained most.",
            evidence={"amplification": largest, "line_hz": frequency, "mode_hz": resonance, "joint": joint},
            suggestion=f"make sure of the dissipation and the stiffness of {joint}: they decide how large it is",
        )


def _strained(structure: structures.Structure, modes: structures.StructureModes, number: int) -> str:
    """The joint that holds most of the energy of a mode, in words."""
    one, other = structures.strained_joint(structure, modes.shapes[:, number]).between
    return f"the joint {one} – {other}"


def chain_findings(model: VibrationModel, coupled: FinalMotions, chains: FinalMotions) -> tuple[Finding, ...]:
    """Lines that no chain carries, and how far the chains are from the coupled structure where they carry one."""
    level: Level = "warning" if model.file.run.method == "chains" else "info"
    differences = []
    for name in (*FINALS, RELATIVE):
        sides = FINALS if name == RELATIVE else (name,)
        carried = np.asarray(chains.carried[[chains.finals.index(side) for side in sides]].all(axis=0))
        one = _difference(name, coupled, coupled.of(*sides), chains.of(*sides), carried)
        differences += [] if one is None else [one]
    off = [] if not differences else [_off(differences, level)]
    return (*_missing(model, coupled, chains, level), *off)


def _missing(model: VibrationModel, coupled: FinalMotions, chains: FinalMotions, level: Level) -> Iterator[Finding]:
    """Finals that a good part of the motion reaches by lines without a chain of their range to them.

    Where the file has no chain to a final it asks nothing of the chains there, unless they make the recording.
    """
    for final in FINALS:
        if level == "info" and not any(chain.final == model.finals[final] for chain in model.chains):
            continue
        rows = np.flatnonzero(~chains.carried[chains.finals.index(final)])
        size, missing = _rms_um(coupled.of(final)), _rms_um(coupled.of(final)[rows])
        if size == 0 or missing <= CHAINS_OFF * size:
            continue
        names = sorted({coupled.sources[number] for number in coupled.source[rows].tolist()})
        frequency = np.sort(coupled.frequency_hz[rows])
        at = ", ".join(f"{value:.4g}" for value in frequency[:6]) + (" …" if len(frequency) > 6 else "")
        yield FINDINGS.finding(
            "no-chain-to-final",
            f"No chain leads to the {final} from {', '.join(names)} at {at} Hz: "
            f"{missing:.3g} µm of its {size:.3g} µm (rms, coupled structure) are missing from the chain method.",
            evidence={
                "final": final,
                "sources": names,
                "frequency_hz": frequency.tolist(),
                "missing_um": missing,
                "coupled_um": size,
            },
            suggestion=f"add chains from these sources to the {final}, or take the coupled structure",
            level=level,
        )


def _difference(
    final: str, coupled: FinalMotions, exact: Complex, published: Complex, carried: Mask
) -> dict[str, Any] | None:
    """One final: its motion by the lines that chains carry there, by both methods."""
    rows = np.flatnonzero(carried)
    size, beside, off = (_rms_um(motion[rows]) for motion in (exact, published, published - exact))
    if size == 0 or off <= CHAINS_OFF * size:
        return None
    worst = int(rows[np.argmax(np.abs(published - exact)[rows])])
    return {
        "final": final,
        "chains_um": beside,
        "coupled_um": size,
        "relative": off / size,
        "lines": len(rows),
        "worst_source": coupled.sources[int(coupled.source[worst])],
        "worst_hz": float(coupled.frequency_hz[worst]),
        "worst_chains_um": 1e6 * float(abs(published[worst])),
        "worst_coupled_um": 1e6 * float(abs(exact[worst])),
    }


def _off(differences: Sequence[dict[str, Any]], level: Level) -> Finding:
    """One finding of the final whose chains are off most; the others stand beside it in the evidence."""
    worst = max(differences, key=lambda one: one["relative"])
    others = [one for one in differences if one is not worst]
    more = worst["chains_um"] / worst["coupled_um"] - 1.0
    names = [_WORDS.get(one["final"], f"the {one['final']}") for one in (worst, *others)]
    beside = [f"{name} by {100 * one['relative']:.3g} %" for name, one in zip(names[1:], others, strict=True)]
    said = (
        f"By the chains {names[0]} moves {worst['chains_um']:.3g} µm (rms of "
        f"{'the lines' if worst['lines'] > 1 else 'the one line'} that they carry), by the coupled structure "
        f"{worst['coupled_um']:.3g} µm: {100 * abs(more):.3g} % {'more' if more > 0 else 'less'}; with their phases "
        f"they differ by {100 * worst['relative']:.3g} %. Most of it is the line of {worst['worst_source']} at "
        f"{worst['worst_hz']:.5g} Hz, {worst['worst_chains_um']:.3g} instead of {worst['worst_coupled_um']:.3g} µm."
        + (f" Off too: {', '.join(beside)}." if beside else "")
    )
    return FINDINGS.finding("chains-off-coupled", said, evidence={**worst, "others": others}, level=level)


def height_findings(heights: Iterable[KindHeight]) -> tuple[Finding, ...]:
    """Kinds of errors whose published height is far above what the motion itself could print."""
    return tuple(
        FINDINGS.finding(
            "height-beyond-motion",
            f"The published height of {one.kind} is {one.rms_um:.3g} µm, but tool and workpiece move only "
            f"{one.kinematic_um:.3g} µm from crest to trough against each other: it takes the inertia force of the "
            "whole member for a cutting force, and that grows with the square of the frequency.",
            evidence={"kind": one.kind, "published_um": one.rms_um, "kinematic_um": one.kinematic_um},
        )
        for one in heights
        if one.rms_um > MORE_THAN_MOVED * one.kinematic_um
    )


def _rms_um(motion_m: Complex) -> float:
    """Root mean square of sines with these amplitudes; squares of none of them leave the range of numbers."""
    size = np.abs(motion_m)
    largest = float(size.max(initial=0.0))
    return 1e6 * largest * math.sqrt(float(np.sum((size / largest) ** 2)) / 2.0) if largest > 0 else 0.0


_UM = 1e6
#: Frequencies at which every chain is judged, as many a decade everywhere; fewer where chains and members are many.
_JUDGED, _FEWEST_JUDGED = 2_000, 100
_JUDGED_AT_ONCE = 20_000_000  #: Motions of members that are held meanwhile (320 MB).
_LOWEST_JUDGED_HZ = 1.0
_BEYOND = 2.0  #: Times the highest line, or the frequency at which the high chains begin: so far chains are judged.


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
    realisations: int  #: How many were gone through
    sections: int


@dataclass(frozen=True)
class VibrationSummary:
    """What a simulation amounts to, at the mean speeds of its shafts."""

    modes: structures.StructureModes  #: Of the coupled structure
    lines: tuple[LineSummary, ...]  #: By frequency; lines of different sources stay apart
    amplitudes: Mapping[str, AmplitudeSummary]  #: "tool", "workpiece" and `RELATIVE`, by the method of ``run.method``
    errors: tuple[PeriodicError, ...] = ()  #: What the motion leaves on the surface; empty without ``[cutting]``
    #: Kind of error (roughness, waviness, lobing, runout) → the height of all errors of the kind together
    heights: Mapping[str, KindHeight] = field(default_factory=dict)
    #: Where chatter begins; None without ``[cutting]``, and where no depth does it
    stability: StabilityLimit | None = None
    #: How good every chain is within the structure; empty without ``[[chains]]``
    accuracy: tuple[ChainAccuracy, ...] = ()
    split_hz: float | None = None  #: Below it the low chains hold, above it the high ones; None without ``[cutting]``
    shaft_rpm: Mapping[str, float] = field(default_factory=dict)  #: Speed that every shaft was taken at [r/min]
    findings: tuple[Finding, ...] = ()  #: What is odd about the model and about this simulation


def vibration_summary(model: VibrationModel, simulation: VibrationSimulation) -> VibrationSummary:
    """The summary of a simulation of this model: of the lines at its mean speeds, by both methods.

    InputError: a mode or a frequency that is beyond what numbers hold.
    """
    modes = structures.structure_modes(model.structure)
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
    stability = None if cut is None else stability_limit(model.structure, modes, cut, **model.finals)
    loss = least_loss(model.structure, modes, **model.finals)
    if cut is not None and cut.feed_exponent > 0 and loss < LEAST_LOSS:
        told = (
            f"A mode in which tool and workpiece move against each other has a loss factor of {loss:.2g}: at some "
            "speeds any depth of cut chatters in it, and no limit is told."
        )
        findings.append(FINDINGS.finding("chatters-at-any-depth", told, evidence={"loss_factor": loss}))
    accuracy, said = _accuracy(model, motions.frequency_hz, split_hz)
    return VibrationSummary(
        modes=modes,
        lines=_lines(structures.excitation(model.sources, simulation.shaft_rpm), motions, coupled, chains),
        amplitudes=amplitudes,
        errors=errors,
        heights={one.kind: one for one in heights},
        stability=stability,
        accuracy=accuracy,
        split_hz=split_hz,
        shaft_rpm=simulation.shaft_rpm,
        findings=(*findings, *height_findings(heights), *said, *_of_speeds(model, simulation)),
    )


def _lines(
    lines: structures.Excitation, motions: FinalMotions, coupled: FinalMotions, chains: FinalMotions | None
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
    motion = motions.of(*(FINALS if name == RELATIVE else (name,)))
    wanted = model.file.realisations
    of_lines = (motion, motions.frequency_hz, motions.source, section_times(wanted.sections, model.file.run.duration_s))
    amounts = realisation_amounts(*of_lines, n_sources=len(motions.sources), phases=wanted.phases)
    found_m = amounts.expected_m, amounts.mean_abs_m, amounts.rms_m, amounts.largest_m
    expected, mean_abs, rms, largest = (_UM * size_m for size_m in found_m)
    return AmplitudeSummary(expected, mean_abs, rms, largest, amounts.count, wanted.sections)


def judged_frequencies_hz(model: VibrationModel, lines_hz: Array, split_hz: float | None) -> Array:
    """Frequencies at which the chains of a model are judged [Hz]: as many a decade from 1 Hz to twice the highest line.

    If the high chains begin above the highest line, to twice the frequency where they do.
    """
    highest = _BEYOND * max(split_hz or 0.0, float(lines_hz.max(initial=_LOWEST_JUDGED_HZ)))
    motions = sum(len(chain.sources) for chain in model.chains) * len(model.structure.members)
    judged = min(max(_JUDGED_AT_ONCE // max(motions, 1), _FEWEST_JUDGED), _JUDGED)
    return np.geomspace(min(_LOWEST_JUDGED_HZ, highest / 10.0), highest, judged)


def _accuracy(
    model: VibrationModel, lines_hz: Array, split_hz: float | None
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
