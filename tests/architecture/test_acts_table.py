"""The table of acts in docs/reference/acts.md is as the code is: act, address, command, permission."""

import importlib
import pkgutil
import re
from collections.abc import Iterator
from typing import Any, get_args

from typer.main import get_command

import app.acts
import app.routes
from app.acts.base import ActModel
from app.auth.command_permissions import required_permission
from app.cli.main import app as regen
from tests.architecture.sources import ROOT

ROW = re.compile(r"^\| `(\w+)` \| (\w+) (\S+) \| (?:regen ([\w -]+))?\s*\| (\w+)", re.MULTILINE)
SEVERAL = {
    "StopRobotAct": "stop", "ExplainStopAct": "stop", "StopRobotsAct": "stop", "SteerAct": "drive",
    "BeginUploadAct": "drive", "ReplayUploadAct": "drive", "ImportUploadAct": "drive",
    "ImportFloorAct": "drive",
    "EvaluateCandidateAct": "propose", "CancelEvaluationAct": "propose",
    "AddAccountAct": "people", "ChangeAccountAct": "people", "IssueTokenAct": "people",
}  # fmt: skip
"""Acts that are not one gate command, with what they need; test_console_people.py asks every route for it."""
WITHOUT_BODY = {("LookAgainAct", "POST", "/handoffs/{handoff_id}/look")}
ASKING = ("/missions/preview", "/candidates/check")
"""What takes an act and does nothing."""


def table() -> list[tuple[str, str, str, str, str]]:
    """(act, method, address, command, permission) of every row."""
    return ROW.findall((ROOT / "docs" / "reference" / "acts.md").read_text(encoding="utf-8"))


def routed() -> set[tuple[str, str, str]]:
    """(act, method, address) of every operation of the API that takes an act."""
    found = set(WITHOUT_BODY)
    for name in names(app.routes, "api"):
        for route in getattr(importlib.import_module(f"app.routes.{name}"), "router", app.routes).__dict__.get(
            "routes", []
        ):
            if route.include_in_schema and not route.path_format.endswith(ASKING):
                for kind in kinds(route.endpoint.__annotations__.get("body")):
                    found |= {(kind, method, route.path_format.removeprefix("/api/v1")) for method in route.methods}
    return found


def kinds(annotation: Any) -> Iterator[str]:
    """The act that a body is, or the two of a decision."""
    inner = get_args(annotation)[:1] or (annotation,)
    for one in get_args(inner[0]) or inner:
        if isinstance(one, type) and issubclass(one, ActModel):
            yield one.__name__


def names(package: Any, begins: str = "") -> list[str]:
    return [one.name for one in pkgutil.iter_modules(package.__path__) if one.name.startswith(begins)]


def acts() -> dict[str, type[ActModel]]:
    """Every act by its name; a base that several share is none."""
    found: dict[str, type[ActModel]] = {}
    for name in names(app.acts):
        module = importlib.import_module(f"app.acts.{name}")
        for one in vars(module).values():
            if isinstance(one, type) and issubclass(one, ActModel) and one.__module__ == module.__name__:
                found[one.__name__] = one
    shared = ("Act", "ActModel", "CandidateAct")
    return {name: one for name, one in found.items() if not name.startswith("_") and name not in shared}


def test_the_table_names_every_act_and_the_address_of_each() -> None:
    assert {(act, method, path) for act, method, path, _, _ in table()} == routed()
    assert {row[0] for row in table()} == set(acts())


def test_each_command_of_the_table_is_there() -> None:
    group: Any = get_command(regen)
    for words in {row[3].strip() for row in table()} - {""}:
        first, second = words.split(" ")
        assert second in group.get_command(None, first).commands, words


def test_each_act_needs_the_permission_that_stands_there() -> None:
    for act, _, _, _, permission in table():
        becomes = getattr(acts()[act], "becomes", None)
        assert permission == (required_permission(becomes) if becomes else SEVERAL[act]), act
