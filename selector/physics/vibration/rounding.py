"""When is a number at a limit, so that rounding must not decide on which side of it.

Frequencies are products of orders, speeds and limits: order 15 at 1290 r/min, divided by the speed again, may be
15.000000000000002. What is within 10⁻⁹ of a limit is at the limit.
"""

import numpy as np
from numpy.typing import ArrayLike

from selector.types import Mask

#: Share by which numbers above 0 differ that are the same; rounding leaves some 10⁻¹⁵, of sampled times up to 10⁻¹⁰.
SAME = 1e-9


def above(values: ArrayLike, limit: float) -> Mask:
    """Whether values lie above a limit by more than rounding."""
    return np.asarray(values, dtype=np.float64) > limit * (1.0 + SAME)


def below(values: ArrayLike, limit: float) -> Mask:
    """Whether values lie below a limit by more than rounding."""
    return np.asarray(values, dtype=np.float64) < limit * (1.0 - SAME)
