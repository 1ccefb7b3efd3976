"""What the files of a site's own folder hold: the shape of site.yaml and robots.yaml; missions are task templates."""

from typing import Annotated

import msgspec

from harness.contracts.observations import Camera
from harness.contracts.places import Site
from harness.contracts.values import Name, Point, Positive, Value

RobotName = Annotated[str, msgspec.Meta(pattern=r"^[a-z0-9][a-z0-9-]{0,30}$")]
Address = Annotated[str, msgspec.Meta(pattern=r"^https?://[^\s/]+(/\S*)?$", max_length=300)]


class SiteDescription(Site):
    """site.yaml: the site, and the floor map that its places and routes are checked against.

    `map`: a map_server YAML file beside a PGM or PNG image, by its path from the folder.
    """

    map: Name | msgspec.UnsetType = msgspec.UNSET


class SecretReference(Value):
    """Where a secret stands: a variable of the environment, or a file by its path from the folder. Never the secret."""

    environment: Annotated[str, msgspec.Meta(pattern=r"^[A-Z_][A-Z0-9_]*$")] = ""
    file: str = ""


class SimulatedRobotEntry(Value, tag_field="kind", tag="simulator"):
    """A robot of the simulator that ships, started as a process of its own."""

    name: RobotName


class HttpRobotEntry(Value, tag_field="kind", tag="http"):
    """A robot, or a provider without a body, that serves the HTTP provider protocol at an address.

    `embodiment`: the body, as capability cards name it; without one, what the robot's own cards are made for.
    `footprint_m`: corners around the body's middle, metres. `speed_limit_mps`: no request goes to it with a higher
    speed cap. `camera`: its pinhole model where the robot does not declare one. `teleoperation`: it serves the
    operations of driving by hand too.
    """

    name: RobotName
    address: Address
    token: SecretReference
    footprint_m: tuple[Point, ...] = ()
    speed_limit_mps: Positive | None = None
    camera: Camera | None = None
    embodiment: str = ""
    teleoperation: bool = False


RobotEntry = SimulatedRobotEntry | HttpRobotEntry


class RobotsFile(Value):
    """robots.yaml."""

    robots: Annotated[tuple[RobotEntry, ...], msgspec.Meta(min_length=1, max_length=200)]
