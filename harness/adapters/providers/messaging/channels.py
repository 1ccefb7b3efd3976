"""Opens the channels of a site: the end that sends and, where there is one, the harness's own that reads back."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from harness.adapters.providers.messaging.dingtalk import DingTalkApp, DingTalkRobot
from harness.adapters.providers.messaging.folder import FolderOutbox
from harness.adapters.providers.messaging.mail import MailboxReader, MailService
from harness.adapters.providers.messaging.memory import MemoryOutbox
from harness.adapters.providers.messaging.other_services import AppriseService
from harness.adapters.providers.messaging.read_back import FolderReader, MemoryReader
from harness.adapters.providers.messaging.recorded import RecordedOutbox
from harness.adapters.secret_values import secret
from harness.contracts.channels import (
    AppriseChannel,
    ChannelEntry,
    DingTalkAppChannel,
    DingTalkRobotChannel,
    EmailChannel,
    FolderChannel,
)
from harness.contracts.errors import ProviderFailed
from harness.contracts.ports import BlobStore, MessageOutbox, MessageReadPath
from harness.contracts.reasons import because
from harness.contracts.secret_references import SecretReference

RECORDS = "channels"


@dataclass(frozen=True)
class MessageChannel:
    """A channel's two ends: the one that sends, and the harness's own that reads back; None where nobody can."""

    outbox: MessageOutbox
    reader: MessageReadPath | None


@dataclass(frozen=True)
class SiteChannels:
    """The outbox of the data folder, and the channels of the site by their names."""

    own: MessageChannel
    named: Mapping[str, MessageChannel] = field(default_factory=dict)

    def of(self, name: str) -> MessageChannel:
        """The data folder's outbox for an empty name. Raises ProviderFailed for a channel that the site has no more."""
        if not name:
            return self.own
        if name not in self.named:
            raise ProviderFailed(because("channel_unknown", channel=name[:40], names=tuple(self.named)))
        return self.named[name]


def open_channels(
    entries: Sequence[ChannelEntry], *, site: Path | None, data: Path | None, blobs: BlobStore
) -> SiteChannels:
    """`site` is the folder that secrets are read from, `data` the one that messages and records are kept in; both None
    for a harness in memory. No service is asked anything yet.
    """
    return SiteChannels(
        own=_folder(data / "outbox" if data else None, blobs),
        named={one.name: _opened(one, site or Path(), data, blobs) for one in entries},
    )


def _opened(entry: ChannelEntry, site: Path, data: Path | None, blobs: BlobStore) -> MessageChannel:
    secret_of = partial(_secret_of, folder=site)
    records = data / "providers" / RECORDS / entry.name if data else None
    match entry:
        case FolderChannel():
            return _folder(data / "outbox" / RECORDS / entry.name if data else None, blobs)
        case DingTalkRobotChannel():
            robot = DingTalkRobot(entry, secret=secret_of)
            return MessageChannel(RecordedOutbox(entry.name, robot, folder=records), None)
        case DingTalkAppChannel():
            app = DingTalkApp(entry, secret=secret_of, blobs=blobs)
            return MessageChannel(RecordedOutbox(entry.name, app, folder=records), None)
        case EmailChannel():
            reader = MailboxReader(entry.name, entry.mailbox, secret=secret_of) if entry.mailbox else None
            mail = MailService(entry, secret=secret_of, blobs=blobs)
            return MessageChannel(RecordedOutbox(entry.name, mail, folder=records, reader=reader), reader)
        case AppriseChannel():
            service = AppriseService(entry, secret=secret_of, blobs=blobs)
            return MessageChannel(RecordedOutbox(entry.name, service, folder=records), None)


def _folder(folder: Path | None, blobs: BlobStore) -> MessageChannel:
    """Messages as files; in memory where there is no folder."""
    if folder is not None:
        return MessageChannel(FolderOutbox(folder, blobs=blobs), FolderReader(folder))
    held = MemoryOutbox()
    return MessageChannel(held, MemoryReader(held))


def _secret_of(reference: SecretReference, *, folder: Path) -> str:
    """Read when it is needed, and kept nowhere. Raises ContractInvalid."""
    return secret(variable=reference.environment, file=reference.file, folder=folder)
