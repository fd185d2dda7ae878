"""What may be asked of an adaptation on the command line."""

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from selector.errors import OptionError

Every = Annotated[
    str | None,
    typer.Option("--every", metavar="TIME", help="See the recorded displacement only so often, e.g. 2h, 90min, 3600s."),
]
TouchOffs = Annotated[
    Path | None,
    typer.Option(
        "--touch-offs", metavar="FILE.csv", help="Touch-offs as measured: run,time_s and a column a response."
    ),
]
Within = Annotated[
    float | None,
    typer.Option("--within", metavar="µm", help="How often to probe so that ± µm is held in 95 % of the time."),
]

_TIME = re.compile(r"\s*(\d+(?:[.]\d*)?|[.]\d+)\s*(s|min|h|d)\s*")
_SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0, "d": 86_400.0}


@dataclass(frozen=True)
class Asked:
    """The options of `adapt`, one field an option."""

    every: Every = None
    touch_offs: TouchOffs = None
    within: Within = None

    def every_s(self) -> float | None:
        """The period of --every [s].

        Raises OptionError: not exactly one of the three options was given, or its value is none.
        """
        given = [self.every is not None, self.touch_offs is not None, self.within is not None]
        if sum(given) != 1:
            raise OptionError(
                f"{sum(given)} of --every, --touch-offs and --within",
                expected="one of them",
                where="adapt",
                advice="--every 2h tries touch-offs on the recordings; --touch-offs FILE.csv has those that were "
                "measured; --within 5 looks for how often to probe",
            )
        if self.within is not None and not 0.0 < self.within < math.inf:
            raise OptionError(
                f"{self.within:g}", expected="a number of µm above 0", where="--within", advice="e.g. --within 5"
            )
        if self.every is None:
            return None
        found = _TIME.fullmatch(self.every)
        seconds = float(found[1]) * _SECONDS[found[2]] if found else 0.0
        if not 0.0 < seconds < math.inf:
            raise OptionError(
                repr(self.every[:40]),
                expected="a time above 0 with its unit: s, min, h or d",
                where="--every",
                advice="e.g. --every 2h, --every 90min or --every 3600s",
            )
        return seconds
