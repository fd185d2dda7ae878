"""Reduced heat systems in files, so that a field is reduced once: NumPy archives without pickles, checked when read."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from selector.errors import ReadError
from selector.physics.thermal.heat_system import HeatSystem

Array = NDArray[np.float64]

SCHEMA = "selector.heat-system/1"
MOST_BYTES = 512 * 2**20
"""Largest content of a file that is read."""

_ROWS = ("film_loads", "sources", "probes", "displacements")
_NAMES = (*_ROWS, "films", "states")
_MEMBERS = ("schema", "capacity", "conduction", "uniform", "films", *_ROWS, *(f"names of {name}" for name in _NAMES))


def write_system(path: Path, system: HeatSystem) -> None:
    """Write a dense system (a network, a reduced field) as a NumPy archive (`.npz`); the same system, the same bytes.

    Raises
    ------
    ValueError
        If the system is sparse: reduce it first.
    """
    n = system.size
    if not all(
        isinstance(matrix, np.ndarray) for matrix in (system.capacity, system.conduction, *system.films.values())
    ):
        raise ValueError(f"a sparse system of {n} states is not stored: reduce it first")
    content: dict[str, NDArray[np.generic]] = {
        "schema": np.array(SCHEMA),
        "capacity": np.asarray(system.capacity),
        "conduction": np.asarray(system.conduction),
        "uniform": system.uniform,
        "films": np.array(list(system.films.values())).reshape(-1, n, n),
        "names of films": _words(list(system.films)),
        "names of states": _words(system.states),
    }
    for name in _ROWS:
        rows = getattr(system, name)
        content[name] = np.array(list(rows.values())).reshape(-1, n)
        content[f"names of {name}"] = _words(list(rows))
    with path.open("wb") as stream:
        np.savez(stream, allow_pickle=False, **content)


def read_system(path: Path) -> HeatSystem:
    """The system in a file of `write_system`.

    Raises
    ------
    ReadError
        If the file is something else, is damaged, or its matrices are not those of a body that conducts heat.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            sizes = {info.filename.removesuffix(".npy"): info.file_size for info in archive.infolist()}
        if sorted(sizes) != sorted(_MEMBERS):
            raise _unreadable(path, f"an archive of {', '.join(sorted(sizes)[:20]) or 'nothing'}")
        if sum(sizes.values()) > MOST_BYTES:
            raise _unreadable(path, f"{sum(sizes.values()) / 2**20:.0f} MiB", f"at most {MOST_BYTES // 2**20} MiB")
        with np.load(path, allow_pickle=False) as archive:
            content = {name: archive[name] for name in _MEMBERS}
    except (OSError, ValueError, EOFError, MemoryError, NotImplementedError, zipfile.BadZipFile) as error:
        raise _unreadable(path, f"a file that cannot be read ({error})") from None
    if content["schema"].dtype.kind != "U" or str(content["schema"]) != SCHEMA:
        raise _unreadable(path, f"schema {str(content['schema'])[:60]!r}", repr(SCHEMA))
    names = {name: _read_words(path, name, content[f"names of {name}"]) for name in _NAMES}
    n = len(content["uniform"]) if content["uniform"].ndim == 1 else 0
    square = {"capacity": (n, n), "conduction": (n, n), "uniform": (n,), "films": (len(names["films"]), n, n)}
    for name, shape in (square | {name: (len(names[name]), n) for name in _ROWS}).items():
        array = content[name]
        if array.dtype != np.float64 or array.shape != shape or not np.isfinite(array).all():
            raise _unreadable(path, f"{name} of shape {array.shape}", f"numbers of shape {shape}")
    if names["film_loads"] != names["films"] or len(names["states"]) not in (0, n) or not n:
        raise _unreadable(path, "names that do not fit the matrices")
    system = HeatSystem(
        capacity=content["capacity"],
        conduction=content["conduction"],
        films=dict(zip(names["films"], content["films"], strict=True)),
        film_loads=dict(zip(names["film_loads"], content["film_loads"], strict=True)),
        sources=dict(zip(names["sources"], content["sources"], strict=True)),
        probes=dict(zip(names["probes"], content["probes"], strict=True)),
        displacements=dict(zip(names["displacements"], content["displacements"], strict=True)),
        uniform=content["uniform"],
        states=names["states"],
    )
    _check_physics(path, system)
    return system


def _check_physics(path: Path, system: HeatSystem) -> None:
    """Symmetric, passive, no heat flow in a uniform field; 1e-9: round-off of whatever reduced it."""
    for name, matrix in {"capacity": system.capacity, "conduction": system.conduction, **system.films}.items():
        dense = np.asarray(matrix)
        scale = float(np.abs(dense).max())
        lowest = float(np.linalg.eigvalsh(dense)[0])
        wrong = np.abs(dense - dense.T).max() > 1e-9 * scale or lowest < -1e-9 * scale
        if name == "capacity":
            wrong = wrong or not lowest > 0
        elif name == "conduction":
            wrong = wrong or np.abs(dense @ system.uniform).max() > 1e-9 * scale * np.abs(system.uniform).max()
        else:
            rest = np.abs(dense @ system.uniform - system.film_loads[name]).max()
            wrong = wrong or rest > 1e-9 * max(scale * np.abs(system.uniform).max(), 1e-300)
        if wrong:
            raise _unreadable(
                path, f"a matrix {name!r} that makes or loses heat", "symmetric matrices of a passive body"
            )


def _words(names: tuple[str, ...] | list[str]) -> NDArray[np.str_]:
    return np.array(list(names), dtype=np.str_) if names else np.zeros(0, dtype="<U1")


def _read_words(path: Path, name: str, words: NDArray[np.generic]) -> tuple[str, ...]:
    found = tuple(str(word) for word in words) if words.ndim == 1 and words.dtype.kind == "U" else None
    if found is None or len(set(found)) < len(found) or not all(word and word.isprintable() for word in found):
        raise _unreadable(path, f"no list of unique names of {name}", "printable names")
    return found


def _unreadable(path: Path, found: str, expected: str = f"a file of {SCHEMA}") -> ReadError:
    return ReadError(found, expected=expected, where=str(path), advice="write the file anew with write_system")
