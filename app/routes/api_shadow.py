"""/api/v1/shadow: what the own stacks of observed robots declared, what was measured, what is accepted."""

from typing import Any

from app.console import ConsoleDep
from app.routes import api_requests
from app.routes.shadow import Only, robots
from app.views.shadow import ShadowReport, shadow_report

router = api_requests.router("robots")


@router.get("/shadow", responses=api_requests.answers(ShadowReport, many=True))
def shadow(console: ConsoleDep, only: Only = "") -> Any:
    """Every robot in shadow mode, and every one that the log holds from earlier, each with its newest goals first.

    `only`: goals where declared and accepted agree, disagree, or cannot be compared. Nothing here is a mission.
    """
    return [api_requests.plain(shadow_report(one)) for one in robots(console, only)]
