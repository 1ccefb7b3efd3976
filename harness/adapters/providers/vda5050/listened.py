"""A VDA 5050 vehicle that another master control commands: its orders as goals of that stack, its condition, samples.

It subscribes and never publishes, not even a question for the vehicle's state.
"""

import threading
import time
from collections import deque
from collections.abc import Callable, Sequence

from harness.adapters.providers.vda5050 import messages
from harness.adapters.providers.vda5050.robot import MessageLink, VehicleSettings
from harness.adapters.providers.vda5050.vehicle import MapIdentity, Vehicle, VehicleIdentity
from harness.contracts import protocol
from harness.contracts.errors import BlobDamaged, ProviderFailed
from harness.contracts.ids import Digest
from harness.contracts.ports import Provider
from harness.contracts.reasons import because

LISTENED: tuple[messages.Topic, ...] = (*messages.INCOMING, "order")
KEPT = 1000
CANCEL = "cancelOrder"
FATAL = "FATAL"


class ListenedVehicle:
    """Implements `contracts.ports.ObservedRobot`, and `Robot` as one without providers.

    An order is over when nothing of it is left and the vehicle does not drive: where its last node was passed, that is
    declared as success, for the standard has no word for it (VDA5050#511). Where another order took its place before
    that was seen, it is unknown how it ended.
    """

    def __init__(
        self, settings: VehicleSettings, link: MessageLink, *, local_s: Callable[[], float] = time.monotonic
    ) -> None:
        self._settings = settings
        self._lock = threading.RLock()
        self._identity = VehicleIdentity(
            settings.interface, settings.manufacturer, settings.serial_number, settings.version
        )
        site = MapIdentity(settings.frame, settings.map_version, settings.map_id)
        self.vehicle = Vehicle(self._identity, site, velocity_measured=settings.velocity_measured, local_s=local_s)
        self._changes: deque[protocol.StackGoal] = deque(maxlen=KEPT)
        self._orders: dict[str, messages.OrderMessage] = {}
        self._order, self._active, self._seq, self._boots = "", False, 0, 0
        link.open([self._identity.topic(one) for one in LISTENED], self._receive, self._lost)

    def providers(self) -> Sequence[Provider]:
        return ()

    def starts(self) -> Sequence[protocol.PhysicalStart]:
        return ()

    def blob(self, digest: Digest) -> bytes:
        """Raises BlobDamaged: a vehicle gives out no bytes."""
        raise BlobDamaged(because("robot_blob_differs", blob=digest[:12]), where=self._settings.name)

    def status(self) -> protocol.RobotStatus:
        """Raises ProviderUnreachable while nothing is known of the vehicle."""
        with self._lock:
            state, fix, now_s = self.vehicle.current(), self.vehicle.newest, self.vehicle.now_s
            return protocol.RobotStatus(
                robot_id=self._settings.name,
                at_s=now_s,
                posture="moving" if state.driving else "standing",
                armed=state.driving,
                hardware_stop=state.safety_state.engaged,
                charge=state.charge or 0.0,
                localised=self.vehicle.localised(),
                map_version=self._settings.map_version if fix is not None else "",
                pose_age_s=None if fix is None else max(0.0, now_s - fix.at_s),
            )

    def observations(self, after: int, limit: int = 5000) -> protocol.Observations:
        """Raises ProviderUnreachable while nothing is known of the vehicle."""
        with self._lock:
            self.vehicle.current()
            return self.vehicle.observations(after, limit)

    def stack_goals(self, after: int, limit: int = protocol.MOST_CHANGES) -> protocol.StackGoals:
        """The orders of the other master control, by the vehicle's own states. Raises ProviderUnreachable while nothing
        is known of the vehicle."""
        with self._lock:
            self.vehicle.current()
            found = tuple(one for one in self._changes if one.seq > after)[:limit]
            return protocol.StackGoals(
                stack="VDA 5050",
                run=f"boot-{self.vehicle.boots}",
                changes=found,
                next_seq=found[-1].seq if found else self._seq,
                at_s=self.now_s(),
            )

    def now_s(self) -> float:
        """The vehicle's clock."""
        with self._lock:
            return self.vehicle.now_s

    def _receive(self, topic: str, body: bytes) -> None:
        name = next((one for one in LISTENED if self._identity.topic(one) == topic), None)
        with self._lock:
            if name == "order":
                self._take_order(body)
            elif name is not None:
                before = self.vehicle.state
                self.vehicle.receive(name, body)
                state = self.vehicle.state
                if state is not None and state is not before:
                    self._follow(state)

    def _lost(self) -> None:
        with self._lock:
            self.vehicle.lost_connection()

    def _take_order(self, body: bytes) -> None:
        """An order of this vehicle; anything else on the topic is left out."""
        try:
            order = messages.read_message(body, messages.OrderMessage)
        except ProviderFailed:
            return
        own = (self._identity.manufacturer, self._identity.serial_number)
        if (order.manufacturer, order.serial_number) == own:
            self._orders = {self._order: self._orders[self._order]} if self._order in self._orders else {}
            self._orders[order.order_id] = order

    def _follow(self, state: messages.VehicleState) -> None:
        """What one more state says of the order."""
        if self.vehicle.boots != self._boots:
            self._boots = self.vehicle.boots
            self._changes.clear()
            self._order, self._active, self._seq = "", False, 0
        over = state.idle and not state.driving
        if state.order_id != self._order:
            if self._active:
                self._change(state, "unknown")
            self._order, self._active = state.order_id, bool(state.order_id) and not over
            if self._active:
                self._change(state, "active")
        elif self._active and over:
            self._active = False
            self._change(state, self._outcome(state))
        elif self._active:
            self._change(state, "active")

    def _outcome(self, state: messages.VehicleState) -> protocol.StackGoalStatus:
        """How the vehicle says that its order ended."""
        if any(one.error_level == FATAL for one in state.errors):
            return "failed"
        if any(one.action_status == "FAILED" and one.action_type != CANCEL for one in state.action_states):
            return "failed"
        order = self._orders.get(self._order)
        last = order.last if order is not None else None
        if last is not None:
            return "succeeded" if last.node_id == state.last_node_id else "cancelled"
        actions = (*state.instant_action_states, *state.action_states)
        cancelled = any(one.action_type == CANCEL and one.action_status == "FINISHED" for one in actions)
        return "cancelled" if cancelled else "succeeded"

    def _change(self, state: messages.VehicleState, status: protocol.StackGoalStatus) -> None:
        """One more change of the order under way; the same once more is none."""
        goal = self._goal(state, status)
        newest = self._changes[-1] if self._changes else None
        if newest is not None and (newest.goal_id, newest.status, newest.target_m) == (
            goal.goal_id,
            goal.status,
            goal.target_m,
        ):
            return
        self._seq = goal.seq
        self._changes.append(goal)

    def _goal(self, state: messages.VehicleState, status: protocol.StackGoalStatus) -> protocol.StackGoal:
        newest = next((one for one in reversed(self._changes) if one.goal_id == self._order[:200]), None)
        place = self._place(state)
        known = newest.target_m if newest is not None else None
        target = (place.x, place.y) if place is not None and place.map_id == self._settings.map_id else known
        return protocol.StackGoal(
            seq=self._seq + 1,
            goal_id=self._order[:200],
            at_s=state.at_s,
            status=status,
            target_m=target,
            frame=self._settings.frame if target is not None else "",
            map_version=self._settings.map_version if target is not None else "",
        )

    def _place(self, state: messages.VehicleState) -> messages.NodePosition | None:
        """Where the order ends: by the order itself, else by what the vehicle says is left of it."""
        order = self._orders.get(self._order)
        last = order.last if order is not None else None
        if last is None and state.order_id == self._order:
            last = max(state.node_states, key=lambda one: one.sequence_id, default=None)
        return last.node_position if last is not None else None
