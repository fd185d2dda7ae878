"""What is odd about a thermal model before it runs: parts of a network that no heat can leave."""

from __future__ import annotations

from selector.findings import Finding, Where
from selector.physics.thermal.model_schema import ModelFile, NetworkFile


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
    return Finding(
        "no-way-for-heat",
        "warning",
        statement,
        Where(channel=group[0] if len(group) == 1 else None),
        {"nodes": group, "heated": heated},
        "give the node a link to its neighbour or a film to the hall in the model file",
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
