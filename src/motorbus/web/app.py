"""The server of the page: who may ask, what is asked for. The only file with starlette and uvicorn.

Each request needs the cookie of the token, a Host that is this server, and an Origin that is this page. A page may
send 64 kB in a message and 200 messages in a second; else its connection is closed, and its lease runs out.
"""

from __future__ import annotations

import asyncio
import ipaddress
import secrets
import socket
from contextlib import suppress
from pathlib import Path
from threading import Thread
from time import monotonic
from typing import Any, Final, Self

import msgspec
import uvicorn
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.requests import HTTPConnection, Request
from starlette.responses import FileResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Receive, Scope, Send
from starlette.websockets import WebSocket, WebSocketDisconnect

from motorbus.core import units
from motorbus.errors import MotorbusError, RequestError
from motorbus.web.messages import DECODER, Failed
from motorbus.web.registers import read_table
from motorbus.web.service import Page, Service, failed, tag_of

STATIC: Final = Path(__file__).parent / "static"
LIBRARIES: Final = ("preact.mjs", "hooks.mjs", "htm.mjs", "uPlot.mjs", "uPlot.css")
MAX_MESSAGE: Final = 65_536  # bytes
RATE: Final = 200  # messages in 1 s
MAX_PAGES: Final = 16
HEADERS: Final = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cache-control": "no-store",
    "cross-origin-resource-policy": "same-origin",
}


class Guard:
    """Lets a request pass that has the cookie, a known Host, and no foreign Origin. `/?token=…` sets the cookie.

    `host` is that of --host, "" for loopback only. A Host that is a name of its own is refused, so that no foreign name
    can be pointed at this server.
    """

    def __init__(self, app: ASGIApp, *, token: str, host: str, port: int) -> None:
        self.app = app
        self.token: Final = token.encode()
        self.cookie: Final = f"motorbus-{port}"
        self._port = port
        self._hosts = {"localhost", "127.0.0.1", "[::1]"} | ({host} if host else set())
        self._any_address = bool(host)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        response = self._refuse(HTTPConnection(scope))
        if response is None:
            await self.app(scope, receive, send)
        elif scope["type"] == "http":
            await response(scope, receive, send)
        else:
            await send({"type": "websocket.close", "code": 1008})

    def _refuse(self, asked: HTTPConnection) -> Response | None:
        host, origin = asked.headers.get("host", ""), asked.headers.get("origin")
        is_socket = asked.scope["type"] == "websocket"
        if not self._is_own(host):
            return PlainTextResponse("This Host is not served here.\n", 403)
        if origin != f"http://{host}" and (origin is not None or is_socket):
            return PlainTextResponse("This Origin may not use the page.\n", 403)
        given = asked.query_params.get("token", "")
        if asked.scope["path"] == "/" and not is_socket and self._is_token(given):
            response = RedirectResponse("/", 303)
            response.set_cookie(self.cookie, given, httponly=True, samesite="strict")
            return response
        if not self._is_token(asked.cookies.get(self.cookie, "")):
            return PlainTextResponse("Open the address that `motorbus web` has printed.\n", 401)
        return None

    def _is_own(self, host: str) -> bool:
        name, colon, port = host.rpartition(":")
        if not colon or port != str(self._port):
            return False
        if name in self._hosts:
            return True
        with suppress(ValueError):
            ipaddress.ip_address(name.strip("[]"))
            return self._any_address
        return False

    def _is_token(self, given: str) -> bool:
        return secrets.compare_digest(given.encode(), self.token)


class Routes:
    """What the page asks for. No GET sends a byte to a device but `/registers`, which reads."""

    def __init__(self, service: Service) -> None:
        self._service = service
        self.app = Starlette(
            routes=[
                Route("/", self.index),
                Route("/describe", self.describe),
                Route("/registers/{axis}", self.registers),
                Route("/recordings", self.recordings),
                WebSocketRoute("/ws", self.socket),
                Mount("/static", StaticFiles(directory=STATIC)),
            ]
        )

    async def index(self, request: Request) -> Response:
        """The page; without its libraries, what is missing."""
        missing = [name for name in LIBRARIES if not (STATIC / "vendor" / name).exists()]
        if missing:
            return PlainTextResponse(
                f"The page needs libraries that are not here: {', '.join(missing)}.\n"
                "`make assets` fetches them (preact, htm, uPlot); then start `motorbus web` again.\n"
            )
        return FileResponse(STATIC / "index.html")

    async def describe(self, request: Request) -> Response:
        """The machine, the scale of each unit, the simulated buses in which faults can be injected."""
        robot = self._service.robot
        scales = {**units.SCALES["position"], **units.SCALES["length"]}
        has_faults = self._service.demo is not None
        description = {"machine": robot.describe(), "warnings": robot.warnings}
        return _json({**description, "scales": scales, "demo": has_faults})

    async def registers(self, request: Request) -> Response:
        """The registers of an axis."""
        try:
            table = await run_in_threadpool(read_table, self._service.robot, request.path_params["axis"])
        except MotorbusError as error:
            return _json(failed("registers", error), 404 if isinstance(error, RequestError) else 502)
        return _json(table)

    async def recordings(self, request: Request) -> Response:
        """The names of the recordings."""
        return _json(sorted(path.stem for path in self._service.folder.glob("*.csv")))

    async def socket(self, connection: WebSocket) -> None:
        """A page: its messages, and the states for it."""
        if len(self._service.pages) >= MAX_PAGES:
            await connection.close(1013)
            return
        await connection.accept()
        page = Page(asyncio.get_running_loop())
        self._service.join(page)
        sender = asyncio.create_task(_send(connection, page))
        try:
            await self._receive(connection, page)
        finally:
            sender.cancel()
            self._service.leave(page)

    async def _receive(self, connection: WebSocket, page: Page) -> None:
        allowance, at = float(RATE), monotonic()
        with suppress(WebSocketDisconnect, RuntimeError):
            while True:
                data = await connection.receive()
                if data["type"] == "websocket.disconnect":
                    return
                now = monotonic()
                allowance, at = min(RATE, allowance + (now - at) * RATE) - 1, now
                if allowance < 0:
                    await connection.close(1008, "too many messages")
                    return
                name = "message"
                try:
                    message = DECODER.decode(data.get("text") or data.get("bytes") or b"")
                    name = tag_of(message)
                    self._service.receive(page, message)
                except MotorbusError as error:
                    page.put(failed(name, error))
                except (msgspec.MsgspecError, UnicodeError) as error:
                    page.put(Failed(name, f"the message is not valid: {error}"))


async def _send(connection: WebSocket, page: Page) -> None:
    with suppress(WebSocketDisconnect, RuntimeError):
        while True:
            for text in await page.next():
                await connection.send_text(text.decode())


def _json(value: Any, status: int = 200) -> Response:
    return Response(msgspec.json.encode(value), status, media_type="application/json")


class Server:
    """Serves a machine until the end of the `with`. `url` has the token. Raises RequestError for a port in use."""

    def __init__(self, service: Service, *, host: str = "", port: int = 0, token: str = "") -> None:
        try:
            self._socket = socket.create_server((host or "127.0.0.1", port))
        except OSError as error:
            raise RequestError(
                f"cannot serve on {host or '127.0.0.1'}:{port}: {error.strerror}", advice="--port"
            ) from None
        self.port: Final[int] = self._socket.getsockname()[1]
        self.token: Final = token or secrets.token_urlsafe(16)
        shown = socket.gethostname() if host in ("0.0.0.0", "::") else host or "127.0.0.1"
        self.url: Final = f"http://{shown}:{self.port}/?token={self.token}"
        config = uvicorn.Config(
            Guard(Routes(service).app, token=self.token, host=shown if host else "", port=self.port),
            ws="websockets-sansio",
            ws_max_size=MAX_MESSAGE,
            ws_per_message_deflate=False,
            log_level="error",
            lifespan="off",
            headers=list(HEADERS.items()),
            server_header=False,
            timeout_graceful_shutdown=1,
        )
        self._server = uvicorn.Server(config)
        self._thread = Thread(
            target=self._server.run, args=([self._socket],), name="motorbus web server", daemon=True
        )

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *exc: object) -> None:
        self._server.should_exit = True
        self._thread.join(5)
        self._socket.close()
