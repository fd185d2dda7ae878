"""From the model to the control: the model file, what it means, how it reads, what it does on other recordings."""

from selector.controllers.application import Accuracy as Accuracy
from selector.controllers.application import Application as Application
from selector.controllers.application import apply_model as apply_model
from selector.controllers.evaluator import evaluate as evaluate
from selector.controllers.evaluator import formula_text as formula_text
from selector.controllers.guard.decided import DecidedLimits as DecidedLimits
from selector.controllers.guard.decided import Mode as Mode
from selector.controllers.guard.decided import decided_limits as decided_limits
from selector.controllers.guard.guarded_model import Corrected as Corrected
from selector.controllers.guard.guarded_model import GuardedModel as GuardedModel
from selector.controllers.model_file import Fallback as Fallback
from selector.controllers.model_file import Guard as Guard
from selector.controllers.model_file import Input as Input
from selector.controllers.model_file import ModelFile as ModelFile
from selector.controllers.model_file import Output as Output
from selector.controllers.model_file import OutputLimits as OutputLimits
from selector.controllers.model_file import PositionPart as PositionPart
from selector.controllers.model_file import State as State
from selector.controllers.model_file import Term as Term
from selector.controllers.model_file import model_json_schema as model_json_schema
from selector.controllers.model_file import model_text as model_text
from selector.controllers.model_file import parsed_model as parsed_model
from selector.controllers.model_file import read_model as read_model
from selector.controllers.model_file import write_model as write_model
from selector.controllers.self_check import model_findings as model_findings
from selector.controllers.self_check import sealed as sealed
