"""Which numbers of a thermal model could be fitted again, and what is odd about it before it runs."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import Any

from selector.findings import Finding, Where
from selector.physics.model_fields import numbers_of
from selector.physics.model_parameters import Number, Parameter, file_with, numbers_in, parameters_of
from selector.physics.model_text import Key, plain_values
from selector.physics.thermal.file.model_file import FieldFile, ModelFile, NetworkFile, checked_model_file
from selector.physics.thermal.finding_table import FINDINGS

_SECTIONS = ("nodes", "links", "films", "coolant_films", "sources", "modes", "run")


def parameters(file: ModelFile) -> dict[str, Parameter]:
    """The physics of a model file as named numbers; what the file does not say (switched off) is no parameter.

    Names are the keys of the file: ``nodes.column.heat_capacity_j_per_k``, ``links.bed~column.conductance_w_per_k``,
    ``films.hall.still_w_per_m2_k``, ``modes.gains_um.Z.2000 rpm.mode 1``, ``run.start_degc``. Bounds are
    those of the fields, unless ``[bounds]`` says otherwise. Errors as `parameters_of`.
    """
    return parameters_of(file, _numbers(file))


def with_parameters(file: ModelFile, values: Mapping[str, float]) -> ModelFile:
    """The model file with other values of some parameters, see `file_with`."""
    return file_with(file, values, _numbers(file), checked_model_file, _complete_values(file))


def _numbers(file: ModelFile) -> Iterator[Number]:
    """Those that the file says, and of the field machine those of the laws that it does not mention, too."""
    values = _complete_values(file)
    whole = FieldFile.model_validate(values) if isinstance(file, FieldFile) else file
    known = {one.path: one for one in numbers_of(whole)}
    for section in _SECTIONS:
        for path in numbers_in(values.get(section, {}), (section,)):
            if path in known:
                yield replace(known[path], name=_name(file, path))


def _complete_values(file: ModelFile) -> dict[str, Any]:
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


def model_findings(file: ModelFile) -> tuple[Finding, ...]:
    """A warning for every group of linked nodes without any film; none for models of other kinds.

    Heat that enters such a group stays in it; a single node that nothing heats keeps its temperature for ever.
    """
    if not isinstance(file, NetworkFile):
        return ()
    wetted = {node for film in file.films.values() for node in film.area_m2}
    heated = {node for source in file.sources.values() for node in source.shares}
    return tuple(
        _closed(group, bool(heated & set(group)), bool(file.films))
        for group in _linked(file)
        if not wetted & set(group)
    )


def _closed(group: list[str], heated: bool, films: bool) -> Finding:
    named = ", ".join(group[:8]) + (" …" if len(group) > 8 else "")
    if heated:
        effect = "heat that enters stays there for ever"
    elif len(group) == 1:
        effect = "its temperature never changes"
    else:
        effect = "nothing outside ever changes their temperatures"
    lacks = "film or link" if len(group) == 1 else "film"
    statement = f"{named}: no {lacks}, so {effect}."
    if not films:
        statement += " The network has no film at all."
    return FINDINGS.finding(
        "no-way-for-heat",
        statement,
        Where(channel=group[0] if len(group) == 1 else None),
        {"nodes": group, "heated": heated},
    )


def _linked(file: NetworkFile) -> list[list[str]]:
    """Groups of nodes that heat can flow between, in the order of the file."""
    group = {name: {name} for name in file.nodes}
    for link in file.links:
        first, second = (group[name] for name in link.between)
        if first is not second:
            first |= second
            for name in second:
                group[name] = first
    order = {name: number for number, name in enumerate(file.nodes)}
    unique = {id(names): sorted(names, key=order.__getitem__) for names in group.values()}
    return list(unique.values())
