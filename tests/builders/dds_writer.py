"""A process that writes ROS 2 topics on DDS: one line of JSON on standard input is one message."""

import dataclasses
import json
import sys
from typing import Any

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import Domain, DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.topic import Topic

from harness.adapters.providers.topics.dds import settings_of
from harness.adapters.providers.topics.dds_types import DDS_TYPES

WRITERS = Qos(Policy.Reliability.BestEffort, Policy.Durability.Volatile, Policy.History.KeepLast(10))
COVARIANCE = 36


def filled(kind: Any, found: Any) -> Any:
    """The message, fields that are not given left at zero."""
    values = {}
    for field in dataclasses.fields(kind):
        given, what = found.get(field.name), field.type
        if dataclasses.is_dataclass(what):
            values[field.name] = filled(what, given or {})
        elif given is not None:
            values[field.name] = given
        elif what in (str, bool):
            values[field.name] = what()
        else:
            values[field.name] = [] if "sequence" in repr(what) else 0
    return kind(**values)


def main(domain_id: int) -> None:
    domain = Domain(domain_id, settings_of("127.0.0.1"))
    participant = DomainParticipant(domain_id)
    writers: dict[str, DataWriter[Any]] = {}
    for line in sys.stdin:
        topic, kind, message = json.loads(line)
        if topic not in writers:
            made = Topic(participant, f"rt/{topic.lstrip('/')}", DDS_TYPES[kind])
            writers[topic] = DataWriter(participant, made, qos=WRITERS)
        writers[topic].write(filled(DDS_TYPES[kind], message))
    del writers, participant, domain


if __name__ == "__main__":
    main(int(sys.argv[1]))
