"""Shapes a robot's newest return to a safe point, or why it lay down instead: declared and measured, never accepted
(D27)."""

from dataclasses import dataclass

from app.i18n.messages import lazy_gettext, reasoned
from harness.contracts.control import PostureOrdered
from harness.contracts.reasons import Reason
from harness.contracts.retreat_events import RetreatEnded, RetreatIntended
from harness.projections.control import Retreating

OLD_S = 86400.0
"""How long an ended return stays on the robot's page in seconds, unless a mission of the robot begins earlier."""


@dataclass(frozen=True)
class LastRetreat:
    """A return as the robot's page shows it: whether it is under way, or when it ended in wall seconds."""

    text: str
    moving: bool
    ended_at_s: float


def last_retreat(
    retreat: Retreating | None, *, ended_at_s: float, mission_began_s: float, now_s: float
) -> LastRetreat | None:
    """None where there was none, or it is of no matter any more: the audit log still has it. Wall seconds.

    `ended_at_s` is when its end was recorded; `mission_began_s` when the robot's newest mission was created, 0 if none.
    """
    if retreat is None:
        return None
    if retreat.ended is None:
        return LastRetreat(text=_under_way(retreat.intent), moving=True, ended_at_s=0.0)
    if _of_no_matter(ended_at_s, mission_began_s=mission_began_s, now_s=now_s):
        return None
    return LastRetreat(text=_over(retreat.intent, retreat.ended), moving=False, ended_at_s=ended_at_s)


def lain_down(order: PostureOrdered, *, at_s: float, mission_began_s: float, now_s: float) -> LastRetreat | None:
    """Why the robot was not sent to its safe point and was told to lie down where it stood; None for any other order,
    and where it is of no matter any more. Wall seconds.
    """
    reason = order.reason
    if not isinstance(reason, Reason) or reason.code != "no_retreat_lies_down":
        return None
    if _of_no_matter(at_s, mission_began_s=mission_began_s, now_s=now_s):
        return None
    text = lazy_gettext(
        "{who} sent it to safety ({reason}). It could not be sent to its safe point and was told to lie down where it "
        "stood. {why}",
        who=order.actor.name,
        reason=reason.facts["reason"],
        why=reasoned(reason.facts["why"]),  # type: ignore[arg-type]
    )
    return LastRetreat(text=text, moving=False, ended_at_s=at_s)


def _of_no_matter(at_s: float, *, mission_began_s: float, now_s: float) -> bool:
    """Whether it is long ago, or a mission of the robot has begun since."""
    return now_s - at_s >= OLD_S or mission_began_s >= at_s


def _under_way(intent: RetreatIntended) -> str:
    return lazy_gettext(
        "On the way to {place}, started by {who}, authorised on {day} by {authority}. It is no stage of a mission.",
        place=intent.place,
        who=intent.actor.name,
        day=intent.authorised_on,
        authority=intent.authorised_by,
    )


def _over(intent: RetreatIntended, ended: RetreatEnded) -> str:
    reason = reasoned(ended.reason).rstrip(".")
    match ended.outcome:
        case "reached":
            return lazy_gettext(
                "Sent to {place}: measured {distance} m from it, declared {declared}. No facts are accepted from this.",
                place=intent.place,
                distance=f"{ended.measured.get('distance_m', 0.0):.2f}",
                declared=ended.declared,
            )
        case "short":
            return lazy_gettext("Sent to {place}; arrival not confirmed. {reason}.", place=intent.place, reason=reason)
        case _:
            return lazy_gettext(
                "Sent to {place}: how it ended is unknown, and it is not sent again. {reason}.",
                place=intent.place,
                reason=reason,
            )
