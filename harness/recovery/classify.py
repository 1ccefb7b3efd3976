"""Classifies a failed result into its failure class. Pure: proposes no recovery."""

from typing import get_args

from harness.contracts.configuration import FailureClass
from harness.contracts.protocol import InvocationStatus
from harness.contracts.verdicts import Verdict

_CLASSES: frozenset[str] = frozenset(get_args(FailureClass))

_WORDS: dict[str, FailureClass] = {
    "unsafe": "unsafe_action",
    "collision": "unsafe_action",
    "safety_stop": "unsafe_action",
    "hardware_stop": "unsafe_action",
    "fallen": "unsafe_action",
    "deadline": "timeout",
    "cancelled": "interrupted",
    "keepalive_lost": "interrupted",
    "playback_differs": "interrupted",
    "robot_restarted": "interrupted",
    "blocked": "no_progress",
    "blocked_passage": "no_progress",
    "unreachable": "no_progress",
    "route_not_reachable": "no_progress",
    "nothing_found": "target_not_found",
    "passage_not_seen": "target_not_found",
    "poses_disagree": "ambiguous",
    "provider_failed": "provider_unavailable",
    "provider_unreachable": "provider_unavailable",
    "store_unavailable": "provider_unavailable",
    "blob_damaged": "provider_unavailable",
    "fencing_refused": "resource_conflict",
    "lease_conflict": "resource_conflict",
    "localisation_lost": "precondition_unmet",
    "not_localised": "precondition_unmet",
}


def classify(
    *,
    verdict: Verdict | None,
    terminal: InvocationStatus | None,
    failure_word: str = "",
    rule: str = "",
    unverified: bool = False,
) -> FailureClass | None:
    """Unsafe first, else how the execution ended, else the verdict (D24). None when nothing failed.

    `terminal` is the supervisor's last status (None: never dispatched), `failure_word` the card's failure code or the
    supervisor's reason, `rule` the gate's rule if it refused. `unverified`: no verifier could answer (R45).
    """
    word = _of_word(failure_word)
    if verdict == "unsafe" or word == "unsafe_action":
        return "unsafe_action"
    ended = _of_ending(terminal, word)
    if ended is not None:
        return ended
    if rule == "obsolete_version":
        return "stale_evidence"
    if unverified and verdict == "ambiguous":
        return "verifier_unavailable"
    judged = _of_verdict(verdict)
    if judged is not None:
        return judged
    if terminal in ("failed", "cancelled", "blocked"):
        return None if verdict == "satisfied" and not rule else "interrupted"
    return "commit_rejected" if rule else None


def _of_word(failure_word: str) -> FailureClass | None:
    name = failure_word.strip().casefold().replace(" ", "_").replace("-", "_")
    known: dict[str, FailureClass] = {name: name} if name in _CLASSES else {}  # type: ignore[dict-item]
    return known.get(name) or _WORDS.get(name)


def _of_ending(terminal: InvocationStatus | None, word: FailureClass | None) -> FailureClass | None:
    match terminal:
        case "outcome_unknown":
            return "outcome_unknown"
        case "stopping":
            return "cancel_unacknowledged"
        case "succeeded":
            return None
        case _:
            return word


def _of_verdict(verdict: Verdict | None) -> FailureClass | None:
    match verdict:
        case "stale":
            return "stale_evidence"
        case "violated":
            return "violated"
        case "ambiguous":
            return "ambiguous"
        case _:
            return None
