"""What does a thermal model file say: TOML text → checked values, or an error that names the key."""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Discriminator, Field, StrictBool, Tag

from selector.physics.model_fields import Fit, Number, Unit, numbers_in, numbers_of
from selector.physics.model_text import (
    MOST_SAMPLES,
    Bounds,
    Column,
    Contradiction,
    Entry,
    Key,
    ModelFamily,
    Name,
    NonNegative,
    Note,
    Point,
    Positive,
    Seed,
    Share,
    Signed,
    bound_contradictions,
    choice_tag,
    file_beside,
    limited,
    plain_values,
    unknown_name,
)
from selector.physics.thermal.network.heat_system import FilmLaw, HeatLaw, Laws

MOST_NODES = 300  #: Nodes of a network. Its exact stepping costs their number cubed.
MOST_SENSORS = 1000  #: Thermometers of a model, candidates among them.
Exponent = Annotated[float, limited(0, 4), Fit(low=0.0, high=4.0)]
Degrees = Annotated[float, limited(-100, 1000), Unit("°C")]
FittedDegrees = Annotated[Degrees, Fit(around=30.0)]
Speed = Annotated[float, limited(1e-3, 1e6), Unit("r/min")]
Heat = Annotated[float, limited(-1e9, 1e9), Unit("W"), Fit(at_zero=1.0)]
Power = Annotated[NonNegative, Unit("W"), Fit(at_zero=1.0)]
FilmCoefficient = Annotated[NonNegative, Unit("W/(m²·K)"), Fit(at_zero=1.0)]
Softening = Annotated[float, limited(0, 1), Unit("1/K"), Fit(at_zero=1.0)]
TorqueShare = Annotated[Share, Fit(low=0.0, high=1.0)]
Place = Annotated[Point, Unit("m")]
Lag = Annotated[NonNegative, Unit("s")]
Kelvins = Annotated[float, limited(0, 100), Unit("K")]
Micrometres = Annotated[float, limited(0, 1e4), Unit("µm")]
Groups = Annotated[tuple[Name, ...], Field(min_length=1, max_length=100)]
Duration = Annotated[float, limited(0, 1e6, above=True)]

_EITHER_WAY = Fit(either_sign=0.0, at_zero=1.0)


class Sine(Entry):
    """A course that swings: mean + amplitude·sin(2π(t − phase)/period); values in the unit of its key."""

    mean: Signed
    amplitude: Signed
    period_min: Annotated[Positive, Unit("min")] = 1440.0
    phase_min: Annotated[Signed, Unit("min")] = 0.0


Step = tuple[Annotated[float, limited(0, 1e9)], Signed]
Steps = Annotated[tuple[Step, ...], Field(min_length=1, max_length=10_000)]


def _course_kind(value: Any) -> str:
    if isinstance(value, list | tuple):
        return _STEPS
    if isinstance(value, Column) or (isinstance(value, Mapping) and ("file" in value or "column" in value)):
        return _COLUMN
    return _SINE if isinstance(value, Sine | Mapping) else _NUMBER


_NUMBER, _STEPS, _SINE, _COLUMN = (choice_tag(form) for form in ("number", "steps", "sine", "column"))

#: A number that holds for the whole run, steps [from minute, value], a sine, or a column of a file.
Course = Annotated[
    Annotated[Signed, Tag(_NUMBER)]
    | Annotated[Steps, Tag(_STEPS)]
    | Annotated[Sine, Tag(_SINE)]
    | Annotated[Column, Tag(_COLUMN)],
    Discriminator(_course_kind),
]


class ModelSection(Entry):
    """``[model]``."""

    kind: Literal["network", "modes", "field", "mesh"]
    name: Name
    note: Note = ""


class RunSection(Entry):
    """``[run]``: how long, how often, how finely, and from which state."""

    duration_min: Annotated[Duration, Unit("min")]
    period_s: Annotated[Duration, Unit("s")] = 60.0
    step_s: Annotated[Duration, Unit("s")] = 10.0
    start_degc: FittedDegrees | None = None
    seed: Seed = 0


class ConditionsSection(Entry):
    """``[conditions]``: what is done to the machine."""

    spindle_speed_rpm: Annotated[Course, Unit("r/min")]
    torque_nm: Annotated[Course, Unit("N·m")] = 0.0
    ambient_degc: Annotated[Course, Unit("°C")] = 20.0
    coolant_on: Course = 0.0
    coolant_degc: Annotated[Course, Unit("°C")] = 20.0
    machine_on: Course = 1.0


class SpeedOnly(Entry):
    """``[conditions]`` of thermal modes, which know the spindle speed only."""

    spindle_speed_rpm: Annotated[Course, Unit("r/min")]


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
    xyz: Place | None = None
    lag_s: Lag = 0.0
    noise_k: Kelvins = 0.0
    resolution_k: Kelvins = 0.0


class Gauge(Entry):
    """``[[gauges]]``: a displacement gauge and its faults."""

    name: Name
    of: Name | None = None
    axis: Name | None = None
    zeroed: StrictBool = True
    noise_um: Micrometres = 0.0
    resolution_um: Micrometres = 0.0


class Node(Entry):
    """``[nodes.NAME]``."""

    heat_capacity_j_per_k: Annotated[Positive, Unit("J/K"), Fit()]
    place: Name | None = None
    xyz: Place | None = None
    expansion_um_per_k: Annotated[dict[Name, Signed], Field(max_length=20), Unit("µm/K"), _EITHER_WAY] = Field(
        default_factory=dict
    )


class Link(Entry):
    """``[[links]]``."""

    between: Annotated[tuple[Name, Name], Field()]
    conductance_w_per_k: Annotated[Positive, Unit("W/K"), Fit()]


class NodeSource(Entry):
    """``[sources.NAME]``: the nodes of a network, or groups of a mesh, that the heat goes to; law: `laws.HeatLaw`."""

    shares: Annotated[
        dict[Name, Annotated[float, limited(0, 1, above=True)]], Field(min_length=1, max_length=MOST_NODES)
    ]
    on_w: Heat = 0.0
    turning_w: Power = 0.0
    coolant_w: Heat = 0.0
    speed_w: Power = 0.0
    reference_rpm: Speed = 1000.0
    exponent: Exponent = 1.0
    torque_share: TorqueShare = 0.0
    softening_per_k: Softening = 0.0
    softening_degc: Degrees = 20.0
    at: Name | None = None


class _NodeAreas(Entry):
    """What a film of a network wets."""

    area_m2: Annotated[dict[Name, Positive], Field(min_length=1, max_length=MOST_NODES), Unit("m²"), Fit()]


class _LawOfFilm(Entry):
    """How a film cools, see `laws.FilmLaw`."""

    still_w_per_m2_k: FilmCoefficient
    speed_w_per_m2_k: FilmCoefficient = 0.0
    reference_rpm: Speed = 1000.0
    exponent: Exponent = 1.0
    while_coolant: StrictBool = False
    fluid: Literal["ambient", "coolant", "fixed"] = "ambient"
    fixed_degc: FittedDegrees = 20.0


class NodeFilm(_LawOfFilm, _NodeAreas):
    """``[films.NAME]`` of a network: the area of every node that it wets, and its law."""


class MeshFilm(_LawOfFilm):
    """``[films.NAME]`` of a mesh: its law, and the groups whose surface it wets."""

    groups: Groups


class FieldSource(Entry):
    """``[sources.NAME]`` of the field machine: what is said takes the place of the shipped law, key by key."""

    on_w: Heat | None = None
    turning_w: Power | None = None
    coolant_w: Heat | None = None
    speed_w: Power | None = None
    reference_rpm: Speed | None = None
    exponent: Exponent | None = None
    torque_share: TorqueShare | None = None
    softening_per_k: Softening | None = None
    softening_degc: Degrees | None = None


class FieldFilm(Entry):
    """``[films.NAME]`` and ``[coolant_films.NAME]`` of the field machine, key by key as `FieldSource`."""

    still_w_per_m2_k: FilmCoefficient | None = None
    speed_w_per_m2_k: FilmCoefficient | None = None
    reference_rpm: Speed | None = None
    exponent: Exponent | None = None


class FieldCooling(Entry):
    """``[cooled.NAME]`` of the field machine: a surface along which a cooler pumps oil of one temperature."""

    still_w_per_m2_k: FilmCoefficient
    fixed_degc: FittedDegrees = 20.0


class ModesSection(Entry):
    """``[modes]``: time constants shared by all displacements, steady gains per tested speed and mode."""

    tau_s: Annotated[tuple[Positive, ...], Field(min_length=1, max_length=20), Unit("s"), Fit()]
    speed_rpm: Annotated[tuple[Speed, ...], Field(min_length=1, max_length=200)]
    gains_um: Annotated[
        dict[Name, Annotated[tuple[tuple[Signed, ...], ...], Field(max_length=200)]],
        Field(min_length=1, max_length=20),
        Unit("µm"),
        _EITHER_WAY,
    ]
    exponent: Annotated[float, limited(0, 4, above=True), Fit(low=0.0, high=4.0)] = 1.0


class FieldSection(Entry):
    """``[field]``: what is varied on the shipped finite-element machine."""

    physics: Literal["linear", "convection", "everything"] = "everything"
    refinement: Annotated[float, limited(0.1, 2.0)] = 1.0
    geometry: Annotated[dict[str, Signed], Field(max_length=100), Unit("m")] = Field(default_factory=dict)


class CandidatesSection(Entry):
    """``[candidates]``: thermometers spread over surfaces of the field machine, or over groups of a mesh."""

    spacing_m: Annotated[float, limited(0.03, 10), Unit("m")] = 0.3
    surfaces: Annotated[tuple[Name, ...], Field(min_length=1, max_length=100)] = (
        "headstock",
        "motor",
        "column",
        "saddle",
        "bed",
    )
    lag_s: Lag = 0.0
    noise_k: Kelvins = 0.0
    resolution_k: Kelvins = 0.0


class MeshSection(Entry):
    """``[mesh]``: the file that holds the body; `read_model_file` makes its path whole."""

    file: Annotated[str, Field(min_length=1, max_length=4096)]
    unit: Literal["m", "mm"]
    order: Annotated[int, Field(strict=True, ge=1, le=2)] = 2


class MeshPart(Entry):
    """``[parts.GROUP]``: a known material, or the numbers in which this one differs."""

    material: Name | None = None
    conductivity_w_per_m_k: Annotated[Positive, Unit("W/(m·K)")] | None = None
    specific_heat_j_per_kg_k: Annotated[Positive, Unit("J/(kg·K)")] | None = None
    density_kg_per_m3: Annotated[Positive, Unit("kg/m³")] | None = None
    expansion_per_k: Annotated[float, limited(-1e-3, 1e-3), Unit("1/K")] | None = None
    young_pa: Annotated[Positive, Unit("Pa")] | None = None
    poisson: Annotated[float, limited(0, 0.49)] | None = None
    slides: Literal["x", "y", "z"] | None = None


class MeshSupport(Entry):
    """``[supports.NAME]``: where the body is held; without a stiffness, rigidly."""

    groups: Groups
    stiffness_n_per_m: Annotated[tuple[NonNegative, NonNegative, NonNegative], Field(), Unit("N/m")] | None = None


class MeshDisplacement(Entry):
    """``[displacements.NAME]``: the tool against the work, each the rigid motion of a group or a point of the body."""

    tool: Name | None = None
    tool_xyz: Place | None = None
    work: Name | None = None
    work_xyz: Place | None = None
    direction: Point | None = None


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
    cooled: Annotated[dict[Name, FieldCooling], Field(max_length=100)] = Field(default_factory=dict)
    sensors: Annotated[tuple[Sensor, ...], Field(max_length=MOST_SENSORS)] = ()
    candidates: CandidatesSection | None = None


class MeshFile(_Common):
    """A finite-element machine of one's own, from a mesh with named groups."""

    conditions: ConditionsSection
    mesh: MeshSection
    parts: Annotated[dict[Name, MeshPart], Field(min_length=1, max_length=100)]
    films: Annotated[dict[Name, MeshFilm], Field(min_length=1, max_length=100)]
    supports: Annotated[dict[Name, MeshSupport], Field(min_length=1, max_length=100)]
    displacements: Annotated[dict[Name, MeshDisplacement], Field(min_length=1, max_length=20)]
    sources: Annotated[dict[Name, NodeSource], Field(max_length=100)] = Field(default_factory=dict)
    sensors: Annotated[tuple[Sensor, ...], Field(max_length=MOST_SENSORS)] = ()
    candidates: CandidatesSection | None = None


ModelFile = NetworkFile | ModesFile | FieldFile | MeshFile
KINDS: Mapping[str, type[ModelFile]] = {
    "network": NetworkFile, "modes": ModesFile, "field": FieldFile, "mesh": MeshFile
}  # fmt: skip


def stated_laws(file: NetworkFile | MeshFile) -> Laws:
    """The laws of a file that says all of them."""
    wide: dict[str, Any] = {"exclude": {"shares", "area_m2", "groups"}, "exclude_none": True}
    heat = (HeatLaw(source=name, **source.model_dump(**wide)) for name, source in file.sources.items())
    return Laws(tuple(heat), tuple(FilmLaw(film=name, **film.model_dump(**wide)) for name, film in file.films.items()))


def columns_needed(file: ModelFile) -> dict[str, Column]:
    """Condition → column of a recording that it is read from."""
    conditions = file.conditions
    courses = {name: getattr(conditions, name) for name in type(conditions).model_fields}
    return {name: course for name, course in courses.items() if isinstance(course, Column)}


def contradictions(file: ModelFile) -> Iterator[Contradiction]:
    """(key, found, expected, advice) of whatever does not fit together in a file whose values are valid one by one."""
    run = file.run
    for key in ("period_s", "step_s"):
        count = run.duration_min * 60.0 / getattr(run, key)
        if count > MOST_SAMPLES:
            advice = f"make {key} larger or duration_min shorter"
            yield ("run", key), f"{count:.3g} samples or steps", f"at most {MOST_SAMPLES}", advice
    for name in type(file.conditions).model_fields:
        steps = getattr(file.conditions, name)
        if isinstance(steps, tuple):
            starts = [start for start, _ in steps]
            if starts[0] != 0.0 or any(b <= a for a, b in pairwise(starts)):
                advice = "begin with [0, …] and sort the steps; one value a time"
                yield ("conditions", name), f"steps at {starts[:6]} min", "times that begin with 0 and increase", advice
    if isinstance(file, NetworkFile):
        yield from _of_network(file)
    if isinstance(file, ModesFile):
        yield from _of_modes(file)
    if isinstance(file, MeshFile):
        yield from _of_mesh(file)
    yield from _of_names(file)
    yield from bound_contradictions(file.bounds)


def _of_network(file: NetworkFile) -> Iterator[Contradiction]:
    pairs = Counter(frozenset(link.between) for link in file.links)
    named: list[tuple[Key, str]] = []
    for number, link in enumerate(file.links):
        key: Key = ("links", number, "between")
        named += [(key, node) for node in link.between]
        if len(set(link.between)) == 1:
            yield key, f"{link.between[0]!r} twice", "two different nodes", "name both ends of the link"
        if pairs[frozenset(link.between)] > 1:
            found, advice = f"{' and '.join(link.between)} linked twice", "add the conductances into one link"
            yield key, found, "one link between two nodes", advice
    named += [(("films", name, "area_m2"), node) for name, film in file.films.items() for node in film.area_m2]
    for name, source in file.sources.items():
        named += [(("sources", name, "shares"), node) for node in source.shares]
        named += [(("sources", name, "at"), source.at)] if source.at is not None else []
    named += [(("sensors", number, "at"), sensor.at or sensor.name) for number, sensor in enumerate(file.sensors)]
    for key, node in named:
        if node not in file.nodes:
            yield key, *unknown_name("node", node, list(file.nodes))
    yield from _of_sources(file)
    displacements = list(dict.fromkeys(d for node in file.nodes.values() for d in node.expansion_um_per_k))
    yield from _of_gauges(file, displacements)


def _of_sources(file: NetworkFile | MeshFile) -> Iterator[Contradiction]:
    for name, source in file.sources.items():
        total = sum(source.shares.values())
        if abs(total - 1.0) > 1e-6:  # numbers of a few digits add up to 1 far better than this
            yield ("sources", name, "shares"), f"shares that add up to {total:g}", "1", "share out all of the heat"
        if source.softening_per_k and source.at is None:
            advice = 'add at = "NAME", the node or group whose temperature thins the lubricant'
            yield ("sources", name, "softening_per_k"), "softening without a place", "a node or group", advice


def _of_mesh(file: MeshFile) -> Iterator[Contradiction]:
    yield from _of_sources(file)
    for name, part in file.parts.items():
        lacking = [key for key in MeshPart.model_fields if getattr(part, key) is None and key != "slides"]
        if part.material is None and len(lacking) > 1:
            found, expected = f"no {', no '.join(lacking)}", "a material by its name, or all of its numbers"
            yield ("parts", name), found, expected, "name a material, or say these numbers too"
    for name, of in file.displacements.items():
        if of.tool is None and of.tool_xyz is None:
            advice = "add tool = the group whose motion it is, or tool_xyz"
            yield ("displacements", name), "a displacement without a tool", "a group or a point of the body", advice
        if not any(direction_of(name, of)):
            advice = "add direction = [0, 0, 1] or so, or call it after its axis"
            yield ("displacements", name, "direction"), "no direction", "a direction other than 0", advice
    anywhere = {s.name: number for number, s in enumerate(file.sensors) if s.xyz is not None and s.at is None}
    groups = {source.at for source in file.sources.values()} | {sensor.at for sensor in file.sensors}
    for name in anywhere.keys() & groups:
        found, advice = f"a place called as the group {name!r} that is read", "give the thermometer another name"
        yield ("sensors", anywhere[name], "name"), found, "a name of its own", advice
    yield from _of_gauges(file, list(file.displacements))


def _of_modes(file: ModesFile) -> Iterator[Contradiction]:
    modes = file.modes
    for key, values in (("tau_s", modes.tau_s), ("speed_rpm", modes.speed_rpm)):
        if any(b <= a for a, b in pairwise(values)):
            yield ("modes", key), f"{list(values)[:8]}", "numbers that increase", "sort them; each once"
    for name, rows in modes.gains_um.items():
        shape = [len(row) for row in rows]
        if len(rows) != len(modes.speed_rpm) or set(shape) != {len(modes.tau_s)}:
            found = f"{len(rows)} rows of {sorted(set(shape))} gains"
            expected = f"{len(modes.speed_rpm)} rows (one a speed) of {len(modes.tau_s)} gains (one a mode)"
            yield ("modes", "gains_um", name), found, expected, "give one row for each speed of speed_rpm"
    yield from _of_gauges(file, list(modes.gains_um))


def direction_of(name: str, displacement: MeshDisplacement) -> tuple[float, float, float]:
    """Along which a displacement counts: as it says, or along the axis after which it is called; else zeros."""
    x, y, z = (float(name[:1].upper() == axis) for axis in "XYZ")
    return displacement.direction or (x, y, z)


def _of_gauges(file: ModelFile, displacements: list[str]) -> Iterator[Contradiction]:
    for number, gauge in enumerate(file.gauges):
        if (gauge.of or gauge.name) not in displacements:
            yield ("gauges", number, "of"), *unknown_name("displacement", gauge.of or gauge.name, displacements)


def _of_names(file: ModelFile) -> Iterator[Contradiction]:
    entries: list[tuple[Key, str]] = []
    if not isinstance(file, ModesFile):
        entries += [(("sensors", number, "name"), sensor.name) for number, sensor in enumerate(file.sensors)]
    entries += [(("gauges", number, "name"), gauge.name) for number, gauge in enumerate(file.gauges)]
    # the channels that hold the conditions of a simulation
    taken = {"time_s", *InputsSection.model_fields}
    for key, name in entries:
        if name in taken:
            yield key, f"a second channel called {name!r}", "a name for each channel", "give it another name"
        taken.add(name)


def _with_mesh(file: ModelFile, path: Path) -> ModelFile:
    """The same with the whole path of its mesh."""
    if not isinstance(file, MeshFile):
        return file
    whole = file_beside(path, file.mesh.file, f"{path}, key mesh.file", "mesh")
    return file.model_copy(update={"mesh": file.mesh.model_copy(update={"file": str(whole)})})


_SECTIONS = ("nodes", "links", "films", "coolant_films", "cooled", "sources", "modes", "run")


def numbers(file: ModelFile) -> Iterator[Number]:
    """The physics of a model file as named numbers; what the file does not say (switched off) is no parameter.

    Their names and bounds: docs/reference/thermal-model.md, ``[bounds]``.
    """
    values = complete_values(file)
    whole = FieldFile.model_validate(values) if isinstance(file, FieldFile) else file
    known = {one.path: one for one in numbers_of(whole)}
    for section in _SECTIONS:
        for path in numbers_in(values.get(section, {}), (section,)):
            if path in known:
                yield replace(known[path], name=_name(file, path))


def complete_values(file: ModelFile) -> dict[str, Any]:
    """The sections as plain values; those of the field machine with the laws that the file does not mention."""
    values = plain_values(file)
    if isinstance(file, FieldFile):
        from selector.physics.thermal.field_model import law_sections

        values |= law_sections(file)
    return values


def _name(file: ModelFile, path: Key) -> str:
    parts = [str(part) for part in path]
    if isinstance(file, NetworkFile) and path[0] == "links" and isinstance(path[1], int):
        parts[1] = "~".join(file.links[path[1]].between)
    if path[0] == "modes":
        speeds = [f"{speed:g} rpm" for speed in plain_values(file)["modes"]["speed_rpm"]]
        *head, mode = path
        if isinstance(mode, int):
            parts[-1] = f"mode {mode + 1}"
        if path[1] == "gains_um" and isinstance(head[-1], int):
            parts[-2] = speeds[head[-1]]
    return ".".join(parts)


FAMILY: ModelFamily[ModelFile] = ModelFamily(
    "thermal", KINDS, contradictions, page="docs/reference/thermal-model.md", examples="fixtures/thermal",
    columns_needed=columns_needed, numbers=numbers, with_files=_with_mesh,
    column_roles={"spindle_speed_rpm": "spindle_speed", "ambient_degc": "ambient", "coolant_degc": "temperature"},
)  # fmt: skip
#: The model file at a path, of a text, and of plain values; see `ModelFamily`.
read_model_file, parsed_model_file, checked_model_file = FAMILY.read, FAMILY.parsed, FAMILY.checked
