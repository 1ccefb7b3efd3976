"""Sends to DingTalk groups: by a custom robot's signed webhook, or by an organisation's own application."""

import base64
import hashlib
import hmac
import json
import time
from collections.abc import Callable, Sequence

import msgspec

from harness.adapters.providers.messaging.exchange import ServiceExchange
from harness.adapters.providers.messaging.recorded import Note
from harness.contracts.channels import DingTalkAppChannel, DingTalkRobotChannel
from harness.contracts.errors import ChannelRefused, ChannelUnreachable
from harness.contracts.ids import Digest
from harness.contracts.ports import BlobStore
from harness.contracts.reasons import because
from harness.contracts.secret_references import SecretReference

TITLE = "Inspection report"
BUSY_CODES = frozenset({-1, 130101, 130102, 410100})
"""The service is busy, or the robot sends too fast: nothing was sent."""
SENT = ("", "SUCCESS", "PROCESSING")
"""What a query answers of a message that was sent, or is on its way."""
RENEW_S = 300.0
"""An access token is renewed when it has so little time left."""
Secret = Callable[[SecretReference], str]


class RobotAnswer(msgspec.Struct, frozen=True):
    """The webhook's answer; `errcode` 0 is success."""

    errcode: int
    errmsg: str = ""


class MediaAnswer(msgspec.Struct, frozen=True):
    """The answer to an upload."""

    errcode: int
    errmsg: str = ""
    media_id: str = ""


class TokenAnswer(msgspec.Struct, frozen=True, rename="camel"):
    """An access token and how many seconds it holds."""

    access_token: str
    expire_in: int


class SendAnswer(msgspec.Struct, frozen=True, rename="camel"):
    """The key by which the application can ask for a message."""

    process_query_key: str


class QueryAnswer(msgspec.Struct, frozen=True, rename="camel"):
    """What became of a message, and who has read it. The service gives neither its text nor its pictures."""

    send_status: str = ""
    read_user_ids: tuple[str, ...] = ()
    has_more: bool = False
    next_token: str = ""


def signature(secret: str, timestamp_ms: int) -> str:
    """What a signed webhook asks for: base64 of HMAC-SHA256 over the timestamp and the secret."""
    signed = f"{timestamp_ms}\n{secret}".encode()
    return base64.b64encode(hmac.new(secret.encode(), signed, hashlib.sha256).digest()).decode()


def marked(text: str, key: str, *, pictures: int = 0) -> str:
    """The text for people, with the key by which a message that came twice can be recognised."""
    missing = f"\n\n{pictures} pictures are with the mission; this channel takes none." if pictures else ""
    return f"{text}{missing}\n\nref {key[:16]}"


class DingTalkRobot:
    """MessageService of a custom robot. It takes no files: the text says how many pictures there are."""

    def __init__(self, entry: DingTalkRobotChannel, *, secret: Secret) -> None:
        self._entry, self._secret = entry, secret
        self._exchange = ServiceExchange(entry.name)

    def send(self, key: str, text: str, images: Sequence[Digest], *, sent: Sequence[str], note: Note) -> None:
        if sent:
            return
        timestamp_ms = round(time.time() * 1000)
        signed = {"timestamp": str(timestamp_ms), "sign": signature(self._secret(self._entry.secret), timestamp_ms)}
        message = {"title": TITLE, "text": marked(text, key, pictures=len(images))}
        answer = self._exchange.post(
            self._entry.address,
            RobotAnswer,
            params={"access_token": self._secret(self._entry.token), **signed},
            json={"msgtype": "markdown", "markdown": message},
        )
        _check(self._entry.name, answer.errcode, answer.errmsg)
        note(f"accepted-{timestamp_ms}")

    def state(self, ids: Sequence[str]) -> str:
        """A webhook cannot be asked."""
        return ""


class DingTalkApp:
    """MessageService of an application: one message with the text, one with each picture, each with its query key."""

    def __init__(self, entry: DingTalkAppChannel, *, secret: Secret, blobs: BlobStore) -> None:
        self._entry, self._secret, self._blobs = entry, secret, blobs
        self._exchange = ServiceExchange(entry.name)
        self._token, self._until_s = "", 0.0

    def send(self, key: str, text: str, images: Sequence[Digest], *, sent: Sequence[str], note: Note) -> None:
        if not sent:
            note(self._message("sampleMarkdown", {"title": TITLE, "text": marked(text, key)}))
        for image in images[max(0, len(sent) - 1) :]:
            note(self._message("sampleImageMsg", {"photoURL": self._uploaded(image)}))

    def state(self, ids: Sequence[str]) -> str:
        """What the service says of the parts: whether they were sent, and how many people have read the text.

        Raises ChannelRefused for a part that was recalled or failed, ChannelUnreachable where it does not answer.
        """
        answers = [self._queried(one) for one in ids]
        bad = [one.send_status for one in answers if one.send_status not in SENT]
        if bad:
            raise ChannelRefused(because("channel_refused", channel=self._entry.name, answer=bad[0][:80]))
        return f"query={answers[0].send_status or 'none'} read={len(answers[0].read_user_ids)}" if answers else ""

    def _queried(self, query_key: str) -> QueryAnswer:
        return self._exchange.prepare(
            f"{self._entry.address}/v1.0/robot/groupMessages/query",
            QueryAnswer,
            headers=self._headers(),
            json={
                "robotCode": self._entry.robot_code,
                "openConversationId": self._entry.conversation,
                "processQueryKey": query_key,
                "maxResults": 100,
            },
        )

    def _message(self, kind: str, parameters: dict[str, str]) -> str:
        """The query key of a message. What was refused was not sent: with a token that is not new, it is tried again
        with a new one."""
        renewed = time.time() >= self._until_s
        try:
            return self._posted(kind, parameters)
        except ChannelRefused:
            if renewed:
                raise
            self._until_s = 0.0
            return self._posted(kind, parameters)

    def _posted(self, kind: str, parameters: dict[str, str]) -> str:
        answer = self._exchange.post(
            f"{self._entry.address}/v1.0/robot/groupMessages/send",
            SendAnswer,
            headers=self._headers(),
            json={
                "robotCode": self._entry.robot_code,
                "openConversationId": self._entry.conversation,
                "msgKey": kind,
                "msgParam": json.dumps(parameters, ensure_ascii=False),
            },
        )
        return answer.process_query_key

    def _uploaded(self, image: Digest) -> str:
        body = self._blobs.get(image)
        suffix = "png" if body.startswith(b"\x89PNG") else "jpg"
        answer = self._exchange.prepare(
            f"{self._entry.media_address}/media/upload",
            MediaAnswer,
            params={"access_token": self._access(), "type": "image"},
            files={"media": (f"{image[:16]}.{suffix}", body, f"image/{suffix.replace('jpg', 'jpeg')}")},
        )
        _check(self._entry.name, answer.errcode, answer.errmsg)
        return answer.media_id

    def _headers(self) -> dict[str, str]:
        return {"x-acs-dingtalk-access-token": self._access()}

    def _access(self) -> str:
        """The access token, asked for anew when it is about to end."""
        if time.time() >= self._until_s:
            answer = self._exchange.prepare(
                f"{self._entry.address}/v1.0/oauth2/accessToken",
                TokenAnswer,
                json={
                    "appKey": self._secret(self._entry.app_key),
                    "appSecret": self._secret(self._entry.app_secret),
                },
            )
            self._token, self._until_s = answer.access_token, time.time() + max(0.0, answer.expire_in - RENEW_S)
        return self._token


def _check(channel: str, code: int, text: str) -> None:
    """Raise for an answer that is no success: nothing was sent."""
    if code in BUSY_CODES:
        raise ChannelUnreachable(because("channel_busy", channel=channel, status=code))
    if code:
        raise ChannelRefused(because("channel_refused", channel=channel, answer=f"{code} {text[:200]}"))
