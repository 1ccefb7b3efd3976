"""Channels over the network: what each sends, what it never sends twice, and what is read back of it."""

import os
from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

from harness.adapters.providers.messaging.channels import SiteChannels, open_channels
from harness.adapters.providers.messaging.recorded import RecordedOutbox, SendingRecord
from harness.contracts.channels import ChannelEntry
from harness.contracts.errors import (
    ChannelRefused,
    ChannelUnreachable,
    DeliveryUnknown,
    HarnessError,
    ProviderFailed,
    StoreUnavailable,
)
from harness.contracts.ids import sha256
from harness.contracts.values import encode
from tests.fakes.channel_services import (
    APP_KEY,
    APP_SECRET,
    CONVERSATION,
    ROBOT_CODE,
    SECRET,
    TOKEN,
    DingTalkService,
    MailService,
    dingtalk,
    mail_service,
)
from tests.saying import raises_saying
from tests.unit.observations.builders import Blobs

JPEG = b"\xff\xd8\xff" + bytes(range(200))
TEXT = "The passage is obstructed: two things stand on its floor.\n货物挡住了通道。"
KEY = "req-1a2b3c"


@pytest.fixture(autouse=True)
def secrets(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in {
        "DING_TOKEN": TOKEN,
        "DING_SECRET": SECRET,
        "DING_KEY": APP_KEY,
        "DING_APP": APP_SECRET,
        "MAIL_PASSWORD": "mail-secret",
    }.items():
        monkeypatch.setenv(name, value)


@pytest.fixture
def group() -> Iterator[DingTalkService]:
    with dingtalk() as service:
        yield service


@pytest.fixture
def post() -> Iterator[MailService]:
    with mail_service() as service:
        yield service


def robot_entry(service: DingTalkService, **more: object) -> dict[str, object]:
    return {
        "kind": "dingtalk-robot",
        "name": "operations",
        "address": f"{service.address}/robot/send",
        "token": {"environment": "DING_TOKEN"},
        "secret": {"environment": "DING_SECRET"},
        **more,
    }


def app_entry(service: DingTalkService, **more: object) -> dict[str, object]:
    return {
        "kind": "dingtalk-app",
        "name": "operations",
        "address": service.address,
        "media_address": service.address,
        "app_key": {"environment": "DING_KEY"},
        "app_secret": {"environment": "DING_APP"},
        "robot_code": ROBOT_CODE,
        "conversation": CONVERSATION,
        **more,
    }


def mail_entry(service: MailService) -> dict[str, object]:
    account = {"host": "127.0.0.1", "encryption": "none"}
    reader = {"user": "robot", "password": {"environment": "MAIL_PASSWORD"}}
    return {
        "kind": "email",
        "name": "operations",
        "server": {**account, "port": service.smtp_port},
        "mailbox": {**account, **reader, "port": service.imap_port},
        "sender": "robot@example.org",
        "recipients": ["operations@example.org"],
    }


def opened(entry: dict[str, object], folder: Path, blobs: Blobs) -> SiteChannels:
    """The channel as a site's folder would have it, with no pause between tries."""
    channels = open_channels(
        [msgspec.convert(entry, ChannelEntry)],
        site=folder,
        data=folder / "data",
        blobs=blobs,
    )
    outbox = channels.of("operations").outbox
    assert isinstance(outbox, RecordedOutbox)
    outbox._wait = lambda _: None
    return channels


def send(channels: SiteChannels, blobs: Blobs, *, pictures: int = 2) -> str:
    images = [blobs.put(JPEG + bytes([number])) for number in range(pictures)]
    return channels.of("operations").outbox.send(KEY, TEXT, images)


def read_back(channels: SiteChannels, key: str = KEY) -> object:
    reader = channels.of("operations").reader
    assert reader is not None
    return reader.find(key)


def test_a_signed_robot_sends_the_text_and_says_what_it_cannot_carry(group: DingTalkService, tmp_path: Path) -> None:
    blobs = Blobs()
    channels = opened(robot_entry(group), tmp_path, blobs)
    assert send(channels, blobs).startswith("operations:accepted-")
    (text,) = group.texts()
    assert TEXT in text and "2 pictures" in text and KEY in text
    assert channels.of("operations").reader is None


@pytest.mark.parametrize(("variable", "said"), [("DING_SECRET", "sign not match"), ("DING_TOKEN", "token")])
def test_a_wrong_secret_is_refused_by_its_service(
    group: DingTalkService, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, variable: str, said: str
) -> None:
    monkeypatch.setenv(variable, "another")
    channels = opened(robot_entry(group), tmp_path, Blobs())
    with raises_saying(ChannelRefused, match=said):
        send(channels, Blobs(), pictures=0)
    assert group.messages == []


def test_the_application_sends_text_and_pictures_and_asks_who_has_read(group: DingTalkService, tmp_path: Path) -> None:
    blobs = Blobs()
    acknowledgement = send(opened(app_entry(group), tmp_path, blobs), blobs)
    assert acknowledgement == "operations:query-1,query-2,query-3 query=SUCCESS read=2"
    assert TEXT in group.texts()[0]
    pictures = [group.media[one["picture"]] for one in group.messages if "picture" in one]
    assert pictures == [JPEG + b"\0", JPEG + b"\1"]


def test_an_access_token_that_ended_early_is_asked_for_anew(group: DingTalkService, tmp_path: Path) -> None:
    blobs = Blobs()
    channels = opened(app_entry(group), tmp_path, blobs)
    send(channels, blobs, pictures=0)
    group.mood = "expired"
    channels.of("operations").outbox.send("another", "text", ())
    assert len(group.texts()) == 2 and group.calls.count("/v1.0/oauth2/accessToken") == 2


def test_a_message_that_the_service_says_failed_is_not_acknowledged(group: DingTalkService, tmp_path: Path) -> None:
    group.mood = "failed"
    with raises_saying(ChannelRefused, match="FAILED"):
        send(opened(app_entry(group), tmp_path, Blobs()), Blobs(), pictures=0)


def test_a_busy_service_is_asked_again_and_gets_one_message(group: DingTalkService, tmp_path: Path) -> None:
    group.mood = "busy-once"
    send(opened(robot_entry(group), tmp_path, Blobs()), Blobs(), pictures=0)
    assert len(group.messages) == 1


def test_a_service_that_is_away_was_sent_nothing_and_can_be_tried_again(group: DingTalkService, tmp_path: Path) -> None:
    away = robot_entry(group, address="http://127.0.0.1:9/robot/send")
    blobs = Blobs()
    with pytest.raises(ChannelUnreachable):
        send(opened(away, tmp_path, blobs), blobs, pictures=0)
    send(opened(robot_entry(group), tmp_path, blobs), blobs, pictures=0)
    assert len(group.messages) == 1, "nothing was begun, so nothing is doubted"


@pytest.mark.parametrize("mood", ["lost-answer", "broken"])
@pytest.mark.parametrize("kind", [robot_entry, app_entry], ids=["robot", "app"])
def test_a_message_that_may_have_been_sent_is_never_sent_again(
    group: DingTalkService, tmp_path: Path, mood: str, kind: object
) -> None:
    group.mood = mood
    entry, blobs = kind(group), Blobs()  # type: ignore[operator]
    with raises_saying(DeliveryUnknown, match="not sent again"):
        send(opened(entry, tmp_path, blobs), blobs, pictures=0)
    group.mood = "good"
    with raises_saying(DeliveryUnknown, match=KEY):
        send(opened(entry, tmp_path, blobs), blobs, pictures=0)
    assert len(group.messages) == 1


def test_a_crash_after_some_parts_goes_on_with_the_next(group: DingTalkService, tmp_path: Path) -> None:
    blobs = Blobs()
    send(opened(app_entry(group), tmp_path, blobs), blobs)
    file = tmp_path / "data" / "providers" / "channels" / "operations" / f"{KEY}.json"
    whole = msgspec.json.decode(file.read_bytes(), type=SendingRecord)
    file.write_bytes(encode(msgspec.structs.replace(whole, ids=whole.ids[:2], begun=False, done=False, sent_s=None)))
    before = len(group.messages)
    send(opened(app_entry(group), tmp_path, blobs), blobs)
    assert len(group.messages) == before + 1 and "picture" in group.messages[-1]


@pytest.mark.parametrize("kind", ["robot", "app", "mail"])
def test_a_key_is_sent_once_and_never_with_other_contents(
    group: DingTalkService, post: MailService, tmp_path: Path, kind: str
) -> None:
    entry = {"robot": robot_entry(group), "app": app_entry(group), "mail": mail_entry(post)}[kind]
    blobs = Blobs()
    first = send(opened(entry, tmp_path, blobs), blobs)
    shown = len(group.messages) + len(post.mails)
    assert send(opened(entry, tmp_path, blobs), blobs) == first
    assert len(group.messages) + len(post.mails) == shown
    with pytest.raises(ProviderFailed):
        opened(entry, tmp_path, blobs).of("operations").outbox.send(KEY, "another text", ())


def test_mail_is_read_back_with_its_text_and_pictures(post: MailService, tmp_path: Path) -> None:
    blobs = Blobs()
    channels = opened(mail_entry(post), tmp_path, blobs)
    assert read_back(channels) is None
    assert send(channels, blobs) == f"operations:<{KEY}@regenharness.invalid>"
    found = read_back(channels)
    images = (sha256(JPEG + b"\0"), sha256(JPEG + b"\1"))
    assert (found.text, found.images, found.copies) == (TEXT, images, 1)  # type: ignore[attr-defined]


def test_a_mail_server_that_says_yes_and_keeps_nothing_is_found_out(post: MailService, tmp_path: Path) -> None:
    post.mood, blobs = "loses", Blobs()
    channels = opened(mail_entry(post), tmp_path, blobs)
    send(channels, blobs)
    assert read_back(channels) is None


def test_another_text_in_the_mailbox_is_what_is_read(post: MailService, tmp_path: Path) -> None:
    post.mood, blobs = "rewrites", Blobs()
    channels = opened(mail_entry(post), tmp_path, blobs)
    send(channels, blobs)
    assert read_back(channels).text == "All is well."  # type: ignore[attr-defined]


def test_copies_are_counted(post: MailService, tmp_path: Path) -> None:
    post.mood, blobs = "doubles", Blobs()
    channels = opened(mail_entry(post), tmp_path, blobs)
    send(channels, blobs)
    assert read_back(channels).copies == 2  # type: ignore[attr-defined]


def test_a_mail_whose_answer_was_lost_is_found_and_not_sent_again(post: MailService, tmp_path: Path) -> None:
    post.mood, blobs = "lost-answer", Blobs()
    channels = opened(mail_entry(post), tmp_path, blobs)
    assert send(channels, blobs).endswith("found")
    assert len(post.mails) == 1


def test_a_mail_that_is_under_way_is_waited_for_and_not_sent_again(post: MailService, tmp_path: Path) -> None:
    post.mood, blobs = "late", Blobs()
    channels = opened(mail_entry(post), tmp_path, blobs)
    outbox = channels.of("operations").outbox
    assert isinstance(outbox, RecordedOutbox)
    outbox._wait = lambda _: post.arrive()
    assert send(channels, blobs).endswith("found")
    assert len(post.mails) == 1


def test_a_group_that_says_yes_and_shows_nothing_is_believed_as_far_as_it_declares(
    group: DingTalkService, tmp_path: Path
) -> None:
    group.mood, blobs = "lies", Blobs()
    channels = opened(app_entry(group), tmp_path, blobs)
    assert "query=SUCCESS" in send(channels, blobs, pictures=0)
    assert group.messages == [] and channels.of("operations").reader is None, "nothing can show it: it stays declared"


def test_a_mailbox_that_cannot_be_read_leaves_it_open(post: MailService, tmp_path: Path) -> None:
    blobs = Blobs()
    channels = opened(mail_entry(post), tmp_path, blobs)
    send(channels, blobs)
    post.mood = "closed"
    with pytest.raises(StoreUnavailable):
        read_back(channels)


def test_a_crash_between_the_sending_and_its_record_asks_the_mailbox(post: MailService, tmp_path: Path) -> None:
    blobs = Blobs()
    send(opened(mail_entry(post), tmp_path, blobs), blobs)
    file = tmp_path / "data" / "providers" / "channels" / "operations" / f"{KEY}.json"
    whole = msgspec.json.decode(file.read_bytes(), type=SendingRecord)
    file.write_bytes(encode(msgspec.structs.replace(whole, ids=(), done=False, sent_s=None)))
    send(opened(mail_entry(post), tmp_path, blobs), blobs)
    assert len(post.mails) == 1
    post.mails.clear()
    file.write_bytes(encode(msgspec.structs.replace(whole, ids=(), done=False, sent_s=None)))
    send(opened(mail_entry(post), tmp_path, blobs), blobs)
    assert len(post.mails) == 1, "what the mailbox does not hold was not sent"


def test_a_busy_mail_server_is_asked_again(post: MailService, tmp_path: Path) -> None:
    post.mood, blobs = "busy-once", Blobs()
    send(opened(mail_entry(post), tmp_path, blobs), blobs)
    assert len(post.mails) == 1


def test_every_other_service_by_apprise(
    group: DingTalkService, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("OTHER", f"json://127.0.0.1:{group.port}/robot/send")
    entry = {"kind": "apprise", "name": "operations", "url": {"environment": "OTHER"}}
    group.webhook = lambda query, body: group.messages.append(body) or (200, {})  # type: ignore[method-assign, func-returns-value]
    blobs = Blobs()
    assert send(opened(entry, tmp_path, blobs), blobs) == "operations:accepted"
    assert TEXT in group.messages[0]["message"] and len(group.messages[0]["attachments"]) == 2
    monkeypatch.setenv("OTHER", "no-service")
    with pytest.raises(ChannelRefused):
        opened(entry, tmp_path, blobs).of("operations").outbox.send("other", "text", ())


def test_a_secret_that_is_missing_is_named_and_nothing_is_sent(
    group: DingTalkService, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("DING_SECRET")
    with raises_saying(HarnessError, match="DING_SECRET"):
        send(opened(robot_entry(group), tmp_path, Blobs()), Blobs(), pictures=0)
    monkeypatch.setenv("DING_SECRET", SECRET)
    send(opened(robot_entry(group), tmp_path, Blobs()), Blobs(), pictures=0)
    assert len(group.messages) == 1


def test_no_error_and_no_record_holds_a_secret(group: DingTalkService, tmp_path: Path) -> None:
    group.mood = "broken"
    with pytest.raises(HarnessError) as caught:
        send(opened(robot_entry(group), tmp_path, Blobs()), Blobs(), pictures=0)
    kept = b"".join(file.read_bytes() for file in tmp_path.rglob("*") if file.is_file())
    for text in (str(caught.value).encode(), kept):
        assert TOKEN.encode() not in text and SECRET.encode() not in text
    assert os.environ["DING_TOKEN"] == TOKEN
