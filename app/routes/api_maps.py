"""/api/v1/maps: the point cloud that a map version is shown with; its bytes are in the blob store already."""

from typing import Any

from app.acts.maps import AttachCloudAct
from app.console import ActorDep, Console, ConsoleDep
from app.routes import api_requests
from harness.contracts.decisions import Refused, refused
from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.maps import AttachCloud, MapCloud, map_stream
from harness.contracts.reasons import because

router = api_requests.router("maps", under="/maps")


@router.get("/{map_version}/cloud", responses=api_requests.answers(MapCloud))
def cloud(console: ConsoleDep, map_version: str) -> Any:
    """The newest cloud of a map version."""
    found: MapCloud | None = console.runtime.fold(map_stream(map_version)).cloud
    if found is None:
        raise UnknownName(because("map_without_cloud", map_version=map_version[:80]))
    return api_requests.plain(found)


@router.post("/{map_version}/cloud", responses=api_requests.answers(MapCloud))
def attach(console: ConsoleDep, actor: ActorDep, map_version: str, body: AttachCloudAct) -> Any:
    """Attach a cloud whose chunks are stored; views of that map version show it from now on."""
    command: AttachCloud = body.to_command(actor)
    if command.cloud.map_version != map_version:
        raise ContractInvalid(
            because("cloud_of_other_map", map_version=command.cloud.map_version), where="cloud.map_version"
        )
    decision = attached(console, command, replace=body.replace)
    return api_requests.refusal(decision) if isinstance(decision, Refused) else api_requests.plain(decision)


def attached(console: Console, command: AttachCloud, *, replace: bool) -> MapCloud | Refused:
    """Attach a cloud whose chunks are stored. A map that has another one keeps it, unless it is to be replaced."""
    cloud = command.cloud
    absent = next((chunk.blob for chunk in cloud.chunks if not console.runtime.has_blob(chunk.blob)), None)
    if absent is not None:
        raise ContractInvalid(because("chunk_missing", chunk=absent), where="cloud.chunks")
    stream = map_stream(cloud.map_version)
    present: MapCloud | None = console.runtime.fold(stream).cloud
    if present is not None and present.source_digest != cloud.source_digest and not replace:
        return refused("map_has_cloud", map_version=cloud.map_version, source=present.source)
    decision = console.runtime.decide([(stream, command)])
    return decision if isinstance(decision, Refused) else cloud
