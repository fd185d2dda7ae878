"""A guarded model as a program of a few kinds of statements, which every writer prints in its language."""

from selector.controllers.program.guarded_program import guarded_program
from selector.controllers.program.language import Program

__all__ = ["Program", "guarded_program"]
