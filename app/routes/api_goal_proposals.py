"""/api/v1/goal-proposals: goals that somebody outside proposes. They wait for a person; nothing is started here."""

from typing import Annotated, Any

from fastapi import Path
from starlette.responses import JSONResponse

from app.acts.goal_proposals import DismissGoalAct, ProposeGoalAct
from app.console import ActorDep, ConsoleDep
from app.routes import api_mission_schemas as schemas
from app.routes import api_requests
from app.routes.queue import proposed_goals
from app.views.readings import reading_json
from app.web.security import PrincipalDep
from harness.contracts.decisions import Refused
from harness.contracts.goal_proposals import PROPOSED_GOALS, GoalProposed
from harness.runtime import Start

router = api_requests.router("goals", under="/goal-proposals")
ProposalPath = Annotated[str, Path(pattern="^[0-9a-f]{16}$")]


@router.get("", responses=api_requests.answers(GoalProposed, many=True))
def waiting(console: ConsoleDep) -> Any:
    """The goals that wait for a person, oldest first."""
    return api_requests.plain(proposed_goals(console))


@router.post("", status_code=201, responses=api_requests.answers(schemas.ProposedGoal, status=201))
def propose(console: ConsoleDep, principal: PrincipalDep, body: ProposeGoalAct) -> Any:
    """Propose a goal in words. It is read now, so that the answer says how; a person reads it again and starts it.

    A goal that is not understood is refused with what was understood of it, and does not wait.
    """
    actor = principal.acting("suggest")
    robot_id = console.robot(body.robot_id)
    understood = console.runtime.understood(Start(actor=actor, robot_id=robot_id, goal=body.goal))
    proposal_id = body.name_of(actor.name, robot_id)
    command = body.to_command(actor, proposal_id=proposal_id, robot_id=robot_id)
    decision = console.runtime.decide([(PROPOSED_GOALS, command)])
    if isinstance(decision, Refused):
        return api_requests.refusal(decision)
    reading = understood.plan.reading if understood.plan else None
    return JSONResponse(
        {
            "proposal_id": proposal_id,
            "robot_id": robot_id,
            "goal": body.goal,
            "reading": reading_json(body.goal, reading) if reading else None,
        },
        status_code=201,
    )


@router.post("/{proposal_id}/dismiss", responses=api_requests.answers(GoalProposed, many=True))
def dismiss(console: ConsoleDep, actor: ActorDep, proposal_id: ProposalPath, body: DismissGoalAct) -> Any:
    """Take it off the list."""
    decision = console.runtime.decide([(PROPOSED_GOALS, body.to_command(actor, proposal_id=proposal_id))])
    if isinstance(decision, Refused):
        return api_requests.refusal(decision)
    return waiting(console)
