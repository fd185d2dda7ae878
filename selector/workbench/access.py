"""Who may talk to the workbench: this computer's browser, with the token, from the workbench's own page.

A page on the internet can make the browser send requests to 127.0.0.1, and another program on this computer can send
them itself. The first is told by the headers that a browser does not let a page forge (`Host`, `Origin`,
`Sec-Fetch-Site`), the second lacks the token.
"""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Sequence
from dataclasses import dataclass, field

from flask import Flask, Request, Response, redirect, request

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
    """The door of one server.

    Attributes
    ----------
    port : int
        Port at 127.0.0.1.
    token : str
        What a request must know.
    """

    port: int
    token: str = field(default_factory=lambda: secrets.token_urlsafe(32))

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

    Parameters
    ----------
    server : Flask
        The server, before its first request.
    access : Access
    scripts : sequence of str
        Hashes of the scripts that stand in the page itself, as a Content-Security-Policy names them.
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
