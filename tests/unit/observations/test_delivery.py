"""Delivery: which frames go, what is written, and what is acknowledged."""

import json
from pathlib import Path

import pytest

from harness.adapters.providers.messaging.channels import MessageChannel, SiteChannels
from harness.adapters.providers.messaging.delivery import CARD, OutboxDelivery
from harness.adapters.providers.messaging.folder import FolderOutbox
from harness.adapters.providers.messaging.memory import MemoryOutbox
from harness.adapters.providers.messaging.selection import cited_then_evenly_spaced
from harness.contracts.errors import ProviderFailed, StoreUnavailable
from harness.contracts.ids import Digest, sha256
from harness.contracts.ports import MessageOutbox
from harness.contracts.reasons import plain
from harness.contracts.values import encode
from tests.saying import raises_saying
from tests.unit.observations.builders import Blobs, StillClock, request_to

FRAMES = tuple(Digest(letter * 64) for letter in "01234567")


def delivery(blobs: Blobs, folder: Path) -> OutboxDelivery:
    outbox = FolderOutbox(folder / "outbox", blobs=blobs)
    return OutboxDelivery(
        SiteChannels(MessageChannel(outbox, None)), clock=StillClock(), blobs=blobs, journal=folder / "journal.jsonl"
    )


def test_cited_frames_come_first_and_the_rest_is_evenly_spaced() -> None:
    assert cited_then_evenly_spaced(FRAMES, cited=(FRAMES[5],)) == (FRAMES[5], FRAMES[0], FRAMES[2], FRAMES[4])
    assert cited_then_evenly_spaced(FRAMES) == (FRAMES[0], FRAMES[2], FRAMES[4], FRAMES[6])


def test_at_most_four_frames_go_even_when_five_are_cited() -> None:
    assert cited_then_evenly_spaced(FRAMES, cited=FRAMES[3:8]) == FRAMES[3:7]


def test_fewer_frames_than_places_all_go_once_and_strangers_never() -> None:
    assert cited_then_evenly_spaced(FRAMES[:2], cited=(FRAMES[1], FRAMES[1], FRAMES[7])) == (FRAMES[1], FRAMES[0])
    assert cited_then_evenly_spaced((), cited=FRAMES) == ()


def test_four_of_eight_images_and_the_text_are_delivered_and_each_is_acknowledged(tmp_path: Path) -> None:
    blobs = Blobs()
    frames = tuple(blobs.put(b"\xff\xd8\xff frame %d" % index) for index in range(8))
    report = blobs.put(encode({"cited": [frames[6], frames[1]], "text": "two boxes"}))
    provider = delivery(blobs, tmp_path)
    request = request_to(CARD, parameters={"text": "Two boxes", "images": frames, "analysis": report})

    ended = provider.report(provider.start(request).handle)

    sent = json.loads((tmp_path / "outbox" / request.identity.request_id / "message.json").read_bytes())
    assert ended.status == "succeeded"
    assert [receipt.blob for receipt in ended.receipts] == [
        frames[6], frames[1], frames[0], frames[4], sha256(b"Two boxes"),
    ]  # fmt: skip
    assert {receipt.text for receipt in ended.receipts} == {f"{sent['acknowledgement']} cited-then-evenly-spaced"}
    for file, frame in zip(sent["files"], sent["images"], strict=True):
        assert sha256((tmp_path / "outbox" / sent["key"] / file).read_bytes()) == frame


def test_a_missing_image_fails_the_delivery_and_leaves_no_message(tmp_path: Path) -> None:
    provider = delivery(Blobs(), tmp_path)
    ended = provider.report(provider.start(request_to(CARD, parameters={"text": "t", "images": FRAMES})).handle)
    assert (ended.status, ended.failure, ended.receipts) == ("failed", "blob_damaged", ())
    assert [path for path in (tmp_path / "outbox").iterdir() if not path.name.startswith(".")] == []


def test_an_unreadable_analysis_report_fails_the_delivery(tmp_path: Path) -> None:
    blobs = Blobs()
    provider = delivery(blobs, tmp_path)
    parameters = {"text": "t", "images": (), "analysis": blobs.put(b"no report")}
    ended = provider.report(provider.start(request_to(CARD, parameters=parameters)).handle)
    assert (ended.status, ended.failure) == ("failed", "provider_failed")
    assert "analysis_unreadable" in plain(ended.message)


@pytest.fixture(params=["folder", "memory"])
def outbox(request: pytest.FixtureRequest, tmp_path: Path) -> MessageOutbox:
    """Every outbox that ships; image blobs are not looked into by the one in memory."""
    return FolderOutbox(tmp_path, blobs=Blobs()) if request.param == "folder" else MemoryOutbox()


def test_a_message_key_is_used_for_one_content_only(outbox: MessageOutbox) -> None:
    first = outbox.send("key-1", "text", [])
    assert first
    assert outbox.send("key-1", "text", []) == first
    assert outbox.send("key-2", "text", []) != first
    with raises_saying(ProviderFailed, match="other contents"):
        outbox.send("key-1", "another text", [])


@pytest.mark.parametrize("key", ["", "../key", "a/b", "."])
def test_a_message_key_cannot_leave_the_outbox(tmp_path: Path, key: str) -> None:
    with pytest.raises(ProviderFailed):
        FolderOutbox(tmp_path, blobs=Blobs()).send(key, "text", [])


def test_an_outbox_that_cannot_be_written_says_where(tmp_path: Path) -> None:
    (tmp_path / "outbox").write_text("a file stands where the folder should be")
    with raises_saying(StoreUnavailable, match="outbox"):
        FolderOutbox(tmp_path / "outbox", blobs=Blobs()).send("key", "text", [])
