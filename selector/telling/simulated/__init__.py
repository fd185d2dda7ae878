"""How the results of simulations are told: an account for every kind."""

import importlib
from collections.abc import Callable

from selector.physics.simulation_kind import SimulationKind, register_kind
from selector.telling.account import Account
from selector.telling.simulated.result import SimulationResult

Teller = Callable[[SimulationResult, bool], Account]
_tellers: dict[str, Teller] = {}


def account_of(result: SimulationResult, *, drawn: bool = False) -> Account:
    """All that is told of a simulation; `drawn` for a page, with its drawings."""
    teller = _tellers.get(result.kind)
    if teller is None:
        module = importlib.import_module(f"selector.telling.simulated.{result.kind}")
        teller = getattr(module, f"{result.kind}_account")
    return teller(result, drawn)


def register(kind: SimulationKind, teller: Teller) -> None:
    """Makes a kind of simulation known: it has its command, report, parameters, refit and reference page from now on.

    `kind` is what can be done with its model files; `teller` makes an account of a result, knowing whether drawings are
    wanted.
    """
    register_kind(kind)
    _tellers[kind.name] = teller
