"""Which sensors to keep, which model to use, and how far to trust it: the workflow over `sensors` and `models`."""

from selector.selection.exploration import Exploration
from selector.selection.options import Options
from selector.selection.result import ProvenModel, Selection
from selector.selection.workflow import select

__all__ = ["Exploration", "Options", "ProvenModel", "Selection", "select"]
