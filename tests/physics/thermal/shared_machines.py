"""Machines of finite elements, made once in a run of the suite by whichever process is the first to ask for one."""

from __future__ import annotations

import hashlib
import json
import os
import pickle
from collections.abc import Callable, Iterator
from copyreg import dispatch_table
from dataclasses import replace
from functools import lru_cache
from io import BytesIO
from pathlib import Path
from types import MappingProxyType
from typing import Any

import pytest

from selector.physics.thermal import field_model
from selector.physics.thermal.field.machine import VirtualMachine
from tests.patience import alone, shared_folder


def _read_only(content: dict[Any, Any]) -> MappingProxyType[Any, Any]:
    return MappingProxyType(content)


def pickled(value: object) -> bytes:
    """As `pickle.dumps`, also with read-only mappings inside."""
    stream = BytesIO()
    pickler = pickle.Pickler(stream)
    pickler.dispatch_table = dispatch_table | {MappingProxyType: lambda one: (_read_only, (dict(one),))}
    pickler.dump(value)
    return stream.getvalue()


def from_folder(folder: Path, kind: str, key: object, made: Callable[[], VirtualMachine]) -> VirtualMachine:
    """The machine of this key, read from the folder, or made and written there; read ones have no factors."""
    path = folder / f"{kind}-{hashlib.sha256(pickled(key)).hexdigest()}.pickle"
    with alone(path.with_suffix(".sign")):
        if path.exists():
            machine: VirtualMachine = pickle.loads(path.read_bytes())
            return machine
        machine = made()
        kept = replace(machine, elastic=None)
        # reduced once for all that read it: what is cached in an object is pickled with it
        assert kept.system is kept.system
        draft = path.with_suffix(f".{os.getpid()}")
        draft.write_bytes(pickled(kept))
        draft.replace(path)
    return machine


@pytest.fixture(scope="session", autouse=True)
def shared_machines(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """What model files make their machines with; tests of these functions themselves call them as they are."""
    folder = shared_folder(tmp_path_factory)
    centre, of_mesh = field_model.virtual_machining_centre, field_model._meshed.__wrapped__

    def virtual_machining_centre(physics: Any, **asked: Any) -> VirtualMachine:
        return from_folder(folder, "centre", (physics, asked), lambda: centre(physics, **asked))

    @lru_cache(maxsize=1)
    def meshed(asked: Any) -> VirtualMachine:
        # a copy of a mesh is the same mesh
        mesh = Path(asked.file.mesh.file)
        content = mesh.read_bytes() if mesh.is_file() else b""
        key = (asked.text.replace(json.dumps(str(mesh)), mesh.suffix), asked.laws, content)
        return from_folder(folder, "mesh", key, lambda: of_mesh(asked))

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(field_model, "virtual_machining_centre", virtual_machining_centre)
        patch.setattr(field_model, "_meshed", meshed)
        yield
