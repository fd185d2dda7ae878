"""The Python API as pages: the public names of the packages that a study is written with, in the order of the field."""

from __future__ import annotations

import importlib
import inspect
from types import ModuleType

PARTS = {
    "recordings": ("Recordings and what is wrong with them", "recording units findings errors readers quality shipped"),
    "sensors": ("Which sensors", "sensors"),
    "models": (
        "Which model",
        "models.design models.least_squares models.best_subsets.subsets models.best_subsets.results"
        " models.best_subsets.problem models.moments",
    ),
    "selection": ("The choice, scikit-learn, and the study file", "selection estimators study"),
    "heat": (
        "How the machine warms",
        "physics.thermal.network.heat_system"
        " physics.thermal.network.transient physics.thermal.field physics.thermal.modes.thermal_test"
        " physics.thermal.modes.modes physics.thermal.modes.choice"
        " physics.thermal.prediction.piecewise"
        " physics.thermal.prediction.prediction physics.thermal.prediction.correction_program"
        " physics.thermal.model_file physics.thermal.thermal_model",
    ),
    "drives": (
        "How its axes follow",
        "physics.drive.parts.catalogue physics.drive.parts.stiffness physics.drive.parts.axis"
        " physics.drive.trajectory physics.drive.simulation physics.drive.closed_loop"
        " physics.drive.stability physics.drive.ball_bar.circle"
        " physics.drive.ball_bar.causes physics.drive.model_file"
        " physics.drive.drive_model physics.drive.driving",
    ),
    "vibration": (
        "How it vibrates",
        "physics.vibration.structure physics.vibration.chains physics.vibration.final_motion"
        " physics.vibration.periodic_error physics.vibration.taps"
        " physics.vibration.recorded_force physics.vibration.model_file physics.vibration.vibration_model",
    ),
    "gauging": (
        "How it grinds to size",
        "physics.gauging.transducer physics.gauging.characteristic"
        " physics.gauging.gauged_grinding"
        " physics.gauging.sizes physics.gauging.model_file physics.gauging.gauging_model",
    ),
    "diagnosis": (
        "What the simulation left out",
        "diagnosis.matching.alignment diagnosis.comparison diagnosis.workflow diagnosis.answer"
        " diagnosis.effects.catalogue diagnosis.effects.effect diagnosis.open_model.runnable",
    ),
    "proof": (
        "The blind proof",
        "proving_ground.case proving_ground.scenarios proving_ground.runner proving_ground.scoring",
    ),
    "control": ("Model to control", "controllers controllers.from_selection exporting"),
    "showing": ("Figures, report, audit", "figures telling audit"),
}
"""Page → its title, and the packages and modules that it shows, of `selector` where nothing else is said."""


def python_pages() -> dict[str, str]:
    """Name → Markdown of a page."""
    return {name: _page(title, modules.split()) for name, (title, modules) in PARTS.items()}


def _page(title: str, modules: list[str]) -> str:
    lines = [f"# {title}\n"]
    for told in modules:
        module = importlib.import_module(told if told.startswith("proving_ground.") else f"selector.{told}")
        name = module.__name__
        names = _names(module)
        lines += [f"## `{name}`\n", "```{eval-rst}", f".. automodule:: {name}"]
        # what a package imports is not its own, unless it is asked for
        asked = [f"   :members: {', '.join(names)}", "   :imported-members:"] if _only_imports(module) else []
        lines += [*asked, ""]
        lines += ["   .. autosummary::", "      :nosignatures:", "", *(f"      {one}" for one in names)]
        lines += ["```\n"]
    return "\n".join(lines)


def _names(module: ModuleType) -> list[str]:
    promised = getattr(module, "__all__", None)
    if promised is not None:
        return list(promised)
    public = {name: value for name, value in vars(module).items() if not name.startswith("_")}
    if _only_imports(module):
        # in the order of a sorted `__all__`
        names = [name for name, value in public.items() if not inspect.ismodule(value)]
        return sorted(names, key=lambda name: (not name.isupper(), not name[0].isupper(), name))
    return [
        name
        for name, value in public.items()
        if (inspect.isclass(value) or inspect.isfunction(value)) and value.__module__ == module.__name__
    ]


def _only_imports(module: ModuleType) -> bool:
    """Whether it is a package that imports its names as themselves, in place of naming them once more."""
    return hasattr(module, "__path__") and not hasattr(module, "__all__")
