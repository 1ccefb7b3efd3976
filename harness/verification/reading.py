"""Reads C3 for the verifier: typed records, checked blobs and tracks. Raises Undecidable for what it cannot read."""

from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, TypeVar, cast

import msgspec

from harness.contracts.capabilities import CapabilityCard
from harness.contracts.contexts import Blobs, Context, ContextRecord
from harness.contracts.effects import Condition
from harness.contracts.errors import HarnessError, StoreUnavailable
from harness.contracts.evidence import CommittedFact, DeclaredEffect, EvidenceReference
from harness.contracts.ids import Digest, NodeId, sha256
from harness.contracts.observations import InstrumentReading, Odometry, Pose, Scan, Trajectory
from harness.contracts.protocol import Receipt
from harness.contracts.reasons import Reason, because
from harness.contracts.verifier_inputs import CommittedNode, Execution, RecentSamples, VerificationPolicy
from harness.verification.finding import Undecidable
from harness.verification.independence import Lineage

T = TypeVar("T")
FUTURE_S = 0.05
"""Samples may not be younger than the evidence: a sensor clock ahead by more than this does not count."""


@dataclass(frozen=True)
class AdmittedTrack:
    """The admitted samples of one execution: distinct sensor times, in order, none below the minimum confidence.

    `imu`: times with accelerations, `turning`: with turn rates.
    `newest_arrived_s`: the latest instant by other streams' clocks at which a pose arrived, whatever its stamp.
    `terminal_s`: when the execution ended, where the reference says so.
    """

    current: bool
    dispatched_s: float
    poses: tuple[Pose, ...]
    odometry: tuple[Odometry, ...]
    imu: tuple[tuple[float, float, float], ...]
    blob: Digest | None
    newest_arrived_s: float | None
    turning: tuple[tuple[float, float], ...] = ()
    terminal_s: float | None = None
    instruments: tuple[InstrumentReading, ...] = ()
    scans: tuple[Scan, ...] = ()

    @property
    def until_s(self) -> float | None:
        """Sensor time of the newest odometry or IMU sample."""
        times = [*(one.at_s for one in self.odometry[-1:]), *(one[0] for one in self.imu[-1:])]
        return max(times, default=None)

    @cached_property
    def maps(self) -> frozenset[tuple[str, str]]:
        """(frame, map version) of the poses."""
        return frozenset((pose.frame, pose.map_version) for pose in self.poses)


@dataclass(frozen=True)
class Evidence:
    """One compiled C3 and the bytes it cites: the only things a predicate sees."""

    context: Context
    blobs: Blobs
    until_s: float | None = None
    scope: str = ""
    lineage: Lineage = field(default_factory=Lineage, compare=False, repr=False)
    """Which accepted facts were read since it was last cleared."""
    found: dict[Hashable, Any] = field(default_factory=dict, compare=False, repr=False)
    """What was computed of this evidence before: it does not change, and several conditions ask the same of it."""

    def once(self, key: Hashable, make: Callable[[], T]) -> T:
        """The result of `make`, computed once per key."""
        if key not in self.found:
            self.found[key] = make()
        value: T = self.found[key]
        return value

    def at(self, instant_s: float) -> "Evidence":
        """The same evidence as it stood at an earlier instant: nothing younger is seen (R14)."""
        return Evidence(self.context, self.blobs, until_s=instant_s, scope=self.scope, lineage=self.lineage)

    def within(self, name: str) -> "Evidence":
        """The same evidence without facts of other clauses, for a condition of that name: `2.goal.linked` is of 2."""
        scope = scope_of(name)
        if scope == self.scope:
            return self
        return Evidence(self.context, self.blobs, until_s=self.until_s, scope=scope, lineage=self.lineage)

    @cached_property
    def conditions(self) -> tuple[Condition, ...]:
        return self._required("conditions", tuple[Condition, ...])

    @cached_property
    def policy(self) -> VerificationPolicy:
        return self._required("policy", VerificationPolicy)

    @cached_property
    def execution(self) -> Execution:
        return self._required("execution", Execution)

    @cached_property
    def speaks_at_s(self) -> float:
        """The instant at which age counts: collection of the packet, now for a goal, or the earlier one asked for."""
        if self.until_s is not None:
            return self.until_s
        return self.execution.collected_s if self.context.one("execution") else self.context.at_s

    @cached_property
    def provider_sources(self) -> tuple[str, ...] | None:
        """Sources that the executing provider itself uses; None where no provider is judged or none is named."""
        record = self.context.one("card")
        return (read(record, CapabilityCard).sources or None) if record else None

    @property
    def facts(self) -> tuple[CommittedFact, ...]:
        """All accepted facts of the context: whoever reads them builds on each of them."""
        for fact in self._facts:
            self.lineage.note(fact.condition_id, fact.independence)
        return self._facts

    @cached_property
    def _facts(self) -> tuple[CommittedFact, ...]:
        record = self.context.one("facts")
        every = read(record, tuple[CommittedFact, ...]) if record else ()
        return tuple(one for one in every if not self.scope or scope_of(one.node_id) in ("", self.scope))

    def build_on(self, nodes: Iterable[NodeId]) -> None:
        """Note that an answer rests on these stages: on their accepted facts, or on effects that are only declared."""
        names = set(nodes)
        for fact in self._facts:
            if fact.node_id in names:
                self.lineage.note(fact.condition_id, fact.independence)
        for effect in self.declared_effects:
            if effect.node_id in names:
                self.lineage.note(effect.condition_id, 0)

    @cached_property
    def receipts(self) -> tuple[Receipt, ...]:
        found = (read(record, tuple[Receipt, ...]) for record in self.context.all("receipts"))
        return tuple(receipt for receipts in found for receipt in receipts)

    @cached_property
    def declared(self) -> tuple[dict[str, float], ...]:
        """Declared numbers, the newest execution's first."""
        records = sorted(self.context.all("declared"), key=lambda record: -record.at_s)
        return tuple(read(record, dict[str, float]) for record in records)

    @cached_property
    def images(self) -> tuple[EvidenceReference, ...]:
        found = [read(record, EvidenceReference) for record in self.context.all("image")]
        return tuple(sorted(found, key=lambda image: image.from_s))

    def measured(self, kind: str) -> tuple[EvidenceReference, ...]:
        """What an independent source measured, oldest first; nothing younger than what the evidence speaks of."""
        found = [read(record, EvidenceReference) for record in self.context.all(kind)]
        return tuple(sorted((one for one in found if one.from_s <= self.speaks_at_s), key=lambda one: one.from_s))

    @cached_property
    def nodes(self) -> tuple[CommittedNode, ...]:
        """The accepted stages."""
        return tuple(node for node in self.ended if not node.declared)

    @cached_property
    def ended(self) -> tuple[CommittedNode, ...]:
        """The accepted stages, and those that are only declared."""
        single = (read(record, CommittedNode) for record in self.context.all("node"))
        listed = (read(record, tuple[CommittedNode, ...]) for record in self.context.all("nodes"))
        return (*single, *(node for nodes in listed for node in nodes))

    @cached_property
    def declared_effects(self) -> tuple[DeclaredEffect, ...]:
        """What only its provider declares, with the mission's consent."""
        record = self.context.one("declared_effects")
        return read(record, tuple[DeclaredEffect, ...]) if record else ()

    @cached_property
    def tracks(self) -> tuple[AdmittedTrack, ...]:
        """Cited executions in order of dispatch, then the current one (or now)."""
        cited: list[EvidenceReference] = []
        current: list[EvidenceReference] = []
        for record in self.context.all("trajectory"):
            reference = read(record, EvidenceReference)
            (current if reference.values.get("role") == "current" else cited).append(reference)
        for record in self.context.all("tracks"):
            cited.extend(read(record, tuple[EvidenceReference, ...]))
        found = [self._track([one], current=False) for one in cited]
        return (*sorted(found, key=lambda track: track.dispatched_s), *self._now(current))

    @cached_property
    def before(self) -> Trajectory:
        """Samples from just before the dispatches, of all packets in the context."""
        found = [
            self.decoded(reference.blob, Trajectory)
            for record in self.context.all("before")
            for reference in [read(record, EvidenceReference)]
            if reference.kind in ("before", "trajectory")
        ]
        return Trajectory(
            poses=tuple(pose for one in found for pose in one.poses),
            odometry=tuple(sample for one in found for sample in one.odometry),
            imu=tuple(sample for one in found for sample in one.imu),
        )

    def bytes_of(self, digest: Digest) -> bytes:
        """The blob, its checksum computed again. Raises Undecidable if it is missing or changed, and StoreUnavailable
        where nobody can say now: an outage is no verdict."""
        try:
            body = self.blobs(digest)
        except StoreUnavailable:
            raise
        except (HarnessError, KeyError) as error:
            raise Undecidable(because("blob_unreadable", blob=digest[:12], error=_why(error))) from error
        if sha256(body) != digest:
            raise Undecidable(because("blob_checksum_wrong", blob=digest[:12]))
        return body

    def decoded(self, digest: Digest, kind: type[T]) -> T:
        """The blob as JSON of `kind`. Raises Undecidable."""
        try:
            body = self.bytes_of(digest)
            known = _decoded if len(body) <= MOST_CACHED_BYTES else _decoded.__wrapped__
            value: T = known(body, cast(Hashable, kind))
        except msgspec.MsgspecError as error:
            raise Undecidable(
                because("blob_of_another_kind", blob=digest[:12], kind=kind.__name__, error=str(error))
            ) from error
        return value

    def fact(self, name: str, *, node_id: str = "") -> CommittedFact:
        """The newest committed fact of that name (of that node). Raises Undecidable if there is none."""
        found = [one for one in self._facts if one.name == name and node_id in ("", one.node_id)]
        if not found:
            raise Undecidable(
                because("no_accepted_fact_of_stage", name=name, stage=node_id)
                if node_id
                else because("no_accepted_fact", name=name)
            )
        newest = max(found, key=lambda one: one.k)
        self.lineage.note(newest.condition_id, newest.independence)
        return newest

    def newest_fact(self, names: Sequence[str], *, node_id: str = "") -> CommittedFact:
        """The newest committed fact of any of these names (of that node). Raises Undecidable if there is none."""
        found = [one for one in self._facts if one.name in names and node_id in ("", one.node_id)]
        if not found:
            raise Undecidable(because("no_accepted_fact", name=names[0]))
        newest = max(found, key=lambda one: one.k)
        self.lineage.note(newest.condition_id, newest.independence)
        return newest

    def facts_of(self, *, node_id: str = "", names: Sequence[str] = ()) -> tuple[CommittedFact, ...]:
        """The accepted facts of a node, or of these names, or both: an answer that reads them rests on them."""
        found = [one for one in self._facts if node_id in ("", one.node_id) and (not names or one.name in names)]
        for fact in found:
            self.lineage.note(fact.condition_id, fact.independence)
        return tuple(found)

    def facts_across(self, node_id: str) -> tuple[CommittedFact, ...]:
        """The accepted facts of a stage of any clause: a report that tells of several clauses rests on all of them."""
        record = self.context.one("facts")
        every = read(record, tuple[CommittedFact, ...]) if record else ()
        found = tuple(one for one in every if one.node_id == node_id)
        for fact in found:
            self.lineage.note(fact.condition_id, fact.independence)
        return found

    def _now(self, references: Sequence[EvidenceReference]) -> list[AdmittedTrack]:
        record = self.context.one("observations")
        if record is not None:
            samples = read(record, RecentSamples).trajectory
            return [self._admitted(samples, current=True, dispatched_s=self.context.at_s, blob=None)]
        return [self._track(references, current=True)] if references else []

    def _track(self, references: Sequence[EvidenceReference], *, current: bool) -> AdmittedTrack:
        samples = [self.decoded(one.blob, Trajectory) for one in references]
        merged = Trajectory(
            poses=tuple(pose for one in samples for pose in one.poses),
            odometry=tuple(sample for one in samples for sample in one.odometry),
            imu=tuple(sample for one in samples for sample in one.imu),
            instruments=tuple(sample for one in samples for sample in one.of_instruments),
            scans=tuple(sample for one in samples for sample in one.scans),
        )
        dispatched_s = min(float(one.values.get("dispatched_s", one.from_s)) for one in references)
        admitted = self._admitted(merged, current=current, dispatched_s=dispatched_s, blob=references[0].blob)
        ends = [float(one.values["terminal_s"]) for one in references if "terminal_s" in one.values]
        return replace(admitted, terminal_s=max(ends, default=None))

    def _admitted(
        self, samples: Trajectory, *, current: bool, dispatched_s: float, blob: Digest | None
    ) -> AdmittedTrack:
        until_s, least = self.speaks_at_s + FUTURE_S, self.policy.evidence.minimum_confidence
        poses = {one.at_s: one for one in samples.poses if one.at_s <= until_s and one.confidence >= least}
        odometry = {one.at_s: one for one in samples.odometry if one.at_s <= until_s}
        imu = {one.at_s: (one.at_s, one.ax_mps2, one.ay_mps2) for one in samples.imu if one.at_s <= until_s}
        turning = {one.at_s: (one.at_s, one.w_radps) for one in samples.imu if one.at_s <= until_s}
        return AdmittedTrack(
            current=current,
            dispatched_s=dispatched_s,
            poses=tuple(poses[at_s] for at_s in sorted(poses)),
            odometry=tuple(odometry[at_s] for at_s in sorted(odometry)),
            imu=tuple(imu[at_s] for at_s in sorted(imu)),
            blob=blob,
            newest_arrived_s=_newest_arrival(samples, until_s=until_s),
            turning=tuple(turning[at_s] for at_s in sorted(turning)),
            instruments=tuple(one for one in samples.of_instruments if one.at_s <= until_s),
            scans=tuple(one for one in samples.scans if one.at_s <= until_s),
        )

    def _required(self, kind: str, of: type[T]) -> T:
        record = self.context.one(kind)
        if record is None:
            raise Undecidable(because("context_lacks", kind=kind))
        return read(record, of)


def scope_of(name: str) -> str:
    """The part of a composite mission that a stage or condition belongs to: `2` of `2.go`; empty for all others."""
    head, dot, _ = name.partition(".")
    return head if dot and head.isdecimal() else ""


MOST_CACHED_BYTES = 4 << 20
"""A track of about three minutes; a longer one takes three times as much when it is read, and is read again instead."""


@lru_cache(maxsize=4)
def _decoded(body: bytes, kind: Hashable) -> Any:
    """Decodes and caches by bytes: a node's track is read again for the goal, and by each of its conditions."""
    return msgspec.json.decode(body, type=kind)


def _why(error: HarnessError | KeyError) -> Reason | str:
    return error.reason if isinstance(error, HarnessError) else str(error)


def read(record: ContextRecord, kind: type[T]) -> T:
    """The record's value as its contract type. Raises Undecidable if it is another."""
    try:
        return record.read(kind)
    except msgspec.ValidationError as error:
        raise Undecidable(because("record_unreadable", kind=record.kind, error=str(error))) from error


def _newest_arrival(samples: Trajectory, *, until_s: float) -> float | None:
    """Arrival of the last pose: the stamp of the newest other sample that the robot numbered before it."""
    last = max((pose.seq for pose in samples.poses if pose.at_s <= until_s), default=None)
    if last is None:
        return None
    times = [one.at_s for one in samples.odometry if one.seq < last]
    times += [one.at_s for one in samples.imu if one.seq < last]
    return max(times, default=None)
