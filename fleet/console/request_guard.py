"""ASGI middleware that checks every request to the console, and adds security headers to every response.

A page of another site can make the browser send requests here. It cannot forge their ``Origin``; if it uses a
name of its own that resolves to this computer (DNS rebinding), that name is in ``Host``.
"""

from __future__ import annotations

from collections.abc import Iterable
from urllib.parse import urlsplit

import msgspec
from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

HOSTS = frozenset({"127.0.0.1", "localhost", "[::1]"})
"""Names of this computer; with any port, because a tunnel may have another one at its far end."""


FOXGLOVE = "/foxglove/"
"""Path prefix of the live view for Foxglove."""


class AllowedHosts(msgspec.Struct, frozen=True):
    """The valid host names of a server, and the advice for requests with others.

    ``viewers`` are the origins of Foxglove, which may only open the live view.
    """

    hosts: frozenset[str]
    advice: str
    viewers: frozenset[str] = frozenset()


FOXGLOVE_DESKTOP = "file://"
"""Origin of Foxglove's desktop program.

Its page is a local file (foxglove/studio, packages/studio-desktop/src/main/StudioWindow.ts). A WebSocket of
such a page has the origin ``file://`` in Electron (webpack/webpack-dev-server#3821), which gives local files
more rights than a browser does (electron/electron, its fuse grantFileProtocolExtraPrivileges).
Measured with Chromium 156: ``file://`` with --allow-file-access-from-files, the same right, and ``null``
without. ``null`` is refused: any page can open a sandboxed frame that has it.
"""
LOOPBACK = AllowedHosts(
    HOSTS,
    "this console is reached by 127.0.0.1 or localhost; from elsewhere through a tunnel (ssh -L)",
    frozenset({"https://app.foxglove.dev", FOXGLOVE_DESKTOP}),
)
LONGEST_BODY = 16 * 1024  # bytes of a request
LONGEST_TARGET = 1024  # bytes of a path with its query

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; connect-src 'self'; "
    "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
"""Loads nothing from elsewhere, and permits no inline code."""
_ANSWERS = {
    "Content-Security-Policy": POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Permissions-Policy": "camera=(), geolocation=(), microphone=()",
    "Cache-Control": "no-store",
}


def refusal_of(
    method: str, headers: Headers, target: str, *, scheme: str, served: AllowedHosts = LOOPBACK
) -> str:
    """Return why a request is refused, empty if it is not; ``method`` is WEBSOCKET for a handshake."""
    hosts = headers.getlist("host")
    if len(hosts) != 1 or _name_of(hosts[0]) not in served.hosts:
        return served.advice
    if len(target) > LONGEST_TARGET:
        return "the address is too long"
    if method in ("GET", "HEAD"):
        return ""
    if method not in ("POST", "WEBSOCKET"):
        return f"{method[:20]} is not served"
    if method == "WEBSOCKET" and target.startswith(FOXGLOVE):
        return _foreign_viewer(headers, served.viewers)
    refusal = _foreign(headers, f"{scheme}://{hosts[0]}")
    return refusal if refusal or method == "WEBSOCKET" else _body_refusal(headers)


def _foreign(headers: Headers, origin: str) -> str:
    """Return why a request is not from a page of ours, empty if it is."""
    if headers.getlist("origin") != [origin]:
        return "it comes from a page of another origin, or names no origin"
    if headers.get("sec-fetch-site", "same-origin") != "same-origin":
        return "it comes from another site"
    return ""


def _foreign_viewer(headers: Headers, viewers: frozenset[str]) -> str:
    """Return why a request is not from Foxglove, empty if it is.

    A program that is no browser sends no origin. The address contains a token, which other pages do not know.
    """
    origins = headers.getlist("origin")
    known = bool(viewers) and (not origins or (len(origins) == 1 and origins[0] in viewers))
    return "" if known else "it comes from a page that is not Foxglove's"


def _body_refusal(headers: Headers) -> str:
    """Return why the body of a request is refused, empty if it is not."""
    if headers.getlist("content-type") != ["application/json"]:
        return "the body must be application/json"
    length = headers.get("content-length", "")
    if not length.isascii() or not length.isdecimal():
        return "the body's length must be given"
    return "" if int(length) <= LONGEST_BODY else f"the body has more than {LONGEST_BODY} bytes"


def _name_of(host: str) -> str:
    """Return the name in a Host header, without its port; empty for an invalid host."""
    try:
        parts = urlsplit(f"//{host}")
        port = parts.port
    except ValueError:
        return ""
    name = host if port is None else host.rpartition(":")[0]
    return name.lower() if parts.netloc == host and "@" not in host else ""


class Guard:
    """Passes permitted requests on to ``app``, and adds the headers to each response."""

    def __init__(self, app: ASGIApp, served: AllowedHosts = LOOPBACK) -> None:
        self._app = app
        self._served = served

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request or WebSocket."""
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        method = scope["method"] if scope["type"] == "http" else "WEBSOCKET"
        scheme = "https" if scope["scheme"] in ("https", "wss") else "http"
        target = scope.get("raw_path", b"").decode("latin-1") + scope["query_string"].decode("latin-1")
        refusal = refusal_of(method, Headers(scope=scope), target, scheme=scheme, served=self._served)

        async def answer(message: Message) -> None:
            if message["type"] == "http.response.start":
                with_headers(message, _ANSWERS.items())
            await send(message)

        if refusal:
            await _refuse(scope, receive, answer, refusal)
        else:
            await self._app(scope, receive, answer)


def with_headers(message: Message, headers: Iterable[tuple[str, str]]) -> None:
    """Add headers to the start of a response."""
    into = MutableHeaders(scope=message)
    for name, value in headers:
        into[name] = value


async def _refuse(scope: Scope, receive: Receive, send: Send, why: str) -> None:
    """Respond with 403, with the reason unless it is a WebSocket."""
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close"})
        return
    await PlainTextResponse(f"refused: {why}\n", status_code=403)(scope, receive, send)
