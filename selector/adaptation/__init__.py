"""Keeping a model true with touch-offs: drift learnt from runs, a Kalman filter, and when to probe."""

from selector.adaptation.drift import Course, Drift
from selector.adaptation.judged import Accuracy, Judged, Learnt, Policy
from selector.adaptation.result import Adaptation, adaptation

__all__ = ["Accuracy", "Adaptation", "Course", "Drift", "Judged", "Learnt", "Policy", "adaptation"]
