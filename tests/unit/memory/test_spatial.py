"""Spatial memory: maps, places, poses, relations and sightings, each as far as it may be believed."""

import pytest
from msgspec.structs import replace

from harness.contracts.commands import ChangeEpoch, RecordObservation
from harness.contracts.ids import ConditionId, mission_stream
from harness.contracts.memory import FloorBox, KnownPlace, KnownPose, KnownRegion, KnownRelation, MapEpoch, Sighting
from harness.memory.spatial import SIGHTING_HOLDS_S, contradiction
from tests.builders.gate import GO
from tests.unit.memory.building import DOCK, FRAME, HALL, LOOK, PASSAGE, REPORT, Log, pose_evidence

ARRIVAL = ConditionId("go.arrival")


def knowledge(log: Log, *kinds: str, **changes: object) -> list[object]:
    """What is said, oldest first, leaving out what was superseded or is in conflict."""
    return [
        one.record.knowledge for one in log.found(*kinds, standings=("configured", "observed", "verified"), **changes)
    ]


@pytest.mark.ledger("R137", symbol="harness.memory.spatial:spatial")
def test_maps_places_entities_poses_relations_and_sightings_are_kept() -> None:
    log = Log()
    log.sighted("msn_a", blocked=1.0, provider="eye")
    assert knowledge(log, "map") == [MapEpoch(frame="map", map_version="m1")]
    assert knowledge(log, "place") == [KnownPlace(place=DOCK)]
    assert knowledge(log, "region") == [KnownRegion(floor_m=PASSAGE.floor_m)]
    assert knowledge(log, "pose") == [
        KnownPose(robot_id="vbot-1", point_m=(5.0, 0.0), within_m=0.1, place="dock")  # type: ignore[arg-type]
    ]
    assert knowledge(log, "relation") == [KnownRelation(relation="at", one="robot/vbot-1", other="place/dock")]
    assert knowledge(log, "sighting") == [Sighting(states={"blocked": 1.0, "obstructions": 1.0}, report=REPORT)]


def test_a_second_mission_on_the_same_site_adds_no_second_place() -> None:
    log = Log()
    log.begin("msn_a")
    before = len(log.found())
    log.begin("msn_b")
    assert len(log.found()) == before


def test_an_arrival_is_verified_by_its_measured_sources_and_a_departure_ends_it() -> None:
    log = Log()
    mission_id = log.begin()
    log.went(mission_id)
    left, there = log.found("pose")
    assert (there.standing, there.record.confidence) == ("verified", 0.9)
    assert there.record.provenance.sources == ("localiser", "odometry")
    assert (left.standing, left.until_s) == ("superseded", there.record.valid_from_s)
    log.dispatched(log.begin("msn_b"))
    assert knowledge(log, "pose") == [KnownPose(robot_id="vbot-1")]  # type: ignore[arg-type]
    assert knowledge(log, "relation") == [KnownRelation(relation="moves_to", one="robot/vbot-1", other="place/dock")]


def test_a_rejected_arrival_places_the_body_nowhere() -> None:
    log = Log()
    log.went(log.begin(), "violated")
    assert knowledge(log, "pose") == [KnownPose(robot_id="vbot-1")]  # type: ignore[arg-type]


def test_a_new_map_version_takes_over_and_the_old_one_stays_readable() -> None:
    log = Log()
    mission_id = log.begin()
    log.commit(mission_id, ChangeEpoch(map_version="m2", reason="surveyed again"))
    assert [(one.record.knowledge.map_version, one.standing) for one in log.found("map")] == [  # type: ignore[union-attr]
        ("m1", "superseded"), ("m2", "observed"),
    ]  # fmt: skip


def test_an_observation_that_contradicts_an_arrival_disputes_it_until_another_arrival_is_accepted() -> None:
    log = Log()
    mission_id = log.begin()
    log.went(mission_id)
    against = RecordObservation(node_id=GO, reference=pose_evidence(1100.0), contradicts=(ARRIVAL,))
    log.commit(mission_id, against)
    assert knowledge(log, "pose", "relation") == []
    (dispute,) = log.found("dispute")
    disputed = [one.record.record_id for one in log.found("pose", "relation") if one.standing == "disputed"]
    assert sorted(dispute.record.conflicts) == sorted(disputed) and len(disputed) == 2
    log.went(log.begin("msn_b"), distance_m=0.2)
    assert [one.within_m for one in knowledge(log, "pose") if isinstance(one, KnownPose)] == [0.2]


def test_an_observation_that_contradicts_nothing_spatial_disputes_nothing() -> None:
    log = Log()
    mission_id = log.begin()
    log.went(mission_id)
    log.commit(mission_id, RecordObservation(node_id=GO, reference=pose_evidence(1100.0), contradicts=()))
    assert log.found("dispute") == []
    assert len(knowledge(log, "pose")) == 1


def test_a_sighting_is_observed_only_and_speaks_from_when_the_images_could_be_taken_for_a_shift() -> None:
    log = Log()
    log.sighted("msn_a", blocked=1.0, provider="eye")
    (sighting,) = log.found("sighting")
    arrived = log.found("pose")[-1].record.valid_from_s
    assert (sighting.standing, sighting.record.subject) == ("observed", "passage/gap")
    assert sighting.record.provenance.sources == ("camera", "eye")
    assert set(sighting.record.provenance.blobs) == {REPORT, FRAME}
    assert sighting.record.valid_from_s == arrived
    assert sighting.record.valid_until_s == arrived + SIGHTING_HOLDS_S


@pytest.mark.ledger("R69", symbol="harness.memory.fabric:MemoryFabric.spatial")
def test_a_region_is_answered_without_what_expired_was_superseded_or_lies_elsewhere() -> None:
    log = Log()
    log.sighted("msn_a", blocked=1.0, provider="eye")
    now_s = log.clock.at_s

    def kinds(at_s: float, **changes: object) -> set[str]:
        region = _moved(**changes)  # type: ignore[arg-type]
        return {one.record.kind for one in log.memory.spatial(region, at_s=at_s)}

    assert kinds(now_s) == {"place", "region", "pose", "relation", "sighting"}
    assert kinds(now_s + 2 * SIGHTING_HOLDS_S) == {"place", "region", "pose", "relation"}
    assert kinds(now_s, x_min_m=6.5) == {"region", "sighting"}
    assert kinds(now_s, x_min_m=9.0) == set()
    assert kinds(now_s, map_version="m2") == set()
    log.dispatched(log.begin("msn_b"))
    assert kinds(log.clock.at_s) == {"place", "region", "sighting"}


def _moved(*, x_min_m: float = -20.0, map_version: str = "m1") -> FloorBox:
    return replace(HALL, x_min_m=x_min_m, map_version=map_version)


def test_two_sightings_differ_on_a_state_beyond_its_tolerance() -> None:
    one = Sighting(states={"blocked": 1.0, "share_0": 0.45})
    assert contradiction(one, Sighting(states={"blocked": 1.0, "share_0": 0.52})) == ""
    assert contradiction(one, Sighting(states={"blocked": 1.0, "share_0": 0.6})) == "share_0"
    assert contradiction(one, Sighting(states={"blocked": 0.0})) == "blocked"


def test_a_mission_that_memory_left_half_read_goes_on_where_it_was() -> None:
    log = Log()
    mission_id = log.begin()
    log.dispatched(mission_id, GO)
    log.memory.catch_up()
    log.judged(mission_id)
    log.dispatched(mission_id, LOOK, "eye")
    log.judged(mission_id)
    assert [one.record.provenance.stream for one in log.found("sighting")] == [mission_stream(mission_id)]
