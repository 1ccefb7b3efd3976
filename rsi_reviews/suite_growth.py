"""Decides and folds the cases that people add to the suite: a disputed or failed mission becomes a case for every later
candidate. Pure.
"""

from collections.abc import Mapping
from types import MappingProxyType

from msgspec.structs import replace

from harness.contracts.actors import Actor, Command, Event
from harness.contracts.decider import Codec, Decider
from harness.contracts.decisions import Accepted, Decision, Refused, refused
from harness.contracts.ids import MissionId, StreamId
from harness.contracts.reasons import because
from harness.contracts.values import Count, Moment, Name, Value
from harness.projections.mission import Mission
from rsi_reviews.contracts import Family, Sentence

GROWTH = StreamId("suite/regression")
NOT_DONE = ("failed", "safe_stopped", "handed_off")
"""How a mission ends whose goal was not reached; one that a person cancelled tells nothing."""
_FAMILIES: Mapping[str, Family] = MappingProxyType(
    {
        "stale-pose": "stale_evidence",
        "missing-pose": "stale_evidence",
        "frozen-localiser": "stale_evidence",
        "lost-localisation": "stale_evidence",
        "biased-localiser": "stale_evidence",
        "duplicate-request": "duplicate_request",
        "interrupted": "interrupted_run",
        "early-success": "interrupted_run",
        "blocked-passage": "resource_conflict",
    }
)


class AddedCase(Value):
    """One mission to run again: a template with its defaults, faults, a seed."""

    family: Family
    template: Name
    faults: tuple[Name, ...]
    seed: Count


class AddCase(Command, tag=True):
    """`mission_id` names where the case comes from."""

    actor: Actor
    mission_id: MissionId
    case: AddedCase
    reason: Sentence


class CaseAdded(Event, tag=True):
    """The regression suite now holds this case. Whoever added it is an author of what is evaluated on it (D33)."""

    actor: Actor
    mission_id: MissionId
    case: AddedCase
    reason: Sentence


class Growth(Value):
    """The cases that people added to the shipped suite on this site, in order."""

    version: Count = 0
    added: tuple[CaseAdded, ...] = ()

    @property
    def hands(self) -> tuple[str, ...]:
        """The people who added a case, once each."""
        return tuple(dict.fromkeys(one.actor.name for one in self.added))


def apply(growth: Growth, event: CaseAdded) -> Growth:
    """The growth after one more event."""
    return replace(growth, version=growth.version + 1, added=(*growth.added, event))


def decide(growth: Growth, command: AddCase, now: Moment) -> Decision[CaseAdded]:
    """Only a person adds a case; a mission becomes one once."""
    if command.actor.channel != "human":
        return refused("not_a_person", because("suite_needs_person"))
    if any(one.mission_id == command.mission_id for one in growth.added):
        return Accepted(())
    same = next((one for one in growth.added if one.case == command.case), None)
    if same is not None:
        return refused("case_known", mission_id=same.mission_id)
    added = CaseAdded(actor=command.actor, mission_id=command.mission_id, case=command.case, reason=command.reason)
    return Accepted((added,))


def case_of(mission: Mission) -> AddedCase | Refused:
    """The case that runs a disputed or failed mission again: its template with its defaults, its faults, its seed."""
    if mission.replay:
        return refused("recorded", because("recording_not_runnable"))
    if not (mission.disputed or mission.status in NOT_DONE):
        return refused("not_disputed")
    faults = tuple(name for name in mission.labels.get("faults", "").split(",") if name)
    families = (_FAMILIES.get(name.partition(":")[0]) for name in faults)
    family: Family = next((one for one in families if one is not None), "nominal")
    return AddedCase(family=family, template=mission.template, faults=faults, seed=mission.seed)


DECIDER: Decider[Growth, AddCase, CaseAdded] = Decider(
    initial=Growth(), apply=apply, decide=decide, codec=Codec(CaseAdded)
)
