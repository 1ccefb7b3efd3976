"""Runs one invocation on the robot: its skill, and its deadline, keepalive and stop."""

from typing import Literal

import msgspec

from harness.contracts import protocol
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.ids import Digest
from harness.contracts.reasons import Explanation, because
from harness.provider_protocol.proposals import intended
from simulator import skill_interface
from simulator.bodies import Velocity
from simulator.proposals import Belief, believed

DEAD_MAN_S = 1.4
STILL_S = 0.2
CRUISING_M = 1.5
Hold = Literal["", "keepalive", "stop", "end"]


class RunningSkill:
    """Runs one skill a tick at a time. Holding always brakes to a standstill before the status changes.

    The heartbeat watchdog brakes from DEAD_MAN_S after the last keepalive, so that the body stands within 2 s (D12).
    """

    def __init__(
        self, card: CapabilityCard, request: protocol.StartRequest, skill: skill_interface.Skill, *, at_s: float
    ) -> None:
        self.card, self.request, self.skill = card, request, skill
        self.handle = f"{card.provider_id}:{request.identity.request_id}"
        self._status: protocol.InvocationStatus = "accepted"
        self._at_s = self._kept_s = at_s
        self._hold: Hold = ""
        self._still_s: float | None = None
        self._text: Explanation = ""
        self._outcome: skill_interface.Outcome | None = None
        self._last = skill_interface.Step()
        self._receipts: list[protocol.Receipt] = []
        self._samples: list[int] = []
        self._blobs: list[Digest] = []
        self._proposed: protocol.ProposedFacts = ()

    @property
    def terminal(self) -> bool:
        return self._status in protocol.TERMINAL

    @property
    def braking(self) -> bool:
        """Whether something outside the skill is braking it."""
        return self._hold != ""

    @property
    def cruising(self) -> bool:
        """Whether it is under way with nothing to decide for a while: far from its end and not held."""
        return self._hold == "" and self._status == "running" and (self.skill.remaining_m or 0.0) > CRUISING_M

    @property
    def held_still(self) -> bool:
        """Whether the heartbeat watchdog has brought it to a standstill."""
        return self._hold == "keepalive" and self._status == "blocked"

    def silent_s(self, at_s: float) -> float:
        """Mission time since it was last kept alive."""
        return at_s - self._kept_s

    def keepalive(self, at_s: float) -> None:
        self._kept_s = at_s

    def stop(self) -> None:
        """Acknowledged as cancelled only once the robot stands."""
        if not self.terminal:
            self._hold, self._status, self._still_s = "stop", "stopping", None

    def brake_for(self, last: skill_interface.Step) -> None:
        """Brake to a standstill, then report `last` as the skill's last status."""
        if self._hold == "":
            self._hold, self._last, self._still_s = "end", last, None

    def resume(self, at_s: float) -> None:
        """Go on after the watchdog stopped it; any other hold remains."""
        if self._hold == "keepalive" and not self.terminal:
            self._hold, self._still_s, self._kept_s, self._status = "", None, at_s, "running"
            self.skill.resume(at_s)

    def tick(self, perception: skill_interface.Perception) -> Velocity:
        """One tick; the velocity that the body is to follow."""
        self._at_s = perception.at_s
        self._watch(perception.at_s)
        if self._hold:
            self._stand(perception)
            return Velocity()
        step = self.skill.step(perception)
        self._take(step, perception)
        return step.command

    def report(self) -> protocol.InvocationReport:
        """The robot's report on it now."""
        outcome = self._outcome
        done = outcome is not None and outcome.status == "succeeded"
        share = 1.0 if done else self.skill.share
        return protocol.InvocationReport(
            handle=self.handle,
            identity=self.request.identity,
            status=self._status,
            at_s=self._at_s,
            progress=protocol.Progress(share=share, text=self._text, remaining_m=self.skill.remaining_m),
            failure=outcome.failure if outcome else protocol.KEEPALIVE_LOST if self.held_still else "",
            message=self._text,
            declared=outcome.declared if outcome else {},
            receipts=tuple(self._receipts),
            samples=tuple(self._samples),
            blobs=tuple(self._blobs),
            proposed_facts=self._proposed,
        )

    def _watch(self, at_s: float) -> None:
        if self._hold in ("stop", "end"):
            return
        if at_s > self.request.deadline_s:
            late = skill_interface.Outcome(status="failed", failure="timeout", message=because("deadline_passed"))
            self._hold, self._last, self._still_s = "end", skill_interface.Step(outcome=late), None
        elif self._hold == "" and self.card.moves and at_s - self._kept_s > DEAD_MAN_S:
            self._hold, self._still_s = "keepalive", None

    def _stand(self, perception: skill_interface.Perception) -> None:
        if not perception.still:
            self._still_s = None
            return
        self._still_s = perception.at_s if self._still_s is None else self._still_s
        if perception.at_s - self._still_s < STILL_S:
            return
        if self._hold == "keepalive":
            self._status, self._text = "blocked", because("keepalive_missed")
        elif self._hold == "stop":
            self._status, self._text = "cancelled", because("stopped_on_request")
        else:
            self._take(self._last, perception)

    def _take(self, step: skill_interface.Step, perception: skill_interface.Perception) -> None:
        for draft in step.drafts:
            self._receipts.append(self._receipt(draft, blob=perception.keep(draft.body) if draft.body else draft.blob))
        for shot in step.shots:
            self._samples.append(shot.seq)
            self._blobs.append(shot.blob)
        if step.outcome is not None:
            self._outcome, self._status, self._text = step.outcome, step.outcome.status, step.outcome.message or ""
            if step.outcome.status == "succeeded":
                self._proposed = self._believed(step.outcome, perception)
            return
        self._status = "blocked" if step.blocked else "running"
        self._text = step.blocked or because("under_way")

    def _believed(
        self, outcome: skill_interface.Outcome, perception: skill_interface.Perception
    ) -> protocol.ProposedFacts:
        """What the robot proposes at the end of a success, of the effects that it was asked for."""
        belief = Belief(
            frame=perception.frame,
            map_version=perception.map_version,
            at_m=(perception.x_m, perception.y_m),
            still=perception.still,
        )
        made = (
            believed(
                one,
                capability=self.card.capability,
                outcome=outcome,
                belief=belief,
                images=tuple(self._blobs),
            )
            for one in intended(self.request)
        )
        return tuple(one for one in made if one is not None)

    def _receipt(self, draft: skill_interface.Draft, *, blob: Digest | None) -> protocol.Receipt:
        request = self.request.identity.request_id
        return protocol.Receipt(
            receipt_id=f"{draft.kind}-{request[:16]}-{len(self._receipts)}",
            kind=draft.kind,
            at_s=draft.at_s,
            source=self.card.provider_id,
            request_id=request,
            text=draft.text,
            blob=blob,
            values=draft.values,
        )


def restarted(report: protocol.InvocationReport) -> protocol.InvocationReport:
    """The status of an invocation that a restart of the robot cut off."""
    message = because("robot_restarted_under_way")
    return msgspec.structs.replace(report, status="failed", failure="robot_restarted", message=message)
