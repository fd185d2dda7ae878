"""From the model to the control: the model file, what it means, how it reads, what it does on other recordings."""

from selector.controllers.application import Accuracy, Application, apply_model
from selector.controllers.evaluator import Evaluator, evaluate, formula_text
from selector.controllers.guard.decided import DecidedLimits, Mode, decided_limits
from selector.controllers.guard.guarded_model import Corrected, GuardedModel
from selector.controllers.model_file import (
    Fallback,
    Guard,
    Input,
    ModelFile,
    Output,
    OutputLimits,
    PositionPart,
    State,
    Term,
    model_json_schema,
    model_text,
    parsed_model,
    read_model,
    write_model,
)
from selector.controllers.self_check import model_findings, sealed

__all__ = [
    "Accuracy",
    "Application",
    "Corrected",
    "DecidedLimits",
    "Evaluator",
    "Fallback",
    "Guard",
    "GuardedModel",
    "Input",
    "Mode",
    "ModelFile",
    "Output",
    "OutputLimits",
    "PositionPart",
    "State",
    "Term",
    "apply_model",
    "decided_limits",
    "evaluate",
    "formula_text",
    "model_findings",
    "model_json_schema",
    "model_text",
    "parsed_model",
    "read_model",
    "sealed",
    "write_model",
]
