"""A report is recognised from what the room's microphone recorded; contraries and other places are told apart."""

import numpy as np
import pytest

from harness.adapters.providers.speech.espeak import synthesise
from harness.adapters.providers.speech.language_model import sentences, spoken
from harness.adapters.providers.speech.recogniser import recognised
from harness.contracts.errors import ProviderFailed
from harness.contracts.measurements import Sound
from simulator.room import SimulatedRoom

NAMES = ("Anchor A", "Office storage area")
ASKED = (
    "Inspection report, Office storage area. The passage is obstructed: one thing stands on its floor, taking 44% of "
    "its width. 4 images and this finding were sent. I am back at Anchor A."
)


def recorded(text: str, *, lead_s: float = 0.3) -> bytes:
    """What the microphone hears of a text, in chunks as a speaker takes them."""
    samples, rate_hz = synthesise(text)
    room, begun_s = SimulatedRoom(), 100.0 + lead_s
    for start in range(0, len(samples), rate_hz // 2):
        part = samples[start : start + rate_hz // 2].astype("<i2").tobytes()
        room.play(Sound(at_s=begun_s + start / rate_hz, rate_hz=rate_hz, pcm=part))
    return room.recording(100.0, begun_s + len(samples) / rate_hz + 0.5)


def test_a_report_is_understood_word_by_word_through_the_room() -> None:
    found = recognised(recorded(ASKED), text=ASKED, names=NAMES)
    assert found.heard == found.asked and found.unknown == ()


@pytest.mark.parametrize(
    ("said", "words"),
    [
        (
            "Inspection report, Office storage area. The passage is clear: nothing stands on its floor.",
            "is clear nothing",
        ),
        ("Inspection report, Office storage area. The passage is not obstructed.", "is not obstructed"),
        (
            "Inspection report, Anchor A. The passage is obstructed: one thing stands on its floor.",
            "report anchor a the",
        ),
    ],
)
def test_what_is_said_is_heard_though_something_else_was_asked_for(said: str, words: str) -> None:
    found = recognised(recorded(said), text=ASKED, names=NAMES)
    assert words in " ".join(found.heard)


def test_a_room_in_which_nothing_is_played_says_nothing_of_a_passage() -> None:
    found = recognised(SimulatedRoom().recording(0.0, 4.0), text=ASKED, names=NAMES)
    assert "passage" not in found.heard


def test_a_recording_is_recognised_once_and_what_is_no_recording_is_refused() -> None:
    recording = recorded("The passage is clear.")
    assert recognised(recording, text=ASKED, names=NAMES) is recognised(recording, text=ASKED, names=NAMES)
    with pytest.raises(ProviderFailed):
        recognised(b"RIFF", text=ASKED, names=NAMES)


def test_words_that_the_dictionary_lacks_are_named() -> None:
    found = recognised(SimulatedRoom().recording(0.0, 1.0), text="Inspection report, Zqxwv bay.", names=("Zqxwv bay",))
    assert found.unknown == ("zqxwv bay",)


def test_numbers_and_names_are_words() -> None:
    assert spoken("4 images, 44% of Anchor A", NAMES) == (
        "four",
        "images",
        "forty",
        "four",
        "percent",
        "of",
        "anchor_a",
    )


def test_contraries_weigh_as_much_as_what_was_to_be_said() -> None:
    weights: dict[str, int] = {}
    for sentence, weight in sentences(ASKED, NAMES):
        text = " ".join(sentence)
        weights[text] = weights.get(text, 0) + weight
    own = weights["inspection report office_storage_area"]
    assert weights["inspection report anchor_a"] == own
    assert weights["the passage is clear"] == weights["the passage is not obstructed"]


def test_the_room_keeps_what_is_played_in_its_place() -> None:
    room = SimulatedRoom()
    tone = (8000 * np.sin(np.arange(8000) / 5)).astype("<i2").tobytes()
    room.play(Sound(at_s=11.0, rate_hz=16_000, pcm=tone))
    heard = np.frombuffer(room.recording(10.0, 13.0)[44:], dtype="<i2")
    loud = np.abs(heard.astype(int)) > 1500
    assert not loud[:15_900].any() and loud[16_000:23_900].mean() > 0.3 and not loud[24_500:].any()


def test_a_name_that_the_dictionary_lacks_is_heard_as_the_words_it_is_written_from() -> None:
    names = ("Coldstore", "Packbay", *NAMES)
    text = ASKED.replace("Office storage area", "Coldstore")
    found = recognised(recorded(text), text=text, names=names)
    assert found.unknown == () and "coldstore" in found.heard
    elsewhere = recognised(recorded(text.replace("Coldstore", "Packbay")), text=text, names=names)
    assert "packbay" in elsewhere.heard and "coldstore" not in elsewhere.heard
