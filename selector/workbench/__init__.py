"""The local web page: recordings are loaded, looked at and corrected, and commands are run, all in one study folder."""

from selector.workbench.server import serve

__all__ = ["serve"]
