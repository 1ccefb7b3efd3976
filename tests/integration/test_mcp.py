"""An outside agent over MCP, by the official client: it reads and proposes, and every other route refuses its token."""

import asyncio
import json
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
import uvicorn
from fastapi.testclient import TestClient
from mcp import Client, StdioServerParameters
from pydantic import SecretStr
from typer.testing import CliRunner

from app.auth.permissions import NotPermitted
from app.cli.mcp_server import check_token
from app.cli.owner_api import OwnerApi
from app.settings import ConsoleSettings
from tests.builders.console_with_roles import ConsoleWithRoles, routes
from tests.builders.consoles import OWNER, Stand, console_stand
from tests.builders.people import SETTING_UP, everybody, program
from tests.builders.workspaces import ROOT, free_port
from tests.saying import raises_saying

PROPOSAL = ("POST", "/api/v1/goal-proposals")
ALLOWED = {PROPOSAL, ("POST", "/candidates/check"), ("POST", "/audit/anchors")}
"""What the token may post; the last two compute an answer and change nothing."""
GOAL = "Go to the Office storage area"


@contextmanager
def listening() -> Iterator[tuple[Stand, str]]:
    """A console at an address of this machine."""
    port = free_port()
    settings = ConsoleSettings(port=port, robots=("vbot-1",), owner_token=SecretStr(OWNER), password_memory_kib=19456)
    with console_stand(settings=settings) as stand:
        server = uvicorn.Server(uvicorn.Config(stand.app, host="127.0.0.1", port=port, log_level="error"))
        thread = threading.Thread(target=server.run, daemon=True)
        thread.start()
        while not server.started:
            thread.join(0.05)
        try:
            yield stand, f"http://127.0.0.1:{port}"
        finally:
            server.should_exit = True
            thread.join(10)


def token_of(stand: Stand, *scopes: str) -> str:
    return str(stand.app.state.sessions.accounts.issue("agent", scopes=scopes, by=SETTING_UP).secret)


async def spoken(url: str, token: str, calls: list[tuple[str, dict[str, Any]]]) -> tuple[list[str], list[Any]]:
    """The tools that `regen mcp` offers, and the answers to calls, over standard input and output."""
    command = StdioServerParameters(
        command=sys.executable,
        args=["-m", "app.cli.main", "mcp", "--url", url],
        env={"REGEN_MCP_TOKEN": token, "PYTHONPATH": str(ROOT)},
    )
    async with Client(command, read_timeout_seconds=60) as client:
        tools = [one.name for one in (await client.list_tools()).tools]
        return tools, [await client.call_tool(name, arguments) for name, arguments in calls]


@pytest.mark.ask("ros-mcp-server#283")
def test_an_agent_reads_the_site_and_its_proposed_goal_waits_for_a_person() -> None:
    with listening() as (stand, url):
        calls = [
            ("read_places", {}),
            ("list_missions", {}),
            ("propose_goal", {"goal": GOAL, "reason": "the shelf was reported empty"}),
            ("propose_goal", {"goal": GOAL}),
            ("propose_goal", {"goal": "Make me a coffee"}),
            ("list_proposed_goals", {}),
            ("read_mission", {"mission_id": "../account"}),
        ]
        tools, answers = asyncio.run(spoken(url, token_of(stand, "read", "suggest"), calls))
        assert not [one for one in tools if any(word in one for word in ("start", "approve", "release", "decide"))]
        places, missions, proposed, again, strange, waiting, outside = answers
        assert "Office" in places.content[0].text and not missions.is_error
        answer = json.loads(proposed.content[0].text)
        assert "Office storage" in answer["reading"]["told"]
        assert again.is_error and strange.is_error and outside.is_error, "once, understood, and by its own address"
        assert GOAL in json.dumps([one.text for one in waiting.content])
        assert list(stand.harness.runtime.missions()) == [], "nothing was started"
        own = {"Origin": url, "Sec-Fetch-Site": "same-origin"}
        operator = TestClient(stand.app, base_url=url, follow_redirects=False, headers=own)
        assert operator.get(stand.app.state.sessions.invite()).status_code == 200
        page = operator.get("/queue").text
        assert GOAL in page and "the shelf was reported empty" in page and "Read it" in page
        named = {"robot_id": "vbot-1", "template": "by-goal", "goal": GOAL}
        assert GOAL in operator.get("/missions/new", params=named).text
        dismissed = operator.post(f"/queue/goals/{answer['proposal_id']}/dismiss", data={"reason": "not today"})
        assert dismissed.status_code == 303 and GOAL not in operator.get("/queue").text


@pytest.fixture(scope="module")
def console() -> Iterator[ConsoleWithRoles]:
    with console_stand() as stand:
        _, handoff_id = stand.handed_off()
        people = everybody(stand) | {"agent": program(stand, "read", "suggest")}
        yield ConsoleWithRoles(stand, people, stand.created(), handoff_id, "t")


def test_every_other_route_refuses_the_token_of_an_agent(console: ConsoleWithRoles) -> None:
    changing = [one for one in routes(console.stand) if one[0] != "GET" and one not in ALLOWED]
    assert len(changing) > 100
    before = console.stand.harness.runtime.head()
    for method, path in changing:
        assert console.send("agent", method, path) in (401, 403, 404, 405, 422), (method, path)
        assert console.stand.harness.runtime.head() == before, (method, path)
    assert console.send("agent", *PROPOSAL) == 201
    (open_one,) = console.people["agent"].get("/api/v1/goal-proposals").json()
    assert open_one["actor"]["role"] == "integration"


@pytest.mark.parametrize("scopes", [("read",), ("read", "suggest", "drive")])
def test_a_token_that_may_do_more_or_less_is_not_used(scopes: tuple[str, ...]) -> None:
    with listening() as (stand, url), raises_saying(NotPermitted, match="read and suggest"):
        check_token(OwnerApi(url, token_of(stand, *scopes)))


def test_without_the_extra_the_command_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "mcp.server.mcpserver", None)
    monkeypatch.setattr("app.cli.mcp_server.check_token", lambda api: None)
    from app.cli.main import app  # noqa: PLC0415  read after the extra is gone

    done = CliRunner().invoke(app, ["mcp", "--token", "t"])
    assert done.exception is not None and "extra" in str(done.exception)
