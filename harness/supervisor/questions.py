"""Builds what a person is asked: a snapshot of the robot now, and exactly what an approval would let run."""

import math
from dataclasses import dataclass
from itertools import islice, pairwise

from msgspec import UNSET, UnsetType
from msgspec.structs import replace

from harness.contexts.recovery import recovery_context
from harness.contracts.configuration import RecoveryAction
from harness.contracts.decisions import Refused
from harness.contracts.errors import ProviderFailed
from harness.contracts.handoff_events import LONGEST_WAIT_S, SLOWEST_MPS, ProposedAction, Snapshot
from harness.contracts.ids import Digest, NodeId, PlaceId, ProviderId
from harness.contracts.observations import Image, Odometry, Pose
from harness.contracts.proposals import RecoveryProposal
from harness.contracts.reasons import Reason, because
from harness.contracts.revision_commands import RevisedPlan
from harness.contracts.values import decode, digest, encode
from harness.gate.revisions import revised_ahead
from harness.planning.revision import revision_refusal
from harness.projections.mission import Mission, eligible, required_contract, required_policy
from harness.recovery.state import cost_of, ladder_of, over_budget
from harness.supervisor.dispatch import DispatchAttempt, Dispatcher, PreparedDispatch
from harness.supervisor.revisions import Revisions
from harness.supervisor.roles import RoleContexts
from harness.verification.preconditions import verify_preconditions

OFFERED: tuple[RecoveryAction, ...] = (
    "retry",
    "verify_again",
    "re_perceive",
    "adjust_view",
    "local_replan",
    "switch_skill",
)
"""What a person can let run; the first is proposed unless they choose. A retry here is an operator's: no budget."""
ALWAYS: tuple[RecoveryAction, ...] = ("retry", "verify_again")
PLANNED: tuple[RecoveryAction, ...] = ("re_perceive", "adjust_view", "local_replan")
"""Steps that go on with another plan, where one is found."""
WAITS_BY: RecoveryAction = "local_replan"
"""What waiting at another place counts as: the stage goes on with another plan."""
MOST_PLACES = 3


@dataclass(frozen=True)
class Wish:
    """What a person wants proposed: a step, and for this one start a wait and a lower speed limit.

    `plan` is the record of the plan that was shown with it; a new one is made where none is named. With a
    `waiting_place` the robot goes there first, stands there for `wait_s`, and then goes on.
    """

    action: RecoveryAction = "retry"
    wait_s: float = 0.0
    speed_cap_mps: float | None = None
    plan: Digest | None = None
    waiting_place: PlaceId | None = None


class Questions:
    """Reads the robot and prepares invocations; writes only pictures, sensor samples and proposed plans."""

    def __init__(self, roles: RoleContexts, dispatcher: Dispatcher) -> None:
        self._roles = roles
        self._runtime = roles.runtime
        self._connection = roles.connection
        self._dispatcher = dispatcher
        self._revisions = Revisions(roles)

    def attempt(self, mission: Mission, node_id: NodeId, wish: Wish) -> DispatchAttempt | None:
        """One further attempt as wished: a retry outside the budget (D1), any other at its own cost.

        None where no other route can be planned.
        """
        state, action = mission.of(node_id), wish.action
        cost = 0 if action == "retry" else cost_of(action)
        provider = state.provider_id if action in ("retry", "local_replan") else None
        if action == "switch_skill":
            provider = self._other(mission, node_id)
        failure = state.failures[-1].failure
        step = RecoveryProposal(
            action=action, failure=failure, provider_id=provider, cost=cost, reason=because("chosen_by_person")
        )
        paid = cost and state.failure is not None
        c4 = recovery_context(self._roles.view(mission), node_id, self._connection.cards) if paid else None
        planned = c4 is not None and (action in PLANNED or wish.waiting_place is not None)
        plan = self._plan(mission, node_id, step, wish) if planned else None
        first = _first(mission, plan, step) if plan is not None else node_id
        if first is None or (plan is None and action == "local_replan"):
            return None
        if first != node_id:
            step = replace(step, provider_id=None)
        aside = (wish.waiting_place, wish.wait_s) if wish.waiting_place is not None else None
        return DispatchAttempt(
            node_id=first,
            recovery=step,
            c4=c4,
            plan=plan,
            wait_s=0.0 if aside else wish.wait_s,
            speed_cap_mps=wish.speed_cap_mps,
            aside=aside,
        )

    def proposal(self, mission: Mission, node_id: NodeId, wish: Wish) -> ProposedAction | None:
        """Exactly what an approval would let run, once; None where no provider can do it now."""
        attempt = self.attempt(mission, node_id, wish)
        return self.proposed(mission, attempt, self._dispatcher.prepare(mission, attempt)) if attempt else None

    def proposed(
        self, mission: Mission, attempt: DispatchAttempt, prepared: PreparedDispatch | Refused
    ) -> ProposedAction | None:
        """What a person is shown of a prepared invocation; None where no provider can do it."""
        if isinstance(prepared, Refused) or attempt.recovery is None:
            return None
        intent, cap_mps = prepared.intent, required_contract(mission).constraints.speed_cap_mps
        place_id, wait_s = attempt.aside or (UNSET, attempt.wait_s)
        return ProposedAction(
            mission_id=mission.mission_id,
            node_id=attempt.node_id,
            attempt=intent.attempt,
            action=attempt.recovery.action,
            provider_id=intent.provider_id,
            provider_version=intent.provider_version,
            parameters=intent.parameters,
            configuration=mission.configuration,
            graph_revision=mission.graph_revision + (attempt.plan is not None),
            limits={
                "speed_cap_mps": min(attempt.speed_cap_mps or cap_mps, cap_mps),
                "timeout_s": round(intent.deadline_s - (intent.not_before_s or intent.dispatched_s), 3),
            },
            spends=attempt.recovery.cost,
            wait_s=wait_s or UNSET,
            plan=self._runtime.keep(encode(attempt.plan)) if attempt.plan else UNSET,
            waiting_place=place_id,
        )

    def first(self, mission: Mission, node_id: NodeId) -> Wish:
        """What is proposed when the question opens: another route where the way is closed and one is known."""
        closed = mission.of(node_id).failures[-1].failure == "no_progress"
        return Wish("local_replan") if closed and "local_replan" in self.choices(mission, node_id) else Wish()

    def wished(self, mission: Mission, proposal: ProposedAction | None, *, again: bool) -> Wish:
        """What the current proposal was wished for; an operator's retry where there is none.

        `again`: another plan is made from where the robot stands now, instead of the one that was shown.
        """
        if proposal is None:
            return Wish()
        limit_mps = proposal.limits["speed_cap_mps"]
        slower = limit_mps < required_contract(mission).constraints.speed_cap_mps
        return Wish(
            action=proposal.action,
            wait_s=0.0 if isinstance(proposal.wait_s, UnsetType) else proposal.wait_s,
            speed_cap_mps=limit_mps if slower else None,
            plan=None if again or isinstance(proposal.plan, UnsetType) else proposal.plan,
            waiting_place=None if isinstance(proposal.waiting_place, UnsetType) else proposal.waiting_place,
        )

    def outside(self, mission: Mission, wish: Wish) -> Reason | None:
        """Why no start may wait so long or drive so fast or slowly, or None."""
        if not 0 <= wish.wait_s <= LONGEST_WAIT_S:
            return because("wait_too_long", wait_s=wish.wait_s, limit_s=LONGEST_WAIT_S)
        if wish.waiting_place is not None and not wish.wait_s:
            return because("waits_no_time", place=wish.waiting_place)
        speed_mps, cap_mps = wish.speed_cap_mps, _cap_mps(mission)
        if speed_mps is None or SLOWEST_MPS <= speed_mps <= cap_mps:
            return None
        return because("speed_outside", speed_mps=speed_mps, low_mps=SLOWEST_MPS, high_mps=cap_mps)

    def unfit(self, wish: Wish, proposal: ProposedAction) -> Reason | None:
        """Why what is proposed cannot be driven at the wished speed, or None."""
        if wish.speed_cap_mps is None:
            return None
        speed_mps = proposal.parameters.get("speed_cap_mps")
        if not isinstance(speed_mps, int | float):
            return because("action_drives_nowhere", action=wish.action)
        length_m, timeout_s = _length_m(proposal.parameters.get("route")), proposal.limits["timeout_s"]
        if length_m / speed_mps > timeout_s:
            return because("too_slow_for_stage", length_m=length_m, speed_mps=speed_mps, timeout_s=timeout_s)
        return None

    def choices(self, mission: Mission, node_id: NodeId) -> tuple[RecoveryAction, ...]:
        """What could be proposed: an operator's retry, a look, and the ladder's steps that the budget still pays.

        A way round only where the map shows one.
        """
        ladder = ladder_of(mission.of(node_id).failures[-1].failure, required_policy(mission))
        return tuple(
            action
            for action in OFFERED
            if (action in ALWAYS or action in ladder)
            and not (action != "retry" and over_budget(mission, node_id, action))
            and not (action == "switch_skill" and self._other(mission, node_id) is None)
            and not (action == "local_replan" and self.attempt(mission, node_id, Wish(action)) is None)
        )

    def waiting_places(self, mission: Mission, node_id: NodeId) -> tuple[PlaceId, ...]:
        """Where the robot could wait before it goes on with this stage: where a plan with that leg could begin now."""
        ladder = ladder_of(mission.of(node_id).failures[-1].failure, required_policy(mission))
        if WAITS_BY not in ladder or mission.of(node_id).failure is None or over_budget(mission, node_id, WAITS_BY):
            return ()
        names = (place.place_id for place in self._revisions.waiting_places(mission))
        wishes = (Wish(WAITS_BY, wait_s=LONGEST_WAIT_S, waiting_place=one) for one in names)
        found = (one.waiting_place for one in wishes if self.attempt(mission, node_id, one) is not None)
        return tuple(islice((one for one in found if one is not None), MOST_PLACES))

    def _plan(self, mission: Mission, node_id: NodeId, step: RecoveryProposal, wish: Wish) -> RevisedPlan | None:
        """The plan that was shown, or another one; None where none is found that the gate would accept."""
        if wish.plan is not None:
            return decode(self._runtime.blob(wish.plan), RevisedPlan)
        if wish.waiting_place is not None:
            plan = self._revisions.waiting(mission, node_id, wish.waiting_place, wish.wait_s)
        else:
            plan = self._revisions.plan(mission, node_id, step)
        refused = plan and revision_refusal(mission, plan.contract, reopened=plan.reopened)
        return None if refused else plan

    def snapshot(self, mission: Mission, node_id: NodeId) -> Snapshot:
        """Looks at the robot now, without motion: a picture where its camera gives one, then its sensor samples.

        The picture comes first, since a camera is slow and a judgement of standstill needs the newest odometry.
        """
        image = self._picture()
        self._roles.observations.collect(None)
        now, recent = self._connection.clock.now(), self._roles.observations.recent
        pose = next((s for s in reversed(recent) if isinstance(s, Pose)), None)
        where = pose or next((s for s in reversed(recent) if isinstance(s, Odometry)), None)
        return Snapshot(
            at_s=now.mission_s,
            taken_at_s=now.wall_s,
            x_m=where.x_m if where else 0.0,
            y_m=where.y_m if where else 0.0,
            yaw_rad=where.yaw_rad if where else 0.0,
            static=self._roles.observations.rest().static,
            results=digest(self.results(mission, node_id)),
            image=image,
        )

    def results(self, mission: Mission, node_id: NodeId) -> tuple[tuple[str, str], ...]:
        """Every condition's current result: the last verdict's, and the preconditions tested now."""
        view, state = self._roles.view(mission), mission.of(node_id)
        fresh = verify_preconditions(
            view.node(node_id),
            status=view.status,
            recent=view.recent,
            facts=mission.facts,
            at_s=view.at_s,
            rules=view.rules,
        )
        judged = state.verdicts[-1].results if state.verdicts else ()
        return tuple((result.condition_id, result.verdict) for result in (*judged, *fresh))

    def evidence(self, mission: Mission, node_id: NodeId, snapshot: Snapshot) -> Digest:
        """What the question rests on: packets, verdicts and the snapshot."""
        state = mission.of(node_id)
        return digest(
            {
                "packets": [packet.identity.packet_id for packet in state.packets],
                "verdicts": [digest(verdict) for verdict in state.verdicts],
                "snapshot": digest(snapshot),
            }
        )

    def _picture(self) -> Digest | None:
        """The camera's current picture; else the newest frame from the sensors. A question also opens without one."""
        seen = next((s.blob for s in reversed(self._roles.observations.recent) if isinstance(s, Image)), None)
        if self._connection.camera is None:
            return seen
        try:
            return self._runtime.keep(self._connection.camera.picture().body)
        except ProviderFailed:
            return seen

    def _other(self, mission: Mission, node_id: NodeId) -> ProviderId | None:
        """Another provider for this node that was not given up."""
        node, state = required_contract(mission).node(node_id), mission.of(node_id)
        return next(
            (
                card.provider_id
                for card in self._connection.cards
                if card.capability in node.capabilities
                and card.provider_id != state.provider_id
                and card.provider_id not in state.excluded
            ),
            None,
        )


def _first(mission: Mission, plan: RevisedPlan, step: RecoveryProposal) -> NodeId | None:
    """The stage that would begin first on this plan; None where none could."""
    ahead = revised_ahead(mission, plan, step)
    mine = {plan.node_id, *plan.reopened, *(set(ahead.nodes) - set(mission.nodes))}
    return next((one for one in eligible(ahead) if one in mine), None)


def _cap_mps(mission: Mission) -> float:
    return required_contract(mission).constraints.speed_cap_mps


def _length_m(route: object) -> float:
    points = route if isinstance(route, tuple | list) else ()
    return math.fsum(math.dist(a, b) for a, b in pairwise(points))
