"""Relays the page and the socket of a 3D view under the console's origin, session and security policy."""

from collections.abc import Callable
from contextlib import suppress
from importlib.metadata import version
from pathlib import Path

import anyio
import msgspec
from httpx import AsyncClient, AsyncHTTPTransport, HTTPError
from starlette.responses import Response
from starlette.websockets import WebSocket, WebSocketDisconnect
from websockets.asyncio.client import ClientConnection, unix_connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.typing import Subprotocol

from app.web.errors import problem
from app.web.security import SCENE_POLICY

ADMITTED = frozenset({"ViewerCameraMessage", "ScenePointerMessage"})
BANNED_QUERIES = frozenset({"websocket", "playbackPath"})
LARGEST = 64 * 1024
TOUCH_S = 30.0
FRAME_STYLE = b'<link rel="stylesheet" href="/static/css/frame.css">'
PROTOCOL = f"viser-v{version('viser')}"


def admitted(message: bytes) -> bool:
    """Whether a browser may send this message: only the pose of its camera and of its pointer."""
    if len(message) > LARGEST:
        return False
    try:
        content = msgspec.msgpack.decode(message)
    except msgspec.DecodeError:
        return False
    return isinstance(content, dict) and content.get("type") in ADMITTED


async def page(viewer: Path, *, queries: frozenset[str]) -> Response:
    """The viewer's page under the viewer's policy. Refuses queries that point it at another server or file."""
    if queries & BANNED_QUERIES:
        return problem(400, code="query_refused", title="Refused", detail="The 3D view shows this mission only.")
    try:
        way = AsyncHTTPTransport(uds=str(viewer))
        async with AsyncClient(base_url="http://viewer", transport=way, timeout=10.0) as client:
            answer = await client.get("/", headers={"Accept-Encoding": "identity"})
    except HTTPError as error:
        return problem(502, code="scene_gone", title="The 3D view does not answer", detail=str(error))
    headers = {"Content-Security-Policy": SCENE_POLICY, "X-Frame-Options": "SAMEORIGIN"}
    body = answer.content.replace(b"</head>", FRAME_STYLE + b"</head>", 1)
    return Response(body, status_code=answer.status_code, media_type="text/html", headers=headers)


async def relay(socket: WebSocket, address: Path, *, touch: Callable[[], None]) -> None:
    """Relay both directions until either end disconnects; `touch` is called while somebody watches.

    Needs the viewer's own version as subprotocol.
    """
    if PROTOCOL not in socket.scope.get("subprotocols", ()):
        await socket.close(code=1002, reason=f"the viewer must speak {PROTOCOL}")
        return
    try:
        viewer = await unix_connect(
            str(address), "ws://viewer/", subprotocols=[Subprotocol(PROTOCOL)], max_size=None, compression=None
        )
    except (OSError, InvalidHandshake):
        await socket.close(code=1011, reason="the 3D view does not answer")
        return
    try:
        await socket.accept(subprotocol=PROTOCOL)
        async with anyio.create_task_group() as group:
            group.start_soon(_watch, touch)
            group.start_soon(_out, socket, viewer, group.cancel_scope)
            await _back(socket, viewer)
            group.cancel_scope.cancel()
    finally:
        viewer.transport.abort()
    await _close(socket, code=1000)


async def _out(socket: WebSocket, viewer: ClientConnection, both: anyio.CancelScope) -> None:
    """Browser to viewer, admitted messages only. Ends both directions when the browser leaves."""
    while True:
        message = await socket.receive()
        if message["type"] == "websocket.disconnect":
            both.cancel()
            return
        body = message.get("bytes")
        if body is not None and admitted(body):
            with suppress(ConnectionClosed):
                await viewer.send(body)


async def _back(socket: WebSocket, viewer: ClientConnection) -> None:
    """Viewer to browser, unchanged."""
    with suppress(ConnectionClosed, WebSocketDisconnect, RuntimeError):
        async for message in viewer:
            if isinstance(message, bytes):
                await socket.send_bytes(message)


async def _watch(touch: Callable[[], None]) -> None:
    while True:
        touch()
        await anyio.sleep(TOUCH_S)


async def _close(socket: WebSocket, *, code: int) -> None:
    with suppress(RuntimeError, WebSocketDisconnect):
        await socket.close(code=code)
