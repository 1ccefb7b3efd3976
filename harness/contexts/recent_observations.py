"""Turns recent observations into items: the newest sample per source, the robot's status, the references. Pure."""

import msgspec

from harness.contexts.selection import SelectionItem
from harness.contexts.view import StateView, referenced
from harness.contracts.contexts import ContextRecord, Withheld
from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import NodeId
from harness.contracts.observations import AnySample, Image, InstrumentReading, Pose, Trajectory
from harness.contracts.reasons import because
from harness.contracts.values import raw
from harness.contracts.verifier_inputs import RecentSamples

SLOW_SOURCES = ("battery", "lidar")
"""Sources that speak less than once a second: they age like images."""


def newest_samples(view: StateView) -> list[SelectionItem]:
    """The newest sample of each source, kind "observation"; ages to now, since it is about now."""
    newest: dict[str, AnySample] = {}
    for sample in view.recent:
        if sample.source not in newest or sample.at_s >= newest[sample.source].at_s:
            newest[sample.source] = sample
    return [_sample_item(view, sample) for sample in newest.values()]


def robot_status(view: StateView) -> list[SelectionItem]:
    """The robot's own status report, kind "robot"."""
    if view.status is None:
        return []
    record = ContextRecord(
        kind="robot",
        origin="provider",
        source=view.status.robot_id,
        at_s=view.status.at_s,
        value=raw(view.status),
    )
    states = {"map_version": view.status.map_version}
    return [SelectionItem(record, speaks_at_s=view.at_s, limit_s=view.rules.pose_age_s, states=states)]


def observed_references(view: StateView, *, scope: frozenset[NodeId] = frozenset()) -> list[SelectionItem]:
    """References that the mission recorded, kind "observed": the newest of each source, none of another map."""
    return [_reference_item(view, reference, scope=scope) for reference in view.mission.observed]


def recent_window(view: StateView, *, window_s: float) -> SelectionItem:
    """The samples of the last `window_s` seconds as one record, kind "observations"."""
    window = [sample for sample in view.recent if view.at_s - window_s <= sample.at_s <= view.at_s]
    streams = {
        name: tuple(sample for sample in window if sample.__struct_config__.tag == tag)
        for name, tag in (("poses", "pose"), ("odometry", "odometry"), ("imu", "imu"), ("battery", "battery"))
    }
    if instruments := tuple(sample for sample in window if isinstance(sample, InstrumentReading)):
        streams["instruments"] = instruments
    samples = RecentSamples(window_s=window_s, trajectory=msgspec.convert(streams, Trajectory, from_attributes=True))
    return SelectionItem(
        ContextRecord(
            kind="observations",
            origin="sensor",
            source="robot",
            at_s=max((sample.at_s for sample in window), default=view.at_s),
            value=raw(samples),
            mandatory=True,
        )
    )


def reference_states(reference: EvidenceReference) -> dict[str, float | str]:
    """The values a reference asserts, under names that only the same quantity in the same frame shares."""
    return {f"{reference.kind}@{reference.frame}.{name}": value for name, value in reference.values.items()}


def other_map(view: StateView, record: ContextRecord, map_version: str) -> Withheld | None:
    """Why a record of another map version is stale; None if it is of this one or of none (maps age by version)."""
    if map_version in ("", view.contract.map_version):
        return None
    detail = because("of_another_map", map_version=map_version, contract_map=view.contract.map_version)
    return Withheld(kind=record.kind, source=record.source, reason="stale", detail=detail)


def _sample_item(view: StateView, sample: AnySample) -> SelectionItem:
    slow = sample.source in SLOW_SOURCES or isinstance(sample, Image)
    confidence = sample.confidence if isinstance(sample, Pose) else 1.0
    record = ContextRecord(
        kind="observation",
        origin="sensor",
        source=sample.source,
        at_s=sample.at_s,
        value=raw(sample),
        confidence=confidence,
        blob=getattr(sample, "blob", None),
    )
    map_version = sample.map_version if isinstance(sample, Pose) else ""
    return SelectionItem(
        record,
        speaks_at_s=view.at_s,
        limit_s=view.rules.image_age_s if slow else view.rules.pose_age_s,
        states={"map_version": map_version} if map_version else {},
        subject="sample",
        barred=other_map(view, record, map_version),
    )


def _reference_item(view: StateView, reference: EvidenceReference, *, scope: frozenset[NodeId]) -> SelectionItem:
    record = referenced("observed", reference)
    return SelectionItem(
        record,
        scope=scope,
        states=reference_states(reference),
        subject=f"{reference.kind}@{reference.frame}",
        barred=other_map(view, record, reference.map_version),
    )
