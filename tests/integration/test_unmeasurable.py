"""A goal whose conditions no source of the robot can show to hold is refused by name, before anything is written."""

from collections.abc import Callable
from typing import Any

import pytest

from harness import bootstrap
from harness.assembly import LocalServices, local_services
from tests.builders.consoles import console_stand

Services = Callable[..., LocalServices]


def without_room(*arguments: Any, **named: Any) -> LocalServices:
    """A robot in whose room nobody records."""
    return local_services(*arguments, **{**named, "room": None})


def without(predicate: str) -> Services:
    """A robot without the source that supplies this predicate."""

    def services(*arguments: Any, **named: Any) -> LocalServices:
        whole = local_services(*arguments, **named)
        return LocalServices(whole.providers, [one for one in whole.sources if one.predicate != predicate])

    return services


@pytest.mark.parametrize(
    ("services", "condition", "stage"),
    [
        (without_room, "report.heard (heard)", "nodes.report"),
        (without("heard"), "report.heard (heard)", "nodes.report"),
        (without("message_stored"), "delivery.stored (message_stored)", "nodes.delivery"),
        (without("passage_checked"), "analysis.checked (passage_checked)", "nodes.analysis"),
    ],
)
def test_an_inspection_that_could_never_be_verified_is_refused_and_named(
    monkeypatch: pytest.MonkeyPatch, services: Services, condition: str, stage: str
) -> None:
    monkeypatch.setattr(bootstrap, "local_services", services)
    with console_stand() as stand:
        owner = stand.owner()
        for way in ("/api/v1/missions/preview", "/api/v1/missions"):
            answer = owner.post(way, json={"goal": "Check the storage area"})
            assert (answer.status_code, answer.json()["code"]) == (422, "unsatisfiable")
            assert condition in answer.text and stage in answer.text
        assert stand.harness.runtime.missions() == []
        assert owner.post("/api/v1/missions/preview", json={"goal": "Walk the circuit"}).status_code == 200
