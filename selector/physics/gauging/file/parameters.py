"""Which numbers of a gauging model could be fitted again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from selector.physics.gauging.file.model_file import GaugingFile, checked_model_file, file_parts
from selector.physics.model_fields import numbers_of
from selector.physics.model_parameters import Number, Parameter, file_with, parameters_of


def parameters(file: GaugingFile) -> dict[str, Parameter]:
    """The physics of gauging as named numbers, those that are switched off included: lag, wear, delay, run-out.

    Names are the keys of the file, also where the file leaves them out, arrays counted from 1:
    ``grinding.stages.1.feed_um_per_s``, ``transducer.contact.stiffness``, ``noise.sd_um``, ``thresholds.volts.2``.
    Tolerances and whole numbers are none. Bounds are those of the fields, unless ``[bounds]`` says otherwise. Errors
    as `parameters_of`.
    """
    return parameters_of(file, _numbers(file))


def with_parameters(file: GaugingFile, values: Mapping[str, float]) -> GaugingFile:
    """The model file with other values of some parameters, see `file_with`."""
    return file_with(file, values, _numbers(file), checked_model_file)


def _numbers(file: GaugingFile) -> Iterator[Number]:
    parts = file_parts(file)
    if parts.transducer is not None:
        yield from numbers_of(parts.transducer, ("transducer",))
    else:
        yield from numbers_of(parts.linear, ("linear",))
        yield from numbers_of(parts.relay, ("relay",))
    yield from numbers_of(parts.grinding, ("grinding",))
    for number in numbers_of(parts.surface, ("surface",)):
        turns, grooved = parts.surface.workpiece_rpm > 0, parts.surface.grooves > 0
        if turns and (grooved or not str(number.path[-1]).startswith("groove_")):
            yield number
    yield from numbers_of(parts.noise, ("noise",))
    yield from numbers_of(file.thresholds, ("thresholds",))
