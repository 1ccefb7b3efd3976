"""regen lease: who holds what, and freeing what is in quarantine, by a named person on what the robot shows now."""

from typing import Annotated, Any

import typer

from app.cli import output
from app.cli.person import me
from app.i18n.reasons import rendering as reasons
from harness.bootstrap import open_harness, owner_of, read_harness
from harness.contracts.actors import Actor
from harness.contracts.decisions import Refused
from harness.contracts.errors import HarnessError, StoreOwned
from harness.contracts.ids import ResourceId
from harness.contracts.reasons import because
from harness.projections.leases import Lease
from harness.runtime import Runtime

app = typer.Typer(no_args_is_help=True, help="See who holds the robot's resources; free what nobody accounts for.")


@app.command("list")
def list_leases(data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False) -> None:
    """Every resource that was ever leased: free, held or in quarantine, with its newest fencing token."""
    with read_harness(output.settings(data_folder=data)) as runtime:
        rows = [_row(lease) for lease in _leases(runtime)]
    lines = output.table(
        [["resource", "status", "token", "mission", "invocation"]]
        + [[r["resource"], r["status"], str(r["token"]), r["mission_id"], r["invocation_id"]] for r in rows]
    )
    lines += [f"{row['resource']}: {row['reason']}" for row in rows if row["status"] == "quarantined"]
    output.show({"leases": rows}, as_json=as_json, lines=lines if rows else ["Nothing was ever leased."])


def _leases(runtime: Runtime) -> list[Lease]:
    return [runtime.lease(ResourceId(stream.partition("/")[2])) for stream in runtime.streams("lease/")]


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
    reason: Annotated[str, typer.Option(help="Why; it stands in the log.")],
    operator: Annotated[str, typer.Option(help="Who frees it; your own name if not said.")] = "",
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Free a resource in quarantine. The robot is observed first: it must stand by its odometry, or have its hardware
    stop engaged. Nothing is started or re-armed by this. Exit 1 if the robot is not shown at rest."""
    owner = owner_of(data)
    if owner is not None:
        raise StoreOwned(because("lease_freed_by_owner", pid=owner.pid), where=str(data))
    actor = Actor(name=operator.strip() or me().name, role="operator")
    with open_harness(output.settings(data_folder=data, speed=0.0)) as harness:
        decision = harness.supervisor.free(ResourceId(resource), actor=actor, reason=reason)
        if isinstance(decision, Refused):
            raise HarnessError(output.refusal(decision), where=resource, do="see `regen lease list`")
        lease = _row(harness.runtime.lease(ResourceId(resource)))
    output.show(lease, as_json=as_json, lines=[f"{resource} is free, by {actor.name}: {reason}"])
