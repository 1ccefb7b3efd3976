"""How a word at a handoff reaches the desk from a terminal: by the owner's API, or by owning the folder a while."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from app.history import Histories
from app.terminal.answers import Progress, exit_code, settings
from app.terminal.missions import me
from app.terminal.owner import OwnerApi, owner_api
from app.views.outcome import mission_outcome
from app.views.saying import reasoned
from harness.bootstrap import Harness, open_harness
from harness.contracts.decisions import Refused
from harness.contracts.errors import HarnessError, UnknownName
from harness.contracts.handoff_commands import LookAgain, PersonCommand
from harness.contracts.ids import HandoffId, MissionId
from harness.projections.handoffs import Handoff

LOOKS = 4


@dataclass(frozen=True)
class Word:
    """One word: where it goes in the API with which body, and the command it is here. Both from the handoff."""

    path: str
    body: Callable[[Handoff], Mapping[str, Any]]
    command: Callable[[Handoff], PersonCommand]


def said(data: Path, handoff_id: str, word: Word) -> Handoff:
    """The handoff after it. Raises UnknownName, or HarnessError with the rule that refused."""
    api = owner_api(data)
    if api is not None:
        return _told(api, handoff_id, word)
    with open_harness(settings(data_folder=data, speed=0.0)) as harness:
        return _answered(harness, HandoffId(handoff_id), word)


def said_and_followed(data: Path, handoff_id: str, word: Word) -> dict[str, Any]:
    """The mission's outcome once it is over or waits again. Raises as `said` does."""
    api = owner_api(data)
    if api is not None:
        handoff = _told(api, handoff_id, word)
        return api.follow(_mission_of(handoff), lambda _: None)
    with open_harness(settings(data_folder=data, speed=0.0)) as harness:
        handoff = _answered(harness, HandoffId(handoff_id), word)
        mission = harness.supervisor.run(_mission_of(handoff), watch=Progress())
        histories = Histories(harness.runtime)
        return mission_outcome(mission, histories.of(mission.mission_id), harness.starts(mission.mission_id))


def looked_at(data: Path) -> list[Handoff]:
    """Every handoff, newest first; those that nobody has claimed are observed again, without motion."""
    api = owner_api(data)
    if api is not None:
        for handoff in api.handoffs():
            if handoff.status == "open":
                api.post(f"/handoffs/{handoff.handoff_id}/look", {})
        return api.handoffs()
    with open_harness(settings(data_folder=data, speed=0.0)) as harness:
        for handoff in harness.runtime.handoffs():
            if handoff.status == "open":
                _observe(harness, _mission_of(handoff))
                harness.runtime.answer(LookAgain(handoff_id=handoff.handoff_id, actor=me()))
        return harness.runtime.handoffs()


def shown(data: Path, handoff_id: str) -> Handoff:
    """One handoff as it stands, without a new look."""
    api = owner_api(data)
    if api is not None:
        return msgspec.convert(api.get(f"/handoffs/{handoff_id}"), Handoff)
    with open_harness(settings(data_folder=data, speed=0.0)) as harness:
        return harness.runtime.handoff(HandoffId(handoff_id))


def ended_as(outcome: Mapping[str, Any], *, wanted: str = "succeeded") -> int:
    """0 where the mission ended as this word asks for; else as every mission's exit code."""
    return 0 if outcome["status"] == wanted else exit_code(outcome["status"])


def _told(api: OwnerApi, handoff_id: str, word: Word) -> Handoff:
    handoff = msgspec.convert(api.get(f"/handoffs/{handoff_id}"), Handoff)
    return msgspec.convert(api.post(f"/handoffs/{handoff_id}/{word.path}", dict(word.body(handoff))), Handoff)


def _answered(harness: Harness, handoff_id: HandoffId, word: Word) -> Handoff:
    handoff = harness.runtime.handoff(handoff_id)
    if handoff.waits:
        _observe(harness, _mission_of(handoff))
    decision = harness.runtime.answer(word.command(handoff))
    if isinstance(decision, Refused):
        raise HarnessError(
            f"{reasoned(decision.message)} ({decision.rule})", do="look again with `regen handoff list`, then decide"
        )
    return harness.runtime.handoff(handoff_id)


def _observe(harness: Harness, mission_id: MissionId) -> None:
    """Let the robot's sensors speak for two seconds of mission time."""
    for _ in range(LOOKS):
        wake_s = harness.supervisor.step(mission_id)
        now_s = harness.clock.now().mission_s
        harness.clock.wait_until(max(now_s + 0.5, wake_s or 0.0))
    harness.supervisor.step(mission_id)


def _mission_of(handoff: Handoff) -> MissionId:
    if handoff.opened is None:
        raise UnknownName(f"There is no handoff {handoff.handoff_id}", do="list them with `regen handoff list`")
    return handoff.opened.mission_id
