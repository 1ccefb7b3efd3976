"""The navigation provider of a VDA 5050 vehicle: a bounded route becomes an order whose base is released step by step.

What the vehicle calls finished is declared. A stop is a cancelled order *and* positions that stay where they were. A
failed order is a result, although the protocol has none. Without keepalives the vehicle is paused, and the base, which
is then extended no more, ends a few metres ahead of it.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, Protocol

from msgspec.structs import replace

from harness.adapters.providers.vda5050 import messages
from harness.adapters.providers.vda5050.orders import RoutePlan, route_plan
from harness.adapters.providers.vda5050.vehicle import Vehicle
from harness.contracts import protocol
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.effects import Metric, Temporal
from harness.contracts.errors import ProviderFailed
from harness.contracts.ids import RequestId
from harness.contracts.reasons import Explanation, Reason, because
from harness.provider_protocol.acceptance import refuse_changed, refuse_unfit
from harness.provider_protocol.journal import JournalEntry, RequestJournal
from harness.provider_protocol.proposals import claims

KEEPALIVE_S = 1.3
"""Without a keepalive for so long the vehicle is paused: it must stand within 2 s."""
TAKEN_S, AGAIN_S, MOST_SENT = 5.0, 1.5, 3
"""An order that the vehicle's states do not show is sent again, unchanged, and given up after TAKEN_S."""
REPEAT_S = 1.0
"""A pause or a cancellation without effect is sent again after so long."""
DRIVES = frozenset({"AUTOMATIC", "SEMIAUTOMATIC"})
HELD_MODE = "INTERVENED"
"""3.0: somebody else moves the vehicle for a while; it keeps its order."""
SERIOUS = frozenset({"FATAL", "CRITICAL"})
REFUSALS = ("validation", "order", "noroute", "unsupported", "map")
"""How the types of errors begin by which a vehicle refuses an order."""
FAILURES = (
    "timeout",
    "order_rejected",
    "order_not_taken",
    "order_differs",
    "order_incomplete",
    "order_replaced",
    "vehicle_restarted",
    "vehicle_error",
    "operating_mode",
    "emergency_stop",
    "other_map",
)
FROM_X, FROM_Y, BEGUN = "from_x_m", "from_y_m", "begun_s"
Ending = Literal["succeeded", "failed", "cancelled"]


class Outbox(Protocol):
    """Sends a message to the vehicle; its header is added on the way. Returns the header id."""

    def __call__(self, topic: messages.Topic, body: dict[str, Any]) -> int: ...


@dataclass
class OrderExecution:
    """One request under way. Times ending in `local_s` are of this machine, others the vehicle's."""

    request: protocol.StartRequest
    accepted: protocol.InvocationReport
    plan: RoutePlan
    accepted_local_s: float
    heard_local_s: float
    sent_local_s: float
    boots: int
    update_id: int = 0
    update_first: int = 0
    base_end: int = 0
    passed: int = 0
    sent: int = 0
    header_ids: set[int] = field(default_factory=set)
    taken: bool = False
    held: bool = False
    dropped: bool = False
    pause_id: str = ""
    told_local_s: float = -math.inf
    ending: Ending | None = None
    failure: str = ""
    message: Explanation = ""
    ending_s: float = 0.0
    ending_local_s: float = 0.0
    share: float = 0.0


class VehicleNavigator:
    """Implements `contracts.ports.Provider`. Its caller holds one lock around every call, and calls `tick` ten times a
    second.

    `journal` is the file that remembers requests and fencing tokens: a process that was killed sends nothing twice.
    """

    def __init__(
        self,
        vehicle: Vehicle,
        card: CapabilityCard,
        *,
        send: Outbox,
        local_s: Callable[[], float],
        journal: Path | None,
        base_m: float,
    ) -> None:
        self._vehicle, self._card, self._send, self._local_s = vehicle, card, send, local_s
        self._journal = RequestJournal(journal)
        self._base_m = base_m
        self._stray_local_s = -math.inf
        self._active: OrderExecution | None = self._adopted()
        self._paused = self._active is not None

    @property
    def card(self) -> CapabilityCard:
        return self._card

    @property
    def at_work(self) -> bool:
        return self._active is not None

    def starts(self) -> list[protocol.PhysicalStart]:
        """Every request for which an order was sent."""
        return [
            protocol.physical_start(request.identity, at_s=report.declared.get(BEGUN, report.at_s), moves=True)
            for name, request in self._journal.requests.items()
            for report in (self._journal.reports[name],)
        ]

    def start(self, request: protocol.StartRequest) -> protocol.InvocationReport:
        """Write the request down, then send its order. Raises ProviderFailed, with nothing sent, where it cannot be."""
        known = self._journal.reports.get(request.identity.request_id)
        if known is not None:
            refuse_changed(self._journal, request, provider=self._card.provider_id)
            return self.report(known.handle)
        refuse_unfit(self._card, self._journal, request)
        here, now_s = self._ready(request), self._vehicle.now_s
        plan = route_plan(request, here=here, base_m=self._base_m)
        accepted = protocol.InvocationReport(
            handle=f"{self._card.provider_id}:{request.identity.request_id}",
            identity=request.identity,
            status="accepted",
            at_s=now_s,
            progress=protocol.Progress(share=0.0, remaining_m=plan.length_m),
            declared={FROM_X: here[0], FROM_Y: here[1], BEGUN: now_s},
        )
        self._journal.write(JournalEntry(report=accepted, request=request))
        local_s = self._local_s()
        run = OrderExecution(
            request, accepted, plan, local_s, local_s, local_s, self._vehicle.boots, base_end=plan.base_end(0)
        )
        self._active = run
        self._order(run)
        return self._now(run)

    def report(self, handle: str) -> protocol.InvocationReport:
        """Raises ProviderFailed for an unknown handle, ProviderUnreachable while nothing is known of the vehicle."""
        known = self._known(handle)
        run = self._active
        if known.status in protocol.TERMINAL or run is None:
            return known
        self._vehicle.current()
        self._step(run)
        return self._now(run) if self._active is run else self._known(handle)

    def find(self, request: RequestId) -> protocol.InvocationReport | None:
        known = self._journal.reports.get(request)
        return None if known is None else self.report(known.handle)

    def keepalive(self, handle: str) -> None:
        self._known(handle)
        if self._active is not None and self._active.accepted.handle == handle and not self._active.held:
            self._active.heard_local_s = self._local_s()

    def resume(self, handle: str) -> protocol.InvocationReport:
        """Go on after a lost keepalive. Raises ProviderFailed where nothing is held, or the vehicle cannot pause."""
        known, run = self._known(handle), self._active
        if run is None or run.accepted.handle != handle or run.ending or not run.held:
            status = known.status if run is None else self._status(run)
            raise ProviderFailed(because("invocation_not_blocked", handle=handle, status=status))
        if run.dropped or not self._card.resumable:
            raise ProviderFailed(because("vehicle_cannot_pause"))
        run.held, run.heard_local_s, run.told_local_s = False, self._local_s(), -math.inf
        self._unpause(run)
        return self.report(handle)

    def stop(self, handle: str) -> protocol.InvocationReport:
        """Cancel the order; `cancelled` once the vehicle dropped it and its positions stay where they were."""
        known, run = self._known(handle), self._active
        if (
            known.status not in protocol.TERMINAL
            and run is not None
            and run.accepted.handle == handle
            and not run.ending
        ):
            self._end(run, "cancelled", message=because("stopped_on_request"))
        return self.report(handle)

    def tick(self) -> None:
        """One turn: watch the keepalive, follow the order, extend its base, end it; cancel an order that is over."""
        run = self._active
        if run is None:
            self._cancel_stray()
            return
        if not run.held and not run.ending and self._local_s() - run.heard_local_s > KEEPALIVE_S:
            self._hold(run)
        if self._vehicle.trouble() is None:
            self._step(run)
        elif run.ending:
            self._cancel(run)

    def leave(self) -> None:
        """Nobody watches this vehicle from here on: it is paused where it still drives for us."""
        if self._active is not None and not self._active.held:
            self._hold(self._active)

    def _adopted(self) -> OrderExecution | None:
        """The request that was under way when the process before this one ended: held, until somebody resumes it."""
        for name, report in self._journal.reports.items():
            if report.status in protocol.TERMINAL:
                continue
            request, local_s = self._journal.requests[name], self._local_s()
            here = (report.declared[FROM_X], report.declared[FROM_Y])
            plan = route_plan(request, here=here, base_m=self._base_m)
            return OrderExecution(
                request, report, plan, local_s, local_s, local_s, self._vehicle.boots,
                base_end=plan.base_end(0), held=True, sent=MOST_SENT,
            )  # fmt: skip
        return None

    def _ready(self, request: protocol.StartRequest) -> tuple[float, float]:
        """Where the vehicle is. Raises ProviderFailed for one that may not or cannot begin."""
        if self._active is not None:
            raise ProviderFailed(because("vehicle_busy", order_id=self._active.plan.order_id[:12]))
        state = self._vehicle.current()
        if request.parameters["frame"] != self._vehicle.site.frame:
            raise ProviderFailed(because("vehicle_on_other_map", map_id=str(request.parameters["frame"])[:80]))
        trouble = self._unfit(state)
        if trouble is not None:
            raise ProviderFailed(because("vehicle_unfit", reason=trouble[1]))
        if not state.idle or state.driving:
            raise ProviderFailed(because("vehicle_busy", order_id=state.order_id[:80]))
        fix = self._vehicle.newest
        if fix is None or not self._vehicle.localised():
            raise ProviderFailed(because("vehicle_not_localised"))
        return fix.point

    def _unfit(self, state: messages.VehicleState) -> tuple[str, Reason] | None:
        """Why the vehicle cannot drive for us at all now: the failure code, and what it says."""
        if state.operating_mode not in DRIVES and state.operating_mode != HELD_MODE:
            return "operating_mode", because("vehicle_mode", mode=state.operating_mode[:40])
        if state.operating_mode == HELD_MODE and self._active is None:
            return "operating_mode", because("vehicle_mode", mode=HELD_MODE)
        if state.safety_state.engaged:
            return "emergency_stop", because("vehicle_emergency_stop")
        serious = next((one for one in state.errors if one.error_level in SERIOUS), None)
        if serious is not None:
            return "vehicle_error", because("vehicle_error", error=error_text(serious))
        position = state.position
        if position is not None and position.map_id != self._vehicle.site.map_id:
            return "other_map", because("vehicle_map", map_id=position.map_id[:80])
        return None

    def _step(self, run: OrderExecution) -> None:
        """Follow the newest state, which is of now."""
        state = self._vehicle.current()
        ours = state.order_id == run.plan.order_id
        if ours and not run.taken:
            run.taken, run.boots = True, self._vehicle.boots
            released = [one.sequence_id // 2 for one in state.node_states if one.released]
            run.update_id, run.base_end = state.order_update_id, max(released, default=run.base_end)
        if ours:
            self._follow(run, state)
        if not run.ending:
            self._judge(run, state, ours=ours)
        if run.ending:
            self._conclude(run, state, ours=ours)
        elif run.held:
            self._keep_held(run, state)
        elif run.taken and state.order_update_id == run.update_id:
            self._extend(run)
        elif self._unheard(run):
            self._order(run)

    def _unheard(self, run: OrderExecution) -> bool:
        """Whether what was sent last is lost: never to a vehicle that started again since, for it may have had it."""
        waited = self._local_s() - run.sent_local_s > AGAIN_S
        return waited and run.sent < MOST_SENT and self._vehicle.boots == run.boots

    def _follow(self, run: OrderExecution, state: messages.VehicleState) -> None:
        node = min(run.plan.last, state.last_node_sequence_id // 2)
        if state.last_node_id == run.plan.node_id(node):  # else it is still the last one of the order before
            run.passed = max(run.passed, node)
        whole_m = max(run.plan.length_m, 0.01)
        run.share = max(run.share, min(1.0, 1.0 - self._remaining_m(run) / whole_m))

    def _judge(self, run: OrderExecution, state: messages.VehicleState, *, ours: bool) -> None:
        """Whether the order ended by itself, and as what."""
        refused = self._refused(run, state)
        unfit = self._unfit(state)
        late_s = self._local_s() - run.accepted_local_s if not run.taken else 0.0
        finished = ours and state.idle and run.passed == run.plan.last
        if refused is not None:
            self._fail(run, "order_rejected", because("vehicle_refused_order", error=error_text(refused)))
        elif run.taken and not ours and self._vehicle.boots != run.boots:
            self._fail(run, "vehicle_restarted", because("vehicle_restarted"))
        elif run.taken and not ours:
            self._fail(run, "order_replaced", because("vehicle_follows_other_order", order_id=state.order_id[:80]))
        elif finished and not state.driving:
            self._end(run, "succeeded", message=because("vehicle_reached_last_node"))
        elif unfit is not None:
            self._fail(run, *unfit)
        elif self._vehicle.now_s >= run.request.deadline_s:
            self._fail(run, "timeout", because("deadline_passed"))
        elif not run.taken and late_s > TAKEN_S:
            self._fail(run, "order_not_taken", because("vehicle_silent_on_order", sent=run.sent))
        elif ours and state.idle and not state.driving and not run.dropped:
            dropped = because("vehicle_dropped_order", passed=run.passed, last=run.plan.last)
            self._fail(run, "order_incomplete", dropped)
        elif ours and not state.idle and _differs(run, state):
            self._fail(run, "order_differs", because("vehicle_lists_other_nodes"))

    def _refused(self, run: OrderExecution, state: messages.VehicleState) -> messages.VehicleError | None:
        """The error by which the vehicle refuses this order or an update of it."""
        for one in state.errors:
            headers = any(one.names("headerId", str(number)) for number in run.header_ids)
            named = one.names("orderId", run.plan.order_id) or (headers and not one.names("topic", "instantActions"))
            kind = one.error_type.lower()
            old = run.taken and any(one.names("orderUpdateId", str(n)) for n in range(state.order_update_id + 1))
            if named and not old and (one.error_level in SERIOUS or kind.startswith(REFUSALS)):
                return one
        return None

    def _extend(self, run: OrderExecution) -> None:
        """Release more of the way, as far as it may be by now."""
        base_end = run.plan.base_end(run.passed)
        if base_end > run.base_end:
            run.update_first, run.base_end = run.base_end, base_end
            run.update_id, run.sent = run.update_id + 1, 0
            self._order(run)

    def _order(self, run: OrderExecution) -> None:
        """Send the order or its newest update; sent again it is the same to the byte, but for its header."""
        plan = run.plan
        body = messages.order_body(
            plan.order_id,
            run.update_id,
            plan.nodes(run.update_first, run.base_end),
            plan.edges(run.update_first, run.base_end),
            map_id=self._vehicle.site.map_id,
            version=self._vehicle.identity.version,
        )
        run.header_ids.add(self._send("order", body))
        run.sent, run.sent_local_s = run.sent + 1, self._local_s()

    def _hold(self, run: OrderExecution) -> None:
        run.held = self._paused = True
        run.pause_id = self._act("startPause", run)

    def _unpause(self, run: OrderExecution) -> None:
        """Take back a pause of ours; one that a person pressed at the vehicle is none."""
        if self._paused:
            self._act("stopPause", run)
        self._paused = False

    def _keep_held(self, run: OrderExecution, state: messages.VehicleState) -> None:
        """Pause again while it still drives; a vehicle that cannot pause loses its order."""
        if state.action(run.pause_id) == "FAILED" or not self._card.resumable:
            run.dropped = True
            if not state.idle:
                self._cancel(run)
        elif state.driving and not state.paused and self._local_s() - run.told_local_s > REPEAT_S:
            run.pause_id = self._act("startPause", run)

    def _cancel(self, run: OrderExecution) -> None:
        if self._local_s() - run.told_local_s > REPEAT_S:
            self._act("cancelOrder", run)

    def _act(self, action_type: str, run: OrderExecution) -> str:
        run.told_local_s = self._local_s()
        action_id = f"{action_type}-{run.plan.order_id[:12]}-{int(self._local_s() * 1000)}"
        self._send(
            "instantActions", messages.instant_body(action_type, action_id, version=self._vehicle.identity.version)
        )
        return action_id

    def _cancel_stray(self) -> None:
        """An order of ours that drives although it is over came late, or came back: it is cancelled."""
        state = self._vehicle.state
        if state is None or self._vehicle.trouble() is not None or state.idle:
            return
        ours = RequestId(state.order_id) in self._journal.reports
        if ours and self._local_s() - self._stray_local_s > REPEAT_S:
            self._stray_local_s = self._local_s()
            action_id = f"cancelOrder-{state.order_id[:12]}-{int(self._local_s() * 1000)}"
            self._send(
                "instantActions",
                messages.instant_body("cancelOrder", action_id, version=self._vehicle.identity.version),
            )

    def _fail(self, run: OrderExecution, failure: str, message: Reason) -> None:
        self._end(run, "failed", failure=failure, message=message)

    def _end(self, run: OrderExecution, ending: Ending, *, failure: str = "", message: Explanation = "") -> None:
        run.ending, run.failure, run.message = ending, failure, message
        run.ending_s, run.ending_local_s, run.told_local_s = self._vehicle.now_s, self._local_s(), -math.inf

    def _conclude(self, run: OrderExecution, state: messages.VehicleState, *, ours: bool) -> None:
        """Report the end once the vehicle has no order of ours and its positions stay where they were."""
        mine = ours or RequestId(state.order_id) in self._journal.reports
        waited = run.taken or self._local_s() - run.accepted_local_s > AGAIN_S
        gone = state.idle if ours else waited
        untold = run.ending != "succeeded" and run.told_local_s == -math.inf
        if (mine and not state.idle) or (untold and not run.taken and state.idle):
            self._cancel(run)
        if gone and self._vehicle.at_rest(run.ending_s):
            ended = self._now(run)
            declared = self._declared(run)
            proposed = self._proposed(run, declared) if run.ending == "succeeded" else ()
            ended = replace(ended, status=run.ending, failure=run.failure, declared=declared, proposed_facts=proposed)
            self._journal.write(JournalEntry(report=ended))
            self._active = None
            self._unpause(run)

    def _declared(self, run: OrderExecution) -> dict[str, float]:
        fix, target = self._vehicle.newest, run.plan.points[-1]
        away_m = {} if fix is None else {"distance_m": math.dist(fix.point, target)}
        return run.accepted.declared | {"nodes_passed": float(run.passed)} | away_m

    def _proposed(self, run: OrderExecution, declared: dict[str, float]) -> tuple[protocol.ProposedFact, ...]:
        arguments: protocol.Parameters = {"target_m": run.plan.points[-1], "frame": self._vehicle.site.frame}
        if "distance_m" in declared:
            arguments["distance_m"] = declared["distance_m"]
        return (*claims(run.request, Metric, arguments), *claims(run.request, Temporal, {}))

    def _now(self, run: OrderExecution) -> protocol.InvocationReport:
        status = self._status(run)
        return replace(
            run.accepted,
            status=status,
            at_s=self._vehicle.now_s,
            progress=protocol.Progress(share=run.share, text=run.message, remaining_m=self._remaining_m(run)),
            failure=protocol.KEEPALIVE_LOST if status == "blocked" and run.held else "",
            message=run.message,
        )

    def _status(self, run: OrderExecution) -> protocol.InvocationStatus:
        if run.ending == "cancelled":
            return "stopping"
        if run.ending is not None:
            return "running"
        if run.held:
            return "blocked"
        return "running" if run.taken else "accepted"

    def _remaining_m(self, run: OrderExecution) -> float:
        """From the last node that was passed, less what the vehicle is nearer to the next one."""
        plan, fix = run.plan, self._vehicle.newest
        left_m = plan.length_m - plan.along_m[run.passed]
        if fix is None or run.passed == plan.last:
            return left_m
        after_m = plan.length_m - plan.along_m[run.passed + 1]
        return min(left_m, after_m + math.dist(fix.point, plan.points[run.passed + 1]))

    def _known(self, handle: str) -> protocol.InvocationReport:
        known = self._journal.reports.get(RequestId(handle.removeprefix(f"{self._card.provider_id}:")))
        if known is None or known.handle != handle:
            raise ProviderFailed(because("handle_unknown", handle=handle[:80]), where=self._card.provider_id)
        return known


def _differs(run: OrderExecution, state: messages.VehicleState) -> bool:
    """Whether the vehicle follows another order than the one that was sent: nodes of its own, or some left out."""
    nodes = [one.sequence_id // 2 for one in state.node_states]
    names = {one.sequence_id: one.node_id for one in state.node_states}
    if any(names[2 * i] != run.plan.node_id(i) for i in nodes if 2 * i in names and i <= run.plan.last):
        return True
    expected = set(range(run.passed + 1, run.plan.last + 1))
    return bool(set(nodes) - expected - {run.passed} or expected - set(nodes))


def error_text(error: messages.VehicleError) -> str:
    text = f"{error.error_type}: {error.error_description}" if error.error_description else error.error_type
    return text[:300]
