"""Whether the parts of a MAT v5 file fit into each other; the library that reads it trusts every length it meets."""

from __future__ import annotations

import math
import struct
import zlib
from dataclasses import dataclass

from selector.errors import ReadError
from selector.readers.tables import MAX_CELLS

_ITEM_BYTES = {1: 1, 2: 1, 3: 2, 4: 2, 5: 4, 6: 4, 7: 4, 9: 8, 12: 8, 13: 8, 16: 1, 17: 2, 18: 4}
_MATRIX, _COMPRESSED = 14, 15
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE, _FUNCTION, _OPAQUE = 1, 2, 3, 4, 5, 16, 17
_MAX_UNPACKED = 8 * MAX_CELLS
_MAX_DEPTH = 12


class _DamagedError(Exception):
    """A length or a type that cannot be right."""


@dataclass(frozen=True)
class _Element:
    kind: int
    begin: int
    end: int
    following: int


def readable_variables(data: bytes, where: str) -> tuple[list[str], list[str]] | None:
    """Names of the readable variables and of the opaque objects; None for MAT v4, which has no nested parts.

    Raises
    ------
    ReadError
        A variable is damaged or cut off, or unpacked they would not fit into memory.
    """
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
    if depth > _MAX_DEPTH:
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
    """Check the arrays inside of a cell array or structure."""
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
