"""regen lease: list leases, and release a quarantined one in a person's name on what the robot reports now."""

from typing import Any
from urllib.parse import quote

import msgspec
import typer

from app.acts.leases import FreeLeaseAct
from app.cli import output
from app.cli.api import api_with_robots
from app.i18n.reasons import rendering as reasons
from harness.bootstrap import read_harness
from harness.projections.leases import Lease

app = typer.Typer(no_args_is_help=True, help="See who holds the robot's resources; free what nobody accounts for.")


@app.command("list")
def list_leases(data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False) -> None:
    """Every resource that was ever leased: free, held or in quarantine, with its newest fencing token."""
    with read_harness(output.settings(data_folder=data)) as runtime:
        rows = [_row(lease) for lease in runtime.leases()]
    lines = output.table(
        [["resource", "status", "token", "mission", "invocation"]]
        + [[r["resource"], r["status"], str(r["token"]), r["mission_id"], r["invocation_id"]] for r in rows]
    )
    lines += [f"{row['resource']}: {row['reason']}" for row in rows if row["status"] == "quarantined"]
    output.show({"leases": rows}, as_json=as_json, lines=lines if rows else ["Nothing was ever leased."])


def _row(lease: Lease) -> dict[str, Any]:
    return {
        "resource": lease.resource,
        "status": lease.status,
        "token": lease.token,
        "mission_id": lease.mission_id,
        "invocation_id": lease.invocation_id,
        "expires_s": lease.expires_s,
        **reasons.stated("reason", lease.reason),
    }


@app.command()
def free(
    resource: str,
    reason: output.Why,
    data: output.Data = output.DEFAULT_DATA,
    site: output.Site = None,
    as_json: output.Json = False,
) -> None:
    """Free a resource in quarantine. The robot is observed first: it must stand by its odometry, or have its hardware
    stop engaged. Nothing is started or re-armed by this. Exit 1 if the robot is not shown at rest."""
    act = FreeLeaseAct.of(reason=reason)
    folder = output.data_of(data, site)
    chosen = output.settings(data_folder=folder, site_folder=site, speed=0.0) if site is not None else None
    with api_with_robots(folder, chosen) as api:
        lease = msgspec.convert(api.post(f"/leases/{quote(resource)}/free", act.body()), Lease)
    output.show(_row(lease), as_json=as_json, lines=[f"{resource} is free: {reason}"])
