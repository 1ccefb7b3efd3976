"""Runs the return of one robot to its safe point: sends it once, keeps it alive, stops it, and measures its end (D27).

What an earlier process left open is never sent again: it is stopped where it still runs, and its end is unknown (D13).
"""

from contextlib import suppress
from math import hypot

from harness.contracts import protocol, retreat_events
from harness.contracts.control import CONTROL
from harness.contracts.errors import HarnessError, ProviderFailed, ProviderUnreachable
from harness.contracts.ids import Digest, ProviderId
from harness.contracts.observations import Odometry, Pose
from harness.contracts.ports import Provider
from harness.contracts.protocol import RobotStatus
from harness.contracts.reasons import Reason, because, plain, recorded
from harness.gate.commit import CommandEnvelope
from harness.projections.control import Retreating, SiteControl
from harness.runtime import Runtime
from harness.supervisor import invocation_monitor
from harness.supervisor.fallback_stop import settle
from harness.supervisor.leases import SUPERVISOR, HeldLeases, give_back, holds
from harness.supervisor.minimal_risk import hindrance
from harness.supervisor.observations import ObservationBuffer
from harness.supervisor.robot_connection import RobotConnection
from harness.supervisor.roles import RoleContexts
from harness.supervisor.standstill import AGE_S, Rest
from harness.supervisor.zones import ARRIVED_M
from harness.verification.predicates.arrival import SAMPLES
from harness.verification.sources import Sources

SILENT_S = 6 * invocation_monitor.UNREACHABLE_S
"""Mission seconds of silence after which the outcome is unknown, however slowly the wall clock goes."""


class Returning:
    """The return of one robot. The fold of the control stream says whether there is one; handles live in memory."""

    def __init__(self, *, runtime: Runtime, connection: RobotConnection) -> None:
        self._runtime = runtime
        self._connection = connection
        self._roles = RoleContexts(
            runtime=runtime,
            connection=connection,
            observations=ObservationBuffer(runtime=runtime, connection=connection),
        )
        left = self._open()
        self._found = left.intent.invocation_id if left else None
        self._handle: str | None = None
        self._sent = self._resumed = False
        self._silent_since: tuple[float, float] | None = None
        self._stopping_since: float | None = None
        self._ended_since: float | None = None

    def halt(self) -> None:
        """Tell the provider to stop the return that a person asked to stop, at once; the next step reads the rest."""
        retreat, handle = self._open(), self._handle
        if retreat is None or retreat.stop is None or handle is None:
            return
        with suppress(HarnessError):
            self._connection.provider(retreat.intent.provider_id).stop(handle)

    @property
    def under_way(self) -> bool:
        """Whether this robot has a return that has not ended."""
        return self._open() is not None

    def step(self) -> float:
        """Do what is due for the open return; returns when to look again, in mission time."""
        retreat = self._open()
        if retreat is None:
            return self._connection.clock.now().mission_s
        if not self._roles.observations.collect(None):
            self._connection.revive()
        now_s = self._connection.clock.now().mission_s
        if retreat.intent.invocation_id == self._found:
            self._left_open(retreat.intent)
            return now_s
        try:
            report = self._report(retreat)
            if report is None:
                return now_s
            self._silent_since = None
            if report.status in protocol.TERMINAL:
                return self._finish(retreat, report)
            return self._supervise(retreat, report, now_s)
        except ProviderUnreachable as error:
            return self._silence(retreat.intent, now_s, error.reason)
        except ProviderFailed as error:
            refused = self._handle is None
            self._end(
                retreat.intent,
                "short" if refused else "unknown",
                declared="refused" if refused else "lost",
                reason=error.reason,
            )
            return now_s

    def _open(self) -> Retreating | None:
        control: SiteControl = self._runtime.fold(CONTROL)
        return control.retreating(self._connection.robot_id)

    def _report(self, retreat: Retreating) -> protocol.InvocationReport | None:
        """The provider's report. Sent once in the life of this process; None where it was cancelled before it was
        sent."""
        intent = retreat.intent
        provider = self._connection.provider(intent.provider_id)
        if self._handle is not None:
            return invocation_monitor.own(provider.report(self._handle), intent)
        if not self._sent:
            with self._runtime.turn():
                in_the_way = self._in_the_way(self._open() or retreat)
            if in_the_way:
                self._end(intent, "short", declared="not sent", reason=in_the_way)
                return None
            self._sent = True
            report = invocation_monitor.own(provider.start(_request(intent)), intent)
        else:
            known = provider.find(intent.request_id) if provider.card.reattach == "by_request" else None
            if known is None:
                raise ProviderUnreachable(because("arrival_unknown"), where=intent.provider_id)
            report = invocation_monitor.own(known, intent)
        self._handle = report.handle
        return report

    def _in_the_way(self, retreat: Retreating) -> Reason | None:
        """Why it must not go on: a person's stop, the deadline, the robot's own condition, a lost lease, a veto."""
        intent = retreat.intent
        if retreat.stop is not None:
            return because("stopped_by", actor=retreat.stop.actor.name, reason=retreat.stop.reason)
        if self._connection.clock.now().mission_s > intent.deadline_s:
            return because("deadline_passed")
        if not holds(self._runtime, self._connection.robot_id, intent):
            return because("lease_lost")
        return hindrance(self._roles, map_version=intent.map_version)

    def _supervise(self, retreat: Retreating, report: protocol.InvocationReport, now_s: float) -> float:
        intent, provider = retreat.intent, self._connection.provider(retreat.intent.provider_id)
        if retreat.stop is None:
            reason = self._in_the_way(retreat)
            if report.failure == protocol.KEEPALIVE_LOST and reason is None:
                reason = self._reawaken(provider, report)
            elif report.failure != protocol.KEEPALIVE_LOST:
                self._resumed = False
            if reason:
                command = retreat_events.StopRetreat(robot_id=intent.robot_id, actor=SUPERVISOR, reason=reason)
                self._runtime.commit([CommandEnvelope(CONTROL, command, self._connection.robot_id)])
                return now_s
        else:
            seen_s = self._roles.observations.robot_s
            self._stopping_since = seen_s if self._stopping_since is None else self._stopping_since
            if seen_s > self._stopping_since + provider.card.cancel.within_s + invocation_monitor.ACKNOWLEDGE_S:
                self._end(intent, "unknown", declared=report.status, reason=because("stop_not_acknowledged"))
                return now_s
            if report.status != "stopping":
                provider.stop(report.handle)
        provider.keepalive(report.handle)
        return now_s + invocation_monitor.POLL_S

    def _reawaken(self, provider: Provider, report: protocol.InvocationReport) -> Reason | None:
        """The robot's watchdog stopped it while this process was away, and that is over: it goes on where its provider
        can (D12); else why it ends here."""
        if not provider.card.resumable:
            return because("supervisor_away_too_long")
        if not self._resumed:
            provider.resume(report.handle)
            self._resumed = True
        return None

    def _finish(self, retreat: Retreating, report: protocol.InvocationReport) -> float:
        """Watch the body come to rest, then measure it against the place.

        The time to settle is the robot's own, as its answers tell it: a second in which nobody looked shows nothing.
        """
        seen_s, clock_s = self._roles.observations.robot_s, self._connection.clock.now().mission_s
        self._ended_since = seen_s if self._ended_since is None else self._ended_since
        settled_s = self._ended_since + invocation_monitor.SETTLE_S
        rest = self._roles.observations.rest()
        away, why = self._measured(retreat.intent, seen_s)
        at_rest_there = rest.static and (why is None or why.code != "no_fresh_poses")
        if seen_s < settled_s or (not at_rest_there and seen_s < settled_s + invocation_monitor.REST_WITHIN_S):
            if self._roles.observations.linked:
                return clock_s + invocation_monitor.POLL_S
            return self._silence(retreat.intent, clock_s, because("robot_status_old"))
        self._silent_since = None
        status = f"{report.status}{f', {report.failure}' if report.failure else ''}"
        stopped = _stopped(retreat, report)
        reached = not why and rest.static
        outcome: retreat_events.RetreatOutcome = "reached" if reached else "short"
        measured = because("measured_from_place", distance_m=away.get("distance_m"), place=retreat.intent.place)
        result = measured if reached else why or rest.reason or because("rest_not_shown")
        reason = result if reached or stopped is None else because("one_and_other", one=result, other=stopped)
        self._end(retreat.intent, outcome, declared=status, reason=reason, measured=away | rest.measured)
        return clock_s

    def _measured(
        self, intent: retreat_events.RetreatIntended, seen_s: float
    ) -> tuple[dict[str, float], Reason | None]:
        """The largest distance of the newest poses from the place, metres, and why that shows no arrival; tested as in
        D18."""
        recent = self._roles.observations.recent
        mine = {one.at_s: one for one in recent if isinstance(one, Pose) and one.map_version == intent.map_version}
        poses = [mine[at_s] for at_s in sorted(mine)]
        newest = poses[-SAMPLES:]
        if len(newest) < SAMPLES or seen_s - newest[-1].at_s > AGE_S:
            return {}, because("no_fresh_poses")
        away_m = max(hypot(one.x_m - intent.target_m[0], one.y_m - intent.target_m[1]) for one in newest)
        measured = {"distance_m": away_m, "bound_m": ARRIVED_M}
        if away_m > ARRIVED_M:
            return measured, because("measured_from_place", distance_m=away_m, place=intent.place)
        sources = Sources(poses, [one for one in recent if isinstance(one, Odometry)])
        agreed, since = sources.before_standstill(), sources.since_agreement(departed_s=intent.dispatched_s)
        if agreed is None or not agreed.holds or (since is not None and not since.holds):
            return measured, because("localiser_and_odometry_differ")
        return measured, None

    def _silence(self, intent: retreat_events.RetreatIntended, now_s: float, reason: Reason) -> float:
        """No answer: asked again for a while of wall time, never sent again; meanwhile the robot's own heartbeat
        watchdog stops it."""
        wall_s = self._connection.clock.now().wall_s
        since_wall_s, since_s = self._silent_since = self._silent_since or (wall_s, now_s)
        if wall_s - since_wall_s >= invocation_monitor.UNREACHABLE_S or now_s - since_s >= SILENT_S:
            self._end(intent, "unknown", declared="silent", reason=reason)
        return now_s + invocation_monitor.POLL_S

    def _left_open(self, intent: retreat_events.RetreatIntended) -> None:
        """The harness stopped in between. What still runs is stopped; whether and how far the robot went is unknown."""
        declared = "not asked"
        try:
            provider = self._connection.provider(intent.provider_id)
            known = provider.find(intent.request_id) if provider.card.reattach == "by_request" else None
            if provider.card.reattach == "by_request":
                declared = known.status if known else "never received"
            if known is not None and known.status not in protocol.TERMINAL:
                provider.stop(known.handle)
        except HarnessError as error:
            declared = plain(error.what)
        self._end(intent, "unknown", declared=declared, reason=because("harness_stopped_under_way"))

    def _end(
        self,
        intent: retreat_events.RetreatIntended,
        outcome: retreat_events.RetreatOutcome,
        *,
        declared: str,
        reason: Reason,
        measured: dict[str, float] | None = None,
    ) -> None:
        """The end and the leases in one commit: freed only at standstill by odometry, and never where the end is
        unknown.

        A body at rest away from the place runs the zone's fallback there, before its lease is released.
        """
        now_s = self._connection.clock.now().mission_s
        rest = self._roles.observations.rest()
        free = outcome != "unknown" and rest.static
        token = max(intent.resources.values())
        done = (
            settle(self._connection, intent.otherwise, rest=rest, token=token, look=self._rest_now)
            if free and outcome == "short"
            else None
        )
        ended = retreat_events.RetreatEnded(
            robot_id=intent.robot_id,
            invocation_id=intent.invocation_id,
            outcome=outcome,
            declared=declared,
            measured=measured if measured is not None else rest.measured,
            reason=because("one_and_other", one=reason, other=done.reason) if done else reason,
            at_s=now_s,
            then=intent.otherwise if done else "",
            then_done=done is not None and done.done,
        )
        over = because("retreat_over", outcome=outcome)
        freed = give_back(self._runtime, HeldLeases(self._connection.robot_id, intent), at_rest=free, reason=over)
        self._runtime.commit(
            [CommandEnvelope(CONTROL, retreat_events.EndRetreat(ended=ended), self._connection.robot_id), *freed]
        )
        self._handle = self._found = None
        self._sent = self._resumed = False
        self._silent_since = self._stopping_since = self._ended_since = None

    def _rest_now(self) -> tuple[Rest, RobotStatus | None]:
        """A new look at the robot: its standstill by odometry and its own status, each at its time."""
        seen = self._roles.observations
        seen.collect(None)
        return seen.rest(), seen.status


def _stopped(retreat: Retreating, report: protocol.InvocationReport) -> Reason | None:
    """Why it went no further: whoever stopped it, else the provider's own report, where it has one."""
    if retreat.stop is not None:
        return because("stopped_by", actor=retreat.stop.actor.name, reason=retreat.stop.reason)
    if isinstance(report.message, str):
        return recorded(report.message) if report.message else None
    return report.message


def _request(intent: retreat_events.RetreatIntended) -> protocol.StartRequest:
    identity = protocol.InvocationIdentity(
        mission_id=intent.task_id,
        node_id=retreat_events.RETREAT,
        attempt=intent.attempt,
        request_id=intent.request_id,
        provider_id=ProviderId(intent.provider_id),
    )
    return protocol.StartRequest(
        identity=identity,
        capability=intent.capability,
        parameters=intent.parameters,
        k_ctx=0,
        configuration=Digest(""),
        deadline_s=intent.deadline_s,
        fencing=intent.resources,
    )
