"""Settings that assign a recording's topics, frames and clocks; the paper's topics are the default."""

import re
from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, field_validator

from harness.contracts.errors import ContractInvalid
from harness.contracts.reasons import because

TRAJECTORY = "trajectory"
"""What the poses of a trajectory file are listed as; topics begin with a slash."""
Clock = Literal["header", "log"]
GOAL_TOPICS = ("/goal_pose", "/move_base_simple/goal")
"""Where navigation stacks publish the goal that a person or a program sent, by custom."""


class _Settings(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")


class StaticTransform(_Settings):
    """Pose of `child` in `parent`: metres, and a quaternion x, y, z, w that need not be normalised."""

    parent: Annotated[str, Field(min_length=1)]
    child: Annotated[str, Field(min_length=1)]
    translation_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 1.0)


class TopicSettings(_Settings):
    """How a recording is read (R176 to R179).

    `odometry`, `camera` and `cloud` are topic names, "" for none, or None for the only topic of a readable type.
    `clock` says which time becomes sensor time: the message's header stamp or the recorder's log time. `camera_clock`
    is log time as in the paper. `arrival`, `departure` and `closing` are regular expressions over the supervisor's log
    lines; a group `distance_m` in `arrival` is the declared distance, and a closing ends a leg's evidence.
    `static_transforms` win over recorded ones. `goal` is the topic of the goals that were sent (PoseStamped), None for
    those of GOAL_TOPICS that are there. `pose_period_s` is the time between two poses of a trajectory without stamps.
    `pose_axes` says which axes a trajectory has: None is camera (x right, y down, z ahead) for KITTI, else robot.
    """

    body_pose: str = "/vbot_planner/body_pose"
    odometry: str | None = None
    dispatched_path: str = "/initial_path"
    goal: str | None = None
    slam_path: str = "/path"
    supervisor_log: str = "/rosout"
    recorded_transforms: str = "/tf_static"
    camera: str | None = None
    cloud: str | None = None
    map_frame: Annotated[str, Field(min_length=1)] = "map"
    map_version: str | None = None
    body_frames: tuple[str, ...] = ("base_link", "base_footprint", "body", "base")
    static_transforms: tuple[StaticTransform, ...] = ()
    clock: Clock = "header"
    camera_clock: Clock = "log"
    arrival: str = r"GOAL REACHED(?:.*?(?P<distance_m>\d+(?:\.\d+)?)\s*m\b)?"
    departure: str = r"DEPART(?:ED|URE)"
    closing: str = r"LEG CLOSED"
    camera_period_s: Annotated[float, Field(ge=0)] = 1.0
    cloud_period_s: Annotated[float, Field(ge=0)] = 1.0
    cloud_points: Annotated[int, Field(ge=1)] = 4096
    pose_period_s: Annotated[float, Field(gt=0, le=3600)] | None = None
    pose_axes: Literal["robot", "camera"] | None = None

    @property
    def goals(self) -> tuple[str, ...]:
        """The topics that goals are read from."""
        return GOAL_TOPICS if self.goal is None else (self.goal,)

    @field_validator("arrival", "departure", "closing")
    @classmethod
    def _compiles(cls, pattern: str) -> str:
        try:
            re.compile(pattern)
        except re.error as error:
            raise ValueError(f"not a regular expression: {error}") from error
        return pattern


def topic_settings(given: Sequence[str], **otherwise: str) -> TopicSettings:
    """Settings of texts like odometry=/odom; `otherwise` are those that nobody gave. Raises ContractInvalid."""
    roles = otherwise | dict(text.partition("=")[::2] for text in given)
    try:
        return TopicSettings.model_validate(roles)
    except ValidationError as error:
        first = error.errors()[0]
        raise ContractInvalid(
            because(
                "topic_setting_invalid",
                name=".".join(str(part) for part in first["loc"]),
                error=first["msg"],
                known=tuple(TopicSettings.model_fields),
            ),
            where="--topic",
        ) from error
