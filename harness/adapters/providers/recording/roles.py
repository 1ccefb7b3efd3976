"""Assigns recorded topics to body pose, odometry, camera and lidar; refuses a recording without a pose."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from harness.adapters.providers.recording.messages import (
    CLOUD,
    COMPRESSED_IMAGE,
    IMAGE,
    ODOMETRY,
    POSE,
    POSE_COVARIANCE,
)
from harness.adapters.providers.recording.raw_messages import Channel
from harness.adapters.providers.recording.topics import TRAJECTORY, TopicSettings
from harness.contracts.errors import RecordingInvalid
from harness.contracts.reasons import Reason, because, several
from harness.contracts.values import Count, Name, Value

READABLE = ("cdr", "ros1")


class Topic(Value):
    """One recorded topic: its ROS 2 type name (several are joined by a comma), encoding and number of messages."""

    name: Name
    type: str
    encoding: str
    messages: Count


class TopicRoles(NamedTuple):
    """Topic names by role, "" where the recording has none. `notes` list what was left out and why."""

    pose: str
    odometry: str
    camera: str
    cloud: str
    notes: tuple[Reason, ...]

    @property
    def position(self) -> str:
        return self.pose or self.odometry


def listed(channels: Sequence[Channel], counts: Mapping[str, int]) -> tuple[Topic, ...]:
    """All topics by name, those without messages included."""
    topics: dict[str, list[Channel]] = {}
    for channel in channels:
        topics.setdefault(channel.topic, []).append(channel)
    return tuple(
        Topic(
            name=name or "(no name)",
            type=", ".join(sorted({channel.type for channel in same})),
            encoding=", ".join(sorted({channel.encoding for channel in same})),
            messages=counts.get(name, 0),
        )
        for name, same in sorted(topics.items())
    )


def assigned(topics: Sequence[Topic], settings: TopicSettings, *, where: str) -> TopicRoles:
    """Roles by the settings; raises RecordingInvalid if no topic gives the robot's position."""
    if not any(topic.messages for topic in topics):
        raise RecordingInvalid(because("recording_without_messages", topics=described(topics)), where=where)
    choice = _Choice(topics, where)
    named_pose = "body_pose" in settings.model_fields_set
    pose = choice.named(settings.body_pose, (POSE, POSE_COVARIANCE, ODOMETRY), role="body_pose", must=named_pose)
    if not named_pose and any((topic.name, topic.type) == (TRAJECTORY, POSE) for topic in topics):
        pose = TRAJECTORY
    odometry = choice.of(settings.odometry, (ODOMETRY,), role="odometry")
    camera = choice.of(settings.camera, (COMPRESSED_IMAGE, IMAGE), role="camera")
    cloud = choice.of(settings.cloud, (CLOUD,), role="cloud")
    roles = TopicRoles(pose, "" if odometry == pose else odometry, camera, cloud, tuple(choice.notes))
    if not roles.position:
        raise _nowhere(topics, choice, where)
    return roles


def described(topics: Sequence[Topic]) -> tuple[str, ...]:
    """Topics for a person: name (type, count); a dash where there are none."""
    return tuple(f"{topic.name} ({topic.type or '-'}, {topic.messages})" for topic in topics) or ("-",)


class _Choice:
    def __init__(self, topics: Sequence[Topic], where: str) -> None:
        self.notes: list[Reason] = []
        self._topics, self._where = topics, where

    def named(self, name: str, types: tuple[str, ...], *, role: str, must: bool) -> str:
        """The named topic, or "" if it is absent and need not be there."""
        topic = next((topic for topic in self._topics if topic.name == name and topic.messages), None)
        if topic is None and not (must and name):
            return ""
        if topic is None or topic.type not in types:
            known = described(self._topics)
            wrong = (
                because("role_topic_type", role=role, topic=name, type=topic.type, types=types, topics=known)
                if topic
                else because("role_topic_absent", role=role, topic=name, types=types, topics=known)
            )
            raise RecordingInvalid(wrong, where=self._where)
        return name

    def of(self, name: str | None, types: tuple[str, ...], *, role: str) -> str:
        """The named topic, or the only one of the types when none is named."""
        if name is not None:
            return self.named(name, types, role=role, must=True)
        found = [topic.name for topic in self._topics if topic.type in types and topic.messages]
        if len(found) == 1:
            return found[0]
        if found:
            self.notes.append(because("role_ambiguous", role=role, topics=tuple(found)))
        return ""


def _nowhere(topics: Sequence[Topic], choice: _Choice, where: str) -> RecordingInvalid:
    held = [topic for topic in topics if topic.messages]
    if not any(topic.encoding in READABLE for topic in held):
        encodings = tuple(sorted({repr(topic.encoding) for topic in held}))
        return RecordingInvalid(because("messages_encoding_unknown", encodings=encodings), where=where)
    services = all("/srv/" in topic.type for topic in held)
    advice = tuple(choice.notes) or (because("position_topic_needed"),)
    return RecordingInvalid(
        because("service_calls_only" if services else "position_topic_missing"),
        where=where,
        do=several((*advice, because("topics_recorded", topics=described(topics)))) or "",
    )
