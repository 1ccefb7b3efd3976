"""What a site's channels.yaml holds: where messages are sent, and who writes down what people say."""

from typing import Annotated

import msgspec

from harness.contracts.secret_references import SecretReference
from harness.contracts.values import Name, Value

ChannelId = Annotated[str, msgspec.Meta(pattern=r"^[a-z0-9][a-z0-9-]{0,30}$")]
Url = Annotated[str, msgspec.Meta(pattern=r"^https?://[^\s/]+(/\S*)?$", max_length=300)]
Host = Annotated[str, msgspec.Meta(pattern=r"^[A-Za-z0-9.:\[\]-]+$", max_length=253)]
Port = Annotated[int, msgspec.Meta(ge=1, le=65535)]
MailAddress = Annotated[str, msgspec.Meta(pattern=r"^[^\s@<>,;]+@[^\s@<>,;]+$", max_length=254)]


class FolderChannel(Value, tag_field="kind", tag="folder"):
    """Messages as folders of files in the data folder, for people and other programs to pick up. It is read back."""

    name: ChannelId
    aliases: tuple[Name, ...] = ()


class DingTalkRobotChannel(Value, tag_field="kind", tag="dingtalk-robot"):
    """A custom robot of a DingTalk group, by its signed webhook. It takes text alone, and nothing can be read back.

    `token`: the access token at the end of the webhook's address; `secret`: the one that signs.
    """

    name: ChannelId
    token: SecretReference
    secret: SecretReference
    aliases: tuple[Name, ...] = ()
    address: Url = "https://oapi.dingtalk.com/robot/send"


class DingTalkAppChannel(Value, tag_field="kind", tag="dingtalk-app"):
    """A DingTalk group by an organisation's own application: text and pictures; who has read them can be asked.

    `robot_code` is the application's robot, `conversation` the group's open conversation id. `media_address` takes the
    pictures.
    """

    name: ChannelId
    app_key: SecretReference
    app_secret: SecretReference
    robot_code: Name
    conversation: Name
    aliases: tuple[Name, ...] = ()
    address: Url = "https://api.dingtalk.com"
    media_address: Url = "https://oapi.dingtalk.com"


class MailServer(Value):
    """A mail server. `encryption`: `tls` from the first byte, `starttls`, or `none` on a network that is trusted."""

    host: Host
    port: Port
    user: str = ""
    password: SecretReference = SecretReference()
    encryption: Annotated[str, msgspec.Meta(pattern=r"^(tls|starttls|none)$")] = "tls"


class Mailbox(MailServer):
    """A mailbox that receives the messages too, by IMAP: where they are read back."""

    folder: Name = "INBOX"


class EmailChannel(Value, tag_field="kind", tag="email"):
    """Mail by SMTP. It is read back from `mailbox`; without one, a delivery is only declared."""

    name: ChannelId
    server: MailServer
    sender: MailAddress
    recipients: Annotated[tuple[MailAddress, ...], msgspec.Meta(min_length=1, max_length=50)]
    mailbox: Mailbox | None = None
    aliases: tuple[Name, ...] = ()
    subject: Name = "Inspection report"


class AppriseChannel(Value, tag_field="kind", tag="apprise"):
    """Any service that Apprise knows, by its address there, which is a secret. Nothing can be read back."""

    name: ChannelId
    url: SecretReference
    aliases: tuple[Name, ...] = ()


ChannelEntry = FolderChannel | DingTalkRobotChannel | DingTalkAppChannel | EmailChannel | AppriseChannel


class TranscriptionEndpoint(Value):
    """A service that answers OpenAI's `POST /v1/audio/transcriptions`: what it writes down is the free decoding of a
    spoken goal, beside the grammar's own (D48).

    `address` is what stands before `/audio/transcriptions`. What it hears in a language that the grammar's recogniser
    does not know is the only decoding, and a person confirms every one.
    """

    address: Url
    model: Name
    token: SecretReference | None = None
    timeout_s: Annotated[float, msgspec.Meta(gt=0, le=60)] = 20.0


class VoiceSection(Value):
    """How people are heard. `wake_phrase`: the words before a command; they are no part of the goal."""

    wake_phrases: tuple[Name, ...] = ("xiao wei",)
    transcription: TranscriptionEndpoint | None = None


class ChannelsFile(Value):
    """channels.yaml. `default` takes what no goal addresses; without it, messages stay in the data folder."""

    channels: Annotated[tuple[ChannelEntry, ...], msgspec.Meta(max_length=50)] = ()
    default: str = ""
    voice: VoiceSection = VoiceSection()


def is_readable(entry: ChannelEntry) -> bool:
    """Whether what this channel holds can be read back by the harness's own client (D46)."""
    match entry:
        case FolderChannel():
            return True
        case EmailChannel():
            return entry.mailbox is not None
        case DingTalkRobotChannel() | DingTalkAppChannel() | AppriseChannel():
            return False


def secrets_of(entry: ChannelEntry) -> dict[str, SecretReference]:
    """Every secret that the entry refers to, by where it stands in the entry."""
    match entry:
        case FolderChannel():
            return {}
        case DingTalkRobotChannel():
            return {"token": entry.token, "secret": entry.secret}
        case DingTalkAppChannel():
            return {"app_key": entry.app_key, "app_secret": entry.app_secret}
        case EmailChannel():
            servers = {"server": entry.server} | ({"mailbox": entry.mailbox} if entry.mailbox else {})
            return {name: server.password for name, server in servers.items() if server.user}
        case AppriseChannel():
            return {"url": entry.url}
