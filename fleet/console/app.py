"""The console's addresses: the page, its session, its WebSocket, and the stop that needs no WebSocket.

=========================  ==========================================================================
``GET /`` and its files    the page, the same for everybody, without data
``POST /api/session``      a link's token for the cookie of a session
``GET /api/session``       whose session it is
``GET /ws``                the WebSocket of a page
``POST /api/stop``         an emergency stop; a request that is known by the WebSocket is not asked again
``GET /api/stops/ID``      how that stop goes
``POST /api/recording``    a window of the recordings as a file
=========================  ==========================================================================
"""

from __future__ import annotations

from collections.abc import Mapping

import msgspec
from starlette.applications import Starlette
from starlette.requests import HTTPConnection, Request
from starlette.responses import Response, StreamingResponse
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp
from starlette.websockets import WebSocket

from fleet.console.exports import Window
from fleet.console.files import PageFile, page_files
from fleet.console.guard import LONGEST_BODY, Guard
from fleet.console.hub import MOST_TABS, Hub
from fleet.console.requests import read_stop
from fleet.console.sessions import Operator, Sessions
from fleet.console.stops import StopTarget
from fleet.console.tab import Tab
from fleet.errors import Refused, WireError
from fleet.runtime.decoding import decode_json

NOT_IN = "nobody is signed in: open a new link, which  fleet console --link  prints"
USED = "this link was used already, or is older than ten minutes: fleet console --link  prints a new one"
PROOF = "x-fleet-proof"
"""The header in which a page shows its proof."""
PROTOCOL = "fleet.console"
"""The protocol of the WebSocket; the proof is named after it, for a page can set no header there."""
TRY_AGAIN_LATER = 1013  # close code: overloaded


class _Given(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What opens a session."""

    token: str


def make_app(hub: Hub, sessions: Sessions) -> ASGIApp:
    """Return the console as an ASGI application, behind its guard."""
    return Guard(_App(hub, sessions, page_files()).routes())


class _App:
    """The handlers of the addresses."""

    def __init__(self, hub: Hub, sessions: Sessions, files: Mapping[str, PageFile]) -> None:
        self._hub = hub
        self._sessions = sessions
        self._files = files

    def routes(self) -> Starlette:
        """Return the application without its guard."""
        return Starlette(
            routes=[
                Route("/api/session", self._open, methods=["POST"]),
                Route("/api/session", self._session),
                Route("/api/stop", self._stop, methods=["POST"]),
                Route("/api/stops/{request}", self._stopped),
                Route("/api/recording", self._recording, methods=["POST"]),
                WebSocketRoute("/ws", self._tab),
                Route("/{path:path}", self._file),
            ]
        )

    def _operator(self, connection: HTTPConnection) -> Operator | None:
        """Return whose session a request shows."""
        shown = connection.scope.get("subprotocols") or []
        proof = shown[-1] if PROTOCOL in shown[:-1] else connection.headers.get(PROOF, "")
        return self._sessions.operator_of(connection.cookies, proof)

    async def _file(self, request: Request) -> Response:
        """Serve a file of the page."""
        found = self._files.get(request.url.path)
        if found is None:
            return Response("there is nothing here\n", 404, media_type="text/plain")
        return Response(found.content, media_type=found.media_type)

    async def _open(self, request: Request) -> Response:
        """Open a session for the token of a link."""
        try:
            token = decode_json(await _body(request), _Given).token
        except (msgspec.DecodeError, WireError):
            return _json({"error": "the token cannot be read"}, 400)
        opened = self._sessions.open(token)
        if opened is None:
            return _json({"error": USED}, 403)
        operator = self._sessions.operator_of({self._sessions.cookie: opened.cookie}, opened.proof)
        response = _json(_shown(operator) | {"proof": opened.proof})
        response.set_cookie(self._sessions.cookie, opened.cookie, httponly=True, samesite="strict", path="/")
        return response

    async def _session(self, request: Request) -> Response:
        """Tell whose session it is."""
        operator = self._operator(request)
        return _json(_shown(operator)) if operator else _json({"error": NOT_IN}, 401)

    async def _stop(self, request: Request) -> Response:
        """Stop robots; answers when each edge has, or is late."""
        operator = self._operator(request)
        if operator is None:
            return _json({"error": NOT_IN}, 401)
        try:
            asked = read_stop(await _body(request))
        except WireError as error:
            return _json({"error": f"the stop cannot be read: {error}"}, 400)
        return _json(await self._hub.stop(StopTarget(asked.robots), operator, asked.why, asked.request))

    async def _stopped(self, request: Request) -> Response:
        """Tell how a stop goes."""
        if self._operator(request) is None:
            return _json({"error": NOT_IN}, 401)
        found = self._hub.view.get("stops", request.path_params["request"])
        return _json(found) if found else _json({"error": "there is no such stop"}, 404)

    async def _recording(self, request: Request) -> Response:
        """Send a window of the recordings."""
        operator = self._operator(request)
        if operator is None:
            return _json({"error": NOT_IN}, 401)
        try:
            window = decode_json(await _body(request), Window)
            file = await self._hub.exports.export(window, operator)
        except (msgspec.DecodeError, WireError) as error:
            return _json({"error": f"the window cannot be read: {error}"}, 400)
        except Refused as error:
            return _json({"error": f"{error.reason}{error.hint and f' ({error.hint})'}"}, 403)
        return StreamingResponse(file, media_type="application/octet-stream")

    async def _tab(self, socket: WebSocket) -> None:
        """Serve the WebSocket of a page."""
        operator = self._operator(socket)
        if operator is None:
            await socket.close()
            return
        await socket.accept(PROTOCOL)
        if len(self._hub.tabs) >= MOST_TABS:
            await socket.close(TRY_AGAIN_LATER, f"{MOST_TABS} pages are open already; close one")
            return
        tab = Tab(socket, self._hub, operator)
        self._hub.tabs.add(tab)
        try:
            await tab.run()
        finally:
            self._hub.tabs.discard(tab)


async def _body(request: Request) -> bytes:
    """Return the body of a request, which is no longer than it says; raises WireError."""
    body = b""
    async for part in request.stream():
        body += part
        if len(body) > LONGEST_BODY:
            raise WireError("the body is too long")
    return body


def _json(told: object, status: int = 200) -> Response:
    """Return an answer in JSON."""
    return Response(msgspec.json.encode(told), status, media_type="application/json")


def _shown(operator: Operator | None) -> dict[str, str]:
    """Return an operator for the page."""
    assert operator is not None
    return {"operator": operator.name, "permission": operator.permission.word}
