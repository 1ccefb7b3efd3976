"""regen map: the point cloud that a map version is shown with in 3D."""

from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer

from app.acts.maps import AttachCloudAct
from app.cli import output
from app.cli.local_api import api_without_robots
from harness.bootstrap import read_harness
from harness.contracts.maps import MapCloud
from harness.map_clouds import stored_cloud

app = typer.Typer(
    no_args_is_help=True, help="Point clouds of maps, for the 3D view. A cloud is a picture, never evidence."
)


@app.command("import")
def import_cloud(
    file: Annotated[Path, typer.Argument(help="A PCD or PLY file.")],
    map_version: Annotated[str, typer.Option(help="The map version it belongs to.")] = "site-1",
    frame: Annotated[str, typer.Option(help="The frame its coordinates are in.")] = "map",
    metres_per_unit: Annotated[float, typer.Option(help="0.001 for a file in millimetres.", min=1e-6, max=1e6)] = 1.0,
    reason: Annotated[str, typer.Option(help="Why; it stands in the log.")] = "imported",
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Split a cloud into levels and attach it. Earlier clouds stay in the log."""
    with api_without_robots(data) as api, read_harness(output.settings(data_folder=data)) as runtime:
        cloud = stored_cloud(runtime, file, map_version=map_version, frame=frame, metres_per_unit=metres_per_unit)
        act = AttachCloudAct.of(cloud=msgspec.to_builtins(cloud), reason=reason)
        api.post(f"/maps/{map_version}/cloud", act.body())
    extent = " x ".join(f"{high - low:.1f}" for low, high in zip(cloud.low_m, cloud.high_m, strict=True))
    lines = [
        f"{file.name}: {cloud.points} points over {extent} m, {cloud.dropped} left out, in {len(cloud.chunks)} chunks.",
        f"Views of map {map_version} show it from now on.",
    ]
    output.show(msgspec.to_builtins(cloud), as_json=as_json, lines=lines)


@app.command("list")
def list_clouds(data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False) -> None:
    """The cloud that each map version is shown with."""
    with read_harness(output.settings(data_folder=data)) as runtime:
        clouds: list[MapCloud] = [runtime.fold(stream).cloud for stream in runtime.streams("map/")]
    rows: list[dict[str, Any]] = [msgspec.to_builtins(cloud) for cloud in clouds]
    lines = output.table(
        [["map", "points", "file"]] + [[one.map_version, str(one.points), one.source] for one in clouds]
    )
    output.show({"maps": rows}, as_json=as_json, lines=lines if rows else ["No map has a cloud."])
