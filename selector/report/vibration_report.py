"""The report of a simulated vibration: what the part keeps, where it comes from, and where the chains go wrong."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selector import __version__
from selector.atomic_file import write_whole
from selector.figures import style
from selector.figures.chain_accuracy import accuracy_strips, chain_text, error_of_chains
from selector.figures.periodic_errors import errors_over_wavelength
from selector.figures.structure import View, can_be_drawn, chain_view, mode_view, structure_diagram
from selector.figures.vibration import (
    MOST_SOURCES,
    Answer,
    line_amplitudes,
    line_text,
    motion_course,
    response_over_frequency,
    source_colours,
)
from selector.findings import Finding
from selector.physics.channel_differences import ChannelDifference
from selector.physics.vibration.chain_values import Chain
from selector.physics.vibration.cutting import Cutting
from selector.physics.vibration.final_motion import Method
from selector.physics.vibration.periodic_error import Surface
from selector.physics.vibration.resonance import CarryingMode
from selector.physics.vibration.source import Source
from selector.physics.vibration.structure import Structure
from selector.physics.vibration.vibration_summary import RELATIVE, VibrationSummary
from selector.recording import Recording
from selector.report import origin
from selector.report.channels_part import channels_part, difference_sentence
from selector.report.numbers import NONE, given_text, listed, share_text
from selector.report.page import Picture, Pictures, rendered
from selector.report.simulation_report import channels_table
from selector.report.tables import Table, remarks_of, table
from selector.report.vibration_wording import (
    chains_sentence,
    chains_table,
    error_sentence,
    errors_table,
    highest,
    kinds_sentence,
    kinds_table,
    line_sentence,
    lines_table,
    modes_table,
    motion_sentence,
    published_sentences,
    run_up_sentence,
    source_shares,
)

Vector = NDArray[np.float64]
MOST_PARAMETERS = 200
MOST_VIEWS = 40


@dataclass(frozen=True, eq=False)
class Course:
    """Motions over a stretch of a run.

    Attributes
    ----------
    run : str
    from_s : float
        Start of the stretch [s].
    time_s : ndarray of shape (n_samples,)
        From there on [s].
    motions_um, forces_n, speeds_rpm : mapping of str to ndarray of shape (n_samples,)
        As `figures.vibration.motion_course` draws them [µm, N, r/min].
    is_whole : bool
        Whether this is the whole run.
    """

    run: str
    from_s: float
    time_s: Vector
    motions_um: Mapping[str, Vector]
    forces_n: Mapping[str, Vector]
    speeds_rpm: Mapping[str, Vector]
    is_whole: bool


@dataclass(frozen=True, eq=False)
class VibrationPage:
    """What the report of a vibration shows.

    Attributes
    ----------
    recording : Recording
        What was simulated.
    model : str
        Name of the model.
    structure : Structure
    sources : tuple of Source
    chains : tuple of Chain
    method : {"coupled", "chains"}
        By which the recording was made.
    summary : VibrationSummary
    cutting : Cutting or None
    surface : Surface
    carried : CarryingMode or None
        Mode that carries the line of the highest error, or else the largest line.
    frequency_hz : ndarray of shape (n_frequencies,)
        Of the answers [Hz].
    answers : mapping of str to tuple of Answer
        Final → its answer to every source.
    courses : tuple of Course
    inputs : tuple of str
        Channels that act on the structure.
    differences : tuple of ChannelDifference
        From the recordings that drove it, if any did.
    findings : tuple of Finding
    parameters : tuple of (name, value, unit, origin)
    told : mapping
        Facts about the origin: model file, its hash, seed.
    """

    recording: Recording
    model: str
    structure: Structure
    sources: tuple[Source, ...]
    chains: tuple[Chain, ...]
    method: str
    summary: VibrationSummary
    cutting: Cutting | None
    surface: Surface
    carried: CarryingMode | None
    frequency_hz: Vector
    answers: Mapping[str, tuple[Answer, ...]]
    courses: tuple[Course, ...]
    inputs: tuple[str, ...] = ()
    differences: tuple[ChannelDifference, ...] = ()
    findings: tuple[Finding, ...] = ()
    parameters: tuple[tuple[str, float, str, str], ...] = ()
    told: Mapping[str, Any] = field(default_factory=dict)


def write_vibration_report(page: VibrationPage, path: str | Path) -> Path:
    """Write the report of a vibration as one HTML file that needs no network; whole or not at all.

    Raises
    ------
    OptionError
        The file cannot be written; an old file of that name is untouched.
    """
    target = Path(path)
    # a lone surrogate in a name must not end the report
    write_whole(target, vibration_html(page).encode("utf-8", "replace"))
    return target


def vibration_html(page: VibrationPage) -> str:
    """The report as text, see `write_vibration_report`."""
    pictures, summary = Pictures(), page.summary
    colours = source_colours(_names_of_sources(page))
    sentences = _sentences(page)
    values: dict[str, Any] = {
        "title": f"Simulation: {page.model}",
        "version": __version__,
        "first": sentences[0],
        "more": sentences[1:],
        "comparison": channels_part(pictures, page.differences) if page.differences else None,
        "errors": _errors(pictures, page, colours),
        "lines": _lines(pictures, page, colours),
        "structure": _structure(pictures, page),
        "modes": modes_table(summary.modes),
        "response": _response(pictures, page, colours),
        "courses": [_course(pictures, page, one, colours) for one in page.courses],
        "chains": _chains(pictures, page),
        "remarks": remarks_of(page.findings),
        "channels": channels_table(page.recording, page.inputs),
        "parameters": _parameters(page),
        "origin": origin.remaining_table(page.told),
    }
    return rendered("vibration.html", values)


def _names_of_sources(page: VibrationPage) -> list[str]:
    """As in the file, or of more than can be told apart those first that move the tool most against the workpiece."""
    names = [source.name for source in page.sources]
    if len(names) <= MOST_SOURCES:
        return names
    shares = source_shares(page.summary.lines)
    return sorted(names, key=lambda name: -shares.get(name, 0.0))


def _sentences(page: VibrationPage) -> list[str]:
    """What matters most, and what it comes from."""
    summary = page.summary
    said = []
    turning = [one for one in page.courses if any(np.ptp(rpm) > 0 for rpm in one.speeds_rpm.values())]
    if turning:
        worst = max(turning, key=lambda one: float(np.abs(one.motions_um[RELATIVE]).max()))
        said.append(run_up_sentence(worst.time_s, worst.motions_um[RELATIVE], worst.speeds_rpm))
        speeds = [f"{name} {rpm:.4g} r/min" for name, rpm in summary.shaft_rpm.items()]
        said.append(f"What follows is about the mean speeds: {listed(speeds)}.")
    if summary.errors:
        said += [error_sentence(highest(summary.errors), page.carried)]
        said += [*published_sentences(summary.errors), kinds_sentence(tuple(summary.heights.values()))]
    elif summary.lines:
        said.append(line_sentence(max(summary.lines, key=lambda one: one.motion_um[RELATIVE]), page.carried))
    said.append(motion_sentence(summary))
    if page.method == "chains":
        said.append("The motions are those of the chain method.")
    if summary.accuracy:
        said.append(chains_sentence(summary.accuracy))
    compared = difference_sentence(page.differences)
    return [compared, *said] if compared else said


def _errors(pictures: Pictures, page: VibrationPage, colours: Mapping[str, str]) -> dict[str, Any] | None:
    errors = page.summary.errors
    if not errors or page.cutting is None:
        return None
    worst = highest(errors)
    title = (
        f"Computed: the highest error of copied motion, {style.number(worst.kinematic_um)} µm, is {worst.kind} with "
        f"{style.number(worst.wavelength_mm)} mm from one crest to the next"
    )
    drawn = errors_over_wavelength(errors, page.cutting, page.surface, colours, title)
    return {
        "picture": pictures.add(drawn, _ERRORS),
        "kinds": kinds_table(tuple(page.summary.heights.values())),
        "table": errors_table(errors),
    }


def _lines(pictures: Pictures, page: VibrationPage, colours: Mapping[str, str]) -> dict[str, Any] | None:
    lines = page.summary.lines
    if not lines:
        return None
    first = max(lines, key=lambda one: one.motion_um[RELATIVE])
    size = style.number(first.motion_um[RELATIVE])
    title = f"Computed: the largest line is {line_text(first)}, which moves the tool by {size} µm against the workpiece"
    other: Method = "coupled" if page.method == "chains" else "chains"
    drawn = line_amplitudes(lines, ("tool", "workpiece", RELATIVE), colours, other, title)
    text = f"Bars: by {'the chains' if page.method == 'chains' else 'the coupled structure'}."
    if any(value is not None for one in lines for value in one.chains_um.values()):
        text += f" Crosses: by {'the coupled structure' if page.method == 'chains' else 'the chains'}."
    return {"picture": pictures.add(drawn, text), "table": lines_table(lines)}


def _structure(pictures: Pictures, page: VibrationPage) -> Picture | None:
    structure, modes = page.structure, page.summary.modes
    if not can_be_drawn(structure):
        return None
    count = len(modes.frequency_hz)
    order = list(range(count))
    if page.carried is not None:
        order = [page.carried.mode, *(k for k in order if k != page.carried.mode)]
    views: list[View] = [
        mode_view(structure, f"mode {k + 1}, {modes.frequency_hz[k]:.4g} Hz", modes.shapes[:, k])
        for k in order[:MOST_VIEWS]
    ]
    views += [
        chain_view(structure, chain, f"chain {chain.name}, {', '.join(chain.sources)} to {chain.final}")
        for chain in page.chains[:MOST_VIEWS]
    ]
    first = order[0]
    which = "the mode that carries most" if page.carried is not None else "the lowest mode"
    title = (
        f"Computed: {len(structure.members)} members on {len(structure.joints)} joints; first in the menu is {which}, "
        f"at {float(modes.frequency_hz[first]):.4g} Hz"
    )
    drawn = structure_diagram(structure, page.sources, views, title)
    return pictures.add(drawn, _STRUCTURE + (_OF_CHAINS if page.chains else ""))


def _response(pictures: Pictures, page: VibrationPage, colours: Mapping[str, str]) -> Picture | None:
    shown = list(colours)[:MOST_SOURCES]
    answers = {final: [one for one in ones if one.source in shown] for final, ones in page.answers.items()}
    answers = {final: ones for final, ones in answers.items() if ones}
    if not answers:
        return None
    final, one, k = max(
        ((final, one, int(np.argmax(one.coupled_um_per_n))) for final, ones in answers.items() for one in ones),
        key=lambda case: float(case[1].coupled_um_per_n[case[2]]),
    )
    title = (
        f"Computed: the {style.label(final)} answers most to {style.label(one.source)} at "
        f"{float(page.frequency_hz[k]):.4g} Hz, "
        f"{style.number(float(one.coupled_um_per_n[k]))} µm per newton"
    )
    drawn = response_over_frequency(page.frequency_hz, answers, colours, title, page.summary.split_hz)
    has_chains = any(one.chains_um_per_n is not None for ones in answers.values() for one in ones)
    text = _RESPONSE + (_RESPONSE_OF_CHAINS if has_chains else "")
    if len(colours) > len(shown):
        text += f" Drawn are the {len(shown)} of {len(colours)} sources that move the tool most against the workpiece."
    return pictures.add(drawn, text)


def _course(pictures: Pictures, page: VibrationPage, one: Course, colours: Mapping[str, str]) -> Picture:
    motion = one.motions_um[RELATIVE]
    k = int(np.argmax(np.abs(motion)))
    unit, seconds = style.time_unit(one.from_s + float(one.time_s[-1]))
    of = f" of run {style.label(one.run)}" if len(page.recording.runs) > 1 else ""
    what = (
        f"the whole run{of}"
        if one.is_whole
        else f"{1e3 * float(one.time_s[-1]):.3g} ms{of} from {one.from_s / seconds:.4g} {unit} on"
    )
    title = f"Simulated: {what}; the tool is up to {style.number(float(abs(motion[k])))} µm off the workpiece's motion"
    drawn = motion_course(one.time_s, one.motions_um, one.forces_n, one.speeds_rpm, colours, title)
    return pictures.add(drawn, _COURSE if one.is_whole else _STRETCH)


def _chains(pictures: Pictures, page: VibrationPage) -> dict[str, Any] | None:
    accuracy = page.summary.accuracy
    if not accuracy:
        return None
    within = share_text(float(np.mean([one.published.share_within for one in accuracy])))
    strips = accuracy_strips(
        accuracy, f"Computed: the chain method is within 10 % of the coupled structure over {within} of the frequencies"
    )
    ranked = sorted(accuracy, key=lambda one: (one.published.share_within, -one.published.rms_db))
    worst = ranked[0]
    course = error_of_chains(
        ranked,
        f"Computed: {chain_text(worst)} is off most, by {style.number(worst.published.rms_db)} dB (rms); within 10 % "
        f"over {share_text(worst.published.share_within)} of its frequencies",
    )
    return {
        "pictures": [
            pictures.add(strips, _STRIPS),
            pictures.add(course, _ONE_CHAIN + (_OTHER_CHAINS if len(accuracy) > 1 else "")),
        ],
        "table": chains_table(accuracy),
    }


def _parameters(page: VibrationPage) -> Table | None:
    if not page.parameters:
        return None
    rows = [
        (name, given_text(value), NONE if unit in ("", "1") else unit, said)
        for name, value, unit, said in page.parameters
    ]
    more = f"{len(rows) - MOST_PARAMETERS} more are in the model file." if len(rows) > MOST_PARAMETERS else ""
    return table(["parameter", ">value", "unit", "from"], rows[:MOST_PARAMETERS], more)


_ERRORS = (
    "Filled: what a tip leaves that copies the motion of the tool against the workpiece. Hollow: W, the law of the "
    "cutting force, which takes inertia forces of tool and workpiece for changes of it. First revolution, without "
    "regeneration and chatter; grey: several sources."
)
_STRUCTURE = (
    "From the ground up; a joint is thicker where it is stiffer. Size: how far a member moves in the mode; blue: with "
    "the member that moves most, orange: against it. Bold: sources, with − where the opposite force acts."
)
_OF_CHAINS = " Of a chain: blue its path, green its branch, black what it takes as standing still."
_RESPONSE = "Amplitude per newton of each source; circles: lines of its spectrum."
_RESPONSE_OF_CHAINS = " Dashed: by the chains. Dotted: up to here those of the low range, then those of the high one."
_COURSE = "Long courses are drawn with the lowest and highest sample of each of 300 stretches; the file has them all."
_STRETCH = "Around the largest motion of the tool against the workpiece. Phases of the sources are drawn by the seed."
_STRIPS = "Error of amplitude and phase against the coupled solution of the whole structure, over the chain's range."
_ONE_CHAIN = (
    "Green: within 10 %. One way: what the back reaction makes, the chain alone solved both ways. Cut out: what "
    "merging, holding and leaving out members makes."
)
_OTHER_CHAINS = " The menu has all chains, the worst first."
