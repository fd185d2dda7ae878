"""What is told of a simulated vibration: what it leaves behind, from which source and resonance, and the chains."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from selector.errors import InputError
from selector.json_text import fields_of
from selector.number_text import listed, number_text, span_text
from selector.physics.vibration import structure as structures
from selector.physics.vibration.chains import ChainAccuracy
from selector.physics.vibration.final_motion import ChainMethod, final_receptance
from selector.physics.vibration.periodic_error import KindHeight, PeriodicError, StabilityLimit
from selector.physics.vibration.structure import Source
from selector.physics.vibration.vibration_model import FINALS, RELATIVE, VibrationModel
from selector.physics.vibration.vibration_summary import LineSummary, VibrationSummary
from selector.telling.account import Account, Block, Drawing, Table, captioned, legend, section, table
from selector.telling.numbers import share_text
from selector.telling.simulated.result import THINNED, SimulationResult, simulation_account
from selector.types import Vector

if TYPE_CHECKING:
    from selector.figures.simulated.vibration import Answer

MOST_RUNS = 3
MOST_ROWS = 40
_MOTIONS = {"tool": "tool", "workpiece": "workpiece", RELATIVE: "tool − workpiece"}
_PERIODS = 6.0  #: Of the largest line, that a stretch of time shows.
_SPEED_HOLDS = 0.02  #: To either side of a speed that is advised.
_WORTH = 1.1  #: Times the depth without chatter from which on another speed is worth a word.
_FAR = 1.5  #: Amplification below which a line is not said to be near a resonance.
_ALONG = {"cut": "along the cut", "feed": "along the feed"}
_FREQUENCIES = 600
_LOWEST_HZ = 1.0
#: Answers are drawn up to so many times the highest line or mode, but of modes only up to the other times the line.
_BEYOND, _BEYOND_LINES = 2.0, 10.0
_AROUND = np.linspace(-3.0, 3.0, 13)  #: Frequencies about a mode, in widths of its resonance, that a sharp one needs.
_NOTHING = 1e-9  #: Share of the largest answer below which there is none, but for rounding.
_MICRO = 1e6


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


def vibration_account(result: SimulationResult, drawn: bool) -> Account:
    """What is told of a simulated vibration: what the part keeps, where it comes from, where chains go wrong."""
    model, summary = result.simulated.model, result.summary
    drawings = _drawings(result) if drawn else {}
    kinds = captioned("Height by kind", kinds_table(tuple(summary.heights.values())))
    errors = captioned("Periodic errors, highest first", errors_table(summary.errors))
    lines = captioned("Lines of the sources, largest first", lines_table(summary.lines))
    modes = captioned("Modes of the coupled structure", modes_table(summary.modes))
    chains = captioned("Chains against the coupled structure", chains_table(summary.accuracy))
    return simulation_account(
        result,
        list(_sentences(result)),
        (
            section(
                "errors", "What the part keeps", *drawings.get("errors", ()), kinds, errors, link="Periodic errors"
            ),
            section("stability", "Where it chatters", *drawings.get("stability", ()), link="Chatter"),
            section("lines", "Where it comes from", lines, link="Lines"),
            section("structure", "Structure and modes", modes),
            section("response", "Response", *drawings.get("response", ())),
            section("course", "Over time", *drawings.get("course", ())),
            section("chains", "Where the chains are off", chains, link="Chains"),
        ),
        drawings=drawings,
        facts={"method": model.file.run.method, "speeds of lines and errors [r/min]": dict(summary.shaft_rpm)},
        data=_data(model, summary),
    )


def _sentences(result: SimulationResult) -> Iterator[str]:
    """What matters most, and what it comes from."""
    model, summary = result.simulated.model, result.summary
    turning = [one for one in motion_courses(result) if any(np.ptp(rpm) > 0 for rpm in one.speeds_rpm.values())]
    if turning:
        worst = max(turning, key=lambda one: float(np.abs(one.motions_um[RELATIVE]).max()))
        motion_um = np.abs(worst.motions_um[RELATIVE])
        k = int(np.argmax(motion_um))
        rpms = [f"{name} at {rpm[k]:.4g} r/min" for name, rpm in worst.speeds_rpm.items() if np.ptp(rpm) > 0]
        yield (
            f"The tool moves against the workpiece by up to {number_text(float(motion_um[k]))} µm, after "
            f"{span_text(float(worst.time_s[k]))}, with {listed(rpms)}."
        )
        speeds = [f"{name} {rpm:.4g} r/min" for name, rpm in summary.shaft_rpm.items()]
        yield f"What follows is about the mean speeds: {listed(speeds)}."
    carried = carrying(model, summary)
    if summary.errors:
        yield error_sentence(highest(summary.errors), carried)
    elif summary.lines:
        line = max(summary.lines, key=lambda one: one.motion_um[RELATIVE])
        yield (
            f"The tool moves most against the workpiece at {line.frequency_hz:.4g} Hz, with an amplitude of "
            f"{number_text(line.motion_um[RELATIVE])} µm. It comes from {line.source}"
            f"{carried_text(carried, line.frequency_hz)}."
        )
    if summary.stability is not None:
        yield stability_sentence(summary.stability)
    yield motion_sentence(summary)
    if model.file.run.method == "chains":
        yield "The motions are those of the chain method."
    if summary.accuracy:
        yield chains_sentence(summary.accuracy)


def motion_courses(result: SimulationResult) -> list[Course]:
    """Of the first runs some periods about the largest motion, or the whole run where a speed changes in it."""
    return [_motion_course(result, run) for run in result.recording.runs[:MOST_RUNS]]


def _motion_course(result: SimulationResult, run: str) -> Course:
    model, recording, summary = result.simulated.model, result.recording, result.summary
    time_s = recording.time_s(run)
    # channels stand as the model gives them, also where they are called as the recorded ones
    names = (*FINALS, RELATIVE), tuple(source.name for source in model.sources), tuple(model.file.shafts)
    columns = iter(recording.values(run, list(recording.names)).T)
    motions, forces, speeds = ({name: next(columns) for name in group} for group in names)
    largest = max(summary.lines, key=lambda one: one.motion_um[RELATIVE], default=None)
    whole = slice(0, len(time_s))
    turns = any(np.ptp(rpm) > 0 for rpm in speeds.values())
    part = whole
    if largest is not None and not turns:
        part = _stretch(time_s, motions[RELATIVE], _PERIODS / largest.frequency_hz)
    return Course(
        run=run,
        from_s=float(time_s[part.start] - time_s[0]),
        time_s=time_s[part] - time_s[part.start],
        motions_um={name: values[part] for name, values in motions.items()},
        forces_n={name: values[part] for name, values in forces.items()},
        speeds_rpm={name: values[part] for name, values in speeds.items()} if part == whole else {},
        is_whole=part == whole,
    )


def _stretch(time_s: Vector, motion: Vector, duration_s: float) -> slice:
    """Samples of so long about the largest motion; all where that is most of the run."""
    k = int(np.nanargmax(np.abs(motion)))
    if duration_s > 0.6 * float(time_s[-1] - time_s[0]):
        return slice(0, len(time_s))
    start = max(float(time_s[0]), min(float(time_s[k]) - duration_s / 2.0, float(time_s[-1]) - duration_s))
    first, last = np.searchsorted(time_s, [start, start + duration_s]).tolist()
    return slice(first, min(max(last, first + 2) + 1, len(time_s)))


def carrying(model: VibrationModel, summary: VibrationSummary) -> structures.CarryingMode | None:
    """The mode that carries what the page begins with: the highest error, or the largest line."""
    if summary.errors:
        worst = highest(summary.errors)
        names, frequency_hz = worst.sources, worst.frequency_hz
    elif summary.lines:
        line = max(summary.lines, key=lambda one: one.motion_um[RELATIVE])
        names, frequency_hz = (line.source,), line.frequency_hz
    else:
        return None
    source = next(one for one in model.sources if one.name == names[0])
    tool, workpiece = (model.finals[name] for name in FINALS)
    return structures.carrying_mode(
        model.structure, summary.modes, source, frequency_hz, tool=tool, workpiece=workpiece
    )


def highest(errors: Sequence[PeriodicError]) -> PeriodicError:
    """The error that is the highest if the tip copies the motion."""
    return max(errors, key=lambda one: one.kinematic_um)


def error_sentence(one: PeriodicError, carried: structures.CarryingMode | None) -> str:
    """The highest periodic error: height, kind, wavelength, source and resonance."""
    return (
        f"The highest periodic error is {one.kind} of {number_text(one.kinematic_um)} µm, every "
        f"{number_text(one.wavelength_mm)} mm {_ALONG[one.direction]}. It comes from {listed(one.sources)} at "
        f"{one.frequency_hz:.4g} Hz{carried_text(carried, one.frequency_hz)}."
    )


def carried_text(carried: structures.CarryingMode | None, frequency_hz: float) -> str:
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
    speed, depths = limit.lobes
    # what a speed allows holds a little above and below it, too
    depths = np.array([depths[np.abs(speed / one - 1.0) <= _SPEED_HOLDS].min() for one in speed])
    depths[np.abs(np.log2(speed / rpm)) > 1.0] = 0.0
    best = int(np.argmax(depths))
    if math.isinf(depth):
        return f"At {rpm:.6g} r/min no depth of cut that the workpiece has chatters."
    text = f"At {rpm:.6g} r/min the cut chatters from a depth of {number_text(depth)} mm on, at {at_hz:.4g} Hz, if it "
    text += "swings along the thickness of the chip"
    if depths[best] < _WORTH * depth:
        return f"{text}; half or twice the speed changes that by less than {share_text(_WORTH - 1.0)}."
    allowed = "any depth" if math.isinf(depths[best]) else f"{number_text(float(depths[best]))} mm"
    return f"{text}; {float(f'{speed[best]:.3g}'):g} r/min ± {100 * _SPEED_HOLDS:.0f} % allows {allowed}."


def kinds_table(heights: Sequence[KindHeight]) -> Table:
    """Height of every kind."""
    rows = [(one.kind, str(one.lines), one.kinematic_um, one.rms_um) for one in heights]
    return table(["kind", ">frequencies", ">copied motion [µm]", ">W [µm]"], rows, legend("vibration.kinds"))


def errors_table(errors: Sequence[PeriodicError]) -> Table:
    """Every periodic error, the highest first."""
    ranked = sorted(errors, key=lambda one: -one.kinematic_um)
    rows = [
        (one.kind, ", ".join(one.sources), f"{one.frequency_hz:.5g}", one.wavelength_mm, one.direction,
         f"{one.waves_per_revolution:.4g}", one.kinematic_um, one.published_um)
        for one in ranked[:MOST_ROWS]
    ]  # fmt: skip
    more = f"{len(errors) - MOST_ROWS} more are in the JSON. " if len(errors) > MOST_ROWS else ""
    note = f"{more}W: by the law of the cutting force, tool and workpiece added up."
    heads = ["kind", "source", ">Hz", ">wavelength [mm]", "along", ">waves per turn"]
    return table([*heads, ">copied [µm]", ">W [µm]"], rows, note)


def lines_table(lines: Sequence[LineSummary]) -> Table:
    """Every line with its amplitudes, the largest first."""
    ranked = sorted(lines, key=lambda one: -one.motion_um[RELATIVE])
    rows = [
        (one.source, f"{one.frequency_hz:.5g}", None if one.order is None else f"{one.order:.4g} × {one.shaft}",
         one.force_n, *(one.coupled_um[final] for final in _MOTIONS))
        for one in ranked[:MOST_ROWS]
    ]  # fmt: skip
    more = f"{len(lines) - MOST_ROWS} more are in the JSON. " if len(lines) > MOST_ROWS else ""
    heads = ["source", ">Hz", "order", ">N", *(f">{name}" for name in _MOTIONS.values())]
    return table(heads, rows, f"{more}Amplitudes in µm.")


def modes_table(modes: structures.StructureModes) -> Table:
    """Frequency, dissipation and shape of every mode."""
    count = len(modes.frequency_hz)
    rows = []
    for k in range(min(count, MOST_ROWS)):
        shape = modes.shapes[:, k] / modes.shapes[int(np.argmax(np.abs(modes.shapes[:, k]))), k]
        order = [int(place) for place in np.argsort(-np.abs(shape), kind="stable")[:4] if abs(shape[place]) >= 0.1]
        moving = [
            f"{modes.members[place]} {number_text(math.copysign(abs(shape[place]), shape[place].real), 2)}"
            for place in order
        ]
        psi = 2.0 * math.pi * float(modes.loss_factor[k])
        rows.append((str(k + 1), f"{float(modes.frequency_hz[k]):.4g}", psi, ", ".join(moving)))
    more = f"{count - MOST_ROWS} more are in the JSON. " if count > MOST_ROWS else ""
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
            number_text(round(one.published.rms_db, 4)),
            number_text(round(one.one_way.rms_db, 4)),
            number_text(round(one.cut_out.rms_db, 4)),
        )
        for one in accuracy
    ]
    heads = ["chain", "source", "final", ">within 10 %", ">rms [dB]"]
    return table([*heads, ">one way [dB]", ">cut out [dB]"], rows, legend("vibration.chains"))


def _drawings(result: SimulationResult) -> dict[str, list[Block]]:
    """Section of the account → its drawings."""
    from selector.figures.simulated.vibration import MOST_SOURCES, source_colours

    model, summary = result.simulated.model, result.summary
    names = [source.name for source in model.sources]
    if len(names) > MOST_SOURCES:
        # those first that move the tool most against the workpiece
        shares = source_shares(summary.lines)
        names.sort(key=lambda name: -shares.get(name, 0.0))
    colours = source_colours(names)
    several = len(result.recording.runs) > 1
    return {
        "errors": _errors(model, summary, colours),
        "stability": _stability(summary),
        "response": _response(model, summary, colours),
        "course": [_course(one, colours, several) for one in motion_courses(result)],
    }


def _errors(model: VibrationModel, summary: VibrationSummary, colours: Mapping[str, str]) -> list[Block]:
    from selector.figures.simulated.vibration import errors_over_wavelength

    cutting = model.cutting(summary.shaft_rpm)
    if not summary.errors or cutting is None:
        return []
    worst = highest(summary.errors)
    title = (
        f"Computed: the highest error of copied motion, {number_text(worst.kinematic_um)} µm, is {worst.kind} with "
        f"{number_text(worst.wavelength_mm)} mm from one crest to the next"
    )
    drawn = errors_over_wavelength(summary.errors, cutting, model.surface, colours, title)
    return [Drawing(drawn, legend("vibration.errors"))]


def _stability(summary: VibrationSummary) -> list[Block]:
    from selector.figures.simulated.vibration import stability_lobes

    limit = summary.stability
    if limit is None:
        return []
    rpm = limit.cutting.workpiece_rpm
    depth, _ = limit.at_speed(rpm)
    allowed = f"up to a depth of {number_text(depth)} mm" if np.isfinite(depth) else "at any depth"
    drawn = stability_lobes(limit, f"Computed: at {rpm:.4g} r/min the cut does not chatter {allowed}")
    return [Drawing(drawn, legend("vibration.stability"))]


def _response(model: VibrationModel, summary: VibrationSummary, colours: Mapping[str, str]) -> list[Block]:
    from selector.figures import style
    from selector.figures.simulated.vibration import MOST_SOURCES, response_over_frequency

    shown = list(colours)[:MOST_SOURCES]
    frequency_hz, of_finals = _answers(model, summary, shown)
    answers = {final: ones for final, ones in of_finals.items() if ones}
    if not answers:
        return []
    final, one, k = max(
        ((final, one, int(np.argmax(one.coupled_um_per_n))) for final, ones in answers.items() for one in ones),
        key=lambda case: float(case[1].coupled_um_per_n[case[2]]),
    )
    title = (
        f"Computed: the {style.label(final)} answers most to {style.label(one.source)} at "
        f"{float(frequency_hz[k]):.4g} Hz, "
        f"{number_text(float(one.coupled_um_per_n[k]))} µm per newton"
    )
    drawn = response_over_frequency(frequency_hz, answers, colours, title, summary.split_hz)
    has_chains = any(one.chains_um_per_n is not None for ones in answers.values() for one in ones)
    text = legend("vibration.response") + (legend("vibration.response-of-chains") if has_chains else "")
    if len(colours) > len(shown):
        text += f" Drawn are the {len(shown)} of {len(colours)} sources that move the tool most against the workpiece."
    return [Drawing(drawn, text)]


def _course(one: Course, colours: Mapping[str, str], several: bool) -> Drawing:
    from selector.figures import style
    from selector.figures.simulated.vibration import motion_course

    motion = one.motions_um[RELATIVE]
    k = int(np.argmax(np.abs(motion)))
    unit, seconds = style.time_unit(one.from_s + float(one.time_s[-1]))
    of = f" of run {style.label(one.run)}" if several else ""
    what = (
        f"the whole run{of}"
        if one.is_whole
        else f"{1e3 * float(one.time_s[-1]):.3g} ms{of} from {one.from_s / seconds:.4g} {unit} on"
    )
    title = f"Simulated: {what}; the tool is up to {number_text(float(abs(motion[k])))} µm off the workpiece's motion"
    drawn = motion_course(one.time_s, one.motions_um, one.forces_n, one.speeds_rpm, colours, title)
    return Drawing(drawn, THINNED if one.is_whole else legend("vibration.stretch"))


def _answers(
    model: VibrationModel, summary: VibrationSummary, shown: Sequence[str]
) -> tuple[Vector, Mapping[str, tuple[Answer, ...]]]:
    """Motion per newton of sources over frequency; nothing where a frequency meets an undamped resonance."""
    from selector.figures.simulated.vibration import Answer

    modes = summary.modes
    slowest, fastest = float(modes.frequency_hz[0]), float(modes.frequency_hz[-1])
    last = max((one.frequency_hz for one in summary.lines), default=slowest)
    last_hz = max(_BEYOND * last, min(_BEYOND * fastest, _BEYOND_LINES * last))
    first_hz = min([_LOWEST_HZ, last_hz / 100.0, *(0.7 * one.frequency_hz for one in summary.lines)])
    near = modes.frequency_hz[:, None] * (1.0 + modes.loss_factor[:, None] / 2.0 * _AROUND)
    frequency_hz = np.unique(np.concatenate([np.geomspace(first_hz, last_hz, _FREQUENCIES), near.ravel()]))
    frequency_hz = frequency_hz[(frequency_hz >= first_hz) & (frequency_hz <= last_hz)]
    sources = [source for source in model.sources if source.name in shown]
    coupled = _coupled_um(model, sources, frequency_hz)
    largest = max((float(answer.max()) for answer in coupled.values()), default=0.0)
    found: dict[str, list[Answer]] = {final: [] for final in FINALS}
    method = model.chain_method(summary.shaft_rpm)
    for source in sources:
        chains = None if method is None else _chains_um(model, source, frequency_hz, method)
        lines_hz = np.array([one.frequency_hz for one in summary.lines if one.source == source.name])
        for row, final in enumerate(FINALS):
            answer = coupled.get((source.name, final))
            if answer is None or answer.max() <= _NOTHING * largest:
                continue
            by_chains = None if chains is None or np.isnan(chains[row]).all() else chains[row]
            found[final].append(Answer(source.name, np.maximum(answer, _NOTHING * largest), by_chains, lines_hz))
    return frequency_hz, {final: tuple(answers) for final, answers in found.items()}


def _coupled_um(
    model: VibrationModel, sources: Sequence[Source], frequency_hz: Vector
) -> Mapping[tuple[str, str], Vector]:
    """Source and final → |X/F| [µm/N]."""
    structure = model.structure
    forces = np.array([structures.unit_force(structure, source.member, source.against) for source in sources])
    try:
        motion = structures.receptances(structure, frequency_hz, forces)
    except InputError:
        return {}
    return {
        (source.name, final): _MICRO * np.abs(motion[row][:, structure.position(model.finals[final])])
        for row, source in enumerate(sources)
        for final in FINALS
    }


def _chains_um(model: VibrationModel, source: Source, frequency_hz: Vector, chains: ChainMethod) -> Vector | None:
    """|X/F| of the finals [µm/N] by the chains; NaN where none leads there from the source."""
    try:
        found = final_receptance(model.structure, source, frequency_hz, model.finals, chains)
    except InputError:
        return None
    return np.where(found.carried, _MICRO * np.abs(found.motion_m_per_n), np.nan)


def _data(model: VibrationModel, summary: VibrationSummary) -> dict[str, Any]:
    """`vibration` of `selector.simulation/1`."""
    return {
        "method": model.file.run.method,
        "shaft_rpm": dict(summary.shaft_rpm),
        "split_hz": summary.split_hz,
        "modes": list(_modes_data(summary.modes)),
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
    stiffness, frequency_hz = limit.least
    rpm = limit.cutting.workpiece_rpm
    speed, depth = limit.lobes
    return {
        "least_stiffness_n_per_um": 1e-6 * stiffness,
        "frequency_hz": frequency_hz,
        "depth_mm": limit.at_speed(rpm)[0],
        "speed_rpm": speed.tolist(),
        "limit_depth_mm": depth.tolist(),
    }


def _modes_data(modes: structures.StructureModes) -> Iterator[dict[str, Any]]:
    for k, frequency in enumerate(modes.frequency_hz.tolist()):
        shape: list[complex] = modes.shapes[:, k].tolist()
        largest = max(shape, key=abs)
        yield {
            "frequency_hz": frequency,
            "loss_factor": float(modes.loss_factor[k]),
            "shape": {
                name: [(part / largest).real, (part / largest).imag]
                for name, part in zip(modes.members, shape, strict=True)
            },
        }


def _accuracy_data(one: ChainAccuracy) -> dict[str, Any]:
    agreements = {name: dict(vars(getattr(one, name))) for name in ("published", "one_way", "cut_out")}
    return {
        **fields_of(one, "chain", "source", "final"),
        "from_hz": float(one.frequency_hz[0]),
        "to_hz": float(one.frequency_hz[-1]),
        **{name: {key: found[key] for key in found if key != "ratio"} for name, found in agreements.items()},
    }
