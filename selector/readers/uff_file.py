"""UFF files of tap tests → compliances: dataset 58 (frequency responses or records in time), dataset 164 (units)."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from selector.findings import Finding
from selector.physics.vibration.taps import TapResponse, response_of_records
from selector.readers.binary.optional import optional_module, read_whole
from selector.readers.finding_table import FINDINGS
from selector.readers.roles.names import printable_name
from selector.readers.text.lines import refused
from selector.types import Vector
from selector.units import convert, parse_unit, same_dimension

MOST_BYTES = 100_000_000
MOST_DATASETS = 20_000
_RECORD, _RESPONSE, _COHERENCE = 1, 4, 6  #: Types of function of dataset 58.
_DERIVATIVES = {8: 0, 11: 1, 12: 2}  #: Type of a motion in dataset 58 → derivative of the displacement.
_FORCES = (9, 13)
_SI = ("m", "m/s", "m/s^2")
_FEWEST = 16  #: Values of a function.
_ALIKE = 0.01  #: Share by which a unit and dataset 164 may differ.
_SAY_UNIT = "say the unit with --unit, e.g. --unit m/s^2/N"
_AXES = {"X": 1, "Y": 2, "Z": 3}


@dataclass(frozen=True)
class TapOptions:
    """What the user says about UFF files."""

    points: Mapping[int, str]  #: Node → member; empty: what was measured there is left out
    axis: str | None = None  #: {"X", "Y", "Z"}: Direction of the files along which the model moves
    #: motion and force: Units that count more than what the files say
    motion: str | None = None
    force: str | None = None
    window_s: float | None = None  #: τ of the exponential window that lies over frequency responses [s]


@dataclass(frozen=True, eq=False)
class _Function:
    """A dataset 58, the dataset 164 before it, and what the user says."""

    content: Mapping[str, Any]
    units: Mapping[str, Any]
    file: Path
    where: str
    asked: TapOptions

    @property
    def kind(self) -> int:
        return int(self.content["func_type"])

    @property
    def tap(self) -> tuple[Path, int, int]:
        """Records with this in common are of one tap."""
        return self.file, int(self.content["load_case_id"]), int(self.content["ver_num"])

    @property
    def is_force(self) -> bool:
        unit = parse_unit(self._label("ordinate")) or "1"
        return self.content["ordinate_spec_data_type"] in _FORCES or same_dimension(unit, "N")

    def _label(self, part: str) -> str:
        return str(self.content.get(f"{part}_axis_units_lab", "")).strip()

    def scale(self, part: str, si: str) -> float:
        """How many of the SI unit one of the file is: as asked, or as label and dataset 164 say."""
        asked = self.asked.force if si == "N" else self.asked.motion
        unit, factor = asked or parse_unit(self._label(part)), self.units.get("force" if si == "N" else "length", 0.0)
        known = [float(convert(np.ones(1), unit, si)[0])] if unit is not None and same_dimension(unit, si) else []
        if asked is None and factor > 0:
            known.append(1.0 / factor)
        if not known or abs(known[0] / known[-1] - 1.0) > _ALIKE:
            by_units = f"a dataset 164 by which it is {known[-1]:.4g} {si}" if known else "no dataset 164"
            raise refused(
                f"the unit {self._label(part)!r}, and {by_units}", f"a unit such as {si}, by label or by dataset 164",
                self.where, _SAY_UNIT,
            )  # fmt: skip
        return known[0]

    def motion(self) -> tuple[int, float]:
        """Derivative of the displacement that was measured, and the scale to SI."""
        unit, kind = self.asked.motion or parse_unit(self._label("ordinate")), self.content["ordinate_spec_data_type"]
        by_unit = next((k for k, si in enumerate(_SI) if unit is not None and same_dimension(unit, si)), None)
        derivative = _DERIVATIVES.get(kind) if by_unit is None else by_unit
        if derivative is None or _DERIVATIVES.get(kind, derivative) != derivative:
            raise refused(
                f"a motion of type {kind} in {unit or 'no known unit'}",
                "displacement (8), velocity (11) or acceleration (12), in a unit of it", self.where, _SAY_UNIT,
            )  # fmt: skip
        return derivative, self.scale("ordinate", _SI[derivative])

    def values(self, over: Vector | None = None) -> tuple[Vector, Any]:
        """Frequencies or times, `over` others if these are given, and all values that the head promises, finite."""
        x, values = np.asarray(self.content["x"], dtype=np.float64), np.asarray(self.content["data"])
        wrong = (
            f"{len(values)} of {self.content['num_pts']} values"
            if len(x) != len(values) or len(values) != self.content["num_pts"] or len(x) < _FEWEST
            else "values that are not finite or all 0, or an axis that does not increase"
            if not (np.isfinite([*x, *values]).all() and values.any()) or (np.diff(x) <= 0).any()
            else f"{len(x)} values from {x[0]:g} to {x[-1]:g}"
            if over is not None and (len(x) != len(over) or np.max(np.abs(x - over)) > 1e-3 * (x[1] - x[0]))
            else None
        )
        if wrong is not None:
            of_others = "" if over is None else f", {len(over)} over {over[0]:g} to {over[-1]:g} as beside it"
            raise refused(
                wrong, f"as many as the head says, {_FEWEST} at least, finite{of_others}", self.where,
                "export the file again: it is damaged, or its functions do not belong together",
            )  # fmt: skip
        return x, values

    def member(self, end: str) -> str:
        """The member that a point is on; empty where it is left out."""
        node = int(self.content[f"{end}_node"])
        if node not in self.asked.points:
            raise refused(
                f"node {node}", "nodes that --point puts on a member", self.where,
                f"add --point {node}=MEMBER, or --point {node}= to leave it out",
            )  # fmt: skip
        return self.asked.points[node]

    def sign(self, *ends: str) -> float:
        """−1 where one of these directions is negative, and the other not."""
        return float(np.prod([-1.0 if self.content[f"{end}_dir"] < 0 else 1.0 for end in ends]))


def read_taps(paths: Sequence[Path], asked: TapOptions) -> tuple[tuple[TapResponse, ...], tuple[Finding, ...]]:
    """The compliances in UFF files, one for every pair of members, and what was left out of the files.

    Frequency responses of the same pair are taps of it; where there are none, records in time, of which those with one
    load case and version in a file are one tap.

    Raises InputError: a file cannot be read, says no unit, or has a node that is no point of a member.
    """
    functions = [one for path in paths for one in _functions(path, asked)]
    kinds = {one.kind for one in functions}
    if not kinds & {_RECORD, _RESPONSE}:
        raise refused(
            f"functions of the types {', '.join(map(str, sorted(kinds)))}" if kinds else "no dataset 58",
            "frequency responses (type 4), or records of force and motion in time (type 1)",
            ", ".join(printable_name(path.name) for path in paths)[:200], "export these from the analyser",
        )  # fmt: skip
    counted = (_RESPONSE, _COHERENCE) if _RESPONSE in kinds else (_RECORD,)
    left = Counter(f"of function type {one.kind}" for one in functions if one.kind not in counted)
    chosen = [one for one in functions if one.kind in counted]
    axis = _axis(chosen, asked)
    kept = []
    for one in chosen:
        ends = ("rsp", "ref") if one.kind != _RECORD else ("rsp",)
        if any(abs(one.content[f"{end}_dir"]) not in (0, axis) for end in ends):
            left["in another direction"] += 1
        elif not all(one.member(end) for end in ends):
            left["at a point that is left out"] += 1
        else:
            kept.append(one)
    lost = {one.tap for one in chosen if one.kind == _RECORD and one.is_force and one not in kept}
    left["of taps that are left out"] += sum(one.tap in lost for one in kept)
    kept, left = [one for one in kept if one.tap not in lost], +left
    made = _of_responses if _RESPONSE in kinds else _of_records
    found = tuple(made(kept))
    if not found:
        raise refused(
            f"no frequency response that is left ({_counts(left)})", "one at least between members", "--point, --axis",
            "name points and direction that the files have",
        )  # fmt: skip
    said = []
    if left:
        told = f"{left.total()} datasets were left out: {_counts(left)}."
        said.append(FINDINGS.finding("uff-left-out", told, evidence=dict(left)))
    there = {int(one.content[f"{end}_node"]) for one in functions for end in ("rsp", "ref")}
    if absent := sorted(set(asked.points) - there):
        told = f"No file has the nodes {', '.join(map(str, absent))} of --point; there are {sorted(there)[:20]}."
        said.append(FINDINGS.finding("uff-no-such-node", told, evidence={"nodes": absent}))
    return found, tuple(said)


def _counts(left: Counter[str]) -> str:
    return ", ".join(f"{count} {why}" for why, count in left.items())


def _functions(path: Path, asked: TapOptions) -> Iterator[_Function]:
    """All datasets 58 of a file."""
    name = printable_name(path.name)
    whole, advice = "a UFF file that ends with the mark of a dataset, -1", "export the file again as dataset 58"
    if not path.is_file() or path.stat().st_size > MOST_BYTES:
        size = f"{path.stat().st_size / 1e6:.0f} MB" if path.is_file() else "no such file, or none that is regular"
        raise refused(size, f"a UFF file of at most {MOST_BYTES / 1e6:.0f} MB", name, "name the files of the tap test")
    content = path.read_bytes()
    marks = content.count(b"    -1")
    if not 2 <= marks <= 2 * MOST_DATASETS or not content.rstrip().endswith(b"    -1"):
        raise refused(f"{marks} marks of datasets, and {content[-20:]!r} at the end", whole, name, advice)
    pyuff = optional_module("pyuff", "a UFF file", name)

    def read() -> list[tuple[int, dict[str, Any]]]:
        file = pyuff.UFF(str(path))
        return [(k + 1, file.read_sets(k)) for k, type_ in enumerate(file.get_set_types()) if type_ in (58, 164)]

    units: Mapping[str, Any] = {}
    for number, one in read_whole(read, "a UFF file", name, whole, advice):
        if one["type"] == 164:
            units = one
        else:
            yield _Function(one, units, path, f"{name}, dataset {number}", asked)


def _axis(functions: Sequence[_Function], asked: TapOptions) -> int:
    """1, 2 or 3 for X, Y or Z."""
    if asked.axis is not None:
        return _AXES[asked.axis]
    ends = [one.content[end] for one in functions for end in ("rsp_dir", "ref_dir")]
    there = sorted({abs(one) for one in ends} - {0})
    if len(there) > 1:
        raise refused(
            f"directions {', '.join(map(str, there))}", "one along which the model moves", functions[0].where,
            "choose it with --axis X, Y or Z; the others are left out",
        )  # fmt: skip
    return there[0] if there else 0


def _of_responses(functions: Sequence[_Function]) -> Iterator[TapResponse]:
    pairs: dict[tuple[str, str], list[_Function]] = {}
    for one in functions:
        pairs.setdefault((one.member("rsp"), one.member("ref")), []).append(one)
    for (of, at), several in pairs.items():
        taps, known, lines, window_s = [], None, several[0].values()[0], several[0].asked.window_s
        inside, decay = lines > 0, 0.0 if window_s is None else 1.0 / window_s
        for one in several:
            values = one.values(lines)[1][inside]
            if one.kind == _COHERENCE:
                known = np.asarray(values.real)
                continue
            derivative, scale = one.motion()
            scale *= one.sign("rsp", "ref") / one.scale("orddenom", "N")
            taps.append(scale * values / (decay + 2j * np.pi * lines[inside]) ** derivative)
        if taps:
            weight = np.full((len(taps), len(taps[0])), 1.0 / len(taps))
            yield TapResponse(of, at, lines[inside], np.array(taps), weight, known, decay)


def _of_records(functions: Sequence[_Function]) -> Iterator[TapResponse]:
    taps: dict[Any, list[_Function]] = {}
    for one in functions:
        taps.setdefault(one.tap, []).append(one)
    pairs: dict[tuple[str, str, int, int, float], list[tuple[Vector, Vector]]] = {}
    for records in taps.values():
        forces = [one for one in records if one.is_force]
        if len(forces) != 1:
            raise refused(
                f"{len(forces)} records of force in a tap", "one, with the motions that have its load case and version",
                records[0].where, "give every tap a load case or a file of its own, with its hammer (type 13, N)",
            )  # fmt: skip
        (hammer,) = forces
        time_s, values = hammer.values()
        force = hammer.sign("rsp") * hammer.scale("ordinate", "N") * values.real
        period_s, at = float(np.ptp(time_s)) / (len(time_s) - 1), hammer.member("rsp")
        for one in records:
            if one is not hammer:
                (derivative, scale), of = one.motion(), one.member("rsp")
                motion = one.sign("rsp") * scale * one.values(time_s)[1].real
                pairs.setdefault((of, at, derivative, len(force), round(period_s, 12)), []).append((force, motion))
    for (of, at, derivative, _, period_s), blows in pairs.items():
        forces_n, motions = (np.array(one) for one in zip(*blows, strict=True))
        yield response_of_records(of, at, forces_n, motions, period_s, derivative)
