"""What a person says about a candidate, from a form to the desk's word. Parses; decides nothing."""

from collections.abc import Callable, Mapping
from typing import Any, get_args

from app.auth.guarded_releases import GuardedReleaseService
from harness.contracts.actors import Actor
from harness.contracts.decider import Codec
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.errors import ContractInvalid
from harness.contracts.ids import Digest, MissionId, RobotId
from harness.contracts.reasons import because
from rsi_reviews.contracts import Finding, Subject
from rsi_reviews.events import CandidateEvent, ReviewOpened
from rsi_reviews.release_service import SeenSubject, SignedBy

Typed = Mapping[str, str]
Answered = Accepted[Any] | Refused
ReviewAct = Callable[[GuardedReleaseService, Digest, SignedBy, SeenSubject, Typed], Answered]
CODEC: Codec[CandidateEvent] = Codec(CandidateEvent)
LONGEST_KEY = 200


def say_of(actor: Actor, typed: Typed, word: str) -> SignedBy:
    """Who, why and under which one-use key. Raises ContractInvalid without a key."""
    key = typed.get("key", "")
    if not 1 <= len(key) <= LONGEST_KEY:
        raise ContractInvalid(because("form_without_key"), where="key")
    return SignedBy(actor=actor, reason=typed.get("reason", "").strip(), key=f"{word}:{key}"[:LONGEST_KEY])


def seen_of(typed: Typed) -> SeenSubject:
    """What the form was shown with. What it does not name equals nothing, and so is refused by the desk."""
    cycle = typed.get("cycle", "")
    known = cycle.isascii() and cycle.isdigit() and len(cycle) < 10
    return SeenSubject(cycle=int(cycle) if known else 0, subject=Digest(typed.get("subject", "")))


def robot_of(typed: Typed) -> RobotId:
    """Raises ContractInvalid where none is named."""
    if not typed.get("robot_id", "").strip():
        raise ContractInvalid(because("no_canary_robot"), where="robot_id")
    return RobotId(typed["robot_id"].strip())


def finding_of(text: str) -> Finding:
    """Raises ContractInvalid for a finding that nobody can make."""
    for finding in get_args(Finding):
        if finding == text:
            known: Finding = finding
            return known
    raise ContractInvalid(because("finding_invalid", text=text[:40], known=tuple(get_args(Finding))), where="finding")


def subject_in(releases: GuardedReleaseService, candidate: str, digest: str) -> Subject | None:
    """The subject that a form was shown with, as it stood when its review was opened."""
    opened = (CODEC.decode(stored) for stored in releases.events(candidate))
    return next((one.subject for one in opened if isinstance(one, ReviewOpened) and one.subject_digest == digest), None)


WORDS: Mapping[str, ReviewAct] = {
    "submit": lambda releases, name, say, seen, typed: releases.submit(name, say),
    "comment": lambda releases, name, say, seen, typed: releases.comment(name, say),
    "recall": lambda releases, name, say, seen, typed: releases.recall(name, say),
    "request-changes": lambda releases, name, say, seen, typed: releases.request_changes(name, say, seen),
    "approve": lambda releases, name, say, seen, typed: releases.approve(name, say, seen),
    "reject": lambda releases, name, say, seen, typed: releases.reject(name, say, seen),
    "authorise": lambda releases, name, say, seen, typed: releases.authorise(name, say, seen),
    "release": lambda releases, name, say, seen, typed: releases.release(name, say, seen, robot_id=robot_of(typed)),
    "adjudicate": lambda releases, name, say, seen, typed: releases.adjudicate(
        name, MissionId(typed.get("mission_id", "")), finding_of(typed.get("finding", "")), say
    ),
    "rollback": lambda releases, name, say, seen, typed: releases.rollback(name, say),
    "withdraw": lambda releases, name, say, seen, typed: releases.withdraw(name, say),
}
"""By the word in the address."""
