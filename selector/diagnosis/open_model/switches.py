"""Which effects a model file can express that it does not have, and which explains most once the model has it."""

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.optimize import nnls
from scipy.stats import chi2

from selector.diagnosis.comparison import Comparison
from selector.diagnosis.effects.effect import Effect, Quantity
from selector.diagnosis.evidence.noise import noise_model, stretches
from selector.diagnosis.matching.usable import rounding_of
from selector.diagnosis.open_model.refitting import Refitted, Say, simulated_rows
from selector.diagnosis.open_model.runnable import OwnModel
from selector.errors import InputError
from selector.physics.model_text import Key, plain_values
from selector.types import Mask, Matrix, Vector

Changes = Callable[[Sequence[float]], Sequence[tuple[Key, Any]]]

_HARMONICS = (1.0, 2.0, 4.0, 6.0, 12.0)
_STRIBECK_M_PER_S = (0.001, 0.005, 0.02)
_HEAT_EXPONENTS = (1.0, 1.5, 2.0)
_AREA_M2 = 0.1
#: Sizes of dry friction that are tried, in parts of the largest that a machine may have.
_OF_LARGEST = (1.0 / 60.0, 1.0 / 15.0)
#: Frequencies of a mode that are tried, of the sampling rate and of each other; ψ of its joint.
_FASTEST, _SLOWEST, _MODES, _DISSIPATION = 0.15, 0.08, 20, 0.4
NEW = "missing"  #: Name of a source or film that a diagnosis has added.


@dataclass(frozen=True, eq=False)
class Switch:
    """One way in which a model file can have an effect that it lacks."""

    id: str  #: The effect
    amounts: tuple[str, ...]  #: What the amounts are, in words; they are 0 in the file
    units: tuple[str, ...]  #: Of the amounts
    sizes: tuple[float, ...]  #: Amounts that a finite difference takes
    changes: Changes  #: Amounts → (place in the file, value) that give the model these amounts
    parameters: tuple[str, ...]  #: Names that the numbers have as parameters of the changed model, to be refitted
    place: str  #: Where it acts
    shape: Mapping[str, Quantity] = field(default_factory=dict)  #: What else was chosen
    is_amount: bool = True  #: Whether no amount can be below 0
    #: Whether the effect has other forms, which the file cannot express: its own shapes are tested as well
    is_part: bool = False
    at_rpm: float | None = None  #: The speed at which an amount that changes with speed is told


def switches(model: OwnModel) -> tuple[Switch, ...]:
    """Every effect that the file of a model can express and has not.

    Which these are, kind by kind: docs/how-to/diagnose-a-model.md. Of thermal modes none.
    """
    kinds = {"drive": _of_drive, "thermal": _of_heat, "gauging": _of_gauging, "vibration": _of_vibration}
    return tuple(kinds[model.kind](model)) if model.kind in kinds else ()


def own_effects(model: OwnModel) -> dict[str, str]:
    """Effects that are parameters which recalibration fits → the name of the parameter."""
    found: dict[str, str] = {}
    for name in model.refitted:
        for end, id_ in _OWN.items():
            if name.endswith(end):
                found.setdefault(id_, name)
    return found


_OWN = {
    ".mechanics.mass_kg": "drive.mass",
    ".mechanics.table_mass_kg": "drive.mass",
    ".guide_damping_ns_per_m": "drive.viscous",
    ".friction.coulomb_n": "drive.coulomb",
    ".friction.offset_n": "drive.offset_force",
    ".transmission.backlash_m": "drive.backlash",
    ".servo.delay_s": "drive.delay",
}


def _of_drive(model: OwnModel) -> Iterator[Switch]:
    for axis, section in plain_values(model.file)["axes"].items():
        known = {
            name.removeprefix(f"axes.{axis}."): one for name, one in model.parameters.items() if f"axes.{axis}." in name
        }
        yield from _of_friction(model, axis, known)
        single = {
            "mechanics.guide_damping_ns_per_m": ("drive.viscous", 20.0, True, "guide"),
            "friction.offset_n": ("drive.offset_force", 2.0, False, "guide"),
            "transmission.backlash_m": ("drive.backlash", 5e-6, True, "nut"),
            "servo.delay_s": ("drive.delay", 1e-3, True, "servo"),
            "transmission.pitch_slope": ("drive.pitch_error", 1e-5, False, "screw"),
        }
        for key, (id_, size, is_amount, place) in single.items():
            if key in known and known[key].value == 0.0:
                yield _number(axis, key, id_, min(size, known[key].high), known[key].unit, is_amount, f"{axis}.{place}")
        if "transmission.pitch_amplitude_m" in known and known["transmission.pitch_amplitude_m"].value == 0.0:
            yield _pitch(axis)
        rigid = section.get("mechanics", {}).get("kind") == "rigid"
        if "ripple" not in section and (not rigid or "ripple_period" in section):
            yield from (_ripple(axis, harmonic, "N" if rigid else "N·m") for harmonic in _HARMONICS)


def _of_friction(model: OwnModel, axis: str, known: Mapping[str, Any]) -> Iterator[Switch]:
    said = plain_values(model.file)["axes"][axis].get("friction", {})
    if "friction.coulomb_n" not in known or "lugre" in said:
        return
    path: Key = ("axes", axis, "friction")
    coulomb = float(known["friction.coulomb_n"].value)
    guide, start = f"{axis}.guide", f"axes.{axis}.friction."
    if coulomb == 0.0 and not said.get("coulomb_negative_n"):
        # friction that cannot hold what pushes the axis at rest does something else than friction that can
        for share in _OF_LARGEST:
            size = share * known["friction.coulomb_n"].high
            yield _number(axis, "friction.coulomb_n", "drive.coulomb", size, "N", True, guide)
            yield Switch(
                "drive.asymmetric_friction", ("friction while moving up", "friction while moving down"), ("N", "N"),
                (size, size),
                _at(path, lambda a: {"coulomb_n": a[0], "coulomb_negative_n": a[1]}),
                (f"{start}coulomb_n", f"{start}coulomb_negative_n"), guide, is_part=True,
            )  # fmt: skip
    elif "coulomb_negative_n" not in said:
        yield Switch(
            "drive.asymmetric_friction", ("friction while moving down beyond that while moving up",), ("N",),
            (0.05 * coulomb,),
            _at(path, lambda a: {"coulomb_negative_n": coulomb + a[0]}),
            (f"{start}coulomb_negative_n",), guide, is_amount=False, is_part=True,
        )  # fmt: skip
    viscous = known.get("mechanics.guide_damping_ns_per_m")
    if viscous is not None and viscous.value > 0.0 and known["friction.viscous_negative_ns_per_m"].value == 0.0:
        key, size = "friction.viscous_negative_ns_per_m", 0.05 * viscous.value
        yield replace(_number(axis, key, "drive.asymmetric_friction", size, "N·s/m", False, guide), is_part=True)
    if coulomb > 0.0 and "static_n" not in said:
        for speed in _STRIBECK_M_PER_S:
            yield _stribeck(path, start, guide, coulomb, said.get("coulomb_negative_n", coulomb), speed)


def _at(path: Key, made: Callable[[Sequence[float]], Mapping[str, Any]]) -> Changes:
    """Changes of the keys of a section by amounts."""
    return lambda a: tuple(((*path, key), value) for key, value in made(a).items())


def _stribeck(path: Key, start: str, place: str, coulomb: float, negative: float, speed: float) -> Switch:
    changes = _at(path, lambda a: {
        "coulomb_negative_n": negative, "static_n": coulomb + a[0], "static_negative_n": negative + a[0],
        "stribeck_speed_m_per_s": speed,
    })  # fmt: skip
    return Switch(
        "drive.stribeck", ("break-away beyond the sliding friction",), ("N",), (0.1 * coulomb,), changes,
        (f"{start}static_n", f"{start}static_negative_n", f"{start}stribeck_speed_m_per_s"), place,
        {"stribeck_speed_m_per_s": Quantity(speed, "m/s")}, is_part=True,
    )  # fmt: skip


def _number(axis: str, key: str, id_: str, size: float, unit: str, is_amount: bool, place: str) -> Switch:
    path: Key = ("axes", axis, *key.split("."))
    return Switch(
        id_, (key.rpartition(".")[2],), (unit,), (size,), lambda a: ((path, float(a[0])),),
        (f"axes.{axis}.{key}",), place, is_amount=is_amount,
    )  # fmt: skip


def _pitch(axis: str) -> Switch:
    path: Key = ("axes", axis, "transmission")
    names = tuple(f"axes.{axis}.transmission.{key}" for key in ("pitch_amplitude_m", "pitch_phase_rad"))

    changes = _at(path, lambda a: {"pitch_amplitude_m": math.hypot(*a), "pitch_phase_rad": math.atan2(a[1], a[0])})
    words = ("error with the lead, in phase", "error with the lead, a quarter later")
    return Switch(
        "drive.pitch_error", words, ("m", "m"), (1e-6, 1e-6), changes, names, f"{axis}.screw", is_amount=False
    )


def _ripple(axis: str, harmonic: float, unit: str) -> Switch:
    changes = _at(("axes", axis), lambda a: {
        "ripple": [{"harmonic": harmonic, "cogging": math.hypot(*a), "phase_rad": math.atan2(a[1], a[0])}]
    })  # fmt: skip
    names = tuple(f"axes.{axis}.ripple.1.{key}" for key in ("cogging", "phase_rad"))
    size = 1.0 if unit == "N" else 0.02
    return Switch(
        "drive.ripple", ("cogging, in phase", "cogging, a quarter later"), (unit, unit), (size, size), changes, names,
        f"{axis}.motor", {"harmonic": Quantity(harmonic, "1")}, is_amount=False,
    )  # fmt: skip


def _of_heat(model: OwnModel) -> Iterator[Switch]:
    plain = plain_values(model.file)
    if plain["model"]["kind"] != "network":
        return
    conditions, films = plain["conditions"], plain.get("films", {})
    # what is not said under [conditions] may be recorded
    has_coolant = "coolant_on" in conditions or _recorded(model, "coolant_on")
    top_rpm = _top_rpm(model, conditions["spindle_speed_rpm"])
    for node, section in plain["nodes"].items():
        place = section.get("place") or node
        for exponent in _HEAT_EXPONENTS:
            law = {"reference_rpm": max(top_rpm, 1.0), "exponent": exponent}
            shape = {"exponent": Quantity(exponent, "1")}
            yield _source(node, place, "thermal.speed_heating", "speed_w", law, shape)
        yield _source(node, place, "thermal.second_source", "on_w")
        yield _source(node, place, "thermal.second_source", "turning_w")
        if has_coolant:
            yield _source(node, place, "thermal.coolant", "coolant_w", is_amount=False)
            if not any(node in film["area_m2"] and film.get("fluid") == "coolant" for film in films.values()):
                yield _film(node, place, "thermal.coolant", {"while_coolant": True, "fluid": "coolant"})
        if not any(node in film["area_m2"] and film.get("fluid", "ambient") == "ambient" for film in films.values()):
            yield _film(node, place, "thermal.ambient", {})
    for name, film in films.items():
        if not film.get("speed_w_per_m2_k"):
            path: Key = ("films", name, "speed_w_per_m2_k")
            yield Switch(
                "thermal.convection", ("film that grows with speed",), ("W/(m²·K)",), (5.0,),
                lambda a, path=path: ((path, a[0]), ((*path[:2], "reference_rpm"), max(top_rpm, 1.0))),  # type: ignore[misc]
                (f"films.{name}.speed_w_per_m2_k",), name, at_rpm=max(top_rpm, 1.0),
            )  # fmt: skip


def _source(
    node: str, place: str, id_: str, key: str, law: Mapping[str, float] | None = None,
    shape: Mapping[str, Quantity] | None = None, *, is_amount: bool = True,
) -> Switch:  # fmt: skip
    name = f"{NEW} {node} {key.removesuffix('_w')}"
    changes = _at(("sources",), lambda a: {name: {"shares": {node: 1.0}, key: a[0], **(law or {})}})
    fitted = [f"sources.{name}.{key}", *([f"sources.{name}.exponent"] if law else [])]
    at_rpm = law["reference_rpm"] if law else None
    return Switch(id_, ("heat",), ("W",), (20.0,), changes, tuple(fitted), place, shape or {}, is_amount, at_rpm=at_rpm)


def _film(node: str, place: str, id_: str, law: Mapping[str, Any]) -> Switch:
    name = f"{NEW} {node} film {id_.partition('.')[2]}"
    changes = _at(("films",), lambda a: {name: {"area_m2": {node: _AREA_M2}, "still_w_per_m2_k": a[0], **law}})
    unit = f"W/(m²·K) on {_AREA_M2:g} m²"
    return Switch(id_, ("film",), (unit,), (10.0,), changes, (f"films.{name}.still_w_per_m2_k",), place)


def _recorded(model: OwnModel, key: str) -> str | None:
    """The recorded channel that drives a condition: the one that ``[inputs]`` names, else the one called so."""
    said = getattr(model.file.inputs, key, None) or key
    return said if said in model.recording.names else None


def _top_rpm(model: OwnModel, course: Any) -> float:
    """Largest speed that was recorded, else that of the file: a number, steps or a sine; a column's is not known."""
    driven = getattr(model.file.inputs, "spindle_speed", None)
    turning = [one.name for one in model.recording.channels if one.name == driven or one.role == "spindle_speed"]
    if turning:
        return float(np.nanmax(np.abs(model.recording.frame[turning[0]].to_numpy())))
    if isinstance(course, list | tuple):
        return max(abs(float(value)) for _, value in course)
    if isinstance(course, Mapping):
        return abs(float(course.get("mean", 1000.0))) + abs(float(course.get("amplitude", 0.0)))
    return abs(float(course))


def _of_gauging(model: OwnModel) -> Iterator[Switch]:
    ends = {
        "time_constant_s": ("gauging.lag", (0.01, 0.1), "gauge"),
        "lag_s": ("gauging.lag", (0.05, 0.4), "wheel and springs"),
        "wheel_wear": ("gauging.wear", (0.05,), "wheel"),
    }
    for name, one in model.parameters.items():
        id_, sizes, place = ends.get(name.rpartition(".")[2], ("", (), ""))
        path: Key = tuple(name.split("."))
        if one.value == 0.0:
            for size in sizes:
                yield Switch(
                    id_, (str(path[-1]),), (one.unit,), (min(size, one.high),),
                    lambda a, path=path: ((path, a[0]),), (name,), place,  # type: ignore[misc]
                )  # fmt: skip


def _of_vibration(model: OwnModel) -> Iterator[Switch]:
    plain = plain_values(model.file)
    finals = dict.fromkeys(str(member) for member in (model.file.finals.tool, model.file.finals.workpiece))
    turning = {one.shaft for one in model.file.sources.values() if any(line.order == 1.0 for line in one.lines)}
    for shaft in model.file.shafts:
        if shaft not in turning:
            yield from (_imbalance(shaft, member) for member in finals)
    fastest_hz = _FASTEST / float(np.median(np.diff(model.recording.time_s(model.recording.runs[0]))))
    for member in finals:
        for hz in np.geomspace(_SLOWEST * fastest_hz, fastest_hz, _MODES).tolist():
            yield _hanging(plain, member, float(hz))


def _imbalance(shaft: str, member: str) -> Switch:
    name = f"{NEW} imbalance of {shaft}"
    changes = _at(("sources",), lambda a: {name: {
        "member": member, "shaft": shaft,
        "lines": [{"order": 1.0, "unbalance_kg_m": max(math.hypot(*a), 1e-12), "phase_rad": math.atan2(a[1], a[0])}],
    }})  # fmt: skip
    fitted = tuple(f"sources.{name}.lines.1.{key}" for key in ("unbalance_kg_m", "phase_rad"))
    words = ("imbalance, in phase", "imbalance, a quarter later")
    return Switch("vibration.imbalance", words, ("kg·m",) * 2, (1e-5, 1e-5), changes, fitted, member, is_amount=False)


def _hanging(plain: Mapping[str, Any], member: str, hz: float) -> Switch:
    name, held = f"{NEW} on {member}", (2.0 * math.pi * hz) ** 2
    joint = {"between": [name, member], "dissipation": _DISSIPATION}
    number = len(plain["joints"])

    def changes(a: Sequence[float]) -> Sequence[tuple[Key, Any]]:
        mass = {"mass_kg": max(float(a[0]), 1e-6)}
        return (("members", name), mass), (("joints", number), {**joint, "stiffness_n_per_m": held * mass["mass_kg"]})

    fitted = (f"members.{name}.mass_kg", f"joints.{number + 1}.stiffness_n_per_m", f"joints.{number + 1}.dissipation")
    size = 0.01 * float(plain["members"][member]["mass_kg"])
    shape = {"frequency_hz": Quantity(hz, "Hz")}
    return Switch("vibration.mode", ("mass that swings",), ("kg",), (size,), changes, fitted, member, shape)


_SHOWS = 1e-6  #: Share of the difference below which a change is rounding.


@dataclass(frozen=True, eq=False)
class ThroughModel:
    """Effects as a model shows them."""

    model: OwnModel  #: The refitted one
    #: (n_rows, n_amounts): What makes an effect → response → its change with every amount [unit per unit]
    columns: Mapping[Switch, Mapping[str, Matrix]]
    own: Mapping[str, str]  #: Effects that are parameters which recalibration fits → that parameter

    def effects(self, known: Sequence[Effect]) -> tuple[Effect, ...]:
        """Those of its family, and faults of the data, that are tested beside it: what it can have is put into it."""
        inside = {one.id for one in self.columns if not one.is_part}
        families = {one.family for one in known}
        alike = {self.model.kind, "data"} if self.model.kind in families else families
        return tuple(one for one in known if one.id not in self.own and one.id not in inside and one.family in alike)


def through_model(model: OwnModel, fitted: Refitted, *, progress: Say | None = None) -> ThroughModel:
    """Every effect that the model's file can express, at its fitted parameters.

    An effect whose sizes make the simulation run away is left to its own shapes.
    """
    at = model.with_values(fitted.values)
    comparison = fitted.comparison
    responses = comparison.responses
    base = {name: comparison.simulated[name] for name in responses}
    scale = {name: float(np.nanstd(comparison.difference(name))) for name in responses}
    found: dict[Switch, dict[str, Matrix]] = {}
    known = switches(at)
    for number, switch in enumerate(known):
        if progress is not None:
            progress(number, len(known), f"{switch.id} at {switch.place}")
        try:
            columns = _columns(at, switch, comparison, base)
        except InputError:
            continue
        sizes = np.array(switch.sizes)
        shows = [np.sqrt(np.mean(columns[name] ** 2, axis=0)) * sizes > _SHOWS * scale[name] for name in responses]
        if all(np.isfinite(columns[name]).all() for name in responses) and np.any(shows, axis=0).all():
            found[switch] = columns
    return ThroughModel(at, found, own_effects(model))


def _columns(model: OwnModel, switch: Switch, comparison: Comparison, base: Mapping[str, Vector]) -> dict[str, Matrix]:
    """Response → change with every amount [unit of the response per unit of the amount], shape (n_rows, n_amounts)."""
    moved = []
    for k, size in enumerate(switch.sizes):
        amounts = [size if j == k else 0.0 for j in range(len(switch.sizes))]
        changed = model.with_changes(switch.changes(amounts))
        moved.append((simulated_rows(comparison, changed.simulated({})), size))
    return {
        name: np.nan_to_num(np.column_stack([(courses[name] - base[name]) / size for courses, size in moved]))
        for name in comparison.responses
    }


#: Of the mismatch that recalibration leaves: what explains less, or carries less to unseen rows, is no name.
LEAST = 0.1
#: Gain by which, and share of its gain within which, a rival may lag behind the best and fits nearly as well.
_CLEAR, _NEARLY = 6.0, 0.7
_AS_WELL = 1.25  #: Times the unseen mean square of the best that a rival may have and is not told from it.
_FAR_BEHIND = 0.2  #: Of the gain of the best: what has less is not tried in its place.
_WEIGHED, _AGAIN = 12, 2  #: How many of the best are weighed by what they leave, and how often.
_IDLE = 0.3  #: Of its size on fitted rows: an effect that is smaller on unseen ones cannot be borne out by them.


@dataclass(frozen=True, eq=False)
class Candidate:
    """One way in which the model can have an effect, fitted together with its parameters, as slopes have it."""

    switch: Switch
    amounts: tuple[float, ...]
    #: courses and left: (n_rows,): Response → what it adds, parameters as they are; what is left with it [unit]
    courses: Mapping[str, Vector]
    left: Mapping[str, Vector]
    gain: float  #: Twice the logarithm of the likelihood gained on fitted rows
    p_value: float  #: Of that gain in noise, for all ways together
    main: str  #: The response that gains most
    share: float  #: Of the mean square of a response on fitted rows that goes with it, where that is most
    carried: float  #: Of the unseen mean squares of all responses, each in parts of what is left of it, that goes
    unseen: float  #: What is left of them
    is_idle: bool  #: Whether it hardly acts on unseen rows


def candidates(fitted: Refitted, through: ThroughModel, of_first: Mapping[str, float] | None = None) -> list[Candidate]:
    """Every way of `through` to change the model, the largest gain first; the best of them weighed by what each leaves.

    Shares are those of what recalibration left, of which `of_first` is still there, response by response.
    """
    problem = _Problem(fitted, of_first or dict.fromkeys(fitted.comparison.responses, 1.0))
    quick = {name: quick_noise(fitted.comparison, name) for name in problem.names}
    start = _Weighed(problem, quick, {name: float(problem.fit[name].sum()) for name in problem.names})
    ways = through.columns.items()
    found = sorted((start.tried(*way) for way in ways), key=lambda one: -one.gain)[:_WEIGHED]
    refined = []
    for one in found:
        for _ in range(_AGAIN):
            weighed = _Weighed(problem, *problem.noise(one.left))
            one = weighed.tried(one.switch, through.columns[one.switch])
        p_value = min(1.0, len(through.columns) * float(chi2.sf(max(one.gain, 0.0), len(one.amounts))))
        refined.append(replace(one, p_value=p_value))
    return sorted(refined, key=lambda one: -one.gain)


def chosen(
    found: Sequence[Candidate], false_alarm: float, without: Collection[tuple[str, ...]]
) -> list[tuple[Candidate, ...]]:
    """Effects that are large and sure enough to be put in, the best first, each with the rivals that do as well.

    Of those that fit nearly as well the one with the fewest amounts comes first, then that which unseen rows like best.
    Ways with the parameters of one `without` are not asked for.
    """
    ways: dict[str, Candidate] = {}
    for one in found:
        if one.p_value <= false_alarm and one.share >= LEAST and one.switch.parameters not in without:
            ways.setdefault(one.switch.id, one)
    left, ranked = list(ways.values()), list[tuple[Candidate, ...]]()
    least = _FAR_BEHIND * max((one.gain for one in left), default=0.0)
    while left and left[0].gain >= least:
        near = [one for one in left if one.gain >= min(_NEARLY * left[0].gain, left[0].gain - _CLEAR)]
        unseen = min(one.unseen for one in near)
        alike = [one for one in near if one.unseen <= _AS_WELL * unseen]
        alike.sort(key=lambda one: (len(one.amounts), one.unseen))
        ranked.append(tuple(alike))
        left = [one for one in left if one is not alike[0]]
    return ranked


class _Problem:
    """Linear least squares of parameters and one effect: all responses, held by nameplates."""

    def __init__(self, fitted: Refitted, of_first: Mapping[str, float]) -> None:
        self.of_first = of_first
        self.comparison = comparison = fitted.comparison
        self.names = comparison.responses
        self.rest = {name: comparison.difference(name) for name in self.names}
        seen = {name: np.isfinite(self.rest[name]) for name in self.names}
        self.fit = {name: seen[name] & ~comparison.held_out for name in self.names}
        self.unseen = {name: seen[name] & comparison.held_out for name in self.names}
        parameters = list(fitted.values)
        self.slopes = {
            name: np.column_stack([np.zeros((len(comparison.time_s), 0)), *(
                fitted.slopes[name][one] * fitted.spread[one] for one in parameters
            )])
            for name in self.names
        }  # fmt: skip
        held = [one for one in parameters if one in fitted.away]
        self.prior = np.array([[float(one == other) for one in parameters] for other in held])
        self.prior = self.prior.reshape(-1, len(parameters))
        self.away = np.array([-fitted.away[one] for one in held])

    def noise(self, left: Mapping[str, Vector]) -> tuple[dict[str, float], dict[str, float]]:
        """Root mean square of what is left on fitted rows [unit], and how many of these readings say something new."""
        scale, count = {}, {}
        for name in self.names:
            rows = self.fit[name]
            parts = [part for part in stretches(self.comparison, rows) if part.stop - part.start > 8]
            size = float(np.sqrt(_mean_square(left[name][rows])))
            scale[name] = max(size, rounding_of(self.comparison, name), 1e-300)
            seen = np.where(rows, left[name], np.nan)
            correlated = noise_model(seen, parts).correlation_samples if parts else 1.0
            count[name] = max(float(rows.sum()) / correlated, 1.0)
        return scale, count


class _Weighed:
    """The same with the noise of every response, and how many of its readings say something new."""

    def __init__(self, problem: _Problem, scale: Mapping[str, float], count: Mapping[str, float]) -> None:
        self.of, self.scale, self.count = problem, scale, count
        self.base, self.triangle = np.linalg.qr(np.vstack([self._stacked(problem.slopes), problem.prior]))
        self.target = np.r_[self._stacked(problem.rest), problem.away]
        self.without = self._solved(self.target)

    def _stacked(self, columns: Mapping[str, Vector | Matrix]) -> Vector | Matrix:
        """Fitted rows of all responses in units of their noise; readings that repeat each other count once."""
        fit, parts = self.of.fit, []
        for name in self.of.names:
            repeated = np.sqrt(max(int(fit[name].sum()), 1) / self.count[name])
            parts.append(columns[name][fit[name]] / (self.scale[name] * repeated))
        return np.concatenate(parts)

    def _solved(self, target: Vector) -> Vector:
        """Parameters that explain a target best."""
        return np.asarray(np.linalg.lstsq(self.triangle, self.base.T @ target, rcond=1e-10)[0])

    def tried(self, switch: Switch, columns: Mapping[str, Matrix]) -> Candidate:
        """The effect with its best amounts."""
        of = self.of
        own = np.vstack([self._stacked(columns), np.zeros((len(of.prior), len(switch.sizes)))])
        free = own - self.base @ (self.base.T @ own)
        if switch.is_amount:
            amounts = nnls(free, self.target - self.base @ (self.base.T @ self.target))[0]
        else:
            amounts = np.linalg.lstsq(free, self.target, rcond=1e-10)[0]
        with_it = self._solved(self.target - own @ amounts)
        courses = {name: np.asarray(columns[name] @ amounts) for name in of.names}
        was = {name: of.rest[name] - of.slopes[name] @ self.without for name in of.names}
        left = {name: of.rest[name] - of.slopes[name] @ with_it - courses[name] for name in of.names}

        def squares(part: Mapping[str, Vector], rows: Mapping[str, Mask]) -> Vector:
            scaled = [_mean_square(part[name][rows[name]]) / self.scale[name] ** 2 for name in of.names]
            return np.maximum(scaled, 1e-300)

        changed = {name: was[name] - left[name] for name in of.names}
        before, after = squares(was, of.fit), squares(left, of.fit)
        gains = np.array([self.count[name] for name in of.names]) * np.log(before / after)
        main = int(np.argmax(gains))
        unseen = [float(np.sum(squares(part, of.unseen))) for part in (was, left, changed)]
        return Candidate(
            switch=switch,
            amounts=tuple(amounts.tolist()),
            courses=courses,
            left=left,
            gain=float(gains.sum()),
            p_value=1.0,
            main=of.names[main],
            share=float(np.max((1.0 - after / before) * [min(of.of_first[name], 1.0) for name in of.names])),
            carried=1.0 - unseen[1] / unseen[0],
            unseen=unseen[1],
            is_idle=unseen[2] < _IDLE**2 * float(np.sum(squares(changed, of.fit))),
        )


def _mean_square(values: Vector) -> float:
    return float(np.mean(values**2)) if len(values) else 0.0


def quick_noise(comparison: Comparison, name: str) -> float:
    """Noise of a response from the second differences of what is left of it [unit]; no less than its rounding."""
    parts = [comparison.difference(name)[rows] for _, rows in comparison.rows_of_runs()]
    bends = np.concatenate([np.diff(part, 2) for part in parts])
    bends = bends[np.isfinite(bends)]
    return max(float(np.sqrt(_mean_square(bends) / 6.0)), rounding_of(comparison, name))


def unseen_squares(comparison: Comparison, floor: Mapping[str, float]) -> dict[str, float]:
    """Response → mean square of its unseen mismatch in parts of its noise."""
    rest = {name: comparison.difference(name)[comparison.held_out] for name in comparison.responses}
    seen = {name: part[np.isfinite(part)] for name, part in rest.items()}
    return {name: _mean_square(part) / max(floor[name], 1e-300) ** 2 for name, part in seen.items() if len(part)}
