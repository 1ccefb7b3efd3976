"""Decides whether a result of the conformance kit is recorded. Pure."""

from harness.contracts.admissions import RecordCheck, RobotChecked
from harness.contracts.decider import Codec, Decider
from harness.contracts.decisions import Accepted, Decision, refused
from harness.contracts.reasons import because
from harness.contracts.values import Moment
from harness.projections.admissions import Admissions, apply


def decide(admissions: Admissions, command: RecordCheck, now: Moment) -> Decision[RobotChecked]:
    """Refuse a result of a robot that was moved without anybody's word that it stands clear, and one named twice."""
    names = [one.provider_id for one in command.checked]
    if len(set(names)) != len(names):
        return refused("named_twice", because("provider_named_twice"))
    moved = tuple(one.provider_id for one in command.checked if one.moves)
    if moved and not command.stands_clear:
        return refused("not_stood_clear", because("moved_without_confirmation", providers=moved))
    return Accepted(
        (
            RobotChecked(
                actor=command.actor,
                robot_id=command.robot_id,
                address=command.address,
                checked=command.checked,
                result=command.result,
                stands_clear=command.stands_clear,
                reason=command.reason,
                at_s=now.wall_s,
            ),
        )
    )


DECIDER: Decider[Admissions, RecordCheck, RobotChecked] = Decider(
    initial=Admissions(), apply=apply, decide=decide, codec=Codec(RobotChecked)
)
