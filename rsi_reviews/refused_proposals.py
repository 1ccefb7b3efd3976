"""Decides and folds the proposals that a rule refused: each is kept with its reasons, to be read and used as a draft.
Pure.
"""

from msgspec.structs import replace

from harness.contracts.actors import Actor, Command, Event
from harness.contracts.decider import Codec, Decider
from harness.contracts.decisions import Accepted, Decision
from harness.contracts.ids import Digest, StreamId
from harness.contracts.values import Count, Moment, Value
from rsi_reviews.contracts import Manifest, RestrictionViolation

REFUSED = StreamId("refused/proposals")


class KeepRefusal(Command, tag=True):
    """`violations`: every rule that the proposal broke, as the static check found them."""

    actor: Actor
    candidate: Digest
    configuration: Digest
    manifest: Manifest
    violations: tuple[RestrictionViolation, ...]


class ProposalRefused(Event, tag=True):
    """A proposal was refused before anything ran. Its configuration is a record of the log, under its digest."""

    actor: Actor
    candidate: Digest
    configuration: Digest
    manifest: Manifest
    violations: tuple[RestrictionViolation, ...]
    at_s: float


class Refusals(Value):
    """The refused proposals, oldest first, each once."""

    version: Count = 0
    kept: tuple[ProposalRefused, ...] = ()

    def of(self, candidate: str) -> ProposalRefused | None:
        """The refused proposal with this digest."""
        return next((one for one in self.kept if one.candidate == candidate), None)


def apply(refusals: Refusals, event: ProposalRefused) -> Refusals:
    """The refusals after one more."""
    return replace(refusals, version=refusals.version + 1, kept=(*refusals.kept, event))


def decide(refusals: Refusals, command: KeepRefusal, now: Moment) -> Decision[ProposalRefused]:
    """The same proposal is kept once, with the reasons it was refused for first."""
    if refusals.of(command.candidate) is not None:
        return Accepted(())
    event = ProposalRefused(
        actor=command.actor,
        candidate=command.candidate,
        configuration=command.configuration,
        manifest=command.manifest,
        violations=command.violations,
        at_s=now.wall_s,
    )
    return Accepted((event,))


DECIDER: Decider[Refusals, KeepRefusal, ProposalRefused] = Decider(
    initial=Refusals(), apply=apply, decide=decide, codec=Codec(ProposalRefused)
)
