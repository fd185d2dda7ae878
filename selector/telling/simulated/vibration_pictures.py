"""The drawings of a simulated vibration: errors, stability, answers over frequency, courses."""

from collections.abc import Mapping, Sequence

import numpy as np

from selector.errors import InputError
from selector.figures import style
from selector.figures.simulated.vibration import (
    MOST_SOURCES,
    Answer,
    errors_over_wavelength,
    motion_course,
    response_over_frequency,
    source_colours,
    stability_lobes,
)
from selector.number_text import number_text
from selector.physics.vibration.motion.final_motion import ChainMethod, final_receptance
from selector.physics.vibration.structure.source import Source
from selector.physics.vibration.structure.structure import receptances, unit_force
from selector.physics.vibration.vibration_model import FINALS, RELATIVE, VibrationModel
from selector.physics.vibration.vibration_summary import VibrationSummary
from selector.telling.account import Block, Drawing
from selector.telling.simulated.result import SimulationResult
from selector.telling.simulated.vibration import Course, highest, motion_courses, source_shares
from selector.types import Vector

_FREQUENCIES = 600
_LOWEST_HZ = 1.0
#: Answers are drawn up to so many times the highest line or mode, but of modes only up to the other times the line.
_BEYOND, _FAR = 2.0, 10.0
_AROUND = np.linspace(-3.0, 3.0, 13)  #: Frequencies about a mode, in widths of its resonance, that a sharp one needs.
_NOTHING = 1e-9  #: Share of the largest answer below which there is none, but for rounding.
_MICRO = 1e6


def drawings(result: SimulationResult) -> dict[str, list[Block]]:
    """Section of the account → its drawings."""
    model, summary = result.simulated.model, result.summary
    colours = source_colours(_names_of_sources(model, summary))
    several = len(result.recording.runs) > 1
    return {
        "errors": _errors(model, summary, colours),
        "stability": _stability(summary),
        "response": _response(model, summary, colours),
        "course": [_course(one, colours, several) for one in motion_courses(result)],
    }


def _names_of_sources(model: VibrationModel, summary: VibrationSummary) -> list[str]:
    """As in the file, or of more than can be told apart those first that move the tool most against the workpiece."""
    names = [source.name for source in model.sources]
    if len(names) <= MOST_SOURCES:
        return names
    shares = source_shares(summary.lines)
    return sorted(names, key=lambda name: -shares.get(name, 0.0))


def _errors(model: VibrationModel, summary: VibrationSummary, colours: Mapping[str, str]) -> list[Block]:
    cutting = model.cutting(summary.shaft_rpm)
    if not summary.errors or cutting is None:
        return []
    worst = highest(summary.errors)
    title = (
        f"Computed: the highest error of copied motion, {number_text(worst.kinematic_um)} µm, is {worst.kind} with "
        f"{number_text(worst.wavelength_mm)} mm from one crest to the next"
    )
    drawn = errors_over_wavelength(summary.errors, cutting, model.surface, colours, title)
    return [Drawing(drawn, _ERRORS)]


def _stability(summary: VibrationSummary) -> list[Block]:
    limit = summary.stability
    if limit is None:
        return []
    rpm = limit.cutting.workpiece_rpm
    depth, _ = limit.at_speed(rpm)
    allowed = f"up to a depth of {number_text(depth)} mm" if np.isfinite(depth) else "at any depth"
    drawn = stability_lobes(limit, f"Computed: at {rpm:.4g} r/min the cut does not chatter {allowed}")
    return [Drawing(drawn, _STABILITY)]


def _response(model: VibrationModel, summary: VibrationSummary, colours: Mapping[str, str]) -> list[Block]:
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
    text = _RESPONSE + (_RESPONSE_OF_CHAINS if has_chains else "")
    if len(colours) > len(shown):
        text += f" Drawn are the {len(shown)} of {len(colours)} sources that move the tool most against the workpiece."
    return [Drawing(drawn, text)]


def _course(one: Course, colours: Mapping[str, str], several: bool) -> Drawing:
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
    return Drawing(drawn, _COURSE if one.is_whole else _STRETCH)


def _answers(
    model: VibrationModel, summary: VibrationSummary, shown: Sequence[str]
) -> tuple[Vector, Mapping[str, tuple[Answer, ...]]]:
    """Motion per newton of sources over frequency; nothing where a frequency meets an undamped resonance."""
    modes = summary.modes
    slowest, fastest = float(modes.frequency_hz[0]), float(modes.frequency_hz[-1])
    last = max((one.frequency_hz for one in summary.lines), default=slowest)
    highest = max(_BEYOND * last, min(_BEYOND * fastest, _FAR * last))
    lowest = min([_LOWEST_HZ, highest / 100.0, *(0.7 * one.frequency_hz for one in summary.lines)])
    near = modes.frequency_hz[:, None] * (1.0 + modes.loss_factor[:, None] / 2.0 * _AROUND)
    frequency_hz = np.unique(np.concatenate([np.geomspace(lowest, highest, _FREQUENCIES), near.ravel()]))
    frequency_hz = frequency_hz[(frequency_hz >= lowest) & (frequency_hz <= highest)]
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
    forces = np.array([unit_force(structure, source.member, source.against) for source in sources])
    try:
        motion = receptances(structure, frequency_hz, forces)
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


_ERRORS = (
    "Filled: what a tip leaves that copies the motion of the tool against the workpiece. Hollow: W, the law of the "
    "cutting force, which takes inertia forces of tool and workpiece for changes of it. First revolution, without "
    "regeneration and chatter; grey: several sources."
)
_STABILITY = (
    "Below the line the waves of one turn die out in the next, above it they grow. The tool is taken to swing along "
    "the thickness of the chip, on the whole structure. Dotted: the speed of the workpiece. What rubs on the flank at "
    "low speeds, and holds chatter back there, is not in it."
)
_RESPONSE = "Amplitude per newton of each source; circles: lines of its spectrum."
_RESPONSE_OF_CHAINS = " Dashed: by the chains. Dotted: up to here those of the low range, then those of the high one."
_COURSE = "Long courses are drawn with the lowest and highest sample of each of 300 stretches; the file has them all."
_STRETCH = "Around the largest motion of the tool against the workpiece. Phases of the sources are drawn by the seed."
