"""What is told of a simulated vibration: what it leaves behind, from which source and resonance, and the chains."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from selector.json_text import fields_of
from selector.number_text import number_text
from selector.physics.vibration.chains import ChainAccuracy
from selector.physics.vibration.motion.chatter import StabilityLimit
from selector.physics.vibration.motion.periodic_error import KindHeight, PeriodicError
from selector.physics.vibration.structure.structure import CarryingMode, StructureModes, carrying_mode
from selector.physics.vibration.vibration_model import FINALS as FINAL_MEMBERS
from selector.physics.vibration.vibration_model import RELATIVE, VibrationModel
from selector.physics.vibration.vibration_summary import LineSummary, VibrationSummary
from selector.telling.account import Account, Captioned, Table, section, table
from selector.telling.numbers import listed, share_text, span_text
from selector.telling.simulated.result import Drawings, SimulationResult, simulation_account
from selector.types import Vector

MOST_RUNS = 3
MOST_LINES = 40
MOST_ERRORS = 40
MOST_MODES = 30
FINALS = {"tool": "tool", "workpiece": "workpiece", RELATIVE: "tool − workpiece"}
_PERIODS = 6.0  #: Of the largest line, that a stretch of time shows.
_WORTH = 1.1  #: Times the depth without chatter from which on another speed is worth a word.
_FAR = 1.5  #: Amplification below which a line is not said to be near a resonance.
_MORE_THAN_MOTION = 3.0  #: Times the copied motion from which on a height by the force is said to be none.
_LEAST_DB = 1e-4  #: Difference below which two solutions are the same, to rounding.
_ALONG = {"cut": "along the cut", "feed": "along the feed"}


@dataclass(frozen=True, eq=False)
class Course:
    """Motions over a stretch of a run."""

    run: str
    from_s: float  #: Start of the stretch [s]
    time_s: Vector  #: (n_samples,): From there on [s]
    #: motions_um, forces_n and speeds_rpm: (n_samples,): As `figures.vibration.motion_course` draws them [µm, N, r/min]
    motions_um: Mapping[str, Vector]
    forces_n: Mapping[str, Vector]
    speeds_rpm: Mapping[str, Vector]
    is_whole: bool  #: Whether this is the whole run


def vibration_account(result: SimulationResult, drawings: Drawings) -> Account:
    """What is told of a simulated vibration: what the part keeps, where it comes from, where chains go wrong."""
    done, model, summary = result.simulated, result.simulated.model, result.summary
    heights = tuple(summary.heights.values())
    errors = stability = lines = chains = None
    if summary.errors:
        errors = section(
            "errors",
            "What the part keeps",
            *drawings.get("errors", ()),
            Captioned("Height by kind", kinds_table(heights)),
            Captioned("Periodic errors, highest first", errors_table(summary.errors)),
            link="Periodic errors",
        )
    if summary.stability is not None:
        stability = section("stability", "Where it chatters", *drawings.get("stability", ()), link="Chatter")
    if summary.lines:
        lines = section(
            "lines",
            "Where it comes from",
            *drawings.get("lines", ()),
            Captioned("Lines of the sources, largest first", lines_table(summary.lines)),
            Captioned("Motion", motions_table(summary)),
            link="Lines",
        )
    if summary.accuracy:
        chains = section(
            "chains",
            "Where the chains are off",
            Captioned("Chains against the coupled structure", chains_table(summary.accuracy)),
            link="Chains",
        )
    modes = Captioned("Modes of the coupled structure", modes_table(summary.modes))
    return simulation_account(
        result,
        _sentences(result),
        (
            errors,
            stability,
            lines,
            section("structure", "Structure and modes", modes),
            section("response", "Response", *drawings.get("response", ())),
            section("course", "Over time", *drawings.get("course", ())),
            chains,
        ),
        drawings=drawings,
        facts={
            "method": model.file.run.method,
            "speeds of lines and errors [r/min]": dict(summary.shaft_rpm),
            "phases of the sources [rad]": {
                run: dict(phases) for run, phases in list(done.details.phases_rad.items())[:1]
            },
        },
        data=_data(model, summary),
    )


def _sentences(result: SimulationResult) -> list[str]:
    """What matters most, and what it comes from."""
    model, summary = result.simulated.model, result.summary
    said = []
    turning = [one for one in motion_courses(result) if any(np.ptp(rpm) > 0 for rpm in one.speeds_rpm.values())]
    if turning:
        worst = max(turning, key=lambda one: float(np.abs(one.motions_um[RELATIVE]).max()))
        motion_um = np.abs(worst.motions_um[RELATIVE])
        k = int(np.argmax(motion_um))
        rpms = [f"{name} at {rpm[k]:.4g} r/min" for name, rpm in worst.speeds_rpm.items() if np.ptp(rpm) > 0]
        said.append(
            f"The tool moves against the workpiece by up to {number_text(float(motion_um[k]))} µm, after "
            f"{span_text(float(worst.time_s[k]))}, with {listed(rpms)}."
        )
        speeds = [f"{name} {rpm:.4g} r/min" for name, rpm in summary.shaft_rpm.items()]
        said.append(f"What follows is about the mean speeds: {listed(speeds)}.")
    carried = carrying(model, summary)
    if summary.errors:
        said += [error_sentence(highest(summary.errors), carried)]
        parts = [f"{one.kind} {number_text(one.kinematic_um)} µm" for one in summary.heights.values()]
        said += published_sentences(summary.errors)
        said.append(f"All lines of a kind together, root of the sum of squares: {listed(parts)}.")
    elif summary.lines:
        line = max(summary.lines, key=lambda one: one.motion_um[RELATIVE])
        said.append(
            f"The tool moves most against the workpiece at {line.frequency_hz:.4g} Hz, with an amplitude of "
            f"{number_text(line.motion_um[RELATIVE])} µm. It comes from {line.source}"
            f"{carried_text(carried, line.frequency_hz)}."
        )
    if summary.stability is not None:
        said.append(stability_sentence(summary.stability))
    said.append(motion_sentence(summary))
    if model.file.run.method == "chains":
        said.append("The motions are those of the chain method.")
    if summary.accuracy:
        said.append(chains_sentence(summary.accuracy))
    return said


def motion_courses(result: SimulationResult) -> list[Course]:
    """Of the first runs some periods about the largest motion, and the whole run where a speed changes in it."""
    return [course for run in result.recording.runs[:MOST_RUNS] for course in _courses(result, run)]


def _courses(result: SimulationResult, run: str) -> list[Course]:
    model, recording, summary = result.simulated.model, result.recording, result.summary
    time_s = recording.time_s(run)
    # channels stand as the model gives them, also where they are called as the recorded ones
    names = (*FINAL_MEMBERS, RELATIVE), tuple(source.name for source in model.sources), tuple(model.file.shafts)
    columns = iter(recording.values(run, list(recording.names)).T)
    motions, forces, speeds = ({name: next(columns) for name in group} for group in names)
    largest = max(summary.lines, key=lambda one: one.motion_um[RELATIVE], default=None)
    whole = slice(0, len(time_s))
    part = whole if largest is None else _stretch(time_s, motions[RELATIVE], _PERIODS / largest.frequency_hz)
    parts = [whole, part] if part != whole and any(np.ptp(rpm) > 0 for rpm in speeds.values()) else [part]
    return [
        Course(
            run=run,
            from_s=float(time_s[one.start] - time_s[0]),
            time_s=time_s[one] - time_s[one.start],
            motions_um={name: values[one] for name, values in motions.items()},
            forces_n={name: values[one] for name, values in forces.items()},
            speeds_rpm={name: values[one] for name, values in speeds.items()} if one == whole else {},
            is_whole=one == whole,
        )
        for one in parts
    ]


def _stretch(time_s: Vector, motion: Vector, duration_s: float) -> slice:
    """Samples of so long about the largest motion; all where that is most of the run."""
    k = int(np.nanargmax(np.abs(motion)))
    if duration_s > 0.6 * float(time_s[-1] - time_s[0]):
        return slice(0, len(time_s))
    start = max(float(time_s[0]), min(float(time_s[k]) - duration_s / 2.0, float(time_s[-1]) - duration_s))
    first, last = np.searchsorted(time_s, [start, start + duration_s]).tolist()
    return slice(first, min(max(last, first + 2) + 1, len(time_s)))


def carrying(model: VibrationModel, summary: VibrationSummary) -> CarryingMode | None:
    """The mode that carries what the page begins with: the highest error, or the largest line."""
    if summary.errors:
        worst = max(summary.errors, key=lambda one: one.kinematic_um)
        names, frequency_hz = worst.sources, worst.frequency_hz
    elif summary.lines:
        line = max(summary.lines, key=lambda one: one.motion_um[RELATIVE])
        names, frequency_hz = (line.source,), line.frequency_hz
    else:
        return None
    source = next(one for one in model.sources if one.name == names[0])
    tool, workpiece = (model.finals[name] for name in FINAL_MEMBERS)
    return carrying_mode(model.structure, summary.modes, source, frequency_hz, tool=tool, workpiece=workpiece)


def motions_table(summary: VibrationSummary) -> Table:
    """How far tool and workpiece move, over the combinations of phases that were tried."""
    counts = summary.amplitudes[RELATIVE].realisations
    rows = []
    for final, name in FINALS.items():
        one = summary.amplitudes[final]
        rows.append((name, one.expected_um, one.rms_um, one.largest_um))
    note = f"Over {counts} combinations of phases."
    return table(["motion [µm]", ">expected amplitude", ">rms", ">largest amplitude"], rows, note)


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


def motion_sentence(summary: VibrationSummary) -> str:
    """How far the tool moves against the workpiece, whatever the phases, and whose share that is."""
    one = summary.amplitudes[RELATIVE]
    text = (
        f"The tool moves against the workpiece by {number_text(one.rms_um)} µm root mean square; its amplitude is "
        f"{number_text(one.expected_um)} µm on average over {one.realisations} combinations of phases and over time, "
        f"{number_text(one.largest_um)} µm at most"
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


def stability_sentence(limit: StabilityLimit) -> str:
    """From which depth of cut on it chatters: at the speed of the workpiece, and at its best speed near by."""
    rpm = limit.cutting.workpiece_rpm
    depth, at_hz = limit.at_speed(rpm)
    speed, depths = (values[np.abs(np.log2(limit.lobes[0] / rpm)) <= 1.0] for values in limit.lobes)
    best = int(np.argmax(depths))
    if math.isinf(depth):
        return f"At {rpm:.6g} r/min no depth of cut that the workpiece has chatters."
    text = (
        f"At {rpm:.6g} r/min the cut chatters from a depth of {number_text(depth)} mm on, at {at_hz:.4g} Hz, if it "
        "swings along the thickness of the chip"
    )
    if depths[best] < _WORTH * depth:
        return f"{text}; half or twice the speed changes that by less than {share_text(_WORTH - 1.0)}."
    allowed = "any depth" if math.isinf(depths[best]) else f"{number_text(float(depths[best]))} mm"
    return f"{text}; {speed[best]:.4g} r/min allows {allowed}."


def kinds_table(heights: Sequence[KindHeight]) -> Table:
    """Height of every kind."""
    rows = [(one.kind, str(one.lines), one.kinematic_um, one.rms_um, one.published_um) for one in heights]
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
            one.wavelength_mm,
            one.direction,
            f"{one.waves_per_revolution:.4g}",
            one.axial_wavelength_mm or "straight",
            one.kinematic_um,
            one.published_um,
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
            None if one.order is None else f"{one.order:.4g} × {one.shaft}",
            one.force_n,
            *(one.coupled_um[final] for final in FINALS),
            *(one.chains_um[final] for final in FINALS if has_chains),
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
        psi = 2.0 * math.pi * float(modes.loss_factor[k])
        rows.append((str(k + 1), f"{float(modes.frequency_hz[k]):.4g}", psi, ", ".join(moving)))
    more = f"{count - MOST_MODES} more are in the JSON. " if count > MOST_MODES else ""
    note = f"{more}ψ: share of the energy that is lost in a cycle. Motions relative to the member that moves most."
    return table([">mode", ">Hz", ">ψ", "what moves"], rows, note)


def chains_table(accuracy: Sequence[ChainAccuracy]) -> Table:
    """How far every chain is off, and by which of its simplifications."""
    rows = [
        (
            one.chain,
            one.source or None,
            one.final,
            "< 1 %" if 0 < one.published.share_within < 0.005 else share_text(one.published.share_within),
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


def _bands(bands_hz: Sequence[tuple[float, float]]) -> str:
    widest = sorted(bands_hz, key=lambda band: math.log(max(band[0], 1e-9) / band[1]))[:3]
    return ", ".join(f"{number_text(a)} to {number_text(b)}" for a, b in sorted(widest)) or "nowhere"


def _data(model: VibrationModel, summary: VibrationSummary) -> dict[str, Any]:
    """`vibration` of `selector.simulation/1`."""
    return {
        "method": model.file.run.method,
        "shaft_rpm": dict(summary.shaft_rpm),
        "split_hz": summary.split_hz,
        "modes": _modes_data(summary.modes),
        "lines": [dict(vars(one)) for one in summary.lines],
        "amplitudes": {final: dict(vars(one)) for final, one in summary.amplitudes.items()},
        "periodic_errors": [dict(vars(one)) for one in summary.errors],
        "heights": {
            kind: {**fields_of(one, "kinematic_um", "rms_um", "published_um"), "frequencies": one.lines}
            for kind, one in summary.heights.items()
        },
        "stability": _stability_data(summary.stability),
        "chains": [_accuracy_data(one) for one in summary.accuracy],
    }


def _stability_data(limit: StabilityLimit | None) -> dict[str, Any] | None:
    if limit is None:
        return None
    least = int(np.argmin(limit.stiffness_n_per_m))
    rpm = limit.cutting.workpiece_rpm
    speed, depth = limit.lobes
    return {
        "least_stiffness_n_per_um": 1e-6 * float(limit.stiffness_n_per_m[least]),
        "frequency_hz": float(limit.frequency_hz[least]),
        "depth_mm": _finite(limit.at_speed(rpm)[0]),
        "speed_rpm": speed.tolist(),
        "limit_depth_mm": [_finite(one) for one in depth.tolist()],
    }


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _modes_data(modes: StructureModes) -> list[dict[str, Any]]:
    found = []
    for k, frequency in enumerate(modes.frequency_hz.tolist()):
        shape: list[complex] = modes.shapes[:, k].tolist()
        largest = max(shape, key=abs)
        found.append(
            {
                "frequency_hz": frequency,
                "loss_factor": float(modes.loss_factor[k]),
                "shape": {
                    name: [(part / largest).real, (part / largest).imag]
                    for name, part in zip(modes.members, shape, strict=True)
                },
            }
        )
    return found


def _accuracy_data(one: ChainAccuracy) -> dict[str, Any]:
    agreements = {name: dict(vars(getattr(one, name))) for name in ("published", "one_way", "cut_out")}
    return {
        **fields_of(one, "chain", "source", "final"),
        "from_hz": float(one.frequency_hz[0]),
        "to_hz": float(one.frequency_hz[-1]),
        **{name: {key: found[key] for key in found if key != "ratio"} for name, found in agreements.items()},
    }
