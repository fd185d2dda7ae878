"""The Python API as pages: the public names of the packages that a study is written with, in the order of the field."""

from __future__ import annotations

import importlib
import inspect
from types import ModuleType

PARTS = {
    "recordings": (
        "Recordings and what is wrong with them",
        "recording units findings errors readers quality shipped",
    ),
    "sensors": ("Which sensors", "sensors"),
    "models": (
        "Which model",
        "models.terms models.memory models.reference models.design models.cross_products models.least_squares"
        " models.subsets models.sensor_sets models.subset_results models.search_limits models.moments"
        " models.validation models.hull models.faults",
    ),
    "selection": ("The choice, scikit-learn, and the study file", "selection estimators study"),
    "heat": (
        "How the machine warms",
        "physics.system physics.thermal.laws physics.thermal.network physics.thermal.transient"
        " physics.thermal.steady_state physics.thermal.time_constants physics.thermal.reduction physics.thermal.field"
        " physics.thermal.thermal_test physics.thermal.modes physics.thermal.mode_choice physics.thermal.cyclogram"
        " physics.thermal.characteristics physics.thermal.piecewise physics.thermal.prediction"
        " physics.thermal.correction_program physics.thermal.correction_text physics.thermal.model_file"
        " physics.thermal.thermal_model physics.thermal.driving",
    ),
    "drives": (
        "How its axes follow",
        "physics.drive.catalogue physics.drive.stiffness physics.drive.mechanics physics.drive.friction"
        " physics.drive.transmission physics.drive.servo physics.drive.axis physics.drive.reference"
        " physics.drive.trajectory physics.drive.course physics.drive.simulation physics.drive.motion"
        " physics.drive.frequency physics.drive.stability physics.drive.gain_limits physics.drive.identification"
        " physics.drive.loop_identification physics.drive.circle physics.drive.ball_bar"
        " physics.drive.circle_quantities physics.drive.circle_causes physics.drive.model_file"
        " physics.drive.drive_model physics.drive.driving",
    ),
    "vibration": (
        "How it vibrates",
        "physics.vibration.structure physics.vibration.source physics.vibration.shaft_course physics.vibration.chain"
        " physics.vibration.coupled physics.vibration.chain_error physics.vibration.modes physics.vibration.run_up"
        " physics.vibration.realisations physics.vibration.periodic_error physics.vibration.recorded_force"
        " physics.vibration.model_file physics.vibration.vibration_model",
    ),
    "gauging": (
        "How it grinds to size",
        "physics.gauging.transducer physics.gauging.vibrating_contact physics.gauging.characteristic"
        " physics.gauging.process physics.gauging.threshold physics.gauging.gauged_grinding"
        " physics.gauging.finished_sizes physics.gauging.size_distribution physics.gauging.capability"
        " physics.gauging.trade_off physics.gauging.model_file physics.gauging.gauging_model",
    ),
    "diagnosis": (
        "What the simulation left out",
        "diagnosis.entrance.alignment diagnosis.comparison diagnosis.workflow diagnosis.answer diagnosis.correction"
        " diagnosis.effects.catalogue diagnosis.effects.effect diagnosis.open_model.runnable",
    ),
    "proof": ("The blind proof", "proof.case proof.scenarios proof.runner proof.scoring"),
    "control": ("Model to control", "controllers controllers.from_selection"),
    "showing": ("Figures, report, audit", "figures report audit"),
}
"""Page → its title, and the packages and modules of `selector` that it shows."""


def python_pages() -> dict[str, str]:
    """Name → Markdown of a page."""
    return {name: _page(title, modules.split()) for name, (title, modules) in PARTS.items()}


def _page(title: str, modules: list[str]) -> str:
    lines = [f"# {title}\n"]
    for module in (importlib.import_module(f"selector.{name}") for name in modules):
        name = module.__name__
        lines += [f"## `{name}`\n", "```{eval-rst}", f".. automodule:: {name}", ""]
        lines += ["   .. autosummary::", "      :nosignatures:", "", *(f"      {one}" for one in _names(module))]
        lines += ["```\n"]
    return "\n".join(lines)


def _names(module: ModuleType) -> list[str]:
    promised = getattr(module, "__all__", None)
    if promised is not None:
        return list(promised)
    return [
        name
        for name, value in vars(module).items()
        if not name.startswith("_")
        and (inspect.isclass(value) or inspect.isfunction(value))
        and value.__module__ == module.__name__
    ]
