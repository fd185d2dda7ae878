"""Which thermometers do the candidates of a model file become: one at every place of the field machine that is free."""

from __future__ import annotations

import dataclasses

from selector.errors import ModelFileError, OptionError
from selector.physics.thermal.field import MachineGeometry, sensor_candidates
from selector.physics.thermal.model_file import FieldFile, key_text, unknown_name
from selector.physics.thermal.model_schema import MOST_SENSORS, Gauge, Sensor


def with_candidates(file: FieldFile) -> FieldFile:
    """The file with a thermometer at every candidate place instead of its section on them; the file's own come first.

    Raises
    ------
    ModelFileError
        The machine has no such surface, the spacing leaves no place or too many, or a name is taken.
    """
    wanted = file.candidates
    if wanted is None:
        return file
    lengths = [part.name for part in dataclasses.fields(MachineGeometry)]
    for name in file.field.geometry:
        if name not in lengths:
            found, expected, advice = unknown_name("length", name, lengths)
            where = f"key {key_text(('field', 'geometry', name))}"
            raise ModelFileError(found, expected=expected, where=where, advice=advice)
    try:
        places = sensor_candidates(MachineGeometry(**file.field.geometry), wanted.spacing_m, wanted.surfaces)
    except OptionError as error:
        where = "key field.geometry" if "geometry" in error.where else "key candidates"
        raise ModelFileError(error.found, expected=error.expected, where=where, advice=error.advice) from None
    count = len(file.sensors) + len(places)
    if count > MOST_SENSORS:
        raise ModelFileError(
            f"{len(places)} candidates beside {len(file.sensors)} thermometers",
            expected=f"at most {MOST_SENSORS} together",
            where="key candidates.spacing_m",
            advice="enlarge the spacing, or name fewer surfaces",
        )
    named: list[tuple[str, str, tuple[Sensor | Gauge, ...]]] = [
        ("sensors", "thermometer", file.sensors),
        ("gauges", "gauge", file.gauges),
    ]
    for section, what, entries in named:
        for number, entry in enumerate(entries):
            if entry.name in places:
                raise ModelFileError(
                    f"a {what} called {entry.name!r}, as a candidate is",
                    expected="names other than P01, P02 and so on",
                    where=f"key {key_text((section, number, 'name'))}",
                    advice="give it another name",
                )
    instrument = wanted.model_dump(include={"lag_s", "noise_k", "resolution_k"})
    spread = (Sensor(name=name, place=at.place, xyz=at.xyz_m, **instrument) for name, at in places.items())
    return file.model_copy(update={"sensors": (*file.sensors, *spread), "candidates": None})
