"""Decides the erasure of a blob: once, with a reason, by a person or by the retention rule. Pure."""

from typing import assert_never

from harness.contracts.actors import Actor
from harness.contracts.decider import Codec, Decider
from harness.contracts.decisions import Accepted, Decision
from harness.contracts.erasure_events import BlobErased, EraseBlob, ErasureCommand, ExpireBlob
from harness.contracts.reasons import Explanation, because
from harness.contracts.values import Moment
from harness.projections.erasures import Erasure, apply

RETENTION = Actor(name="retention", role="harness", channel="policy")


def decide(erasure: Erasure, command: ErasureCommand, now: Moment) -> Decision[BlobErased]:
    """What was erased already adds nothing: its tombstone keeps the first reason."""
    if erasure.erased is not None:
        return Accepted(())
    match command:
        case EraseBlob():
            return Accepted((_tombstone(command, command.actor, command.reason, now),))
        case ExpireBlob():
            reason = because("retention_over", days=command.after_days)
            return Accepted((_tombstone(command, RETENTION, reason, now, ended_mission=command.mission_id),))
        case _:
            assert_never(command)


def _tombstone(
    command: ErasureCommand, actor: Actor, reason: Explanation, now: Moment, *, ended_mission: str = ""
) -> BlobErased:
    return BlobErased(
        digest=command.digest,
        medium=command.medium,
        size_bytes=command.size_bytes,
        actor=actor,
        reason=reason,
        at_s=now.wall_s,
        ended_mission=ended_mission,
    )


DECIDER: Decider[Erasure, ErasureCommand, BlobErased] = Decider(
    initial=Erasure(), apply=apply, decide=decide, codec=Codec(BlobErased)
)
