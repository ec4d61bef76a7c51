"""HTTP and WebSocket endpoints of the console: page, session, live data, and stops without a WebSocket.

=========================  ==========================================================================
``GET /`` and its files    the page, the same for all users, without data
``POST /api/session``      exchanges a link's token for a session cookie
``POST /api/login``        exchanges name and password for a session cookie, if login is configured
``GET /api/session``       the operator of the session
``POST /api/logout``       ends the session and its pages
``GET /ws``                the WebSocket of a page
``POST /api/stop``         an emergency stop; a request already known by the WebSocket is not repeated
``GET /api/stops/ID``      the progress of that stop
``GET /api/basemap``       the placement of the map under the robots, if there is one
``GET /api/tiles/Z/X/Y``   a tile of it
``GET /api/photos/ROBOT``  the newest picture of a robot shown by a page
``POST /api/recording``    a window of the recordings as a file
``GET /foxglove/TOKEN``    the WebSocket of Foxglove, on loopback only
=========================  ==========================================================================
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Mapping
from typing import Annotated

import msgspec
from starlette.applications import Starlette
from starlette.requests import HTTPConnection, Request
from starlette.responses import Response, StreamingResponse
from starlette.routing import Route, WebSocketRoute
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket

from fleet.console.exports import ExportWindow
from fleet.console.files import PageFile, page_files
from fleet.console.hub import MOST_TABS, Hub
from fleet.console.login import Login, LoginRefused
from fleet.console.page_connection import PageConnection
from fleet.console.passwords import LONGEST as LONGEST_PASSWORD
from fleet.console.people import LONGEST_NAME
from fleet.console.request_guard import FOXGLOVE, LONGEST_BODY, AllowedHosts, Guard
from fleet.console.requests import read_stop
from fleet.console.sessions import BrowserSession, ConsoleUser, NewSession, Sessions
from fleet.console.stops import StopTarget
from fleet.errors import Refused, WireError
from fleet.runtime.decoding import decode_json

NOT_IN = "not signed in: open a new link, printed by  fleet console --link"
USED = "this link was used already, or is older than ten minutes: fleet console --link  prints a new one"
LOGGED_OUT = "not logged in, or the session has ended: log in"
LOGIN_PAGE = "/login.html"
SESSION_ENDED = 4401  # close code of our own
PROOF = "x-fleet-proof"
"""The header with the proof of a page."""
PROTOCOL = "fleet.console"
"""The subprotocol of the WebSocket; the proof is sent as a second one, as pages cannot set headers there."""
TRY_AGAIN_LATER = 1013  # close code: overloaded


class _Given(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Request to open a session by a link; ``page`` identifies the page in a repeated request."""

    token: str
    page: str = ""


class _LoginRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Request to log in."""

    name: Annotated[str, msgspec.Meta(max_length=LONGEST_NAME)]
    password: Annotated[str, msgspec.Meta(max_length=LONGEST_PASSWORD)]


def make_app(hub: Hub, sessions: Sessions) -> ASGIApp:
    """Return the console on loopback, opened by links, as an ASGI application behind its guard."""
    return Guard(_App(hub, sessions, page_files()).routes())


def make_login_app(hub: Hub, login: Login, served: AllowedHosts) -> ASGIApp:
    """Return the console with login, as an ASGI application behind its guard."""
    return Guard(_App(hub, login.sessions, page_files(), login).routes(), served)


class _ExportResponse(StreamingResponse):
    """Response with an export; ``stack`` ends the export, even if the browser leaves before it begins."""

    def __init__(self, blocks: AsyncIterator[bytes], stack: contextlib.AsyncExitStack) -> None:
        super().__init__(blocks, media_type="application/octet-stream")
        self._stack = stack

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the file."""
        async with self._stack:
            await super().__call__(scope, receive, send)


class _App:
    """The request handlers."""

    def __init__(
        self, hub: Hub, sessions: Sessions, files: Mapping[str, PageFile], login: Login | None = None
    ) -> None:
        self._hub = hub
        self._login = login
        self._sessions = sessions
        self._files = files

    def routes(self) -> Starlette:
        """Return the application without its guard."""
        begin = (
            Route("/api/session", self._open, methods=["POST"])
            if self._login is None
            else Route("/api/login", self._log_in, methods=["POST"])
        )
        views = [WebSocketRoute(FOXGLOVE + "{token}", self._foxglove)] if self._login is None else []
        return Starlette(
            routes=[
                begin,
                Route("/api/session", self._session),
                Route("/api/logout", self._log_out, methods=["POST"]),
                Route("/api/stop", self._stop, methods=["POST"]),
                Route("/api/stops/{request}", self._stopped),
                Route("/api/basemap", self._basemap),
                Route("/api/tiles/{zoom:int}/{column:int}/{row:int}", self._tile),
                Route("/api/photos/{robot:path}", self._photo),
                Route("/api/recording", self._recording, methods=["POST"]),
                WebSocketRoute("/ws", self._tab),
                *views,
                Route("/{path:path}", self._file),
            ]
        )

    def _shown(self, connection: HTTPConnection) -> BrowserSession | None:
        """Return the session of a request."""
        shown = connection.scope.get("subprotocols") or []
        proof = shown[-1] if PROTOCOL in shown[:-1] else connection.headers.get(PROOF, "")
        return self._sessions.session_of(connection.cookies, proof)

    def _operator(self, connection: HTTPConnection) -> ConsoleUser | None:
        """Return the operator of a request's session."""
        session = self._shown(connection)
        return session.operator if session is not None else None

    def _unauthorized(self) -> Response:
        """Return the response to a request without a session."""
        if self._login is None:
            return _json({"error": NOT_IN}, 401)
        return _json({"error": LOGGED_OUT, "login": LOGIN_PAGE}, 401)

    async def _file(self, request: Request) -> Response:
        """Serve a file of the page."""
        found = self._files.get(request.url.path)
        if found is None:
            return Response("there is nothing here\n", 404, media_type="text/plain")
        return Response(found.content, media_type=found.media_type)

    async def _open(self, request: Request) -> Response:
        """Open a session for the token of a link."""
        try:
            given = decode_json(await _body(request), _Given)
        except (msgspec.DecodeError, WireError):
            return _json({"error": "the token cannot be read"}, 400)
        opened = self._sessions.open(given.token, given.page)
        if opened is None:
            return _json({"error": USED}, 403)
        return self._opened(opened)

    async def _log_in(self, request: Request) -> Response:
        """Open a session for a name and its password."""
        assert self._login is not None
        try:
            given = decode_json(await _body(request), _LoginRequest)
        except (msgspec.DecodeError, WireError):
            return _json({"error": "name and password cannot be read, or are too long"}, 400)
        address = request.client.host if request.client is not None else ""
        opened = await self._login.log_in(given.name, given.password, address)
        if isinstance(opened, LoginRefused):
            answer = _json({"error": opened.why}, opened.status)
            if opened.wait:
                answer.headers["Retry-After"] = str(opened.wait)
            return answer
        return self._opened(opened)

    def _opened(self, opened: NewSession) -> Response:
        """Return the response with a new session."""
        name = self._sessions.cookie
        operator = self._sessions.operator_of({name: opened.cookie}, opened.proof)
        if operator is None:  # removed at this very moment
            return self._unauthorized()
        response = _json(_operator_fields(operator) | {"proof": opened.proof})
        secure = self._login is not None
        response.set_cookie(name, opened.cookie, httponly=True, samesite="strict", path="/", secure=secure)
        return response

    async def _log_out(self, request: Request) -> Response:
        """End a session; its pages are closed at the next tick."""
        session = self._shown(request)
        if session is None:
            return self._unauthorized()
        self._sessions.end(session)
        return _json({})

    async def _session(self, request: Request) -> Response:
        """Return the operator of the session."""
        operator = self._operator(request)
        return _json(_operator_fields(operator)) if operator else self._unauthorized()

    async def _stop(self, request: Request) -> Response:
        """Stop robots; the response follows when each edge has answered or timed out."""
        operator = self._operator(request)
        if operator is None:
            return self._unauthorized()
        try:
            requested = read_stop(await _body(request))
        except WireError as error:
            return _json({"error": f"the stop cannot be read: {error}"}, 400)
        return _json(
            await self._hub.stop(StopTarget(requested.robots), operator, requested.why, requested.request)
        )

    async def _stopped(self, request: Request) -> Response:
        """Return the progress of a stop."""
        if self._operator(request) is None:
            return self._unauthorized()
        found = self._hub.view.get("stops", request.path_params["request"])
        return _json(found) if found else _json({"error": "there is no such stop"}, 404)

    async def _basemap(self, request: Request) -> Response:
        """Return the placement of the map under the robots; empty if there is none."""
        if self._operator(request) is None:
            return self._unauthorized()
        return _json(self._hub.tiles.description if self._hub.tiles is not None else {})

    async def _tile(self, request: Request) -> Response:
        """Send a tile of the map; no content if it has none."""
        if self._operator(request) is None:
            return self._unauthorized()
        at = request.path_params
        tiles = self._hub.tiles
        found = await tiles.tile(at["zoom"], at["column"], at["row"]) if tiles is not None else None
        if found is None:
            return Response(status_code=204)  # no error: a map has an edge
        return Response(found.content, media_type=found.media_type)

    async def _photo(self, request: Request) -> Response:
        """Send the newest picture of a robot."""
        if self._operator(request) is None:
            return self._unauthorized()
        photo = self._hub.edges.watched.photos.newest(request.path_params["robot"])
        if photo is None:
            return _json({"error": "there is no picture of it"}, 404)
        return Response(photo, media_type="image/jpeg")

    async def _recording(self, request: Request) -> Response:
        """Send a window of the recordings."""
        operator = self._operator(request)
        if operator is None:
            return self._unauthorized()
        async with contextlib.AsyncExitStack() as stack:
            try:
                window = decode_json(await _body(request), ExportWindow)
                export = await stack.enter_async_context(self._hub.exports.export(window, operator))
            except (msgspec.DecodeError, WireError) as error:
                return _json({"error": f"the window cannot be read: {error}"}, 400)
            except Refused as error:
                return _json({"error": f"{error.reason}{error.hint and f' ({error.hint})'}"}, 403)
            return _ExportResponse(export.blocks(), stack.pop_all())

    async def _tab(self, socket: WebSocket) -> None:
        """Serve the WebSocket of a page."""
        session = self._shown(socket)
        if session is None:
            await socket.close()
            return
        await socket.accept(PROTOCOL)
        if len(self._hub.tabs) >= MOST_TABS:
            await socket.close(TRY_AGAIN_LATER, f"{MOST_TABS} pages are open already; close one")
            return
        tab = PageConnection(socket, self._hub, session.operator)
        self._hub.tabs.add(tab)
        watching = asyncio.create_task(self._end_with(session, socket), name="session")
        try:
            await tab.run()
        finally:
            watching.cancel()
            self._hub.tabs.discard(tab)

    async def _foxglove(self, socket: WebSocket) -> None:
        """Serve the WebSocket of Foxglove."""
        await self._hub.foxglove.serve(socket, socket.path_params["token"])

    async def _end_with(self, session: BrowserSession, socket: WebSocket) -> None:
        """Close a page when its session ends; an open page keeps the session in use."""
        while self._sessions.renew(session):
            await self._hub.next_tick()
        with contextlib.suppress(RuntimeError):  # the socket is closing already
            await socket.close(SESSION_ENDED, "the session has ended")


async def _body(request: Request) -> bytes:
    """Return the body of a request within the limit; raises WireError."""
    body = b""
    async for part in request.stream():
        body += part
        if len(body) > LONGEST_BODY:
            raise WireError("the body is too long")
    return body


def _json(value: object, status: int = 200) -> Response:
    """Return a JSON response."""
    return Response(msgspec.json.encode(value), status, media_type="application/json")


def _operator_fields(operator: ConsoleUser) -> dict[str, str]:
    """Return an operator for the page."""
    return {"operator": operator.name, "permission": operator.permission.word}
