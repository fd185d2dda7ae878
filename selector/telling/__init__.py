"""Results → what people read: accounts as data, and pages that open without a network."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from selector.telling.page import account_page, write_account
    from selector.telling.selected.account import write_report

__all__ = ["account_page", "write_account", "write_report"]

_PLACES = {"account_page": "page", "write_account": "page", "write_report": "selected.account"}


def __getattr__(name: str) -> Any:
    """What writes pages; drawing comes in with it, which what only tells on a screen does not need."""
    from importlib import import_module

    if name not in _PLACES:
        raise AttributeError(name)
    return getattr(import_module(f"selector.telling.{_PLACES[name]}"), name)
