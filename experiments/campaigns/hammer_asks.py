"""What a caller of the hammer campaign asks of the gate, under a key of its own, and the journal it keeps of it.

A line before each question and one, forced to the disk, after each answer. A caller that is killed in between asks
the same again when it is back, as anybody would who got no answer.
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
    """One decision. `slot`: which mission, question or resource; `holder`: whose lease is given back, or whose token.

    `back`: a veto is cleared, a lease given back. `requests` stand together in the log or not at all.
    """

    key: str
    kind: Kind
    slot: int = 0
    back: bool = False
    holder: str = ""
    token: int = 0

    @property
    def requests(self) -> int:
        """How many events with its key it leaves: an answer takes the lease of what it lets happen with it."""
        return 2 if self.kind == "answer" else 1


class JournalLine(Value):
    """One line of a caller's journal: a question, or the answer to the last one."""

    ask: HammerRequest | None = None
    key: str = ""
    answer: Answer = ""


class CallerJournal:
    """Append-only. Answers are on the disk before the caller goes on; questions survive its process."""

    def __init__(self, file: Path) -> None:
        self._file = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)

    def asks(self, ask: HammerRequest) -> None:
        """Before the question."""
        os.write(self._file, msgspec.json.encode(JournalLine(ask=ask)) + b"\n")

    def hears(self, key: str, answer: Answer) -> None:
        """After the answer."""
        os.write(self._file, msgspec.json.encode(JournalLine(key=key, answer=answer)) + b"\n")
        os.fsync(self._file)

    def __enter__(self) -> "CallerJournal":
        return self

    def __exit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        os.close(self._file)


class JournalContent(Value):
    """What a journal says: every question, the answers by key, and the last question if nobody answered it.

    `again`: keys that were asked for more than once; who asks again for what was done may well be refused.
    """

    asks: tuple[HammerRequest, ...]
    answers: dict[str, Answer]
    open: HammerRequest | None
    again: frozenset[str]


def told(file: Path) -> JournalContent:
    """The whole journal of one caller; one that is not there says nothing. A torn last line was never an answer."""
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
    """The commands of an ask of caller `number`, the same whenever it is asked; `creating` is any new mission."""
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
            asked = msgspec.structs.replace(opening(question), reason=ask.key)
            return [CommandEnvelope(handoff_stream(question), asked, None)]
        case "answer":
            return [_approval(ask, number), _lease(ask, own_resource(number))]
        case "rest":
            return [_lease(ask, own_resource(number))]
        case "lease":
            return [_lease(ask, shared_resource(ask.slot))]


def _approval(ask: HammerRequest, number: int) -> CommandEnvelope:
    question = question_id(ask.slot)
    asked = opening(question)
    approve = ApproveHandoff(
        actor=person(number),
        reason="go on",
        key=ask.key,
        cycle=1,
        subject=digest(asked.proposal),
        evidence=NOTHING,
        k=asked.k,
        fresh=asked.snapshot,
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
    """What the answers of one caller let happen with."""
    return ResourceId(f"vbot-1/own_{number}")


def question_id(slot: int) -> HandoffId:
    """The questions are numbered; all callers walk along them."""
    return HandoffId(f"hof_{slot}")
