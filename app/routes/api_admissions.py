"""/api/v1/robots/{robot}/checks: what the conformance kit found at a robot's address, and what is admitted since."""

from typing import Any

from app.acts.admissions import RecordCheckAct
from app.console import ActorDep, ConsoleDep
from app.routes import api_requests
from app.routes.robots import RobotPath, admissions
from harness.contracts.admissions import admission_stream
from harness.contracts.decisions import Refused
from harness.projections.admissions import Admissions

router = api_requests.router("robots", under="/robots")


@router.get("/{robot_id}/checks", responses=api_requests.answers(Admissions))
def checks(console: ConsoleDep, robot_id: RobotPath) -> Any:
    """The newest check of each provider; empty for a robot that nobody checked."""
    return api_requests.plain(admissions(console, robot_id))


@router.post("/{robot_id}/checks", responses=api_requests.answers(Admissions))
def record(console: ConsoleDep, actor: ActorDep, robot_id: RobotPath, body: RecordCheckAct) -> Any:
    """Record a result of the kit. A robot is connected anew with it at the next start of the harness."""
    command = body.to_command(actor, robot_id=robot_id)
    console.runtime.keep(body.result())
    decision = console.runtime.decide([(admission_stream(robot_id), command)])
    if isinstance(decision, Refused):
        return api_requests.refusal(decision)
    return api_requests.plain(admissions(console, robot_id))
