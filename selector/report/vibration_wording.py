"""What vibration leaves behind, in sentences and tables: how high, of which kind, from which source and resonance."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from selector.physics.vibration.chain_error import ChainAccuracy
from selector.physics.vibration.modes import StructureModes
from selector.physics.vibration.periodic_error import KindHeight, PeriodicError
from selector.physics.vibration.resonance import CarryingMode
from selector.physics.vibration.vibration_summary import RELATIVE, LineSummary, VibrationSummary
from selector.report.numbers import NONE, listed, number_text, share_text, span_text
from selector.report.tables import Table, table

MOST_LINES = 40
MOST_ERRORS = 40
MOST_MODES = 30
FINALS = {"tool": "tool", "workpiece": "workpiece", RELATIVE: "tool − workpiece"}
_FAR = 1.5
"""Amplification below which a line is not said to be near a resonance."""

_MORE_THAN_MOTION = 3.0
"""Times the copied motion from which on a height by the force is said to be none."""

_LEAST_DB = 1e-4
"""Difference below which two solutions are the same, to rounding."""

_ALONG = {"cut": "along the cut", "feed": "along the feed"}


def highest(errors: Sequence[PeriodicError]) -> PeriodicError:
    """The error that is the highest if the tip copies the motion."""
    return max(errors, key=lambda one: one.kinematic_um)


def error_sentence(one: PeriodicError, carried: CarryingMode | None) -> str:
    """The highest periodic error: height, kind, wavelength, source and resonance."""
    return (
        f"The highest periodic error is {one.kind} of {number_text(one.kinematic_um)} µm, every "
        f"{number_text(one.wavelength_mm)} mm {_ALONG[one.direction]}. It comes from {listed(one.sources)} at "
        f"{one.frequency_hz:.4g} Hz{carried_text(carried, one.frequency_hz)}."
    )


def published_sentences(errors: Sequence[PeriodicError]) -> list[str]:
    """The highest error by the law of the cutting force (V eq. 2), and how much of a motion there is behind it."""
    one = max(errors, key=lambda error: error.published_um)
    said = (
        f"That is what a tip leaves which copies the motion of the tool against the workpiece. By the law of the "
        f"cutting force, with the inertia forces of both as its changes, the highest is {one.kind} of "
        f"{number_text(one.published_um)} µm by {listed(one.sources)} at {one.frequency_hz:.4g} Hz"
    )
    if one.published_um > _MORE_THAN_MOTION * one.kinematic_um:
        times = number_text(one.published_um / one.kinematic_um) if one.kinematic_um > 0 else "many"
        return [f"{said}: {times} times what the motion there can cut, so do not take it for a height."]
    return [f"{said}."]


def line_sentence(one: LineSummary, carried: CarryingMode | None) -> str:
    """The line that moves the tool most against the workpiece, where nothing is said of a cut."""
    return (
        f"The tool moves most against the workpiece at {one.frequency_hz:.4g} Hz, with an amplitude of "
        f"{number_text(one.motion_um[RELATIVE])} µm. It comes from {one.source}"
        f"{carried_text(carried, one.frequency_hz)}."
    )


def run_up_sentence(
    time_s: NDArray[np.float64], motion_um: NDArray[np.float64], speeds_rpm: Mapping[str, NDArray[np.float64]]
) -> str:
    """The largest motion of the tool against the workpiece while speeds change, when, and at which of them."""
    k = int(np.argmax(np.abs(motion_um)))
    turning = [f"{name} at {rpm[k]:.4g} r/min" for name, rpm in speeds_rpm.items() if np.ptp(rpm) > 0]
    return (
        f"The tool moves against the workpiece by up to {number_text(float(abs(motion_um[k])))} µm, after "
        f"{span_text(float(time_s[k]))}, with {listed(turning)}."
    )


def carried_text(carried: CarryingMode | None, frequency_hz: float) -> str:
    """Which resonance has a hand in a line of this frequency [Hz], or that none has, as the end of a sentence."""
    if carried is None:
        return ""
    at_hz = f"{carried.frequency_hz:.4g} Hz"
    if carried.amplification >= _FAR:
        mode = f"the mode at {at_hz}, in which the {carried.member} moves most"
        return f", near {mode}: the resonance makes it {number_text(carried.amplification)} times as large"
    below = frequency_hz < carried.frequency_hz
    side, why = ("below", "the machine gives way as to a steady force") if below else ("above", "the masses resist it")
    mode = f"the mode that has most of it ({at_hz}, the {carried.member} moves most)"
    return f". No resonance makes it large: it lies {side} {mode}, and {why}"


def kinds_sentence(heights: Sequence[KindHeight]) -> str:
    """All errors of each kind together."""
    parts = [f"{one.kind} {number_text(one.kinematic_um)} µm" for one in heights]
    return f"All lines of a kind together, root of the sum of squares: {listed(parts)}."


def motion_sentence(summary: VibrationSummary) -> str:
    """How far the tool moves against the workpiece, whatever the phases, and whose share that is."""
    one = summary.amplitudes[RELATIVE]
    text = f"The tool moves against the workpiece by {number_text(one.rms_um)} µm root mean square"
    if one.realisations:
        text += (
            f"; its amplitude is {number_text(one.expected_um)} µm on average over {one.realisations} combinations of "
            f"phases and over time, {number_text(one.largest_um)} µm at most"
        )
    shares = source_shares(summary.lines)
    first = [f"{name} {share_text(share)}" for name, share in list(shares.items())[:3] if share >= 0.01]
    return f"{text}. Of its mean square: {', '.join(first)}." if first else f"{text}."


def source_shares(lines: Sequence[LineSummary]) -> dict[str, float]:
    """Source → its share of the mean square of the motion of the tool against the workpiece, the largest first."""
    squares: dict[str, float] = {}
    for one in lines:
        squares[one.source] = squares.get(one.source, 0.0) + one.motion_um[RELATIVE] ** 2
    whole = sum(squares.values())
    ranked = sorted(squares.items(), key=lambda item: -item[1])
    return {name: square / whole for name, square in ranked} if whole > 0 else {}


def chains_sentence(accuracy: Sequence[ChainAccuracy]) -> str:
    """For how many chains the published method holds."""
    good = [one for one in accuracy if one.published.share_within >= 0.5]
    cases = f"{len(good)} of {len(accuracy)} cases of chain and source"
    mean = share_text(float(np.mean([one.published.share_within for one in accuracy])))
    return (
        f"The chain method is within 10 % of the coupled structure over half of the frequencies or more in {cases}, "
        f"and over {mean} of the frequencies on average."
    )


def kinds_table(heights: Sequence[KindHeight]) -> Table:
    """Height of every kind."""
    rows = [
        (
            one.kind,
            str(one.lines),
            number_text(one.kinematic_um),
            number_text(one.rms_um),
            number_text(one.published_um),
        )
        for one in heights
    ]
    note = (
        "Copied: root of the sum of squares of 2·|motion of tool against workpiece|, of lines that know nothing of "
        "each other. W: the same root of the heights by the law of the cutting force; largest: W of all inertia "
        "forces added up, when all crests meet. First revolution, without regeneration and chatter."
    )
    heads = ["kind", ">frequencies", ">copied motion [µm]", ">W [µm]", ">W, largest [µm]"]
    return table(heads, rows, note)


def errors_table(errors: Sequence[PeriodicError]) -> Table:
    """Every periodic error, the highest first."""
    ranked = sorted(errors, key=lambda one: -one.kinematic_um)
    rows = [
        (
            one.kind,
            ", ".join(one.sources),
            f"{one.frequency_hz:.5g}",
            number_text(one.wavelength_mm),
            one.direction,
            f"{one.waves_per_revolution:.4g}",
            "straight" if one.axial_wavelength_mm is None else number_text(one.axial_wavelength_mm),
            number_text(one.kinematic_um),
            number_text(one.published_um),
        )
        for one in ranked[:MOST_ERRORS]
    ]
    more = f"{len(errors) - MOST_ERRORS} more are in the JSON. " if len(errors) > MOST_ERRORS else ""
    note = (
        f"{more}W: by the law of the cutting force, tool and workpiece added up. Along the axis: what a stylus meets "
        "that runs along the part; straight where the waves of all turns lie side by side."
    )
    heads = ["kind", "source", ">Hz", ">wavelength [mm]", "along", ">waves per turn", ">along the axis [mm]"]
    return table([*heads, ">copied [µm]", ">W [µm]"], rows, note)


def lines_table(lines: Sequence[LineSummary]) -> Table:
    """Every line with the amplitudes of both methods, the largest first."""
    ranked = sorted(lines, key=lambda one: -one.motion_um[RELATIVE])
    has_chains = any(value is not None for one in lines for value in one.chains_um.values())
    rows = [
        (
            one.source,
            f"{one.frequency_hz:.5g}",
            NONE if one.order is None else f"{one.order:.4g} × {one.shaft}",
            number_text(one.force_n),
            *(number_text(one.coupled_um[final]) for final in FINALS),
            *(number_text(one.chains_um[final]) for final in FINALS if has_chains),
        )
        for one in ranked[:MOST_LINES]
    ]
    more = f"{len(lines) - MOST_LINES} more are in the JSON. " if len(lines) > MOST_LINES else ""
    note = f"{more}Amplitudes in µm." + (" A dash: no chain of that range leads there." if has_chains else "")
    heads = [f">{name}" for name in FINALS.values()]
    return table(
        ["source", ">Hz", "order", ">N", *heads, *(f"{head}, chains" for head in heads if has_chains)], rows, note
    )


def modes_table(modes: StructureModes) -> Table:
    """Frequency, dissipation and shape of every mode."""
    count = len(modes.frequency_hz)
    rows = []
    for k in range(min(count, MOST_MODES)):
        shape = modes.shapes[:, k] / modes.shapes[int(np.argmax(np.abs(modes.shapes[:, k]))), k]
        order = [int(place) for place in np.argsort(-np.abs(shape), kind="stable")[:4] if abs(shape[place]) >= 0.1]
        moving = [
            f"{modes.members[place]} {number_text(math.copysign(abs(shape[place]), shape[place].real), 2)}"
            for place in order
        ]
        rows.append(
            (
                str(k + 1),
                f"{float(modes.frequency_hz[k]):.4g}",
                number_text(2.0 * math.pi * float(modes.loss_factor[k]), 3),
                ", ".join(moving),
            )
        )
    more = f"{count - MOST_MODES} more are in the JSON. " if count > MOST_MODES else ""
    note = f"{more}ψ: share of the energy that is lost in a cycle. Motions relative to the member that moves most."
    return table([">mode", ">Hz", ">ψ", "what moves"], rows, note)


def chains_table(accuracy: Sequence[ChainAccuracy]) -> Table:
    """How far every chain is off, and by which of its simplifications."""
    rows = [
        (
            one.chain,
            one.source or NONE,
            one.final,
            _share(one.published.share_within),
            _bands(one.published.bands_hz),
            _decibel_text(one.published.rms_db),
            _decibel_text(one.one_way.rms_db),
            _decibel_text(one.cut_out.rms_db),
        )
        for one in accuracy
    ]
    lowest = min(float(one.frequency_hz[0]) for one in accuracy)
    highest = max(float(one.frequency_hz[-1]) for one in accuracy)
    note = (
        "Against the coupled solution of the whole structure with the same force, from "
        f"{number_text(lowest)} to {number_text(highest)} Hz, evenly over the logarithm, in the chain's range, phase "
        "counted. One way: published against the coupled solution of the chain alone. Cut out: the chain "
        "alone, coupled, against the whole structure."
    )
    heads = ["chain", "source", "final", ">within 10 %", "widest bands within 10 % [Hz]", ">rms [dB]"]
    return table([*heads, ">one way [dB]", ">cut out [dB]"], rows, note)


def _decibel_text(value: float) -> str:
    return number_text(value) if value >= _LEAST_DB else "0"


def _share(share: float) -> str:
    return "< 1 %" if 0 < share < 0.005 else share_text(share)


def _bands(bands_hz: Sequence[tuple[float, float]], most: int = 3) -> str:
    widest = sorted(bands_hz, key=lambda band: math.log(max(band[0], 1e-9) / band[1]))[:most]
    return ", ".join(f"{number_text(a)} to {number_text(b)}" for a, b in sorted(widest)) or "nowhere"
