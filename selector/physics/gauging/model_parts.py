"""What do the sections of a gauging model file describe: gauge, grinding, surface, noise, tolerance."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from selector.errors import InputError
from selector.physics.gauging.model_schema import GaugingFile
from selector.physics.gauging.process import Grinding, Noise, Stage, Surface, Tolerance
from selector.physics.gauging.transducer import LinearGauge, Relay, Transducer
from selector.physics.model_entries import Entry
from selector.physics.model_text import Contradiction, Key
from selector.physics.model_values import given, refused, value_of


@dataclass(frozen=True)
class FileParts:
    """The values that a model file describes.

    Attributes
    ----------
    transducer, linear : Transducer or None, LinearGauge or None
        The gauge: one of the two.
    relay : Relay
    grinding : Grinding
    surface : Surface
    noise : Noise
    tolerance : Tolerance or None
    """

    transducer: Transducer | None
    linear: LinearGauge | None
    relay: Relay
    grinding: Grinding
    surface: Surface
    noise: Noise
    tolerance: Tolerance | None

    @property
    def filter_s(self) -> float:
        """T_Φ of the gauge [s]."""
        gauge = self.linear if self.transducer is None else self.transducer.smoothing
        return gauge.time_constant_s if gauge is not None else 0.0


def file_parts(file: GaugingFile) -> FileParts:
    """The values of the sections; errors as their dataclasses have them."""
    transducer = None if file.transducer is None else value_of(Transducer, file.transducer)
    relay = Relay() if file.relay is None else value_of(Relay, file.relay)
    return FileParts(
        transducer,
        None if file.linear is None else value_of(LinearGauge, file.linear),
        relay if transducer is None else transducer.relay,
        _grinding(file.grinding),
        value_of(Surface, file.surface),
        value_of(Noise, file.noise),
        None if file.tolerance is None else value_of(Tolerance, file.tolerance),
    )


def part_contradictions(file: GaugingFile) -> Iterator[Contradiction]:
    """Whatever the values of the sections refuse, at the key of the section."""
    stages: tuple[Entry, ...] = file.grinding.stages  # type: ignore[attr-defined]
    kinds: list[tuple[type, Entry | None, Key]] = [
        (Transducer, file.transducer, ("transducer",)),
        (LinearGauge, file.linear, ("linear",)),
        (Relay, file.relay, ("relay",)),
        *((Stage, stage, ("grinding", "stages", number)) for number, stage in enumerate(stages)),
        (Surface, file.surface, ("surface",)),
        (Noise, file.noise, ("noise",)),
        (Tolerance, file.tolerance, ("tolerance",)),
    ]
    refusals = []
    for kind, section, key in kinds:
        if section is not None:
            try:
                value_of(kind, section)
            except InputError as error:
                refusals.append(refused(error, key, section))
    yield from refusals
    if not refusals:
        try:
            _grinding(file.grinding)
        except InputError as error:
            yield refused(error, ("grinding",), file.grinding)


def _grinding(section: Entry) -> Grinding:
    said = given(Grinding, section)
    return Grinding(**(said | {"stages": tuple(value_of(Stage, stage) for stage in said["stages"])}))
