"""Goals that say what a picture is to show: the harness reads the very picture itself, whatever a provider says."""

from collections.abc import Sequence

import pytest

from app.i18n.reasons.rendering import sentence
from harness.adapters.pictures import PICTURES
from harness.baseline.load import site
from harness.contracts.decisions import Accepted
from harness.contracts.errors import Unsatisfiable
from harness.contracts.ids import Digest
from harness.contracts.pictures import DetectedObject, PictureInventory, ReadText, VisionModel
from harness.extra_templates import begin
from harness.goals.reader import read_goal
from harness.projections.readings import reading_in_words
from harness.runtime import Start
from tests.builders.connections import staged
from tests.builders.missions_run import OPERATOR, ROBOT, Ran

MODEL = VisionModel(task="texts", name="scripted", version="1", digest=Digest("d" * 64))


class ScriptedReading:
    """A PictureObserver that finds these lines of text and objects in every picture."""

    labels = frozenset({"chair", "couch"})

    def __init__(self, texts: Sequence[tuple[str, float]] = (), objects: Sequence[tuple[str, float]] = ()) -> None:
        self._texts = tuple(ReadText(text=text, score=score, box_px=(1, 2, 30, 10)) for text, score in texts)
        self._objects = tuple(DetectedObject(label=name, score=score, box_px=(1, 2, 30, 40)) for name, score in objects)

    def observe(self, image: Digest, body: bytes) -> PictureInventory:
        width_px, height_px = PICTURES.size(body)
        return PictureInventory(
            image=image,
            width_px=width_px,
            height_px=height_px,
            objects=self._objects,
            texts=self._texts,
            models=(MODEL,),
        )


class AnotherPicture(ScriptedReading):
    """Answers with a reading of some other picture."""

    def observe(self, image: Digest, body: bytes) -> PictureInventory:
        return super().observe(Digest("0" * 64), body)


def photographed(goal: str, observer: ScriptedReading | None) -> Ran:
    with staged(observer=observer) as stage:
        start = Start(actor=OPERATOR, robot_id=ROBOT, goal=goal, seed=3)
        assert isinstance(begin(stage.runtime, start), Accepted)
        return stage.run(stage.runtime.missions()[0].mission_id)


SIGN = "Photograph the sign that says B-12"


def test_a_sign_that_the_harness_reads_in_the_picture_ends_the_mission_well() -> None:
    mission = photographed(SIGN, ScriptedReading([("EXIT", 0.99), ("B-12", 0.95)])).mission
    assert mission.status == "succeeded", mission.reason
    assert {fact.name for fact in mission.facts} >= {"pictured", "shows", "kept_picture"}


@pytest.mark.parametrize(
    "observer",
    [
        ScriptedReading(),
        ScriptedReading([("B-121", 0.99), ("B-13", 0.99)]),
        ScriptedReading([("B-12", 0.6)]),
        AnotherPicture([("B-12", 0.99)]),
    ],
    ids=["nothing", "other signs", "doubtful", "reading of another picture"],
)
def test_a_picture_in_which_it_is_not_read_never_counts(observer: ScriptedReading) -> None:
    mission = photographed(SIGN, observer).mission
    assert mission.status in ("failed", "awaiting_human", "handed_off") and mission.goal_outcome != "satisfied"
    assert not any(fact.name == "shows" for fact in mission.facts)


def test_an_object_needs_a_score_above_that_of_a_description() -> None:
    assert photographed("Photograph the chair", ScriptedReading(objects=[("chair", 0.7)])).mission.status == "succeeded"
    doubtful = photographed("Photograph the chair", ScriptedReading(objects=[("chair", 0.5)])).mission
    assert doubtful.status != "succeeded" and doubtful.goal_outcome != "satisfied"


def test_without_a_reader_the_goal_is_refused_with_the_extra_that_brings_one() -> None:
    with pytest.raises(Unsatisfiable) as caught:
        photographed(SIGN, None)
    assert caught.value.reason.code == "pictures_not_read" and caught.value.reason.facts["extra"] == "vision"


def test_a_thing_that_no_detector_here_knows_is_refused_by_name() -> None:
    with pytest.raises(Unsatisfiable) as caught:
        photographed("Photograph the fire extinguisher", ScriptedReading())
    assert (caught.value.reason.code, caught.value.reason.facts["name"]) == ("object_not_known", "fire extinguisher")


@pytest.mark.parametrize(
    ("goal", "read"),
    [
        (SIGN, "take a picture from here, showing a sign that says B-12"),
        ('Take a photo of the sign which reads "EXIT 3".', "take a picture from here, showing a sign that says EXIT 3"),
        (
            "Photograph the sign that says B-12 in the office storage area",
            "photograph Office storage area, showing a sign that says B-12",
        ),
        ("Photograph the fire extinguisher", "take a picture from here, showing fire extinguisher"),
        ("拍摄写着B-12的标牌", "take a picture from here, showing a sign that says B-12"),
        ("去储物区拍摄写着“B-12”的标牌", "photograph Office storage area, showing a sign that says B-12"),
    ],
)
def test_what_a_picture_is_to_show_is_read_in_english_and_chinese(goal: str, read: str) -> None:
    reading = read_goal(goal, site=site())
    assert sentence(reading_in_words(reading)) == read and not reading.unread


@pytest.mark.parametrize("goal", ["Do not photograph the chair", "Go to the chair", "Photograph the chair the couch"])
def test_a_subject_that_no_condition_expresses_is_asked_about(goal: str) -> None:
    assert read_goal(goal, site=site()).unread
