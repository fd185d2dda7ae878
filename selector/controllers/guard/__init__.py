"""The guard: a model made safe against broken sensors, restarts and jumps, as every exported program runs it."""

from selector.controllers.guard.codes import Mode, SensorCode
from selector.controllers.guard.decided import DecidedLimits, decided_limits, with_decided_limits
from selector.controllers.guard.guarded_model import Corrected, GuardedModel

__all__ = ["Corrected", "DecidedLimits", "GuardedModel", "Mode", "SensorCode", "decided_limits", "with_decided_limits"]
