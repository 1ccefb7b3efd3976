"""Decides whether the release pointer may move: it names versions that exist, one canary at a time, and keeps its
history. Pure.
"""

from typing import assert_never

from harness.contracts.decider import Codec, Decider
from harness.contracts.decisions import Accepted, Decision, Refused, refused
from harness.contracts.ids import Digest
from harness.contracts.reasons import because
from harness.contracts.values import Moment
from rsi_reviews import commands, events
from rsi_reviews.approval_policy import repeated, signed
from rsi_reviews.pointers import Pointer, apply
from rsi_reviews.release import PEOPLE

ALPHA = 0.05
"""Spent over all held-out looks: the k-th gets ALPHA / (k (k + 1)), which adds up to ALPHA however many there are."""


def decide(pointer: Pointer, command: commands.PointerCommand, now: Moment) -> Decision[events.PointerEvent]:
    """Accept or refuse one command at the pointer."""
    match command:
        case commands.OpenPointer():
            return _opened(pointer, command, now)
        case commands.Confirm():
            return _stale(pointer, command) or Accepted(())
        case commands.MovePointer():
            return _moved(pointer, command, now)
        case commands.SavePolicy():
            return _policy(pointer, command, now)
        case commands.CountLook():
            return _look(pointer, command, now)
        case commands.RecordUptake():
            return _uptake(pointer, command, now)
        case commands.RetireVersion():
            return _retired(pointer, command, now)
        case _:
            assert_never(command)


def _opened(pointer: Pointer, command: commands.OpenPointer, now: Moment) -> Decision[events.PointerEvent]:
    if pointer.version:
        return Accepted(())
    shipped = events.PointerMoved(
        revision=0,
        cause="shipped",
        configuration=command.configuration,
        rollback=command.configuration,
        released=None,
        canary=None,
        trial=None,
        robot_id=None,
        actor=command.actor,
        reason="what the program ships",
        at_s=now.wall_s,
    )
    return Accepted((shipped,))


def _stale(pointer: Pointer, command: commands.Confirm) -> Refused | None:
    if command.baseline is not None and command.baseline != pointer.configuration:
        return refused(
            "stale_baseline",
            baseline=command.baseline[:12],
            current=pointer.configuration[:12],
            revision=pointer.revision,
        )
    if command.policy is not None and command.policy != pointer.policy:
        return refused("policy_changed", policy=pointer.policy.kind)
    return _unusable(pointer, command.configuration) if command.configuration is not None else None


def _unusable(pointer: Pointer, configuration: Digest) -> Refused | None:
    if bad := pointer.quarantined.get(configuration):
        return refused(
            "quarantined",
            because("configuration_rolled_back", configuration=configuration[:12], at_s=bad.at_s, reason=bad.reason),
        )
    if configuration in pointer.retired:
        return refused("retired", because("configuration_retired", configuration=configuration[:12]))
    return None


def _moved(pointer: Pointer, command: commands.MovePointer, now: Moment) -> Decision[events.PointerEvent]:
    match command.cause:
        case "canary":
            if pointer.trial is not None:
                return refused("canary_open", trial=pointer.trial[:12])
            confirm = commands.Confirm(baseline=command.rollback, configuration=command.configuration)
            if stale := _stale(pointer, confirm):
                return stale
            return Accepted((_move(pointer, command, now),))
        case "released" | "withdrawn":
            if pointer.trial != command.candidate:
                return refused("not_in_canary", because("candidate_not_in_canary", candidate=command.candidate[:12]))
            return Accepted((_move(pointer, command, now),))
        case "rolled_back":
            return _rolled_back(pointer, command, now)
        case _:
            assert_never(command.cause)


def _rolled_back(pointer: Pointer, command: commands.MovePointer, now: Moment) -> Decision[events.PointerEvent]:
    if command.candidate not in (pointer.trial, pointer.released):
        return refused("not_current", candidate=command.candidate[:12])
    if command.candidate == pointer.released and command.rollback != pointer.rollback:
        return refused("other_rollback", because("rollback_fixed", rollback=pointer.rollback[:12]))
    quarantined = events.ConfigurationQuarantined(
        configuration=command.configuration, candidate=command.candidate, reason=command.reason, at_s=now.wall_s
    )
    return Accepted((_move(pointer, command, now), quarantined))


def _move(pointer: Pointer, command: commands.MovePointer, now: Moment) -> events.PointerMoved:
    """The pointer after the move. Going back restores the former candidate and the former rollback version."""
    configuration, rollback, released = pointer.configuration, pointer.rollback, pointer.released
    if command.cause == "released":
        configuration, rollback, released = command.configuration, command.rollback, command.candidate
    elif command.cause == "rolled_back" and command.candidate == pointer.released:
        configuration = command.rollback
        before = pointer.standing(configuration)
        rollback, released = (before.rollback, before.released) if before else (configuration, None)
    begins = command.cause == "canary"
    return events.PointerMoved(
        revision=pointer.revision + 1,
        cause=command.cause,
        configuration=configuration,
        rollback=rollback,
        released=released,
        canary=command.configuration if begins else None,
        trial=command.candidate if begins else None,
        robot_id=command.robot_id if begins else None,
        actor=command.actor,
        reason=command.reason,
        at_s=now.wall_s,
    )


def _policy(pointer: Pointer, command: commands.SavePolicy, now: Moment) -> Decision[events.PointerEvent]:
    """Refuses a policy that nobody could satisfy when it is saved, not when it is first needed."""
    if (again := repeated(command, pointer.receipts)) is not None:
        return again
    policy, people = command.policy, {*command.reviewers, *command.releasers}
    if command.actor.channel != "human":
        return refused("not_a_person", because("policy_needs_person", actor=command.actor.name))
    if policy.quorum < 1:
        return refused("quorum", because("quorum_of_none"))
    if len({*command.reviewers}) < policy.quorum or not command.releasers:
        return refused(
            "nobody_could",
            because(
                "too_few_people",
                quorum=policy.quorum,
                reviewers=len({*command.reviewers}),
                releasers=len({*command.releasers}),
            ),
        )
    if policy.kind == "two_person" and len(people) < PEOPLE:
        return refused("nobody_could", because("two_people_needed", people=tuple(people)))
    if policy.kind == "single_operator" and policy.cooling_off_s <= 0:
        return refused("cooling_off", because("cooling_off_needed"))
    if policy.authorisation_s <= 0:
        return refused("nobody_could", because("authorisation_ends_at_once"))
    return Accepted((events.PolicySaved(policy=policy, by=signed(command, now)),))


def _look(pointer: Pointer, command: commands.CountLook, now: Moment) -> Decision[events.PointerEvent]:
    """One look per candidate, each under its own number, and none may spend more than its share of ALPHA (D32)."""
    answer = command.answer
    if (taken := pointer.look_of(command.candidate)) is not None:
        if (taken.terms, taken.look) == (command.terms, answer.look):
            return Accepted(())
        return refused("look_taken", candidate=command.candidate[:12], at_s=taken.at_s)
    if any(look.look == answer.look for look in pointer.looks):
        return refused("look_counted_twice", look=answer.look)
    if answer.alpha > ALPHA / (answer.look * (answer.look + 1)) + 1e-12:
        return refused("alpha_overspent", look=answer.look, spent=answer.alpha, alpha=ALPHA)
    looked = events.HeldOutLooked(
        candidate=command.candidate, terms=command.terms, look=answer.look, alpha=answer.alpha, at_s=now.wall_s
    )
    return Accepted((looked,))


def _uptake(pointer: Pointer, command: commands.RecordUptake, now: Moment) -> Decision[events.PointerEvent]:
    if command.revision > pointer.revision:
        return refused("no_revision", revision=command.revision, latest=pointer.revision)
    latest = next((one for one in reversed(pointer.uptakes) if one.worker == command.worker), None)
    if latest is not None and latest.revision >= command.revision:
        return Accepted(())
    return Accepted((events.UptakeRecorded(worker=command.worker, revision=command.revision, at_s=now.wall_s),))


def _retired(pointer: Pointer, command: commands.RetireVersion, now: Moment) -> Decision[events.PointerEvent]:
    if (again := repeated(command, pointer.receipts)) is not None:
        return again
    if command.configuration in (pointer.configuration, pointer.canary, pointer.rollback):
        return refused("in_use", because("configuration_in_use", configuration=command.configuration[:12]))
    if command.pinned:
        return refused("pinned_missions", missions=tuple(command.pinned[:5]))
    return Accepted((events.VersionRetired(configuration=command.configuration, by=signed(command, now)),))


DECIDER: Decider[Pointer, commands.PointerCommand, events.PointerEvent] = Decider(
    initial=Pointer(), apply=apply, decide=decide, codec=Codec(events.PointerEvent)
)
