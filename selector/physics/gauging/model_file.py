"""What does the model file of in-process gauging say: TOML text → checked values, or an error that names the key."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from pathlib import Path
from typing import Any

from selector.errors import InputError
from selector.physics.gauging.model_length import length_contradictions
from selector.physics.gauging.model_limits import MOST_STAGES
from selector.physics.gauging.model_parts import file_parts, part_contradictions
from selector.physics.gauging.model_schema import KINDS, GaugingFile
from selector.physics.gauging.model_slips import early_slips, late_slips
from selector.physics.gauging.threshold import wear_share
from selector.physics.model_text import Contradiction, ModelFamily, bound_contradictions, plain_values
from selector.physics.model_values import refused


def read_model_file(path: str | Path) -> GaugingFile:
    """The gauging model file at `path`.

    Raises
    ------
    ModelFileError
        As `selector.physics.model_text.ModelFamily.read`.
    """
    return _FAMILY.read(path)


def parsed_model_file(text: str, *, where: str = "model file") -> GaugingFile:
    """The model file with this content; `where` names it in messages. Errors as `read_model_file`."""
    return _FAMILY.parsed(text, where=where)


def checked_model_file(values: Mapping[str, Any], *, where: str = "model file") -> GaugingFile:
    """The model file with these sections as plain values. Errors as `read_model_file`."""
    return _FAMILY.checked(values, where=where)


def contradictions(file: GaugingFile) -> Iterator[Contradiction]:
    """(key, found, expected, advice) of whatever does not fit together in a file whose values are valid one by one."""
    yield from _of_gauge(file)
    yield from early_slips(file)
    yield from part_contradictions(file)
    yield from _of_linear(file)
    yield from _of_wear(file)
    yield from _of_thresholds(file)
    yield from late_slips(file)
    yield from bound_contradictions(file.bounds)
    yield from length_contradictions(file)


def _of_gauge(file: GaugingFile) -> Iterator[Contradiction]:
    one = "one gauge: [transducer] with its parts, or [linear]"
    if file.transducer is None and file.linear is None:
        yield (
            ("linear",),
            "no gauge",
            one,
            "add gain_v_per_um, bias_v and time_constant_s under [linear], or a transducer",
        )
    elif file.transducer is not None and file.linear is not None:
        yield ("linear",), "a second gauge beside [transducer]", one, "leave one of the two out"
    if file.transducer is not None and file.relay is not None:
        expected = "the relay of [linear]"
        yield ("relay",), "a relay beside [transducer]", expected, "move its keys to [transducer.relay]"
    if file.transducer is None and file.run.waveform_s > 0:
        found, expected = "a waveform of a linear gauge", "a [transducer], whose parts swing"
        yield ("run", "waveform_s"), found, expected, "leave it out, or describe the gauge by its parts"


def _of_linear(file: GaugingFile) -> Iterator[Contradiction]:
    gauge = file_parts(file).linear
    if gauge is not None and gauge.gain_v_per_um >= 0:
        yield (
            ("linear", "gain_v_per_um"),
            f"{gauge.gain_v_per_um:g} V/µm",
            "a gain below 0: the voltage rises while the allowance falls",
            "turn the sign of gain_v_per_um" if gauge.gain_v_per_um > 0 else "give the slope of the gauge",
        )


def _of_wear(file: GaugingFile) -> Iterator[Contradiction]:
    grinding = file_parts(file).grinding
    since = min(file.run.parts, grinding.dress_every or file.run.parts)
    try:
        wear_share(grinding, since - 1)
    except InputError as error:
        yield refused(error, ("grinding",), file.grinding)


def _of_thresholds(file: GaugingFile) -> Iterator[Contradiction]:
    parts = file_parts(file)
    stages = len(parts.grinding.stages)
    if stages > MOST_STAGES:
        yield ("grinding", "stages"), f"{stages} stages", f"at most {MOST_STAGES}", "leave stages out"
    if file.thresholds is None:
        return
    key, volts = ("thresholds", "volts"), file.thresholds.volts
    if len(volts) != stages:
        many = f"{stages} stage{'s' * (stages != 1)}"
        advice = "give one voltage a stage, or leave the section out: they are then calculated (eq. 23)"
        yield key, f"{len(volts)} for {many}", "one threshold for each of the stages", advice
    elif any(later <= earlier for earlier, later in pairwise(volts)):
        found = ", ".join(f"{one:g}" for one in volts)
        yield key, f"{found} V", "voltages that rise, as that of the gauge does", "sort them as the stages are sorted"


_FAMILY: ModelFamily[GaugingFile] = ModelFamily(
    "gauging", KINDS, contradictions, page="docs/reference/gauging-model.md", examples="fixtures/gauging"
)

__all__ = [
    "GaugingFile",
    "checked_model_file",
    "contradictions",
    "parsed_model_file",
    "plain_values",
    "read_model_file",
]
