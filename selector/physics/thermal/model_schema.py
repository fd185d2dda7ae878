"""Which keys may a thermal model file have: closed sections for networks, modes and the field machine.

A key carries its unit in its name, as everywhere in the program: a number in a file then has one meaning, and the
same name serves the file, the law in Python and the parameter of a fit. What each key means stands in
`docs/reference/thermal-model.md`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, StrictBool, Tag

from selector.physics.model_entries import (
    MOST_SAMPLES,
    Bounds,
    Column,
    Entry,
    Name,
    NonNegative,
    Note,
    Point,
    Positive,
    Seed,
    Share,
    Signed,
    choice_tag,
    limited,
)

MOST_NODES = 300
"""Nodes of a network. Its exact stepping costs their number cubed."""

MOST_SENSORS = 1000
"""Thermometers of a model, candidates among them."""

Exponent = Annotated[float, limited(0, 4)]
Degrees = Annotated[float, limited(-100, 1000)]
Speed = Annotated[float, limited(1e-3, 1e6)]


class Sine(Entry):
    """A course that swings: mean + amplitude·sin(2π(t − phase)/period); values in the unit of its key."""

    mean: Signed
    amplitude: Signed
    period_min: Positive = 1440.0
    phase_min: Signed = 0.0


Step = tuple[Annotated[float, limited(0, 1e9)], Signed]
Steps = Annotated[tuple[Step, ...], Field(min_length=1, max_length=10_000)]


def _course_kind(value: Any) -> str:
    if isinstance(value, list | tuple):
        return _STEPS
    if isinstance(value, Column) or (isinstance(value, Mapping) and ("file" in value or "column" in value)):
        return _COLUMN
    return _SINE if isinstance(value, Sine | Mapping) else _NUMBER


_NUMBER, _STEPS, _SINE, _COLUMN = (choice_tag(form) for form in ("number", "steps", "sine", "column"))

Course = Annotated[
    Annotated[Signed, Tag(_NUMBER)]
    | Annotated[Steps, Tag(_STEPS)]
    | Annotated[Sine, Tag(_SINE)]
    | Annotated[Column, Tag(_COLUMN)],
    Discriminator(_course_kind),
]
"""A number that holds for the whole run, steps [from minute, value], a sine, or a column of a file."""


class ModelSection(Entry):
    """``[model]``."""

    kind: Literal["network", "modes", "field"]
    name: Name
    note: Note = ""


class RunSection(Entry):
    """``[run]``: how long, how often, how finely, and from which state."""

    duration_min: Annotated[float, limited(0, 1e6, above=True)]
    period_s: Annotated[float, limited(0, 1e6, above=True)] = 60.0
    step_s: Annotated[float, limited(0, 1e6, above=True)] = 10.0
    start_degc: Degrees | None = None
    seed: Seed = 0


class ConditionsSection(Entry):
    """``[conditions]``: what is done to the machine."""

    spindle_speed_rpm: Course
    torque_nm: Course = 0.0
    ambient_degc: Course = 20.0
    coolant_on: Course = 0.0
    coolant_degc: Course = 20.0
    machine_on: Course = 1.0


class SpeedOnly(Entry):
    """``[conditions]`` of thermal modes, which know the spindle speed only."""

    spindle_speed_rpm: Course


class InputsSection(Entry):
    """``[inputs]``: channels of a recording that drives the model, where the role does not tell."""

    spindle_speed: Name | None = None
    torque: Name | None = None
    ambient: Name | None = None
    coolant_on: Name | None = None
    coolant: Name | None = None
    machine_on: Name | None = None


class Sensor(Entry):
    """``[[sensors]]``: a thermometer and its faults."""

    name: Name
    at: Name | None = None
    place: Name | None = None
    xyz: Point | None = None
    lag_s: NonNegative = 0.0
    noise_k: Annotated[float, limited(0, 100)] = 0.0
    resolution_k: Annotated[float, limited(0, 100)] = 0.0


class Gauge(Entry):
    """``[[gauges]]``: a displacement gauge and its faults."""

    name: Name
    of: Name | None = None
    axis: Name | None = None
    zeroed: StrictBool = True
    noise_um: Annotated[float, limited(0, 1e4)] = 0.0
    resolution_um: Annotated[float, limited(0, 1e4)] = 0.0


class Node(Entry):
    """``[nodes.NAME]``."""

    heat_capacity_j_per_k: Positive
    place: Name | None = None
    xyz: Point | None = None
    expansion_um_per_k: Annotated[dict[Name, Signed], Field(max_length=20)] = Field(default_factory=dict)


class Link(Entry):
    """``[[links]]``."""

    between: Annotated[tuple[Name, Name], Field()]
    conductance_w_per_k: Positive


Heat = Annotated[float, limited(-1e9, 1e9)]
Softening = Annotated[float, limited(0, 1)]


class NodeSource(Entry):
    """``[sources.NAME]`` of a network: the nodes that the heat goes to, and its law, see `laws.HeatLaw`."""

    shares: Annotated[
        dict[Name, Annotated[float, limited(0, 1, above=True)]], Field(min_length=1, max_length=MOST_NODES)
    ]
    on_w: Heat = 0.0
    turning_w: NonNegative = 0.0
    coolant_w: Heat = 0.0
    speed_w: NonNegative = 0.0
    reference_rpm: Speed = 1000.0
    exponent: Exponent = 1.0
    torque_share: Share = 0.0
    softening_per_k: Softening = 0.0
    softening_degc: Degrees = 20.0
    at: Name | None = None


class NodeFilm(Entry):
    """``[films.NAME]`` of a network: the area of every node that it wets, and its law, see `laws.FilmLaw`."""

    area_m2: Annotated[dict[Name, Positive], Field(min_length=1, max_length=MOST_NODES)]
    still_w_per_m2_k: NonNegative
    speed_w_per_m2_k: NonNegative = 0.0
    reference_rpm: Speed = 1000.0
    exponent: Exponent = 1.0
    while_coolant: StrictBool = False
    fluid: Literal["ambient", "coolant", "fixed"] = "ambient"
    fixed_degc: Degrees = 20.0


class FieldSource(Entry):
    """``[sources.NAME]`` of the field machine: what is said takes the place of the shipped law, key by key."""

    on_w: Heat | None = None
    turning_w: NonNegative | None = None
    coolant_w: Heat | None = None
    speed_w: NonNegative | None = None
    reference_rpm: Speed | None = None
    exponent: Exponent | None = None
    torque_share: Share | None = None
    softening_per_k: Softening | None = None
    softening_degc: Degrees | None = None


class FieldFilm(Entry):
    """``[films.NAME]`` and ``[coolant_films.NAME]`` of the field machine, key by key as `FieldSource`."""

    still_w_per_m2_k: NonNegative | None = None
    speed_w_per_m2_k: NonNegative | None = None
    reference_rpm: Speed | None = None
    exponent: Exponent | None = None


class ModesSection(Entry):
    """``[modes]``: time constants shared by all displacements, steady gains per tested speed and mode."""

    tau_s: Annotated[tuple[Positive, ...], Field(min_length=1, max_length=20)]
    speed_rpm: Annotated[tuple[Speed, ...], Field(min_length=1, max_length=200)]
    gains_um: Annotated[
        dict[Name, Annotated[tuple[tuple[Signed, ...], ...], Field(max_length=200)]], Field(min_length=1, max_length=20)
    ]
    exponent: Annotated[float, limited(0, 4, above=True)] = 1.0


class FieldSection(Entry):
    """``[field]``: what is varied on the shipped finite-element machine."""

    physics: Literal["linear", "convection", "everything"] = "everything"
    refinement: Annotated[float, limited(0.1, 2.0)] = 1.0
    geometry: Annotated[dict[str, Signed], Field(max_length=100)] = Field(default_factory=dict)


class CandidatesSection(Entry):
    """``[candidates]`` of the field machine: thermometers spread over its surfaces, see `field.sensor_candidates`."""

    spacing_m: Annotated[float, limited(0.03, 10)] = 0.3
    surfaces: Annotated[tuple[Name, ...], Field(min_length=1, max_length=100)] = (
        "headstock",
        "motor",
        "column",
        "saddle",
        "bed",
    )
    lag_s: NonNegative = 0.0
    noise_k: Annotated[float, limited(0, 100)] = 0.0
    resolution_k: Annotated[float, limited(0, 100)] = 0.0


class _Common(Entry):
    model: ModelSection
    run: RunSection
    inputs: InputsSection = InputsSection()
    gauges: Annotated[tuple[Gauge, ...], Field(max_length=100)] = ()
    bounds: Bounds = Field(default_factory=dict)


class NetworkFile(_Common):
    """A lumped network of nodes, links, films and sources."""

    conditions: ConditionsSection
    nodes: Annotated[dict[Name, Node], Field(min_length=1, max_length=MOST_NODES)]
    links: Annotated[tuple[Link, ...], Field(max_length=20 * MOST_NODES)] = ()
    films: Annotated[dict[Name, NodeFilm], Field(max_length=MOST_NODES)] = Field(default_factory=dict)
    sources: Annotated[dict[Name, NodeSource], Field(max_length=MOST_NODES)] = Field(default_factory=dict)
    sensors: Annotated[tuple[Sensor, ...], Field(max_length=MOST_SENSORS)] = ()


class ModesFile(_Common):
    """Thermal modes: displacements only, no thermometers."""

    conditions: SpeedOnly
    modes: ModesSection


class FieldFile(_Common):
    """The finite-element machine; its laws may be replaced source by source and film by film."""

    conditions: ConditionsSection
    field: FieldSection = FieldSection()
    sources: Annotated[dict[Name, FieldSource], Field(max_length=100)] = Field(default_factory=dict)
    films: Annotated[dict[Name, FieldFilm], Field(max_length=100)] = Field(default_factory=dict)
    coolant_films: Annotated[dict[Name, FieldFilm], Field(max_length=100)] = Field(default_factory=dict)
    sensors: Annotated[tuple[Sensor, ...], Field(max_length=MOST_SENSORS)] = ()
    candidates: CandidatesSection | None = None


ModelFile = NetworkFile | ModesFile | FieldFile
KINDS: Mapping[str, type[NetworkFile] | type[ModesFile] | type[FieldFile]] = {
    "network": NetworkFile,
    "modes": ModesFile,
    "field": FieldFile,
}

__all__ = [
    "KINDS", "MOST_NODES", "MOST_SAMPLES", "MOST_SENSORS", "CandidatesSection", "Column", "ConditionsSection", "Entry",
    "FieldFile", "FieldFilm", "FieldSection", "FieldSource", "Gauge", "InputsSection", "Link", "ModelFile",
    "ModelSection", "ModesFile", "ModesSection", "NetworkFile", "Node", "NodeFilm", "NodeSource", "RunSection",
    "Sensor", "Sine", "SpeedOnly",
]  # fmt: skip
