"""MATLAB .mat (v4 to v7 by SciPy, v7.3 by h5py) and plain HDF5 → tables, checked before a library trusts them."""

import io
import math
import struct
import zlib
from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from selector.errors import ReadError
from selector.readers.binary.optional import optional_module, read_whole
from selector.readers.binary.tdms import column_values
from selector.readers.finding_table import FINDINGS
from selector.readers.tables import (
    MAX_CELLS,
    Column,
    Overrides,
    Table,
    checked_size,
    checked_width,
    reading_of,
    unique_headers,
)

_ITEM_BYTES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
_MATRIX, _COMPRESSED = 14, 15
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE, _FUNCTION, _OPAQUE = 1, 2, 3, 4, 5, 16, 17
_MAX_UNPACKED = 8 * MAX_CELLS
_MAT_MAX_DEPTH = 12


class _DamagedError(Exception):
    """A length or a type that cannot be right."""


@dataclass(frozen=True)
class _Element:
    kind: int
    begin: int
    end: int
    following: int


def readable_variables(data: bytes, where: str) -> tuple[list[str], list[str]] | None:
    """Names of the readable variables and of the opaque objects; None for MAT v4, which has no nested parts."""
    if not data.startswith(b"MATLAB 5.0"):
        return None
    order = {b"IM": "<", b"MI": ">"}.get(data[126:128])
    names: list[str] = []
    opaque: list[str] = []
    broken = 0
    position, unpacked = 128, 0
    while order is not None and position + 8 <= len(data):
        try:
            element = _element(data, position, len(data), order, top=True)
        except _DamagedError:
            broken += 1
            break
        content, begin, end = data, element.begin, element.end
        try:
            if element.kind == _COMPRESSED:
                content = _inflated(data[begin:end], _MAX_UNPACKED - unpacked)
                unpacked += len(content)
                inner = _element(content, 0, len(content), order)
                begin, end = inner.begin, inner.end
            name, readable = _matrix(content, begin, end, order, 0)
            if name:
                (names if readable else opaque).append(name)
        except (_DamagedError, struct.error, zlib.error, RecursionError):
            broken += 1
        position = element.following
    if broken or order is None:
        raise ReadError(
            f"a MAT file with {broken or 'only'} damaged or cut-off variable(s)"
            + (f" beside {names[:5]}" if names else ""),
            expected="a complete MAT file",
            where=where,
            advice="copy the file again, or save it again in MATLAB with save(..., '-v7')",
        )
    return names, opaque


def _inflated(packed: bytes, limit: int) -> bytes:
    engine = zlib.decompressobj()
    content = engine.decompress(packed, max(limit, 1))
    if engine.unconsumed_tail or not engine.eof:
        raise _DamagedError
    return content


def _element(data: bytes, position: int, end: int, order: str, *, top: bool = False) -> _Element:
    if position + 8 > end:
        raise _DamagedError
    kind, n_bytes = struct.unpack_from(order + "II", data, position)
    if kind >> 16 and not top:
        kind, n_bytes = kind & 0xFFFF, kind >> 16
        if n_bytes > 4 or kind not in _ITEM_BYTES:
            raise _DamagedError
        return _Element(kind, position + 4, position + 4 + n_bytes, position + 8)
    begin = position + 8
    if begin + n_bytes > end or kind not in (*_ITEM_BYTES, _MATRIX, _COMPRESSED):
        raise _DamagedError
    padded = n_bytes if kind == _COMPRESSED else -(-n_bytes // 8) * 8
    return _Element(kind, begin, begin + n_bytes, min(begin + padded, end))


def _numbers(data: bytes, position: int, end: int, order: str, count: int | None = None) -> _Element:
    """An element of plain items, `count` of them if given."""
    element = _element(data, position, end, order)
    if element.kind not in _ITEM_BYTES:
        raise _DamagedError
    size = _ITEM_BYTES[element.kind]
    if (element.end - element.begin) % size or (count is not None and element.end - element.begin != size * count):
        raise _DamagedError
    return element


def _matrix(data: bytes, begin: int, end: int, order: str, depth: int) -> tuple[str, bool]:
    """Name of an array whose parts all fit, and whether it can be read (objects cannot)."""
    if begin == end and depth:
        return "", True
    if depth > _MAT_MAX_DEPTH:
        raise _DamagedError
    flags = _numbers(data, begin, end, order, 2)
    if flags.kind != 6:
        raise _DamagedError
    (word,) = struct.unpack_from(order + "I", data, flags.begin)
    kind, is_complex = word & 0xFF, bool(word & 0x0800)
    if kind == _OPAQUE:
        return _name(data, flags.following, end, order)[0], False
    shape = _numbers(data, flags.following, end, order)
    n_dims = (shape.end - shape.begin) // 4
    if shape.kind != 5 or not 2 <= n_dims <= 32:
        raise _DamagedError
    dims = struct.unpack_from(f"{order}{n_dims}i", data, shape.begin)
    count = math.prod(dims)
    if min(dims) < 0 or count > MAX_CELLS:
        raise _DamagedError
    name, position = _name(data, shape.following, end, order)
    if kind in (_CELL, _STRUCT):
        _check_parts(data, position, end, order, depth, kind, count)
    elif kind == _CHAR:
        _check_text(data, _numbers(data, position, end, order), count)
    elif 6 <= kind <= 15:
        for _ in range(2 if is_complex else 1):
            position = _numbers(data, position, end, order, count).following
    elif kind not in (_OBJECT, _SPARSE, _FUNCTION):
        raise _DamagedError
    return name, kind not in (_OBJECT, _SPARSE, _FUNCTION)


def _name(data: bytes, position: int, end: int, order: str) -> tuple[str, int]:
    title = _numbers(data, position, end, order)
    if title.kind not in (1, 2, 16):
        raise _DamagedError
    return data[title.begin : title.end].decode("latin-1"), title.following


def _check_text(data: bytes, text: _Element, count: int) -> None:
    n_bytes = text.end - text.begin
    if n_bytes > 4 * count + 8 or (count > 0 and n_bytes == 0):
        raise _DamagedError
    try:
        data[text.begin : text.end].decode({16: "utf-8", 17: "utf-16", 18: "utf-32"}.get(text.kind, "latin-1"))
    except UnicodeDecodeError as error:
        raise _DamagedError from error


def _check_parts(data: bytes, position: int, end: int, order: str, depth: int, kind: int, count: int) -> None:
    n_parts = count
    if kind == _STRUCT:
        width = _numbers(data, position, end, order, 1)
        (length,) = struct.unpack_from(order + "i", data, width.begin)
        fields = _numbers(data, width.following, end, order)
        if width.kind != 5 or not 0 < length <= 64 or (fields.end - fields.begin) % length:
            raise _DamagedError
        n_parts *= (fields.end - fields.begin) // length
        position = fields.following
    if n_parts > (end - position) // 8:
        raise _DamagedError
    for _ in range(n_parts):
        part = _element(data, position, end, order)
        if part.kind != _MATRIX:
            raise _DamagedError
        _matrix(data, part.begin, part.end, order, depth + 1)
        position = part.following


_MAX_DEPTH = 4
_NAMES = "name names channels channel_names labels header headers colheaders varnames columns"
_NAME_FIELDS = frozenset(_NAMES.split())
_UNIT_FIELDS = ("units", "unit")


def read_mat(path: Path, data: bytes, overrides: Overrides) -> list[Table]:
    """Vectors, matrices and structures of a MAT or HDF5 file: one table, or one per structure with its own length."""
    expected = "a complete MAT file with vectors or structures of vectors"
    advice = "load it in MATLAB and save it again with save(..., '-v7'), or export a CSV with writetable"

    def read() -> list[Table]:
        is_hdf = b"\x89HDF\r\n\x1a\n" in data[:2048]
        content, opaque, form = _hdf(path, data) if is_hdf else _mat5(data, path.name)
        return _tables(content, opaque, form, path, overrides)

    return read_whole(read, "a MAT or HDF5 file", path.name, expected, advice)


def _mat5(data: bytes, where: str) -> tuple[dict[str, Any], list[str], str]:
    from scipy import io as scipy_io

    stream: Any = io.BytesIO(data)
    checked = readable_variables(data, where)
    names, opaque = checked if checked is not None else (None, [])
    content = scipy_io.loadmat(
        stream, variable_names=names, struct_as_record=False, squeeze_me=True, chars_as_strings=True
    )
    plain = {k: v for k, v in content.items() if not k.startswith("__")}
    return _unpacked(plain, opaque, 0), opaque, "mat"


def _unpacked(content: dict[str, Any], opaque: list[str], depth: int) -> dict[str, Any]:
    """Structures as nested dicts, structure arrays as lists of dicts, cells of texts as lists."""
    out: dict[str, Any] = {}
    for name, value in content.items():
        kind = type(value).__name__
        if kind == "mat_struct" and depth < _MAX_DEPTH:
            out[name] = _unpacked({f: getattr(value, f) for f in value._fieldnames}, opaque, depth + 1)
        elif kind in ("MatlabOpaque", "MatlabFunction"):
            opaque.append(name)
        elif isinstance(value, np.ndarray) and value.dtype == object and value.size:
            items = list(value.ravel())
            if all(type(item).__name__ == "mat_struct" for item in items):
                out[name] = [
                    _unpacked({f: getattr(item, f) for f in item._fieldnames}, opaque, depth + 1)
                    for item in items[:500]
                ]
            elif all(isinstance(item, str) for item in items):
                out[name] = [str(item) for item in items]
        elif isinstance(value, np.ndarray):
            if value.dtype.names is None:
                out[name] = value
            else:
                opaque.append(name)
        elif isinstance(value, str):
            out[name] = value
    return out


def _hdf(path: Path, data: bytes) -> tuple[dict[str, Any], list[str], str]:
    h5py = optional_module("h5py", "a MAT v7.3 or HDF5 file", path.name)
    opaque: list[str] = []
    total = 0.0

    def group(node: Any, depth: int) -> dict[str, Any]:
        nonlocal total
        out: dict[str, Any] = {}
        for name in node:
            if name.startswith("#"):
                continue
            # links out of the file are not followed
            if isinstance(node.get(name, getlink=True), h5py.ExternalLink):
                continue
            item = node.get(name)
            if item is None:
                continue
            if isinstance(item, h5py.Group):
                if "MATLAB_object_decode" in item.attrs or depth >= _MAX_DEPTH:
                    opaque.append(name)
                else:
                    out[name] = group(item, depth + 1)
            elif isinstance(item, h5py.Dataset):
                if "MATLAB_object_decode" in item.attrs:
                    opaque.append(name)
                    continue
                total += float(np.prod(item.shape or (1,), dtype=np.float64))
                if total > MAX_CELLS:
                    checked_size(int(min(total, 9e18)), path.name)
                value = _hdf_value(item, node.file, h5py)
                if value is not None:
                    out[name] = value
                    unit = item.attrs.get("unit", item.attrs.get("units"))
                    if unit is not None:
                        out.setdefault("#units", {})[name] = unit.decode() if isinstance(unit, bytes) else str(unit)
        return out

    with h5py.File(io.BytesIO(data), "r") as file:
        content = group(file, 0)
        matlab = b"MATLAB" in data[:128] or any("MATLAB_class" in file[n].attrs for n in file if n in content)
    return content, opaque, "mat-7.3" if matlab else "hdf5"


def _hdf_value(item: Any, file: Any, h5py: Any) -> Any:
    kind = item.attrs.get("MATLAB_class", b"")
    kind = kind.decode() if isinstance(kind, bytes) else str(kind)
    if item.attrs.get("MATLAB_empty", 0) or item.shape is None or 0 in item.shape:
        return None
    if kind == "char":
        return "".join(chr(int(c)) for c in np.asarray(item[()]).T.ravel()[:10_000])
    if kind == "cell" or item.dtype == h5py.ref_dtype:
        if item.size > 20_000:
            return None
        texts = []
        for reference in np.asarray(item[()]).ravel():
            target = file[reference]
            plain = isinstance(target, h5py.Dataset) and target.dtype != h5py.ref_dtype
            texts.append(_hdf_value(target, file, h5py) if plain else None)
        return texts if texts and all(isinstance(t, str) for t in texts) else None
    if item.dtype.names is not None:
        return {name: np.asarray(item[name]) for name in item.dtype.names}
    value = np.asarray(item[()])
    if value.dtype.kind == "O":
        return [v.decode("utf-8", "replace") if isinstance(v, bytes) else str(v) for v in value.ravel()[:100_000]]
    # MATLAB stores columns first: a matrix appears transposed
    return np.squeeze(value.T) if kind else np.squeeze(value)


def _tables(content: dict[str, Any], opaque: list[str], form: str, path: Path, overrides: Overrides) -> list[Table]:
    candidates = list(_sets(content, path.stem, 0))
    if overrides.sheet is not None:
        candidates = [c for c in candidates if c[0].split(".")[-1] == overrides.sheet or c[0] == overrides.sheet]
    tables = [table for name, level in candidates if (table := _table(name, level, path, form)) is not None]
    if not tables:
        if opaque:
            raise ReadError(
                f"MATLAB objects that only MATLAB can read ({', '.join(opaque[:6])}: timetable, table, datetime or "
                "string)",
                expected="vectors or a structure of vectors",
                where=path.name,
                advice="in MATLAB: s = table2struct(timetable2table(TT), 'ToScalar', true); save('run.mat', '-struct', "
                "'s', '-v7'); or writetimetable(TT, 'run.csv')",
            )
        raise ReadError(
            f"no vectors of the same length (variables: {', '.join(list(content)[:10]) or 'none'})",
            expected="one vector per channel, or a matrix with one row per sample",
            where=path.name,
            advice="store one vector per channel with the same number of samples, and the time as another vector",
        )
    # the largest table and those with the same columns are runs; others (parameters, settings) are not
    wanted = [c.header for c in max(tables, key=lambda t: len(t) * len(t.columns)).columns]
    first, *others = (t for t in tables if [c.header for c in t.columns] == wanted)
    if not others:
        first = replace(first, name=path.stem)
    if opaque:
        told = f"{', '.join(opaque[:6])} in {path.name} are MATLAB objects that only MATLAB can read; "
        told += "they were left out."
        noticed = FINDINGS.finding("opaque-objects", told, evidence={"variables": opaque[:50]})
        first = replace(first, findings=(*first.findings, noticed))
    return [first, *others]


def _sets(content: dict[str, Any], name: str, depth: int) -> Iterator[tuple[str, dict[str, Any]]]:
    """Every level of the structure that may be a table."""
    yield name, content
    for key, value in content.items():
        if isinstance(value, dict) and key != "#units" and depth < _MAX_DEPTH:
            yield from _sets(value, f"{name}.{key}" if depth else key, depth + 1)
        elif isinstance(value, list) and value and all(isinstance(v, dict) for v in value):
            for i, item in enumerate(value, start=1):
                yield from _sets(item, f"{name}_{key}{i}", depth + 1)


def _with_channels(level: dict[str, Any]) -> dict[str, Any]:
    """A level with each channel that is a structure of its own (one vector, its unit, its name) as a plain vector."""
    flat, units = dict(level), dict(level.get("#units", {}))
    beside = (level[key] for key in level if key.lower() in _UNIT_FIELDS and isinstance(level[key], dict))
    named: dict[str, Any] = next(beside, {})
    units.update({key: unit for key, unit in named.items() if isinstance(unit, str)})
    parts = {key: value for key, value in level.items() if isinstance(value, dict) and value is not named}
    for value in level.values():
        if isinstance(value, list) and all(isinstance(one, dict) for one in value):
            parts.update({_text_of(one, _NAME_FIELDS) or f"col{i}": one for i, one in enumerate(value, start=1)})
    for key, part in parts.items():
        found = [one for one in part.values() if isinstance(one, np.ndarray) and one.ndim == 1 and len(one) > 1]
        unit = _text_of(part, _UNIT_FIELDS)
        if len(found) == 1 and (unit is not None or _text_of(part, _NAME_FIELDS)):
            flat[key] = found[0]
            if unit:
                units[key] = unit
    return {**flat, "#units": units} if units else flat


def _text_of(part: dict[str, Any], fields: Collection[str]) -> str | None:
    return next((one for key, one in part.items() if key.lower() in fields and isinstance(one, str)), None)


def _table(name: str, level: dict[str, Any], path: Path, form: str) -> Table | None:
    level = _with_channels(level)
    vectors: list[tuple[str, NDArray[Any]]] = []
    names = next((level[k] for k in level if k.lower() in _NAME_FIELDS and isinstance(level[k], list)), None)
    units = next((level[k] for k in level if k.lower() in _UNIT_FIELDS and isinstance(level[k], list)), None)
    unit_of: dict[str, str] = dict(level.get("#units", {})) if isinstance(level.get("#units"), dict) else {}
    for key, value in level.items():
        if isinstance(value, list) and value and all(isinstance(v, str) for v in value):
            vectors.append((key, np.array(value, dtype=object)))
        if not isinstance(value, np.ndarray) or value.dtype.kind not in "fiubM":
            continue
        if value.ndim == 1 and len(value) > 1:
            vectors.append((key, value))
        elif value.ndim == 2 and min(value.shape) > 0:
            matrix = value if value.shape[0] >= value.shape[1] else value.T
            checked_width(matrix.shape[1], path.name)
            own = names if names is not None and len(names) == matrix.shape[1] else None
            for k in range(matrix.shape[1]):
                header = own[k] if own else f"{key}_{k + 1}"
                vectors.append((header, matrix[:, k]))
                if units is not None and len(units) == matrix.shape[1]:
                    unit_of[header] = units[k]
    numeric = [len(v) for _, v in vectors if v.dtype.kind != "O" and len(v) > 1]
    if not numeric:
        return None
    length = max(set(numeric), key=lambda n: (numeric.count(n) * n, n))
    chosen = [(k, v) for k, v in vectors if len(v) == length and k != "#units"]
    left = [k for k, v in vectors if len(v) != length and v.dtype.kind != "O"]
    headers, findings = unique_headers([k for k, _ in chosen], path.name)
    columns = []
    for header, (key, value) in zip(headers, chosen, strict=True):
        values = column_values(value)
        if values is not None:
            columns.append(Column(header, values, unit_of.get(key)))
    if left:
        told = f"Variables {', '.join(left[:8])} of {path.name} do not have {length} samples; they were left out."
        evidence = {"variables": left[:50], "samples": length}
        findings.append(FINDINGS.finding("other-length", told, evidence=evidence, level="info"))
    return Table(name, path, tuple(columns), reading_of(form, sheet=name), tuple(findings)) if columns else None
