"""/api/v1/leases: who holds what, and freeing what is in quarantine on what the robot shows now."""

from typing import Any

from app.acts.leases import FreeLeaseAct
from app.console import ConsoleDep
from app.routes import api_requests
from harness.contracts.decisions import Refused
from harness.contracts.ids import ResourceId
from harness.projections.leases import Lease

router = api_requests.router("leases")


@router.get("/leases", responses=api_requests.answers(Lease, many=True))
def leases(console: ConsoleDep) -> Any:
    """Every resource that was ever leased: free, held or in quarantine, with its newest fencing token."""
    return api_requests.plain(console.runtime.leases())


@router.post("/leases/{resource:path}/free", responses=api_requests.answers(Lease))
def free(console: ConsoleDep, resource: ResourceId, body: FreeLeaseAct) -> Any:
    """Free what is in quarantine: its robot must stand by its odometry, or have its hardware stop engaged."""
    decision = console.runtime.free(resource, reason=body.reason)
    return (
        api_requests.refusal(decision)
        if isinstance(decision, Refused)
        else api_requests.plain(console.runtime.lease(resource))
    )
