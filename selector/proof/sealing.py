"""How is the truth kept apart: answers as canonical text, the hashes that are published before anybody answers."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

from selector.proof.case import Case, Truth
from selector.recording import Recording


def truth_as_dict(truth: Truth) -> dict[str, Any]:
    """The truth as JSON values."""
    return {name: _plain(getattr(truth, name)) for name in (field.name for field in dataclasses.fields(truth))}


def sealed_text(answers: Mapping[str, Mapping[str, Any]]) -> str:
    """Answers by case as canonical JSON: sorted keys, so that equal answers have equal bytes and equal hashes."""
    return json.dumps(answers, sort_keys=True, ensure_ascii=False, allow_nan=False, indent=1) + "\n"


def sha256_of_text(text: str) -> str:
    """SHA-256 of a text in UTF-8."""
    return hashlib.sha256(text.encode("utf-8")).hexdigest()


def sealed_sha256_of_case(case: Case) -> str:
    """SHA-256 of everything a case consists of: recordings, simulation, truth.

    It shows afterwards that neither data nor answers were changed once the hash was known. Numbers enter with all
    their bits, so that it also shows whether two machines make the same cases.
    """
    digest = hashlib.sha256()
    digest.update(
        sealed_text({case.name: {"truth": truth_as_dict(case.truth), "responses": list(case.responses)}}).encode()
    )
    for recording in (case.recording, case.simulation):
        _update(digest, recording)
    return digest.hexdigest()


def seal_of(seals: Iterable[str]) -> str:
    """One hash for many cases, whatever their order."""
    return sha256_of_text("\n".join(sorted(set(seals))))


def _update(digest: Any, recording: Recording) -> None:
    for channel in recording.channels:
        digest.update(repr(channel).encode())
    for run in recording.runs:
        digest.update(run.encode())
        for values in (recording.time_s(run), recording.values(run, recording.names)):
            digest.update(np.ascontiguousarray(values, dtype="<f8").tobytes())


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: _plain(getattr(value, field.name)) for field in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(item) for item in value]
    if isinstance(value, np.generic):
        return value.item()
    return value
