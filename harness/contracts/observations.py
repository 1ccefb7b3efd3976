"""Sensor samples with a source, a sensor time and a frame. Observed, never accepted (R28)."""

from typing import Annotated, Literal

import msgspec

from harness.contracts.ids import Digest, RequestId
from harness.contracts.values import Count, Name, Share, Value

SINGLE_SOURCE = "single_source"
"""The label of a mission whose position and motion come from one source, which it names."""
Origin = Literal["sensor", "provider", "planner", "verifier", "human", "configuration"]
Source = Literal["localiser", "odometry", "imu", "lidar", "camera", "battery", "joints"]


class Sample(Value, tag_field="kind"):
    """One sample. `seq` rises by one per robot; `at_s` is the sensor's own time, not the arrival time."""

    seq: Count
    at_s: float


class SensorSample(Sample):
    """A sample of one of the robot's own sensors or estimators."""

    source: Source


class Pose(SensorSample, tag="pose"):
    """Planar body pose in `frame` (metres, radians), from the localiser. `confidence` is the estimator's own."""

    frame: Name
    map_version: str
    x_m: float
    y_m: float
    yaw_rad: float
    confidence: Share = 1.0


class Odometry(SensorSample, tag="odometry"):
    """Planar pose in the odometry frame (drifts, never jumps) and body twist (m/s, rad/s)."""

    frame: Name
    x_m: float
    y_m: float
    yaw_rad: float
    v_mps: float
    w_radps: float


class Imu(SensorSample, tag="imu"):
    """Body accelerations (m/s^2, gravity removed) and yaw rate (rad/s)."""

    ax_mps2: float
    ay_mps2: float
    w_radps: float


class Scan(SensorSample, tag="scan"):
    """A lidar sweep: `blob` holds float32 xyz triples, body frame, metres; `points` of them."""

    frame: Name
    blob: Digest
    points: Count


class Image(SensorSample, tag="image"):
    """One camera frame: `blob` holds the encoded file. `yaw_rad` is the commanded heading of the frame."""

    frame: Name
    blob: Digest
    media_type: Literal["image/jpeg", "image/png"]
    width_px: Count
    height_px: Count
    yaw_rad: float
    request_id: RequestId


class Battery(SensorSample, tag="battery"):
    """State of charge, 0 to 1."""

    charge: Share


class InstrumentReading(Sample, tag="instrument"):
    """What an instrument shows: a scale, a gripper's width, a force. `source` is the instrument's name."""

    source: Annotated[str, msgspec.Meta(pattern=r"^[a-z][a-z0-9 _-]{0,60}$")]
    value: float
    unit: Annotated[str, msgspec.Meta(max_length=20)] = ""


AnySample = Pose | Odometry | Imu | Scan | Image | Battery | InstrumentReading


class Trajectory(Value):
    """The sealed samples of one invocation, in order of sensor time; stored as one blob (D8)."""

    poses: tuple[Pose, ...] = ()
    odometry: tuple[Odometry, ...] = ()
    imu: tuple[Imu, ...] = ()
    battery: tuple[Battery, ...] = ()
    scans: tuple[Scan, ...] = ()
    instruments: tuple[InstrumentReading, ...] | msgspec.UnsetType = msgspec.UNSET
    """What instruments showed; unset where there are none, and in what earlier releases stored."""

    @property
    def of_instruments(self) -> tuple[InstrumentReading, ...]:
        """The readings of all instruments."""
        return () if isinstance(self.instruments, msgspec.UnsetType) else self.instruments


class Camera(Value):
    """Pinhole model of the robot's camera: pixels; mounted `height_m` over the floor, `forward_m` ahead of the body."""

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    height_m: float
    forward_m: float
    pitch_rad: float


class LaserMount(Value):
    """Where the scan's origin is on the body, metres and radians."""

    x_m: float = 0.0
    y_m: float = 0.0
    yaw_rad: float = 0.0
