"""regen map: the point cloud that a map version is shown with in 3D."""

import sys
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer

from app.acts.maps import AttachCloudAct
from app.cli import output
from app.cli.api import api_without_robots
from harness.bootstrap import read_harness
from harness.contracts.errors import ContractInvalid
from harness.contracts.maps import MapCloud
from harness.contracts.reasons import because
from harness.map_clouds import stored_cloud

app = typer.Typer(
    no_args_is_help=True, help="Point clouds of maps, for the 3D view. A cloud is a picture, never evidence."
)


@app.command("import")
def import_cloud(
    file: Annotated[Path, typer.Argument(help="A PCD, PLY, LAS or LAZ (COPC) file.")],
    map_version: Annotated[str, typer.Option(help="The map version it belongs to.")] = "site-1",
    frame: Annotated[str, typer.Option(help="The frame its coordinates are in; asked for where it is missing.")] = "",
    metres_per_unit: Annotated[
        float | None,
        typer.Option(help="1 for metres, 0.001 for millimetres; asked for where it is missing.", min=1e-6, max=1e6),
    ] = None,
    replace: Annotated[bool, typer.Option("--replace", help="Show it instead of the map's present cloud.")] = False,
    reason: output.Why = "imported",
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Split a cloud into levels and attach it. Earlier clouds stay in the log."""
    frame = frame or _answer("frame", "The frame its coordinates are in")
    metres_per_unit = metres_per_unit or _metres(_answer("metres-per-unit", "Metres per unit of the file"))
    with api_without_robots(data) as api, read_harness(output.settings(data_folder=data)) as runtime:
        cloud = stored_cloud(runtime, file, map_version=map_version, frame=frame, metres_per_unit=metres_per_unit)
        act = AttachCloudAct.of(cloud=msgspec.to_builtins(cloud), reason=reason, replace=replace)
        api.post(f"/maps/{map_version}/cloud", act.body())
    extent = " x ".join(f"{high - low:.1f}" for low, high in zip(cloud.low_m, cloud.high_m, strict=True))
    lines = [
        f"{file.name}: {cloud.points} points over {extent} m, {cloud.dropped} left out, in {len(cloud.chunks)} chunks.",
        f"Views of map {map_version} show it from now on.",
    ]
    output.show(msgspec.to_builtins(cloud), as_json=as_json, lines=lines)


def _answer(option: str, question: str) -> str:
    """What a file does not say of itself. Raises ContractInvalid where nobody can be asked."""
    if not sys.stdin.isatty():
        raise ContractInvalid(because("cloud_option_missing", option=option), where=option)
    answer: str = typer.prompt(question)
    return answer


def _metres(text: str) -> float:
    """Raises ContractInvalid for what is no positive number."""
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 1e-6 <= value <= 1e6:
        raise ContractInvalid(because("cloud_unit_invalid", text=text[:40]), where="metres-per-unit")
    return value


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
