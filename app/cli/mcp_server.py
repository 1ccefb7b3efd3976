"""regen mcp: lets an outside agent read missions, evidence and places, and propose a goal, by the official MCP SDK.

It is a client of the console's API with a token that may read and propose, and nothing else: it cannot start, confirm,
approve, release or commit, because the console would refuse it, whatever tool it was given. A token that may do more
is not used.
"""

from collections.abc import Callable
from functools import wraps
from typing import Annotated, Any

import typer

from app.auth.permissions import NotPermitted
from app.cli.owner_api import OwnerApi
from app.i18n.reasons.rendering import explained
from harness.contracts.errors import ContractInvalid, HarnessError
from harness.contracts.reasons import because

MAY: frozenset[str] = frozenset({"read", "suggest"})
"""What a token of this server may do at most."""
INSTRUCTIONS = (
    "Reads a robot site: missions, the evidence they rest on, places. propose_goal puts a goal before a person;"
    " nothing moves until that person has read and started it. There is no tool that starts, approves or accepts."
)


def serve(
    url: Annotated[str, typer.Option(help="The console's address.", envvar="REGEN_URL")] = "http://127.0.0.1:8080",
    token: Annotated[
        str, typer.Option(help="An API token with the scopes read and suggest.", envvar="REGEN_MCP_TOKEN")
    ] = "",
) -> None:
    """Serve MCP on standard input and output, for an agent that starts this command."""
    api = OwnerApi(url.rstrip("/"), token)
    check_token(api)
    server_on(api).run("stdio")


def check_token(api: OwnerApi) -> None:
    """Raise NotPermitted for a token that may do more than read and propose, or less."""
    may = frozenset(api.get("/account")["may"])
    if may != MAY:
        raise NotPermitted(because("mcp_token_odd", may=tuple(sorted(may)) or ("none",)), where=api.address)


def server_on(api: OwnerApi) -> Any:
    """The MCP server on this API. Raises ContractInvalid where the SDK is not installed."""
    try:
        from mcp.server.mcpserver import MCPServer  # noqa: PLC0415  an extra, and heavy
    except ImportError as error:
        raise ContractInvalid(because("extra_missing", extra="mcp"), where="mcp") from error
    server = MCPServer("regenharness", instructions=INSTRUCTIONS)
    for tool in SiteTools(api).tools():
        server.add_tool(_telling(tool))
    return server


class SiteTools:
    """What an agent may ask: each method is a tool, and its docstring is what the agent is answering of it."""

    def __init__(self, api: OwnerApi) -> None:
        self._api = api

    def tools(self) -> tuple[Callable[..., Any], ...]:
        """All of them."""
        return (
            self.list_missions,
            self.read_mission,
            self.read_mission_events,
            self.list_evidence,
            self.read_places,
            self.propose_goal,
            self.list_proposed_goals,
        )

    def list_missions(self, limit: int = 20) -> list[dict[str, Any]]:
        """Missions, newest first: id, status, goal, robot."""
        found: list[dict[str, Any]] = self._api.get(f"/missions?limit={max(1, min(limit, 200))}")
        return found

    def read_mission(self, mission_id: str) -> dict[str, Any]:
        """One mission with its stages, its goal verdict by clause, and what of it is unverified."""
        found: dict[str, Any] = self._api.get(f"/missions/{_one(mission_id)}")
        return found

    def read_mission_events(self, mission_id: str) -> list[dict[str, Any]]:
        """The events of one mission as the log holds them: what was planned, sent, measured, judged and accepted."""
        found: list[dict[str, Any]] = self._api.get(f"/missions/{_one(mission_id)}/events")
        return found

    def list_evidence(self, limit: int = 50) -> list[dict[str, Any]]:
        """Evidence packets with their verdicts, newest first."""
        found: list[dict[str, Any]] = self._api.get(f"/evidence?limit={max(1, min(limit, 200))}")
        return found

    def read_places(self) -> dict[str, Any]:
        """The places, routes and passages of the site: what a goal may name."""
        found: dict[str, Any] = self._api.get("/places")
        return found

    def propose_goal(self, goal: str, robot_id: str = "", reason: str = "proposed by an agent") -> dict[str, Any]:
        """Put a goal in words before a person. Answers how it is read; nothing starts."""
        body = {"goal": goal, "reason": reason} | ({"robot_id": robot_id} if robot_id else {})
        found: dict[str, Any] = self._api.post("/goal-proposals", body)
        return found

    def list_proposed_goals(self) -> list[dict[str, Any]]:
        """Goals that still wait for a person."""
        found: list[dict[str, Any]] = self._api.get("/goal-proposals")
        return found


def _telling(tool: Callable[..., Any]) -> Callable[..., Any]:
    """The tool, whose refusals reach the agent in words."""
    from mcp.server.mcpserver.exceptions import ToolError  # noqa: PLC0415  an extra, and heavy

    @wraps(tool)
    def answering(**given: Any) -> Any:
        try:
            return tool(**given)
        except HarnessError as error:
            raise ToolError(explained(error)) from error

    return answering


def _one(name: str) -> str:
    """One segment of an address."""
    if not name.isascii() or not name.replace("_", "").isalnum():
        raise ContractInvalid(because("unknown_mission", mission_id=name[:40]), where="mission_id")
    return name
