"""Sends mail by SMTP, and reads it back by IMAP from a mailbox that receives it: two clients that share nothing."""

import email
import imaplib
import smtplib
import ssl
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from email import policy
from email.message import EmailMessage
from typing import Any

from harness.adapters.connection_guard import guarded, not_of_this_link
from harness.adapters.providers.messaging.recorded import Note
from harness.contracts.channels import EmailChannel, Mailbox, MailServer
from harness.contracts.errors import (
    ChannelRefused,
    ChannelUnreachable,
    ContractInvalid,
    DeliveryUnknown,
    StoreUnavailable,
)
from harness.contracts.ids import Digest, sha256
from harness.contracts.measurements import StoredMessage
from harness.contracts.ports import BlobStore
from harness.contracts.reasons import because
from harness.contracts.secret_references import SecretReference

TIMEOUT_S = 10.0
MOST_MESSAGES = 10
DOMAIN = "regenharness.invalid"
Secret = Callable[[SecretReference], str]


def message_id(key: str) -> str:
    """The same for every copy of a message, so that mail systems and readers recognise a second one."""
    return f"<{key}@{DOMAIN}>"


class MailService:
    """MessageService by SMTP: one mail with the text as it is and the pictures as attachments."""

    def __init__(self, entry: EmailChannel, *, secret: Secret, blobs: BlobStore) -> None:
        self._entry, self._secret, self._blobs = entry, secret, blobs

    def send(self, key: str, text: str, images: Sequence[Digest], *, sent: Sequence[str], note: Note) -> None:
        if sent:
            return
        mail = self._mail(key, text, images)
        with guarded(not_of_this_link), self._connected() as client:
            try:
                refused = client.send_message(mail)
            except smtplib.SMTPServerDisconnected as error:
                raise self._unknown(error) from error
            except smtplib.SMTPResponseException as error:
                raise self._answered(error) from error
            except smtplib.SMTPRecipientsRefused as error:
                raise self._refused(f"{len(error.recipients)} recipients") from error
            except (OSError, smtplib.SMTPException) as error:
                raise self._unknown(error) from error
        note(f"{message_id(key)} refused={len(refused)}" if refused else message_id(key))

    def state(self, ids: Sequence[str]) -> str:
        """The sending server is not asked: the mailbox is read by another client."""
        return ""

    def _mail(self, key: str, text: str, images: Sequence[Digest]) -> EmailMessage:
        mail = EmailMessage()
        mail["From"], mail["To"] = self._entry.sender, ", ".join(self._entry.recipients)
        mail["Subject"], mail["Message-ID"] = self._entry.subject, message_id(key)
        mail.set_content(text.encode(), maintype="text", subtype="plain", cte="base64", params={"charset": "utf-8"})
        for number, image in enumerate(images, start=1):
            body = self._blobs.get(image)
            subtype = "png" if body.startswith(b"\x89PNG") else "jpeg"
            mail.add_attachment(body, maintype="image", subtype=subtype, filename=f"image-{number}.{subtype}")
        return mail

    @contextmanager
    def _connected(self) -> Iterator[smtplib.SMTP]:
        """A session that is signed in. Raises ChannelUnreachable, ChannelRefused."""
        server, client = self._entry.server, None
        try:
            client = _smtp(server)
            if server.user:
                client.login(server.user, self._secret(server.password))
        except smtplib.SMTPAuthenticationError as error:
            raise self._refused("the user or the password") from error
        except (OSError, smtplib.SMTPException) as error:
            raise ChannelUnreachable(
                because("channel_unreachable", channel=self._entry.name, error=type(error).__name__)
            ) from error
        try:
            yield client
        finally:
            _closed(client)

    def _answered(self, error: smtplib.SMTPResponseException) -> ChannelRefused | ChannelUnreachable:
        if 400 <= error.smtp_code < 500:
            return ChannelUnreachable(because("channel_busy", channel=self._entry.name, status=error.smtp_code))
        return self._refused(f"{error.smtp_code}")

    def _refused(self, answer: str) -> ChannelRefused:
        return ChannelRefused(because("channel_refused", channel=self._entry.name, answer=answer))

    def _unknown(self, error: Exception) -> DeliveryUnknown:
        return DeliveryUnknown(because("delivery_unknown", channel=self._entry.name, error=type(error).__name__))


class MailboxReader:
    """MessageReadPath by IMAP, reading only. It knows the mailbox and nothing of the service that sends."""

    def __init__(self, channel: str, mailbox: Mailbox, *, secret: Secret) -> None:
        self._channel, self._mailbox, self._secret = channel, mailbox, secret

    def find(self, key: str) -> StoredMessage | None:
        """The message of this key; of several that differ, one that differs from the first. Raises StoreUnavailable."""
        try:
            with guarded(not_of_this_link):
                found = self._found(key)
        except (OSError, imaplib.IMAP4.error, ContractInvalid, ValueError) as error:
            problem = because("message_unreadable", error=type(error).__name__)
            raise StoreUnavailable(problem, where=self._channel) from error
        if not found:
            return None
        odd = next((one for one in found if one != found[0]), found[0])
        return StoredMessage(text=odd.text, images=odd.images, copies=len(found))

    def _found(self, key: str) -> list[StoredMessage]:
        client = _imap(self._mailbox)
        try:
            if self._mailbox.user:
                client.login(self._mailbox.user, self._secret(self._mailbox.password))
            client.select(f'"{self._mailbox.folder}"', readonly=True)
            _, answer = client.uid("SEARCH", "HEADER", "Message-ID", f'"{message_id(key)}"')
            numbers = (answer[0] or b"").split()[-MOST_MESSAGES:]
            bodies = [_body(client.uid("FETCH", number.decode(), "(BODY.PEEK[])")[1]) for number in numbers]
        finally:
            _logged_out(client)
        mails = [email.message_from_bytes(body, policy=policy.default) for body in bodies]
        return [_stored(mail) for mail in mails if str(mail.get("Message-ID", "")).strip() == message_id(key)]


def _stored(mail: Any) -> StoredMessage:
    """The text and the checksums of the attachments, as they came."""
    text, images = b"", []
    for part in mail.walk():
        if part.is_multipart():
            continue
        body = part.get_payload(decode=True) or b""
        if part.get_content_disposition() == "attachment":
            images.append(sha256(body))
        elif part.get_content_type() == "text/plain":
            text += body
    return StoredMessage(text=text.decode("utf-8", errors="replace"), images=tuple(images))


def _body(answer: Any) -> bytes:
    return next((one[1] for one in answer if isinstance(one, tuple)), b"")


def _smtp(server: MailServer) -> smtplib.SMTP:
    if server.encryption == "tls":
        return smtplib.SMTP_SSL(server.host, server.port, timeout=TIMEOUT_S, context=ssl.create_default_context())
    client = smtplib.SMTP(server.host, server.port, timeout=TIMEOUT_S)
    if server.encryption == "starttls":
        client.starttls(context=ssl.create_default_context())
    return client


def _imap(server: MailServer) -> imaplib.IMAP4:
    if server.encryption == "tls":
        return imaplib.IMAP4_SSL(server.host, server.port, timeout=TIMEOUT_S, ssl_context=ssl.create_default_context())
    client = imaplib.IMAP4(server.host, server.port, timeout=TIMEOUT_S)
    if server.encryption == "starttls":
        client.starttls(ssl_context=ssl.create_default_context())
    return client


def _closed(client: smtplib.SMTP) -> None:
    """End the session; a mail that was taken stays taken however the session ends."""
    try:
        client.quit()
    except (OSError, smtplib.SMTPException):
        client.close()


def _logged_out(client: imaplib.IMAP4) -> None:
    try:
        client.logout()
    except (OSError, imaplib.IMAP4.error):
        client.shutdown()
