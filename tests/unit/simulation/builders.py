"""Builders for the simulated robot: requests over the real site's routes, and a bench that drives any transport."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import msgspec
import yaml

from harness.contracts.ids import Digest, MissionId, NodeId, ProviderId, request_id
from harness.contracts.observations import AnySample
from harness.contracts.places import Route, Site
from harness.contracts.ports import Provider, Robot
from harness.contracts.protocol import TERMINAL, InvocationIdentity, InvocationReport, Parameters, StartRequest
from simulator.faults import parse_faults
from simulator.robot import SimulatedRobot
from simulator.truth import Truth
from simulator.world import Fidelity, WorldSettings

MISSION = MissionId("mission-1")
SITE_FILE = Path(__file__).resolve().parents[3] / "harness" / "baseline" / "site" / "site.yaml"
SITE = msgspec.convert(yaml.safe_load(SITE_FILE.read_text()), Site)


def route(name: str) -> Route:
    return next(route for route in SITE.routes if route.name == name)


def along(name: str) -> Parameters:
    """Parameters of a navigation along a reference route under the trial's settings."""
    waypoints = route(name).waypoints_m
    return {
        "route": waypoints,
        "target": waypoints[-1],
        "frame": "map",
        "tolerance_m": 0.4,
        "speed_cap_mps": 0.5,
        "lookahead_m": 0.6,
    }


@dataclass
class Bench:
    """One robot on any transport, with its time in the test's hand."""

    robot: Robot
    advance_to: Callable[[float], float]
    configure: Callable[[MissionId, int, Sequence[str]], None]
    truth: Callable[[], list[Truth]]
    tokens: dict[str, int] = field(default_factory=lambda: {"mobile_base": 7, "camera": 7})

    @property
    def at_s(self) -> float:
        return self.robot.status().at_s

    def wait(self, seconds: float) -> None:
        self.advance_to(self.at_s + seconds)

    def provider(self, name: str) -> Provider:
        return next(provider for provider in self.robot.providers() if provider.card.provider_id == name)

    def request(self, name: str, parameters: Parameters, *, node: str = "go", attempt: int = 1) -> StartRequest:
        card = self.provider(name).card
        node_id = NodeId(node)
        identity = InvocationIdentity(
            mission_id=MISSION,
            node_id=node_id,
            attempt=attempt,
            request_id=request_id(MISSION, node_id, attempt),
            provider_id=ProviderId(name),
        )
        return StartRequest(
            identity=identity,
            capability=card.capability,
            parameters=parameters,
            k_ctx=1,
            configuration=Digest("0" * 64),
            deadline_s=self.at_s + 300.0,
            fencing={resource: self.tokens[resource] for resource in card.resources},
        )

    def start(self, name: str, parameters: Parameters, *, node: str = "go", attempt: int = 1) -> InvocationReport:
        return self.provider(name).start(self.request(name, parameters, node=node, attempt=attempt))

    def watch(self, report: InvocationReport, *, until_s: float = 300.0, poll_s: float = 0.5) -> InvocationReport:
        """Poll with keepalives until it is terminal, or `until_s` passed."""
        provider, ends_s = self.provider(report.identity.provider_id), self.at_s + until_s
        while report.status not in TERMINAL and self.at_s < ends_s:
            self.wait(poll_s)
            provider.keepalive(report.handle)
            report = provider.report(report.handle)
        return report

    def run(self, name: str, parameters: Parameters, *, node: str = "go", attempt: int = 1) -> InvocationReport:
        return self.watch(self.start(name, parameters, node=node, attempt=attempt))

    def samples(self, source: str, after: int = 0) -> list[AnySample]:
        found = self.robot.observations(after, limit=20_000).samples
        return [sample for sample in found if sample.source == source]

    def newest(self) -> int:
        """The last sequence number so far."""
        return self.robot.observations(0, limit=20_000).next_seq

    def pose(self) -> Truth:
        """Where the body truly was at the last line of truth."""
        return self.truth()[-1]


def bench(
    fidelity: Fidelity = "kinematic", *, seed: int = 5, faults: Sequence[str] = (), folder: Path | None = None
) -> Bench:
    """A robot in this process, one second old, its mission begun."""
    robot = SimulatedRobot(WorldSettings(fidelity=fidelity, seed=seed), folder)

    def configure(mission_id: MissionId, number: int, names: Sequence[str]) -> None:
        robot.configure(mission_id, number, parse_faults(names))

    made = Bench(robot, robot.advance_to, configure, lambda: robot.world.truth.records)
    made.configure(MISSION, seed, faults)
    made.wait(1.0)
    return made
