"""The door at the command: whoever asks, by whichever page or address, is checked and signed here."""

from collections.abc import Callable, Sequence
from contextvars import ContextVar
from dataclasses import replace
from typing import Any

import msgspec

from app.permissions import NotPermitted, Visitor, needed
from harness.contracts.actors import Actor
from harness.contracts.any_events import AnyEvent
from harness.contracts.commands import CreateMission
from harness.contracts.decisions import Accepted, Decision, Refused
from harness.contracts.ids import HandoffId, MissionId
from harness.contracts.person_commands import PersonCommand
from harness.contracts.ports import Record
from harness.runtime import Runtime

VISITOR: ContextVar[Visitor] = ContextVar("visitor")
"""Who the present request comes from. Set by the doorkeeper alone."""

Trail = Callable[[Visitor, Actor, str, str, str], object]
"""Writes (visitor, actor, command, subject, outcome) where people's commands are kept with their source."""


class GuardedRuntime(Runtime):
    """The runtime as people and integrations reach it: the same state, and every command checked and signed.

    A command's actor is the visitor in the role that allows it, whatever the caller had written there.
    """

    __slots__ = ("_trail",)

    def __init__(self, runtime: Runtime, trail: Trail) -> None:
        self.__dict__ = runtime.__dict__
        self._trail = trail

    def commit(self, requests: Sequence[Any], *, records: Sequence[Record] = ()) -> Accepted[AnyEvent] | Refused:
        """Raises NotPermitted before anything is decided."""
        signed = [self._signed(request) for request in requests]
        decision = super().commit(signed, records=records)
        for request in signed:
            self._told(request.command, request.stream, decision)
        return decision

    def answer(self, handoff_id: HandoffId, command: PersonCommand) -> Decision[AnyEvent]:
        """Raises NotPermitted before anything is observed or decided."""
        actor = _visitor().acting(needed(command))
        self._same_robot(self._robot_of_handoff(handoff_id))
        signed = msgspec.structs.replace(command, actor=actor)
        decision = super().answer(handoff_id, signed)
        self._told(signed, f"handoff/{handoff_id}", decision)
        return decision

    def _signed(self, request: Any) -> Any:
        command = request.command
        actor = _visitor().acting(needed(command))
        if isinstance(command, CreateMission):
            self._same_robot(command.robot_id)
            return replace(request, command=msgspec.structs.replace(command, requested_by=actor))
        kind, _, name = request.stream.partition("/")
        if kind == "handoff":
            raise NotPermitted("A handoff takes no command by itself", do="answer it: the robot is looked at first")
        if kind == "mission":
            self._same_robot(self.mission(MissionId(name)).robot_id)
        return replace(request, command=msgspec.structs.replace(command, **_signature(command, actor)))

    def _robot_of_handoff(self, handoff_id: HandoffId) -> str:
        opened = self.handoff(handoff_id).opened
        return opened.robot_id if opened else ""

    def _same_robot(self, robot_id: str) -> None:
        visitor = _visitor()
        if visitor.robot_id not in ("", robot_id):
            raise NotPermitted(
                f"This token is for {visitor.robot_id}", where=f"token {visitor.name}", do=f"use one for {robot_id}"
            )

    def _told(self, command: Any, subject: str, decision: Decision[AnyEvent]) -> None:
        actor = getattr(command, "requested_by", None) or getattr(command, "actor", None) or _visitor().actor
        outcome = f"refused: {decision.rule}" if isinstance(decision, Refused) else "accepted"
        self._trail(_visitor(), actor, type(command).__name__, subject, outcome)


def _signature(command: Any, actor: Actor) -> dict[str, Actor]:
    return {"actor": actor} if "actor" in command.__struct_fields__ else {}


def _visitor() -> Visitor:
    try:
        return VISITOR.get()
    except LookupError:
        raise NotPermitted("Nobody is known to ask for this", do="sign in, or use a token") from None
