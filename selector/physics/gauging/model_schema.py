"""Which keys may the model file of in-process gauging have: closed sections, most of them fields of the gauge's values.

What each key means stands in `docs/reference/gauging-model.md`. Gauge, grinding, surface, noise and tolerance are made
from the dataclasses of `selector.physics.gauging`: a key is a field, with its unit and its default.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Annotated, Literal, TypeAlias

from pydantic import Field

from selector.physics.gauging.model_limits import MOST_STAGES, limits_of_key
from selector.physics.gauging.process import Grinding, Noise, Surface, Tolerance
from selector.physics.gauging.transducer import LinearGauge, Relay, Transducer
from selector.physics.model_entries import MOST_SAMPLES, Bounds, Entry, Name, Note, Seed, Signed, limited
from selector.physics.model_values import entry_of

MOST_PARTS = 1_000_000
"""Parts of one file."""

MOST_STEPS = 500_000_000
"""Samples of all parts together; some half a minute."""

MOST_WAVEFORM_S = 10.0
"""Of it thousands of samples a second are kept."""

if TYPE_CHECKING:
    TransducerSection: TypeAlias = Entry
    LinearSection: TypeAlias = Entry
    RelaySection: TypeAlias = Entry
    GrindingSection: TypeAlias = Entry
    SurfaceSection: TypeAlias = Entry
    NoiseSection: TypeAlias = Entry
    ToleranceSection: TypeAlias = Entry
else:
    _section = partial(entry_of, limits=limits_of_key)
    TransducerSection, LinearSection, RelaySection = _section(Transducer), _section(LinearGauge), _section(Relay)
    GrindingSection, SurfaceSection = _section(Grinding), _section(Surface)
    NoiseSection, ToleranceSection = _section(Noise), _section(Tolerance)


class ModelSection(Entry):
    """``[model]``."""

    kind: Literal["gauging"]
    name: Name
    note: Note = ""


class RunSection(Entry):
    """``[run]``: how many parts, how often they are looked at, with which noise."""

    period_s: Annotated[float, limited(1e-6, 10.0)] | None = None
    parts: Annotated[int, Field(strict=True, ge=1, le=MOST_PARTS)] = 1
    waveform_s: Annotated[float, limited(0, MOST_WAVEFORM_S)] = 0.0
    seed: Seed = 0


class ThresholdsSection(Entry):
    """``[thresholds]``: voltages of the relay, where they are not those of eq. 23."""

    volts: Annotated[tuple[Signed, ...], Field(min_length=1, max_length=MOST_STAGES)]


class RecordedSection(Entry):
    """``[recorded]``: channels of a recording, where role and name do not tell."""

    allowance: Name | None = None
    feed: Name | None = None
    gauge: Name | None = None
    measured: Name | None = None


class GaugingFile(Entry):
    """A gauge, the grinding that it stops, and what size is wanted."""

    model: ModelSection
    run: RunSection = RunSection()
    transducer: TransducerSection | None = None
    linear: LinearSection | None = None
    relay: RelaySection | None = None
    grinding: GrindingSection
    surface: SurfaceSection = SurfaceSection()
    noise: NoiseSection = NoiseSection()
    tolerance: ToleranceSection | None = None
    thresholds: ThresholdsSection | None = None
    recorded: RecordedSection = RecordedSection()
    bounds: Bounds = Field(default_factory=dict)


KINDS: Mapping[str, type[GaugingFile]] = {"gauging": GaugingFile}

__all__ = ["KINDS", "MOST_SAMPLES", "MOST_STEPS"]
