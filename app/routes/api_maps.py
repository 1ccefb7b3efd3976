"""/api/v1/maps: the cloud that a map version is shown with. Its bytes lie in the blob store already."""

from typing import Annotated, Any

import msgspec
from fastapi import APIRouter
from pydantic import Field
from starlette.responses import JSONResponse

from app.console import ActorDep, ConsoleDep
from app.routes import api_requests
from harness.contracts.decisions import Refused
from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.maps import AttachCloud, MapCloud, map_stream
from harness.contracts.reasons import because

router = APIRouter(
    prefix="/api/v1/maps",
    default_response_class=JSONResponse,
    responses=api_requests.PROBLEMS,
    dependencies=api_requests.CHECKED,
    tags=["maps"],
)


class CloudBody(api_requests.RequestBody):
    """A MapCloud as `regen map import --json` prints it, and why it is attached."""

    cloud: Annotated[dict[str, Any], Field(max_length=20)]
    reason: api_requests.Reason


@router.get("/{map_version}/cloud", responses=api_requests.answers(MapCloud))
def cloud(console: ConsoleDep, map_version: str) -> Any:
    """The newest cloud of a map version."""
    found: MapCloud | None = console.runtime.fold(map_stream(map_version)).cloud
    if found is None:
        raise UnknownName(because("map_without_cloud", map_version=map_version[:80]))
    return api_requests.plain(found)


@router.post("/{map_version}/cloud", responses=api_requests.answers(MapCloud))
def attach(console: ConsoleDep, actor: ActorDep, map_version: str, body: CloudBody) -> Any:
    """Attach a cloud whose chunks are stored; views of that map version show it from now on."""
    try:
        asked = msgspec.convert(body.cloud, MapCloud)
    except msgspec.ValidationError as error:
        raise ContractInvalid(because("cloud_invalid", error=str(error)), where="cloud") from error
    if asked.map_version != map_version:
        raise ContractInvalid(because("cloud_of_other_map", map_version=asked.map_version), where="cloud.map_version")
    absent = next((chunk.blob for chunk in asked.chunks if not console.runtime.has_blob(chunk.blob)), None)
    if absent is not None:
        raise ContractInvalid(because("chunk_missing", chunk=absent), where="cloud.chunks")
    decision = console.runtime.decide(
        [(map_stream(map_version), AttachCloud(actor=actor, cloud=asked, reason=body.reason))]
    )
    return api_requests.refusal(decision) if isinstance(decision, Refused) else api_requests.plain(asked)
