"""ROS messages as JSON has them, with the fields that evidence is read from."""

import math
from typing import Any


def header(at_s: float, frame: str) -> dict[str, Any]:
    return {"stamp": {"sec": int(at_s), "nanosec": int((at_s % 1.0) * 1e9)}, "frame_id": frame}


def _pose(x: float, y: float, yaw: float) -> dict[str, Any]:
    turn = {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}
    return {"position": {"x": x, "y": y, "z": 0.0}, "orientation": turn}


def pose(at_s: float, x: float, y: float, yaw: float = 0.0, *, frame: str = "map", variance: float = 0.01) -> Any:
    covariance = [0.0] * 36
    covariance[0] = covariance[7] = variance
    return {"header": header(at_s, frame), "pose": {"pose": _pose(x, y, yaw), "covariance": covariance}}


def pose_stamped(at_s: float, x: float, y: float, yaw: float = 0.0, *, frame: str = "map") -> Any:
    return {"header": header(at_s, frame), "pose": _pose(x, y, yaw)}


def odometry(at_s: float, x: float, y: float, yaw: float = 0.0, *, v: float = 0.0, w: float = 0.0) -> Any:
    twist = {"linear": {"x": v, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": w}}
    return {
        "header": header(at_s, "odom"),
        "child_frame_id": "base_link",
        "pose": {"pose": _pose(x, y, yaw), "covariance": [0.0] * 36},
        "twist": {"twist": twist, "covariance": [0.0] * 36},
    }


def scan(at_s: float, ranges: list[float | None], *, frame: str = "base_link") -> Any:
    return {
        "header": header(at_s, frame), "angle_min": 0.0, "angle_max": 3.0, "angle_increment": math.pi / 2,
        "time_increment": 0.0, "scan_time": 0.1, "range_min": 0.1, "range_max": 10.0, "ranges": ranges,
        "intensities": [],
    }  # fmt: skip


def battery(at_s: float, share: float | None) -> Any:
    return {"header": header(at_s, ""), "voltage": 24.0, "percentage": share, "present": True}
