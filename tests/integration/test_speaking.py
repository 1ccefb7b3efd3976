"""A goal that is spoken into a microphone: its words as they come, its wake phrase, and its two instants."""

import io
import json
import wave
from collections.abc import Iterator

import numpy as np
import pytest
from fastapi.testclient import TestClient

from harness.adapters.providers.speech.waves import Wave, read_wave
from tests.builders.consoles import Stand, console_stand
from tests.builders.wishes import silence, wish

WISH = "Xiao Wei, check the office storage area"
LASTS_S = 8.16


@pytest.fixture(scope="module")
def stand() -> Iterator[Stand]:
    with console_stand() as made:
        yield made


@pytest.fixture(scope="module")
def operator(stand: Stand) -> TestClient:
    return stand.operator()


def paper_recording() -> bytes:
    """The paper's: 8.16 s at 16 kHz, a wake phrase and a command between two silences."""
    sound = read_wave(wish(WISH))
    assert isinstance(sound, Wave)
    whole = np.zeros(round(LASTS_S * 16_000), dtype="<i2")
    whole[32_000 : 32_000 + len(sound.samples)] = sound.samples
    made = io.BytesIO()
    with wave.open(made, "wb") as file:
        file.setnchannels(1)
        file.setsampwidth(2)
        file.setframerate(16_000)
        file.writeframes(whole.tobytes())
    return made.getvalue()


@pytest.mark.ledger("R181", entry="API", symbol="harness.adapters.providers.speech.streaming:SphinxStream.feed")
def test_words_come_while_somebody_speaks_and_the_whole_is_kept(operator: TestClient) -> None:
    opened = operator.post("/api/v1/speech").json()["stream"]
    samples = paper_recording()[44:]
    heard = []
    for at in range(0, len(samples), 16_000):
        answer = operator.post(f"/api/v1/speech/{opened}", content=samples[at : at + 16_000])
        assert answer.status_code == 200, answer.text
        heard.append(answer.json()["partial"])
    assert heard[0] == "" and any("check" in one for one in heard[:-1]), "words come before the end"
    whole = operator.post(f"/api/v1/speech/{opened}/end").json()
    assert (whole["text"], whole["wake"]) == ("check the office storage area", "xiao wei")
    assert whole["duration_s"] == pytest.approx(LASTS_S)
    assert operator.get(f"/evidence/{whole['recording']}").content[44:] == samples
    assert operator.post(f"/api/v1/speech/{opened}", content=b"12").status_code == 404, "the stream is over"


def test_a_stream_is_its_speakers_own_and_takes_samples_alone(stand: Stand, operator: TestClient) -> None:
    opened = operator.post("/api/v1/speech").json()["stream"]
    assert stand.host().post(f"/api/v1/speech/{opened}", content=b"12").status_code == 404
    assert operator.post(f"/api/v1/speech/{opened}", content=b"123").status_code >= 400
    assert operator.post(f"/api/v1/speech/{opened}", content=b"12").status_code == 404, "what failed is over"


@pytest.mark.ledger("R197", entry="API", symbol="harness.adapters.providers.speech.transcriber:woken")
@pytest.mark.ledger("R235", entry="page", symbol="app.acts.missions:StartMissionAct._capture")
def test_the_papers_recording_is_read_back_and_starts_the_inspection(stand: Stand, operator: TestClient) -> None:
    recording = paper_recording()
    form = {"template": "", "robot_id": "vbot-1", "captured_by": "microphone", "acquired_s": "1790000000.250"}
    form |= {"recording_s": "1790000001.750", "key": "k1"}
    asked = operator.post("/missions/preview", data=form, files={"recording_file": ("w.wav", recording, "audio/wav")})
    assert asked.status_code == 422
    assert "check the office storage area" in asked.text and "xiao wei" in asked.text
    assert "Heard without the site" in asked.text, "two decodings that differ are shown"
    digest = asked.text.split('name="confirm_reading" value="', 1)[1].split('"', 1)[0]
    stored = asked.text.split('name="recording" value="', 1)[1].split('"', 1)[0]
    goal = {"goal": "check the office storage area", "heard": "check the office storage area", "template": "by-goal"}
    chosen = asked.text.split('name="template" value="', 1)[1].split('"', 1)[0]
    goal["template"] = chosen
    begun = operator.post("/missions", data=form | goal | {"recording": stored, "confirm_reading": digest})
    assert begun.status_code == 303, begun.text
    mission_id = begun.headers["location"].rpartition("/")[2]
    outcome = operator.get(f"/api/v1/missions/{mission_id}").json()
    capture = outcome["spoken"]["capture"]
    assert (capture["acquired_s"], capture["recording_s"]) == (1790000000.25, 1790000001.75)
    assert outcome["spoken"]["wake"] == "xiao wei" and outcome["template"] == "warehouse-inspection"
    for page in ("", "/report"):
        text = operator.get(f"/missions/{mission_id}{page}").text
        assert f'src="/evidence/{stored}"' in text and "1.500 s later" in text
        assert "Heard freely" in text and "Wake phrase" in text


def test_a_recording_cannot_begin_before_its_microphone(operator: TestClient) -> None:
    stored = operator.post("/api/v1/recordings", content=wish(WISH)).json()["recording"]
    body = {"recording": stored, "captured_by": "microphone", "acquired_s": 5.0, "recording_s": 4.0}
    answer = operator.post("/api/v1/missions", json=body)
    assert answer.status_code == 422 and "before its microphone" in json.dumps(answer.json())


def test_silence_is_no_speech_and_only_one_page_may_ask_for_the_microphone(operator: TestClient) -> None:
    assert operator.post("/api/v1/recordings", content=silence(3.0)).status_code == 422
    assert "microphone=(self)" in operator.get("/missions/new").headers["permissions-policy"]
    assert "microphone=()" in operator.get("/missions").headers["permissions-policy"]
