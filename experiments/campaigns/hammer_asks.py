"""Defines the requests that a caller of the hammer campaign sends to the gate, each under its own key, and the caller's
journal.

The journal has a line before each request, and one after each answer that is forced to the disk. A caller that is
killed in between sends the same request again when it is restarted.
"""

import os
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from types import TracebackType
from typing import Literal

import msgspec

from experiments.campaigns.races import NOTHING, opening, person
from harness.contracts.commands import AcquireLease, ApproveHandoff, ClearVeto, CreateMission, RaiseVeto, ReleaseLease
from harness.contracts.ids import HandoffId, InvocationId, MissionId, ResourceId, handoff_stream, lease_stream
from harness.contracts.ids import mission_stream as stream_of_mission
from harness.contracts.values import Value, digest
from harness.gate.commit import CommandEnvelope

Kind = Literal["mission", "veto", "question", "answer", "rest", "lease"]
Answer = Literal["", "done", "refused"]
KEYED = {
    "MissionCreated": "mission_id",
    "VetoRaised": "reason",
    "VetoCleared": "reason",
    "HandoffOpened": "reason",
    "HandoffApproved": "key",
    "LeaseAcquired": "invocation_id",
    "LeaseReleased": "reason",
}
"""Where an event bears the key under which it was asked for."""
SHARED_MISSIONS = 3
SHARED_RESOURCES = 3
FAR_S = 4e9


class HammerRequest(Value):
    """One decision. `slot`: which mission, question or resource; `holder`: whose lease is released, or whose token.

    `back`: a veto is cleared, a lease released. `requests` are in the log together or not at all.
    """

    key: str
    kind: Kind
    slot: int = 0
    back: bool = False
    holder: str = ""
    token: int = 0

    @property
    def requests(self) -> int:
        """How many events with its key it leaves: an answer also takes the lease of what it permits."""
        return 2 if self.kind == "answer" else 1


class JournalLine(Value):
    """One line of a caller's journal: a request, or the answer to the last one."""

    ask: HammerRequest | None = None
    key: str = ""
    answer: Answer = ""


class CallerJournal:
    """Append-only. Answers are on the disk before the caller continues; requests survive its process."""

    def __init__(self, file: Path) -> None:
        self._file = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)

    def asks(self, ask: HammerRequest) -> None:
        """Write a request before it is sent."""
        os.write(self._file, msgspec.json.encode(JournalLine(ask=ask)) + b"\n")

    def hears(self, key: str, answer: Answer) -> None:
        """Write the answer after it arrived."""
        os.write(self._file, msgspec.json.encode(JournalLine(key=key, answer=answer)) + b"\n")
        os.fsync(self._file)

    def __enter__(self) -> "CallerJournal":
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        os.close(self._file)


class JournalContent(Value):
    """The content of a journal: every request, the answers by key, and the last request if it has no answer.

    `again`: keys that were requested more than once; a repetition of what was done may be refused.
    """

    asks: tuple[HammerRequest, ...]
    answers: dict[str, Answer]
    open: HammerRequest | None
    again: frozenset[str]


def read_journal(file: Path) -> JournalContent:
    """The whole journal of one caller; a missing one is empty. A torn last line was never an answer."""
    asks: list[HammerRequest] = []
    answers: dict[str, Answer] = {}
    for text in file.read_bytes().split(b"\n")[:-1] if file.exists() else ():
        line = msgspec.json.decode(text, type=JournalLine)
        if line.ask is not None:
            asks.append(line.ask)
        else:
            answers[line.key] = line.answer
    last = asks[-1] if asks and asks[-1].key not in answers else None
    times = Counter(ask.key for ask in asks)
    again = frozenset(key for key, n in times.items() if n > 1)
    return JournalContent(asks=tuple(dict.fromkeys(asks)), answers=answers, open=last, again=again)


def requests_of(ask: HammerRequest, *, number: int, creating: CreateMission) -> Sequence[CommandEnvelope]:
    """The commands of request number `asked` of caller `number`, always the same; `creating` is any new mission."""
    match ask.kind:
        case "mission":
            mission_id = MissionId(ask.key)
            return [
                CommandEnvelope(
                    stream_of_mission(mission_id), msgspec.structs.replace(creating, mission_id=mission_id), None
                )
            ]
        case "veto":
            layer = f"caller-{number}"
            veto = ClearVeto(layer=layer, reason=ask.key) if ask.back else RaiseVeto(layer=layer, reason=ask.key)
            return [CommandEnvelope(stream_of_mission(shared_mission(ask.slot)), veto, None)]
        case "question":
            question = question_id(ask.slot)
            request = msgspec.structs.replace(opening(question), reason=ask.key)
            return [CommandEnvelope(handoff_stream(question), request, None)]
        case "answer":
            return [_approval(ask, number), _lease(ask, own_resource(number))]
        case "rest":
            return [_lease(ask, own_resource(number))]
        case "lease":
            return [_lease(ask, shared_resource(ask.slot))]


def _approval(ask: HammerRequest, number: int) -> CommandEnvelope:
    question = question_id(ask.slot)
    request = opening(question)
    approve = ApproveHandoff(
        actor=person(number),
        reason="go on",
        key=ask.key,
        cycle=1,
        subject=digest(request.proposal),
        evidence=NOTHING,
        k=request.k,
        fresh=request.snapshot,
    )
    return CommandEnvelope(handoff_stream(question), approve, None)


def _lease(ask: HammerRequest, resource: ResourceId) -> CommandEnvelope:
    if ask.back:
        return CommandEnvelope(
            lease_stream(resource), ReleaseLease(invocation_id=InvocationId(ask.holder), reason=ask.key), None
        )
    take = AcquireLease(
        resource=resource,
        mission_id=shared_mission(0),
        invocation_id=InvocationId(ask.key),
        token=ask.token,
        expires_s=FAR_S,
    )
    return CommandEnvelope(lease_stream(resource), take, None)


def shared_mission(slot: int) -> MissionId:
    """One of the missions that all callers write to."""
    return MissionId(f"mis_shared_{slot}")


def shared_resource(slot: int) -> ResourceId:
    """One of the resources that all callers want."""
    return ResourceId(f"vbot-1/shared_{slot}")


def own_resource(number: int) -> ResourceId:
    """The resource that the answers of one caller permit to be used."""
    return ResourceId(f"vbot-1/own_{number}")


def question_id(slot: int) -> HandoffId:
    """Questions are numbered; all callers take them in order."""
    return HandoffId(f"hof_{slot}")
