"""From the model to the control: the model file, what it means, how it reads, what it does on other recordings."""

from selector.controllers.application import Accuracy, Application, apply_model, write_predictions
from selector.controllers.evaluator import Evaluator, evaluate
from selector.controllers.formula import formula_text, legend_text, physical_coefficients, physical_slopes
from selector.controllers.guard import Corrected, DecidedLimits, GuardedModel, Mode, SensorCode, decided_limits
from selector.controllers.model_file import (
    CheckVector,
    Fallback,
    Guard,
    Input,
    ModelFile,
    Output,
    OutputLimits,
    PositionPart,
    Provenance,
    State,
    Term,
    Validation,
    model_json_schema,
)
from selector.controllers.model_io import model_sha256, model_text, parsed_model, read_model, write_model
from selector.controllers.self_check import check_model, check_vectors, model_findings, output_bound_um

__all__ = [
    "Accuracy",
    "Application",
    "CheckVector",
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
    "Provenance",
    "SensorCode",
    "State",
    "Term",
    "Validation",
    "apply_model",
    "check_model",
    "check_vectors",
    "decided_limits",
    "evaluate",
    "formula_text",
    "legend_text",
    "model_findings",
    "model_json_schema",
    "model_sha256",
    "model_text",
    "output_bound_um",
    "parsed_model",
    "physical_coefficients",
    "physical_slopes",
    "read_model",
    "write_model",
    "write_predictions",
]
