"""The messages of VDA 5050, versions 2.0, 2.1 and 3.0, as far as an order to drive needs them. Written from the
specification; fields that are not listed here are ignored.

Where 3.0 renamed a field, both names are read, and `order_body` writes those of the version that the vehicle speaks.
"""

from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any, Literal, TypeVar

import msgspec

from harness.contracts.errors import ProviderFailed
from harness.contracts.reasons import because

Version = Literal["2.0", "2.1", "3.0"]
Topic = Literal["order", "instantActions", "state", "visualization", "connection", "factsheet"]
INCOMING: tuple[Topic, ...] = ("state", "visualization", "connection", "factsheet")
MOST_BYTES = 1 << 20
"""No message of a vehicle is longer: a state with a thousand nodes has a fifth of that."""
M = TypeVar("M", bound="VehicleMessage")


class Wire(msgspec.Struct, frozen=True, rename="camel"):
    """A part of a message; unknown fields are read over, as the specification wants it."""


class VehicleMessage(Wire, frozen=True, rename="camel"):
    """The header of every message. `header_id` counts the messages of one topic; `timestamp` is ISO 8601 in UTC."""

    header_id: int
    timestamp: str
    version: str
    manufacturer: str
    serial_number: str

    @property
    def at_s(self) -> float:
        """The vehicle's own clock when it sent this, seconds since 1970. Raises ProviderFailed for no time."""
        try:
            found = datetime.fromisoformat(self.timestamp)
        except ValueError as error:
            raise ProviderFailed(because("vehicle_timestamp_invalid", timestamp=self.timestamp[:40])) from error
        return (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()


class VehiclePosition(Wire, frozen=True, rename="camel"):
    """Where the vehicle says that it is: metres and radians in the map `map_id`."""

    x: float
    y: float
    theta: float
    map_id: str
    position_initialized: bool | None = None
    localized: bool | None = None
    localization_score: float | None = None

    @property
    def trusted(self) -> bool:
        """Whether the vehicle says that it is localised: `positionInitialized` in 2.x, `localized` in 3.0."""
        return bool(self.localized if self.localized is not None else self.position_initialized)


class VehicleVelocity(Wire, frozen=True, rename="camel"):
    """The vehicle's twist in its own frame: m/s and rad/s."""

    vx: float = 0.0
    vy: float = 0.0
    omega: float = 0.0


class NodePosition(Wire, frozen=True, rename="camel"):
    """Where a node is, metres, in the map `map_id`."""

    x: float
    y: float
    map_id: str


class OrderNodeState(Wire, frozen=True, rename="camel"):
    node_id: str
    sequence_id: int
    released: bool
    node_position: NodePosition | None = None


class OrderEdgeState(Wire, frozen=True, rename="camel"):
    edge_id: str
    sequence_id: int
    released: bool


class ActionState(Wire, frozen=True, rename="camel"):
    action_id: str
    action_status: str
    action_type: str = ""


class ErrorReference(Wire, frozen=True, rename="camel"):
    reference_key: str
    reference_value: str


class VehicleError(Wire, frozen=True, rename="camel"):
    """`error_level`: WARNING or FATAL, in 3.0 also URGENT and CRITICAL."""

    error_type: str
    error_level: str
    error_references: tuple[ErrorReference, ...] | None = None
    error_description: str | None = None

    def names(self, key: str, value: str) -> bool:
        """Whether it refers to this value under this key."""
        return any((one.reference_key, one.reference_value) == (key, value) for one in self.error_references or ())


class PowerSupply(Wire, frozen=True, rename="camel"):
    """Per cent: `batteryCharge` in 2.x, `stateOfCharge` in 3.0."""

    battery_charge: float | None = None
    state_of_charge: float | None = None


class VehicleSafety(Wire, frozen=True, rename="camel"):
    """The emergency stop: `eStop` in 2.x, `activeEmergencyStop` in 3.0; NONE where it is released."""

    e_stop: str = "NONE"
    active_emergency_stop: str = "NONE"
    field_violation: bool = False

    @property
    def engaged(self) -> bool:
        return (self.e_stop, self.active_emergency_stop) != ("NONE", "NONE")


class VehicleState(VehicleMessage, frozen=True, rename="camel"):
    """Topic `state`: the whole condition of the vehicle, and how far it is with its order."""

    order_id: str
    order_update_id: int
    last_node_id: str
    last_node_sequence_id: int
    driving: bool
    operating_mode: str
    node_states: tuple[OrderNodeState, ...]
    edge_states: tuple[OrderEdgeState, ...]
    errors: tuple[VehicleError, ...] = ()
    action_states: tuple[ActionState, ...] = ()
    instant_action_states: tuple[ActionState, ...] = ()
    safety_state: VehicleSafety = VehicleSafety()
    battery_state: PowerSupply | None = None
    power_supply: PowerSupply | None = None
    agv_position: VehiclePosition | None = None
    mobile_robot_position: VehiclePosition | None = None
    velocity: VehicleVelocity | None = None
    paused: bool | None = None

    @property
    def position(self) -> VehiclePosition | None:
        return self.mobile_robot_position or self.agv_position

    @property
    def charge(self) -> float | None:
        """State of charge, 0 to 1; None where the vehicle does not say."""
        battery = self.power_supply or self.battery_state or PowerSupply()
        value = battery.state_of_charge if battery.state_of_charge is not None else battery.battery_charge
        return None if value is None else min(1.0, max(0.0, value / 100.0))

    @property
    def idle(self) -> bool:
        """Whether no node and no edge of any order is left."""
        return not self.node_states and not self.edge_states

    def action(self, action_id: str) -> str:
        """The status of an action; empty where the state does not list it."""
        listed = (*self.instant_action_states, *self.action_states)
        return next((one.action_status for one in listed if one.action_id == action_id), "")


class OrderMessage(VehicleMessage, frozen=True, rename="camel"):
    """Topic `order`: what a master control sent to the vehicle, as far as it says where that leads."""

    order_id: str
    order_update_id: int
    nodes: tuple[OrderNodeState, ...]

    @property
    def last(self) -> OrderNodeState | None:
        """The node where the order ends, with what is not released yet."""
        return max(self.nodes, key=lambda one: one.sequence_id, default=None)


class VisualizationMessage(VehicleMessage, frozen=True, rename="camel"):
    """Topic `visualization`: position and velocity at a higher rate than the state."""

    agv_position: VehiclePosition | None = None
    mobile_robot_position: VehiclePosition | None = None
    velocity: VehicleVelocity | None = None

    @property
    def position(self) -> VehiclePosition | None:
        return self.mobile_robot_position or self.agv_position


class ConnectionMessage(VehicleMessage, frozen=True, rename="camel"):
    """Topic `connection`: retained; the broker itself sends the broken one, as the vehicle's last will."""

    connection_state: str

    @property
    def online(self) -> bool:
        return self.connection_state == "ONLINE"


class TypeSpecification(Wire, frozen=True, rename="camel"):
    series_name: str = ""


class PhysicalParameters(Wire, frozen=True, rename="camel"):
    """Speeds in m/s: `speedMax` in 2.x, `maximumSpeed` in 3.0."""

    speed_max: float | None = None
    maximum_speed: float | None = None


class SupportedAction(Wire, frozen=True, rename="camel"):
    action_type: str = ""


class ProtocolFeatures(Wire, frozen=True, rename="camel"):
    """The actions that the vehicle knows: `agvActions` in 2.x, `mobileRobotActions` in 3.0."""

    agv_actions: tuple[SupportedAction, ...] = ()
    mobile_robot_actions: tuple[SupportedAction, ...] = ()


class FactsheetMessage(VehicleMessage, frozen=True, rename="camel"):
    """Topic `factsheet`: what the manufacturer says of the vehicle."""

    type_specification: TypeSpecification = TypeSpecification()
    physical_parameters: PhysicalParameters = PhysicalParameters()
    protocol_features: ProtocolFeatures = ProtocolFeatures()

    @property
    def speed_mps(self) -> float | None:
        """The highest speed, where the vehicle names one."""
        physical = self.physical_parameters
        return physical.maximum_speed or physical.speed_max or None

    @property
    def actions(self) -> frozenset[str]:
        """The types of the actions that it lists; empty where it lists none."""
        features = self.protocol_features
        return frozenset(one.action_type for one in (*features.agv_actions, *features.mobile_robot_actions))


class OrderNode(msgspec.Struct, frozen=True):
    """A node to send: where, metres; `deviation_m` is how near counts as passed."""

    node_id: str
    sequence_id: int
    released: bool
    x_m: float
    y_m: float
    deviation_m: float


class OrderEdge(msgspec.Struct, frozen=True):
    """An edge to send, between the nodes before and after it, and how fast it may be driven, m/s."""

    edge_id: str
    sequence_id: int
    released: bool
    start_node_id: str
    end_node_id: str
    speed_mps: float


def read_message(body: bytes, kind: type[M]) -> M:
    """Raises ProviderFailed for what is no such message."""
    if len(body) > MOST_BYTES:
        raise ProviderFailed(because("answer_too_large", limit_mib=MOST_BYTES >> 20))
    try:
        return msgspec.json.decode(body, type=kind)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise ProviderFailed(because("vehicle_message_invalid", error=str(error)[:300])) from error


def order_body(
    order_id: str,
    update_id: int,
    nodes: Sequence[OrderNode],
    edges: Sequence[OrderEdge],
    *,
    map_id: str,
    version: Version,
) -> dict[str, Any]:
    """An order or its update without a header."""
    third = version == "3.0"
    return {
        "orderId": order_id,
        "orderUpdateId": update_id,
        "nodes": [
            {
                "nodeId": one.node_id,
                "sequenceId": one.sequence_id,
                "released": one.released,
                "nodePosition": {
                    "x": one.x_m,
                    "y": one.y_m,
                    "mapId": map_id,
                    "allowedDeviationXY": {"a": one.deviation_m, "b": one.deviation_m, "theta": 0.0}
                    if third
                    else one.deviation_m,
                },
                "actions": [],
            }
            for one in nodes
        ],
        "edges": [
            {
                "edgeId": one.edge_id,
                "sequenceId": one.sequence_id,
                "released": one.released,
                "maximumSpeed" if third else "maxSpeed": one.speed_mps,
                "actions": [],
            }
            | ({} if third else {"startNodeId": one.start_node_id, "endNodeId": one.end_node_id})
            for one in edges
        ],
    }


def instant_body(action_type: str, action_id: str, *, version: Version) -> dict[str, Any]:
    """One instant action without a header. The text of 2.0 calls the list `actions`, its schema `instantActions`:
    vehicles of that version get it under both names."""
    actions = [{"actionType": action_type, "actionId": action_id, "blockingType": "NONE", "actionParameters": []}]
    return {"actions": actions} | ({"instantActions": actions} if version == "2.0" else {})


def header(
    number: int, *, at_s: float, version: Version, manufacturer: str, serial_number: str
) -> dict[str, str | int]:
    """The header of a message to the vehicle; `at_s` is the harness's wall clock."""
    stamp = datetime.fromtimestamp(at_s, UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")
    return {
        "headerId": number,
        "timestamp": stamp,
        "version": f"{version}.0",
        "manufacturer": manufacturer,
        "serialNumber": serial_number,
    }
