"""Which keys may the model file of a vibration have: closed sections, named as the fields of the values they make.

What each key means stands in `docs/reference/vibration-model.md`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag

from selector.physics.model_entries import MOST_SAMPLES, Entry, Name, Note, Seed, choice_tag, limited
from selector.physics.vibration.structure import GROUND

MOST_MEMBERS = 200
MOST_LINES = 2_000
LEAST_PERIOD_S = 1e-7
MOST_SINES = 500_000_000
"""Lines × samples of one run: some ten seconds."""

Stiffness = Annotated[float, limited(1e-3, 1e15)]
Dissipation = Annotated[float, limited(0, 100)]
Rpm = Annotated[float, limited(0, 1e6)]
Corner = tuple[Annotated[float, limited(0, 1e6)], Rpm]
_NUMBER, _CORNERS = choice_tag("number"), choice_tag("corners")


def _speed_kind(value: Any) -> str:
    return _CORNERS if isinstance(value, list | tuple) else _NUMBER


Speed = Annotated[
    Annotated[Rpm, Tag(_NUMBER)] | Annotated[tuple[Corner, ...], Field(min_length=2, max_length=10_000), Tag(_CORNERS)],
    Discriminator(_speed_kind),
]
"""A speed that stays, or the corners of a course that is straight between them."""

Exponent = Annotated[float, limited(-10, 10)]
Limit = Annotated[float, limited(-1e15, 1e15)]
Bounds = Annotated[dict[str, tuple[Limit, Limit]], Field(max_length=5_000)]


class ModelSection(Entry):
    """``[model]``."""

    kind: Literal["vibration"]
    name: Name
    note: Note = ""


class RunSection(Entry):
    """``[run]``: how often, how long, from which phases, by which method."""

    period_s: Annotated[float, limited(LEAST_PERIOD_S, 10)]
    duration_s: Annotated[float, limited(0, 1e6, above=True)]
    seed: Seed = 0
    method: Literal["coupled", "chains"] = "coupled"


class MemberSection(Entry):
    """``[members.NAME]``."""

    mass_kg: Annotated[float, limited(1e-9, 1e9)]


class JointSection(Entry):
    """``[[joints]]``."""

    between: tuple[Name, Name]
    stiffness_n_per_m: Stiffness
    dissipation: Dissipation = 0.0


def _grouped(path: Any) -> Any:
    """A text in a path stands for a group of one."""
    return [[group] if isinstance(group, str) else group for group in path] if isinstance(path, list | tuple) else path


Groups = Annotated[
    tuple[Annotated[tuple[Name, ...], Field(min_length=1, max_length=MOST_MEMBERS)], ...],
    BeforeValidator(_grouped),
    Field(max_length=MOST_MEMBERS),
]


class ChainSection(Entry):
    """``[[chains]]``."""

    name: Name
    range: Literal["high", "low"]
    sources: Annotated[tuple[Name, ...], Field(min_length=1, max_length=50)]
    path: Annotated[Groups, Field(min_length=1)]
    final: Name
    branch: Groups = ()
    held: Name = GROUND


class LineSection(Entry):
    """One of ``lines`` of a source."""

    frequency_hz: Annotated[float, limited(1e-6, 1e6)] | None = None
    order: Annotated[float, limited(1e-6, 1e5)] | None = None
    force_n: Annotated[float, limited(0, 1e9)] = 0.0
    unbalance_kg_m: Annotated[float, limited(0, 1e4)] = 0.0
    phase_rad: Annotated[float, limited(-1e3, 1e3)] = 0.0


class SourceSection(Entry):
    """``[sources.NAME]``."""

    member: Name
    lines: Annotated[tuple[LineSection, ...], Field(min_length=1, max_length=MOST_LINES)]
    against: Name | None = None
    shaft: Name | None = None


class ShaftSection(Entry):
    """``[shafts.NAME]``: its own speed, or that of another one times a ratio."""

    rpm: Speed | None = None
    of: Name | None = None
    ratio: Annotated[float, limited(0, 1e4, above=True)] | None = None


class CuttingSection(Entry):
    """``[cutting]``."""

    shaft: Name
    diameter_mm: Annotated[float, limited(0, 1e5, above=True)]
    feed_mm_per_rev: Annotated[float, limited(0, 1e3, above=True)]
    force_coefficient: Annotated[float, limited(0, 1e6, above=True)]
    depth_exponent: Annotated[float, limited(0, 10, above=True)]
    feed_exponent: Exponent
    speed_exponent: Exponent
    force_correction: Annotated[float, limited(0, 1e3, above=True)] = 1.0


class SurfaceSection(Entry):
    """``[surface]``: where one kind of periodic error ends and the next begins."""

    roughness_below_mm: Annotated[float, limited(0, 1e3, above=True)] = 0.8
    lobing_up_to_upr: Annotated[float, limited(2, 1e4)] = 15.0


class RealisationsSection(Entry):
    """``[realisations]``: phase shifts of every source, and how many times are looked at."""

    phases: Annotated[int, Field(strict=True, ge=1, le=360)] = 4
    sections: Annotated[int, Field(strict=True, ge=1, le=20_000)] = 1000


class FinalsSection(Entry):
    """``[finals]``: members whose motion is asked for."""

    tool: Name = "tool"
    workpiece: Name = "workpiece"


class SensingSection(Entry):
    """``[sensing]``."""

    noise_um: Annotated[float, limited(0, 1e4)] = 0.0


class VibrationFile(Entry):
    """A structure, what shakes it, and the cut that it shakes."""

    model: ModelSection
    run: RunSection
    members: Annotated[dict[Name, MemberSection], Field(min_length=1, max_length=MOST_MEMBERS)]
    joints: Annotated[tuple[JointSection, ...], Field(min_length=1, max_length=2_000)]
    chains: Annotated[tuple[ChainSection, ...], Field(max_length=50)] = ()
    sources: Annotated[dict[Name, SourceSection], Field(min_length=1, max_length=50)]
    shafts: Annotated[dict[Name, ShaftSection], Field(max_length=50)] = Field(default_factory=dict)
    cutting: CuttingSection | None = None
    surface: SurfaceSection = SurfaceSection()
    realisations: RealisationsSection = RealisationsSection()
    finals: FinalsSection = FinalsSection()
    sensing: SensingSection = SensingSection()
    bounds: Bounds = Field(default_factory=dict)


KINDS: Mapping[str, type[VibrationFile]] = {"vibration": VibrationFile}

__all__ = ["KINDS", "LEAST_PERIOD_S", "MOST_LINES", "MOST_MEMBERS", "MOST_SAMPLES", "MOST_SINES"]
