"""regen init and regen check: a site's own folder."""

from pathlib import Path
from typing import Annotated

import msgspec
import typer

from app.acts.maps import AttachCloudAct
from app.cli import output
from app.cli.api import api_without_robots
from app.i18n.reasons import rendering as reasons
from harness.adapters.installed_predicates import INSTALLED
from harness.baseline.load import shipped_missions
from harness.bootstrap import read_harness
from harness.contracts.errors import ContractInvalid, HarnessError
from harness.contracts.predicates import InstalledPredicate
from harness.contracts.reasons import because
from harness.map_clouds import stored_cloud
from harness.workspace.files import SimulatedRobotEntry
from harness.workspace.new_folder import write_folder
from harness.workspace.reading import Workspace, examined, open_workspace

CLOUDS = (".pcd", ".ply", ".las", ".laz")
MAPS = (".yaml", ".yml")
Folder = Annotated[Path, typer.Argument(help="The site's folder.")]


def init(
    folder: Folder,
    source: Annotated[
        Path | None, typer.Option("--from", help="A map_server map (map.yaml) or a point cloud (PCD, PLY, LAS, LAZ).")
    ] = None,
    name: Annotated[str, typer.Option(help="The site's name; the folder's without one.")] = "",
    address: Annotated[str, typer.Option(help="Where the robot serves the provider protocol.")] = "",
    as_json: output.Json = False,
) -> None:
    """Write a new site's folder: two places, the routes between them, a robot by its address and a first mission."""
    suffix = source.suffix.lower() if source else ""
    if source and suffix not in (*CLOUDS, *MAPS):
        raise ContractInvalid(because("source_format_unknown", known=(*MAPS, *CLOUDS)), where=str(source))
    files = write_folder(folder, name=name, map_file=source if suffix in MAPS else None, address=address)
    found = open_workspace(folder, reserved=shipped_missions())
    if source and suffix in CLOUDS:
        _import_cloud(source, found)
    lines = [f"wrote {file}" for file in files]
    lines += [f"Edit them, then: regen check {folder}"]
    output.show({"folder": str(folder), "files": [str(one) for one in files]}, as_json=as_json, lines=lines)


def check(folder: Folder, as_json: output.Json = False) -> None:
    """Read a site's folder and say everything that is wrong with it. Exit 0: it can be used; 2: it cannot."""
    found, problems = examined(folder, reserved=shipped_missions())
    notes = found.notes if found else ()
    lines = [reasons.explained(one) for one in problems]
    lines += [f"note: {reasons.explained(one)}" for one in notes]
    lines += _counted(found) if found else []
    predicates = [_predicate(one, found) for one in INSTALLED.installed.values()]
    lines += [f"predicate {one['name']} {one['version']} of {one['package']}: {one['decides']}" for one in predicates]
    lines += [reasons.explained(one) for one in INSTALLED.problems]
    answer = {
        "ok": found is not None,
        "problems": [_row(one) for one in problems],
        "notes": [_row(one) for one in (*notes, *INSTALLED.problems)],
        "predicates": predicates,
    }
    output.show(answer, as_json=as_json, lines=lines)
    raise typer.Exit(0 if found else 2)


def _predicate(one: InstalledPredicate, found: Workspace | None) -> dict[str, str]:
    vouched = found is not None and one.name in found.site.vouched
    decides = "the site vouches for it" if vouched else "the site does not vouch for it, so it decides nothing"
    return {"name": one.name, "version": one.version, "package": one.package, "code": one.code, "decides": decides}


def _counted(found: Workspace) -> list[str]:
    site = found.site
    addressed = sum(not isinstance(one, SimulatedRobotEntry) for one in found.robots)
    return [
        f"{site.name}, map {site.map_version}: {len(site.places)} places, {len(site.routes)} routes, "
        f"{len(site.passages)} passages, {len(site.zones)} zones",
        f"{len(found.robots)} robots, {addressed} of them by address; {len(found.missions)} missions of its own",
        *([_channels(found)] if found.site.channels else []),
    ]


def _channels(found: Workspace) -> str:
    named = ", ".join(one.name + (" (default)" if one.default else "") for one in found.site.channels)
    readable = sum(one.readable for one in found.site.channels)
    return f"{len(found.site.channels)} channels, {readable} of them read back: {named}"


def _row(error: HarnessError) -> dict[str, str]:
    return {"code": error.reason.code, "where": reasons.sentence(error.where), "text": reasons.explained(error)}


def _import_cloud(file: Path, found: Workspace) -> None:
    """As `regen map import` does, into the site's data folder."""
    data = output.data_of(output.DEFAULT_DATA, found.folder)
    version, frame = found.site.map_version, found.site.frame
    with api_without_robots(data) as api, read_harness(output.settings(data_folder=data)) as runtime:
        cloud = stored_cloud(runtime, file, map_version=version, frame=frame)
        act = AttachCloudAct.of(cloud=msgspec.to_builtins(cloud), reason="imported with the site")
        api.post(f"/maps/{version}/cloud", act.body())
