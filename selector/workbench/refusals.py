"""What is answered to a request that is too large, or that goes wrong on the way: one line, and no more memory."""

from __future__ import annotations

import logging

from flask import Flask, Response, request
from werkzeug.exceptions import HTTPException

MOST_REQUEST_BYTES = 10_000_000
"""Of requests that carry no file; what a page sends is far less."""

UPLOAD = "/upload/"
"""Where files are sent to; they are not held in memory, and have a limit of their own."""

_LOG = logging.getLogger("selector.workbench")


def tell(doing: str, error: Exception) -> None:
    """A defect, for the person at the terminal: what was being done, and where it went wrong."""
    _LOG.error("%s: %s: %s", doing, type(error).__name__, error, exc_info=error)


def answer_refusals(server: Flask) -> None:
    """Requests beyond `MOST_REQUEST_BYTES` are refused before they are read; a defect is answered with one line."""

    @server.before_request
    def _too_large() -> Response | None:
        if request.path.startswith(UPLOAD):
            return None
        if "Transfer-Encoding" in request.headers:
            return _line("A request of unknown length. Send its length.", 411)
        if (request.content_length or 0) > MOST_REQUEST_BYTES:
            return _line(f"A request of more than {MOST_REQUEST_BYTES // 1_000_000} MB. The page sends less.", 413)
        return None

    @server.errorhandler(Exception)
    def _defect(error: Exception) -> Response | HTTPException:
        if isinstance(error, HTTPException):
            return error
        tell(f"{request.method} {request.path}", error)
        return _line(
            f"This is a defect of the workbench ({type(error).__name__}). Load the page again; if it comes back, "
            "report it with what the terminal says.",
            500,
        )


def _line(text: str, status: int) -> Response:
    return Response(text + "\n", status=status, mimetype="text/plain")
