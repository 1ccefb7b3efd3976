"""Capability cards of the simulated robot's providers: two that navigate, one that photographs, one that looks."""

from msgspec.structs import replace

from harness.contracts import capabilities
from harness.contracts.ids import ProviderId, ResourceId
from harness.contracts.protocol import PROTOCOL

BASE, CAMERA = ResourceId("mobile_base"), ResourceId("camera")
SOFTWARE = "harness.adapters.providers.simulation"
_NAVIGATION = (
    capabilities.Parameter(name="route", type="points", unit="m"),
    capabilities.Parameter(name="target", type="point", unit="m"),
    capabilities.Parameter(name="frame", type="frame"),
    capabilities.Parameter(name="tolerance_m", type="number", unit="m", minimum=0.05, maximum=5.0),
    capabilities.Parameter(name="speed_cap_mps", type="number", unit="m/s", minimum=0.05, maximum=0.5),
    capabilities.Parameter(name="lookahead_m", type="number", required=False, unit="m", minimum=0.2, maximum=2.0),
    capabilities.Parameter(name="replan", type="boolean", required=False),
    capabilities.Parameter(name="keep_out", type="points", required=False, unit="m"),
    capabilities.Parameter(
        name="heading_rad", type="number", required=False, unit="rad", minimum=-3.1416, maximum=3.1416
    ),
)
_NAVIGATION_FAILURES = ("no_progress", "route_not_reachable", "interrupted", "timeout", "robot_restarted", "fallen")
_NAVIGATION_EVIDENCE = ("pose", "odometry", "imu", "scan", "receipt:arrival", "receipt:disarm")
_SOURCES = ("localiser", "odometry", "lidar")

ROUTE_FOLLOWER = capabilities.CapabilityCard(
    provider_id=ProviderId("route-follower"),
    version="1.0.0",
    embodiments=("quadruped", "wheeled"),
    parameters=_NAVIGATION,
    preconditions=("localised", "hardware_stop_released"),
    side_effects=("moves the robot along the given route",),
    latency=capabilities.Latency(base_s=6.0, per_metre_s=2.1),
    resources=(BASE,),
    cancel=capabilities.CancelBehaviour(acknowledged=True, within_s=2.0),
    risk="low",
    failure_words=_NAVIGATION_FAILURES,
    evidence=_NAVIGATION_EVIDENCE,
    capability="navigate",
    estimates=capabilities.Estimates(success=0.95, risk=0.1, uncertainty=0.1, cost=1.0),
    moves=True,
    sources=_SOURCES,
    reattach="by_request",
    resumable=True,
    software=SOFTWARE,
    protocol=PROTOCOL,
)
CAREFUL_PLANNER = replace(
    ROUTE_FOLLOWER,
    provider_id=ProviderId("careful-local-planner"),
    side_effects=("moves the robot near the given route, around obstacles",),
    latency=capabilities.Latency(base_s=8.0, per_metre_s=3.6),
    estimates=capabilities.Estimates(success=0.88, risk=0.15, uncertainty=0.2, cost=2.0),
)
PANORAMA_CAMERA = capabilities.CapabilityCard(
    provider_id=ProviderId("panorama-camera"),
    version="1.0.0",
    embodiments=("quadruped", "wheeled"),
    parameters=(
        capabilities.Parameter(name="frames", type="number", minimum=3, maximum=24),
        capabilities.Parameter(name="segment_s", type="number", required=False, unit="s", minimum=0.0, maximum=60.0),
    ),
    preconditions=("localised", "hardware_stop_released"),
    side_effects=("turns the robot once around in place", "captures images"),
    latency=capabilities.Latency(base_s=28.0),
    resources=(BASE, CAMERA),
    cancel=capabilities.CancelBehaviour(acknowledged=True, within_s=2.0),
    risk="low",
    failure_words=("timeout", "robot_restarted", "fallen"),
    evidence=("image", "pose", "odometry", "receipt:rotation", "receipt:capture"),
    capability="capture_panorama",
    estimates=capabilities.Estimates(success=0.98, risk=0.05, uncertainty=0.05, cost=1.0),
    moves=True,
    sources=("camera", "odometry"),
    reattach="by_request",
    resumable=True,
    software=SOFTWARE,
    protocol=PROTOCOL,
)
OBSERVER = capabilities.CapabilityCard(
    provider_id=ProviderId("observer"),
    version="1.0.0",
    embodiments=("quadruped", "wheeled"),
    parameters=(
        capabilities.Parameter(name="duration_s", type="number", unit="s", minimum=0.1, maximum=600.0),
        capabilities.Parameter(name="frames", type="number", required=False, minimum=0, maximum=1),
    ),
    preconditions=(),
    side_effects=(),
    latency=capabilities.Latency(base_s=2.0),
    resources=(),
    cancel=capabilities.CancelBehaviour(acknowledged=True, within_s=0.5),
    risk="low",
    failure_words=("timeout", "robot_restarted"),
    evidence=("pose", "odometry", "imu", "scan", "image"),
    capability="observe",
    estimates=capabilities.Estimates(success=0.99, risk=0.0, uncertainty=0.05, cost=0.2),
    moves=False,
    sources=("localiser", "odometry", "lidar", "camera"),
    reattach="by_request",
    software=SOFTWARE,
    protocol=PROTOCOL,
)
CARDS: tuple[capabilities.CapabilityCard, ...] = (ROUTE_FOLLOWER, CAREFUL_PLANNER, PANORAMA_CAMERA, OBSERVER)
