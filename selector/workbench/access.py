"""Who may talk to the workbench, in which form, and what is answered to a request that may not be."""

from __future__ import annotations

import functools
import hmac
import logging
import secrets
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import dash
from flask import Flask, Request, Response, redirect, request
from pydantic import ConfigDict, ValidationError, validate_call
from werkzeug.exceptions import HTTPException

from selector.errors import OptionError

TOKEN = "token"  # noqa: S105 (the name of the parameter)
_OWN = ("same-origin", "none")
_HEADERS = {
    "Cache-Control": "no-store",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
}

RESULT_POLICY = (
    "sandbox allow-scripts allow-downloads; default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; "
    "script-src 'unsafe-inline'; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
"""For pages that a command wrote: they run in an origin of their own, whoever opens them, and load nothing."""


@dataclass(frozen=True)
class Access:
    """The door of one server."""

    port: int  #: Port at 127.0.0.1
    token: str = field(default_factory=lambda: secrets.token_urlsafe(32))  #: What a request must know

    @property
    def address(self) -> str:
        """The address with the token, for the browser."""
        return f"http://127.0.0.1:{self.port}/?{TOKEN}={self.token}"

    @property
    def cookie(self) -> str:
        """Name of the cookie: browsers do not tell ports apart, so two workbenches need two names."""
        return f"selector_{self.port}"

    def refusal(self, asked: Request) -> str | None:
        """Why a request is refused, in plain words; None: it is not."""
        own = {f"127.0.0.1:{self.port}", f"localhost:{self.port}"}
        if asked.headers.get("Host", "") not in own:
            return "This address is not the workbench's own. Open the address that `selector workbench` printed."
        origin = asked.headers.get("Origin")
        if origin is not None and origin not in {f"http://{one}" for one in own}:
            return "Another page tried to use the workbench. It was not let in."
        if asked.headers.get("Sec-Fetch-Site", "none") not in _OWN:
            return (
                "Another page pointed to the workbench. Copy the address that `selector workbench` printed into the "
                "address bar of the browser."
            )
        if not self._knows(asked.cookies.get(self.cookie)) and not self._knows(asked.args.get(TOKEN)):
            return (
                "The token is missing or wrong. Open the whole address that `selector workbench` printed, with all "
                "that follows the question mark."
            )
        return None

    def _knows(self, said: str | None) -> bool:
        return said is not None and hmac.compare_digest(said.encode("utf-8", "replace"), self.token.encode("ascii"))


def guard(server: Flask, access: Access, scripts: Sequence[str] = ()) -> None:
    """Lets only requests in that `access` does not refuse, and sends every answer with strict headers.

    `scripts` are hashes of the scripts in the page itself, as a Content-Security-Policy names them.
    """
    policy = (
        f"default-src 'none'; script-src 'self' {' '.join(scripts)}; style-src 'self' 'unsafe-inline'; "
        "img-src 'self' data: blob:; font-src 'self'; connect-src 'self'; frame-src 'self'; base-uri 'none'; "
        "form-action 'none'; frame-ancestors 'none'"
    )

    @server.before_request
    def _refused() -> Response | None:
        why = access.refusal(request)
        if why is not None:
            return Response(why + "\n", status=403, mimetype="text/plain")
        if TOKEN in request.args and request.method == "GET" and request.path == "/":
            # the token leaves the address, so that it is in no history and on no screenshot
            answer = redirect("/", code=303)
            answer.set_cookie(access.cookie, access.token, httponly=True, samesite="Strict", path="/")
            return answer  # type: ignore[return-value]
        return None

    @server.after_request
    def _strict(answer: Response) -> Response:
        for name, value in _HEADERS.items():
            answer.headers[name] = value
        answer.headers.setdefault("Content-Security-Policy", policy)
        answer.headers.setdefault("X-Frame-Options", "DENY")
        return answer


MOST_REQUEST_BYTES = 10_000_000  #: Of requests that carry no file; what a page sends is far less.

UPLOAD = "/upload/"  #: Where files are sent to; they are not held in memory, and have a limit of their own.

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


class CheckedDash(dash.Dash):
    """Dash whose callbacks are called only with arguments of the kinds that their annotations name."""

    def callback(self, *of: Any, **options: Any) -> Callable[..., Any]:
        """As `dash.Dash.callback`."""
        register = super().callback(*of, **options)
        return lambda function: register(checked(function))


def checked(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function that is called only with arguments of the kinds that its annotations name."""
    judged = validate_call(config=ConfigDict(strict=True))(function)

    @functools.wraps(function)
    def called(*sent: Any) -> Any:
        try:
            return judged(*sent)
        except ValidationError as error:
            first = error.errors(include_url=False)[0]
            raise OptionError(
                f"{repr(first['input'])[:80]} came from the browser",
                expected=first["msg"].removeprefix("Input should be "),
                where=function.__name__.strip("_"),
                advice="load the page again; nothing was changed",
            ) from None

    return called
