"""What is odd about a vibrating structure: unlikely numbers, sharp resonances, and what its chains leave out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from selector.findings import Finding, Level
from selector.physics.model_plausibility import UsualRange, unlikely_numbers
from selector.physics.vibration.final_motion import FinalMotions
from selector.physics.vibration.model_file import plain_values
from selector.physics.vibration.modes import StructureModes
from selector.physics.vibration.parameters import UNITS
from selector.physics.vibration.periodic_error import KindHeight
from selector.physics.vibration.structure import GROUND, Structure
from selector.physics.vibration.vibration_model import FINALS, RELATIVE, VibrationModel

Complex = NDArray[np.complex128]

SHARP = 30.0
"""Amplification of a line by a mode above which a part of a percent in frequency decides its size."""

CHAINS_OFF = 0.1
"""Share by which the chains may differ from the coupled structure before it is said."""

MORE_THAN_MOVED = 10.0
"""Published height over the height that a copied motion leaves, from which on it is said."""

LOWEST_HZ, HIGHEST_HZ = 1.0, 20e3
"""Between them lie the eigenfrequencies of machines that are described by masses and joints."""

USUAL = {
    "mass_kg": UsualRange(0.02, 2e5, {"t": 1e3, "g": 1e-3}),
    "joints.stiffness_n_per_m": UsualRange(1e5, 1e11, {"N/µm": 1e6, "N/mm": 1e3, "kN/mm": 1e6}),
    "joints.dissipation": UsualRange(0.0, 3.0, {"%": 0.01}),
    "lines.force_n": UsualRange(1e-4, 1e5, {"kN": 1e3, "mN": 1e-3}),
    "lines.unbalance_kg_m": UsualRange(0.0, 1.0, {"g·mm": 1e-6, "kg·mm": 1e-3}),
    "run.period_s": UsualRange(1e-6, 0.05, {"ms": 1e-3, "µs": 1e-6}),
    "cutting.diameter_mm": UsualRange(0.5, 2e4, {"m": 1e3}),
    "cutting.feed_mm_per_rev": UsualRange(1e-3, 20.0, {"µm": 1e-3}),
    "cutting.force_coefficient": UsualRange(5.0, 2000.0, {"N": 0.1}),
    "sensing.noise_um": UsualRange(0.0, 100.0, {"nm": 1e-3}),
}
"""Section and key of the file → what is usual."""

_WORDS = {RELATIVE: "the tool against the workpiece"}
_KEY_UNITS = {**UNITS, "period_s": "s", "diameter_mm": "mm", "feed_mm_per_rev": "mm/rev", "noise_um": "µm"}


def model_findings(model: VibrationModel, modes: StructureModes) -> tuple[Finding, ...]:
    """What is odd before it runs: numbers and eigenfrequencies that no machine has, lines in sharp resonances."""
    found = list(unlikely_numbers(plain_values(model.file), USUAL, lambda key: _KEY_UNITS.get(key, "1")))
    found += _odd_frequencies(model.structure, modes)
    found += _sharp(model, modes)
    return tuple(found)


def _odd_frequencies(structure: Structure, modes: StructureModes) -> Iterator[Finding]:
    for number in (0, -1):
        frequency = float(modes.frequency_hz[number])
        if LOWEST_HZ <= frequency <= HIGHEST_HZ:
            continue
        member = modes.members[int(np.argmax(np.abs(modes.shapes[:, number])))]
        joint = _strained(structure, modes, number)
        yield Finding(
            "unlikely-eigenfrequency",
            "warning",
            f"The {'lowest' if number == 0 else 'highest'} eigenfrequency is {frequency:.4g} Hz, in which "
            f"{member!r} moves most; machines have {LOWEST_HZ:g} Hz to {HIGHEST_HZ / 1e3:g} kHz.",
            evidence={"frequency_hz": frequency, "member": member, "joint": joint},
            suggestion=f"check the mass of {member!r} (kg, not g) and the stiffness of {joint} (N/m, not N/µm)",
        )


def _sharp(model: VibrationModel, modes: StructureModes) -> Iterator[Finding]:
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
        yield Finding(
            "sharp-resonance",
            "warning",
            f"{source} shakes at {frequency:.5g} Hz, and the structure rings at {resonance:.5g} Hz, so little damped "
            f"that it makes {largest:.3g} times as much of it; {joint} is strained most.",
            evidence={"amplification": largest, "line_hz": frequency, "mode_hz": resonance, "joint": joint},
            suggestion=f"make sure of the dissipation and the stiffness of {joint}: they decide how large it is",
        )


def _strained(structure: Structure, modes: StructureModes, number: int) -> str:
    """The joint that holds most of the energy of a mode, in words."""
    shape = {**dict(zip(modes.members, modes.shapes[:, number], strict=True)), GROUND: 0.0}
    one, other = max(
        structure.joints,
        key=lambda joint: joint.stiffness_n_per_m * abs(shape[joint.between[0]] - shape[joint.between[1]]) ** 2,
    ).between
    return f"the joint {one} – {other}"


def chain_findings(model: VibrationModel, coupled: FinalMotions, chains: FinalMotions) -> tuple[Finding, ...]:
    """Lines that no chain carries, and how far the chains are from the coupled structure."""
    level: Level = "warning" if model.file.run.method == "chains" else "info"
    found: list[Finding] = []
    lost = ~chains.carried.any(axis=0)
    for number, source in enumerate(chains.sources):
        of = chains.source == number
        if not (lost & of).any():
            continue
        frequency = np.sort(chains.frequency_hz[lost & of])
        named = any(source in chain.sources for chain in model.chains)
        where = "in any chain" if not named else "in a chain of their range"
        listed = ", ".join(f"{value:.4g}" for value in frequency[:6]) + (" …" if len(frequency) > 6 else "")
        found.append(
            Finding(
                "source-in-no-chain",
                level,
                f"{source} is not {where} at {listed} Hz: what it moves there is missing from the chain method.",
                evidence={"source": source, "frequency_hz": frequency.tolist()},
                suggestion="name it in the chains that begin where it acts, or take the coupled structure",
            )
        )
    for name in (*FINALS, RELATIVE):
        sides = FINALS if name == RELATIVE else (name,)
        if not all(chains.carried[chains.finals.index(side)].any() for side in sides):
            continue  # no chain ends there: nothing that could be compared
        one = _difference(name, coupled, coupled.of(*sides), chains.of(*sides), level)
        found += [] if one is None else [one]
    return tuple(found)


def _difference(final: str, coupled: FinalMotions, exact: Complex, published: Complex, level: Level) -> Finding | None:
    size, beside, off = (_rms_um(motion) for motion in (exact, published, published - exact))
    if size == 0 or off <= CHAINS_OFF * size:
        return None
    worst = int(np.argmax(np.abs(published - exact)))
    source, frequency = coupled.sources[int(coupled.source[worst])], float(coupled.frequency_hz[worst])
    line_um, exact_um = (1e6 * float(abs(motion[worst])) for motion in (published, exact))
    more = beside / size - 1.0
    said = (
        f"By the chains {_WORDS.get(final, f'the {final}')} moves {beside:.3g} µm (rms of all lines), by the coupled "
        f"structure {size:.3g} µm: {100 * abs(more):.3g} % {'more' if more > 0 else 'less'}; with their phases they "
        f"differ by {100 * off / size:.3g} %. Most of it is the line of {source} at {frequency:.5g} Hz, {line_um:.3g} "
        f"instead of {exact_um:.3g} µm."
    )
    evidence = {
        "final": final,
        "chains_um": beside,
        "coupled_um": size,
        "relative": off / size,
        "worst_source": source,
        "worst_hz": frequency,
    }
    advice = "believe the coupled structure: the chains leave out how members act back on those before them"
    return Finding("chains-off-coupled", level, said, evidence=evidence, suggestion=advice)


def height_findings(heights: Iterable[KindHeight]) -> tuple[Finding, ...]:
    """Kinds of errors whose published height is far above what the motion itself could print."""
    return tuple(
        Finding(
            "height-beyond-motion",
            "warning",
            f"The published height of {one.kind} is {one.rms_um:.3g} µm, but tool and workpiece move only "
            f"{one.kinematic_um:.3g} µm from crest to trough against each other: it takes the inertia force of the "
            "whole member for a cutting force, and that grows with the square of the frequency.",
            evidence={"kind": one.kind, "published_um": one.rms_um, "kinematic_um": one.kinematic_um},
            suggestion="believe the copied motion, unless a measured surface says otherwise",
        )
        for one in heights
        if one.rms_um > MORE_THAN_MOVED * one.kinematic_um
    )


def _rms_um(motion_m: Complex) -> float:
    """Root mean square of sines with these amplitudes; squares of none of them leave the range of numbers."""
    size = np.abs(motion_m)
    largest = float(size.max(initial=0.0))
    return 1e6 * largest * math.sqrt(float(np.sum((size / largest) ** 2)) / 2.0) if largest > 0 else 0.0
