"""/missions/{id}/scene/{view}/: moves one reader's 3D view to an instant, and exports it as a recording.

The doorkeeper has checked session and origin.
"""

from typing import Annotated

from fastapi import APIRouter, Path, Query, Request, WebSocket
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response

from app.console import Console, ConsoleDep
from app.scene import proxy
from app.scene.port import SceneFile
from app.web.security import PrincipalDep
from harness.contracts.errors import HarnessError
from harness.contracts.ids import MissionId

router = APIRouter(prefix="/missions/{mission_id}/scene")
ViewPath = Annotated[str, Path(pattern="^[A-Za-z0-9_-]{1,64}$")]
EXPORTS: dict[SceneFile, str] = {"viser": "application/octet-stream", "html": "text/html"}


@router.get("/export.{form}")
def export(console: ConsoleDep, principal: PrincipalDep, mission_id: MissionId, form: SceneFile) -> Response:
    """The mission as a recording of its 3D view; for operators."""
    principal.acting("export")
    entries = console.histories.of(mission_id)
    begin_s, end_s = entries[0].mission_s, entries[-1].mission_s
    body = console.scenes.export(mission_id, form, begin_s=begin_s, end_s=end_s)
    name = f'attachment; filename="{mission_id}.{form}"'
    return Response(body, media_type=EXPORTS[form], headers={"Content-Disposition": name})


@router.get("/{view}/")
async def page(request: Request, console: ConsoleDep, mission_id: MissionId, view: ViewPath) -> Response:
    viewer = await run_in_threadpool(console.scenes.socket, mission_id, view)
    return await proxy.page(viewer, queries=frozenset(request.query_params))


@router.post("/{view}/instant")
def seek(
    console: ConsoleDep,
    mission_id: MissionId,
    view: ViewPath,
    t: Annotated[float | None, Query(ge=0, allow_inf_nan=False)] = None,
) -> Response:
    """Show the view `t` seconds into the mission, or its newest instant; a view that is not open yet opens there."""
    begin_s = console.histories.of(mission_id)[0].mission_s
    console.scenes.seek(mission_id, view, None if t is None else begin_s + t)
    return Response(status_code=204)


@router.websocket("/{view}")
@router.websocket("/{view}/")
async def viewer(socket: WebSocket, mission_id: MissionId, view: str) -> None:
    """The viewer strips the trailing slash of its own address, so both are answered."""
    console: Console = socket.app.state.console
    try:
        address = await run_in_threadpool(console.scenes.socket, mission_id, view)
    except HarnessError:
        await socket.close(code=1008)
        return
    await proxy.relay(socket, address, touch=lambda: console.scenes.touch(mission_id, view))
