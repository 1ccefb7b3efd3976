"""What a site's own files hold: the shape of site.yaml, robots.yaml and models.yaml; channels.yaml is a contract of its
own, and missions are task templates.
"""

from typing import Annotated, Literal

import msgspec

from harness.contracts.models import ModelEndpoint, ModelName, ModelRole
from harness.contracts.observations import Camera, LaserMount
from harness.contracts.places import Site
from harness.contracts.secret_references import SecretReference as SecretReference
from harness.contracts.values import Name, Point, Positive, Value

RobotName = Annotated[str, msgspec.Meta(pattern=r"^[a-z0-9][a-z0-9-]{0,30}$")]
Address = Annotated[str, msgspec.Meta(pattern=r"^https?://[^\s/]+(/\S*)?$", max_length=300)]
EvidenceAddress = Annotated[
    str, msgspec.Meta(pattern=r"^((https?|wss?)://[^\s/]+(/\S*)?|dds://[^\s/:]+(/\d{1,3})?)$", max_length=300)
]
RosTopic = Annotated[str, msgspec.Meta(pattern=r"^/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*$", max_length=200)]
BrokerAddress = Annotated[str, msgspec.Meta(pattern=r"^mqtts?://[^\s/@:]+(:\d{1,5})?/?$", max_length=300)]
TopicLevel = Annotated[str, msgspec.Meta(pattern=r"^[^\s/+#]+$", max_length=200)]
"""One level of an MQTT topic."""


Authority = Literal["command", "observe"]
"""Whether the harness commands a robot, or only watches what its own stack does: shadow mode."""


class SiteDescription(Site):
    """site.yaml: the site, and the floor map that its places and routes are checked against.

    `map`: a map_server YAML file beside a PGM or PNG image, by its path from the folder.
    """

    map: Name | msgspec.UnsetType = msgspec.UNSET


class SimulatedRobotEntry(Value, tag_field="kind", tag="simulator"):
    """A robot of the simulator that ships, started as a process of its own."""

    name: RobotName


class EvidenceTopics(Value):
    """The ROS topics that witness for a robot, by their names; without a name that kind of sample is not read."""

    pose: RosTopic
    odometry: RosTopic
    scan: RosTopic | None = None
    image: RosTopic | None = None
    battery: RosTopic | None = None


class EvidencePath(Value):
    """A second path at the same robot that only observes: evidence comes from there, not from who executes.

    `http` is another program that serves the provider protocol. The other kinds read `topics`: `rosbridge` and
    `foxglove` from a WebSocket (`ws://`, `wss://`), `dds` from DDS itself (`dds://PEER/DOMAIN`). `laser`: where the
    scan's origin is on the body, where scans are not in `base_frame`.
    """

    address: EvidenceAddress
    kind: Literal["http", "rosbridge", "foxglove", "dds"] = "http"
    token: SecretReference | None = None
    topics: EvidenceTopics | None = None
    base_frame: Name = "base_link"
    laser: LaserMount | None = None


class HttpRobotEntry(Value, tag_field="kind", tag="http"):
    """A robot, or a provider without a body, that serves the HTTP provider protocol at an address.

    `embodiment`: the body, as capability cards name it; without one, what the robot's own cards are made for.
    `footprint_m`: corners around the body's middle, metres. `speed_limit_mps`: no request goes to it with a higher
    speed cap. `camera`: its pinhole model where the robot does not declare one. `teleoperation`: it serves the
    operations of driving by hand too. `evidence`: where its condition, samples and blobs are read instead.
    `authority: observe`: its own stack decides, and nothing is ever sent to it (shadow mode).
    """

    name: RobotName
    address: Address
    token: SecretReference
    footprint_m: tuple[Point, ...] = ()
    speed_limit_mps: Positive | None = None
    camera: Camera | None = None
    embodiment: str = ""
    teleoperation: bool = False
    evidence: EvidencePath | None = None
    authority: Authority = "command"

    @property
    def identity(self) -> str:
        """The robot's address as a whole."""
        return self.address


class VehicleEntry(Value, tag_field="kind", tag="vda5050"):
    """A vehicle that speaks VDA 5050 over an MQTT broker.

    `address`: the broker, `mqtt://HOST:PORT`, or `mqtts://` for TLS; `authority_file`: its certificate authority, by
    its path from the folder. `map_id`: the vehicle's own id of the site's map. `base_m`: how far ahead of the vehicle
    the way is released, metres: so far it may still drive where the harness's process ends. `velocity: measured` says
    that it measures its velocity apart from its position, with its wheels; without that nothing but its localiser shows
    that it stands, and it is not admitted to drive. `authority: observe`: another master control gives its orders, and
    nothing is ever published to it (shadow mode).
    """

    name: RobotName
    address: BrokerAddress
    manufacturer: TopicLevel
    serial_number: TopicLevel
    map_id: Annotated[str, msgspec.Meta(min_length=1, max_length=200)]
    interface: TopicLevel = "uagv"
    version: Literal["2.0", "2.1", "3.0"] = "2.1"
    user: str = ""
    password: SecretReference | None = None
    authority_file: str = ""
    base_m: Annotated[float, msgspec.Meta(ge=0.5, le=20.0)] = 1.5
    velocity: Literal["measured", "unknown"] = "unknown"
    footprint_m: tuple[Point, ...] = ()
    speed_limit_mps: Positive | None = None
    camera: Camera | None = None
    embodiment: str = ""
    evidence: EvidencePath | None = None
    authority: Authority = "command"

    @property
    def identity(self) -> str:
        """The vehicle's address as a whole: its broker and the level of its topics."""
        topics = f"{self.interface}/v{self.version[0]}/{self.manufacturer}/{self.serial_number}"
        return f"{self.address.rstrip('/')}/{topics}"


AddressedEntry = HttpRobotEntry | VehicleEntry
RobotEntry = SimulatedRobotEntry | HttpRobotEntry | VehicleEntry


def kind_of(entry: RobotEntry) -> str:
    """`kind` of an entry, as its YAML says it."""
    return str(entry.__struct_config__.tag)


class RobotsFile(Value):
    """robots.yaml."""

    robots: Annotated[tuple[RobotEntry, ...], msgspec.Meta(min_length=1, max_length=200)]


class ModelEntry(ModelEndpoint):
    """A model by its name. `key`: the API key of its endpoint; a local server often needs none."""

    key: SecretReference | None = None


class ModelsFile(Value):
    """models.yaml: models by name, and which of them has which role. A role that is not named has no model."""

    models: Annotated[tuple[ModelEntry, ...], msgspec.Meta(max_length=50)] = ()
    roles: dict[ModelRole, ModelName] = msgspec.field(default_factory=dict)
