"""/missions/{id}/scene/: the 3D view, relayed from its own server. The doorkeeper has checked session and origin."""

from fastapi import APIRouter, Request, WebSocket
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response

from app import proxy
from app.console import Console, ConsoleDep
from harness.contracts.errors import HarnessError
from harness.contracts.ids import MissionId

router = APIRouter(prefix="/missions/{mission_id}/scene")


@router.get("/")
async def page(request: Request, console: ConsoleDep, mission_id: MissionId) -> Response:
    port = await run_in_threadpool(console.scenes.port, mission_id)
    return await proxy.page(port, queries=frozenset(request.query_params))


@router.websocket("")
@router.websocket("/")
async def viewer(socket: WebSocket, mission_id: MissionId) -> None:
    """The viewer strips the trailing slash of its own address, so both are answered."""
    console: Console = socket.app.state.console
    try:
        port = await run_in_threadpool(console.scenes.port, mission_id)
    except HarnessError:
        await socket.close(code=1008)
        return
    await proxy.relay(socket, port, touch=lambda: console.scenes.touch(mission_id))
