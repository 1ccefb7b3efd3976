"""Local services of message channels: DingTalk's webhook and application API, a mail server and its mailbox.

They check signatures and tokens, and can lose, delay, double and lie as their `mood` says.
"""

import base64
import hashlib
import hmac
import json
import re
import socket
import socketserver
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from email import message_from_bytes, policy
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlsplit

from aiosmtpd.controller import Controller

TOKEN, SECRET = "robot-token", "SEC-of-the-robot"
APP_KEY, APP_SECRET, ACCESS = "ding-key", "ding-secret", "access-1"
CONVERSATION, ROBOT_CODE = "cid-operations", "robot-7"


class DingTalkService:
    """Both APIs on one port. `messages` are those that the group shows. Moods: good, busy-once, lost-answer (taken, and
    the line cut), broken (500), lies (says yes and keeps nothing), expired (the token is refused once), failed (the
    query says so).
    """

    def __init__(self) -> None:
        self.mood = "good"
        self.messages: list[dict[str, Any]] = []
        self.media: dict[str, bytes] = {}
        self.readers = ["user-1", "user-2"]
        self.calls: list[str] = []
        self.port = 0

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def texts(self) -> list[str]:
        """What people read in the group."""
        return [one["text"] for one in self.messages if "text" in one]

    def webhook(self, query: dict[str, str], body: dict[str, Any]) -> tuple[int, Any]:
        timestamp = query.get("timestamp", "0")
        signed = hmac.new(SECRET.encode(), f"{timestamp}\n{SECRET}".encode(), hashlib.sha256).digest()
        fresh = abs(time.time() * 1000 - int(timestamp)) < 3_600_000
        if query.get("access_token") != TOKEN or not fresh:
            return 200, {"errcode": 300005, "errmsg": "token is not exist"}
        if query.get("sign") != base64.b64encode(signed).decode():
            return 200, {"errcode": 310000, "errmsg": "sign not match"}
        if self.mood == "busy-once":
            self.mood = "good"
            return 200, {"errcode": 130101, "errmsg": "send too fast"}
        if self.mood != "lies":
            self.messages.append({"text": body["markdown"]["text"]})
        return (500, {}) if self.mood == "broken" else (200, {"errcode": 0, "errmsg": "ok"})

    def app(self, path: str, headers: Any, body: dict[str, Any]) -> tuple[int, Any]:
        if path == "/v1.0/oauth2/accessToken":
            known = (body.get("appKey"), body.get("appSecret")) == (APP_KEY, APP_SECRET)
            return (200, {"accessToken": ACCESS, "expireIn": 7200}) if known else (400, {"code": "invalidSecret"})
        if self.mood == "expired":
            self.mood = "good"
            return 401, {"code": "InvalidAuthentication"}
        if headers.get("x-acs-dingtalk-access-token") != ACCESS:
            return 401, {"code": "InvalidAuthentication"}
        if (body.get("robotCode"), body.get("openConversationId")) != (ROBOT_CODE, CONVERSATION):
            return 400, {"code": "invalid conversation"}
        if path == "/v1.0/robot/groupMessages/query":
            status = "FAILED" if self.mood == "failed" else "SUCCESS"
            return 200, {"sendStatus": status, "readUserIds": self.readers, "hasMore": False}
        parameters = json.loads(body["msgParam"])
        key = f"query-{len(self.messages) + 1}"
        if self.mood != "lies":
            shown = {"picture": parameters["photoURL"]} if body["msgKey"] == "sampleImageMsg" else parameters
            self.messages.append({**shown, "key": key})
        return (500, {}) if self.mood == "broken" else (200, {"processQueryKey": key})

    def upload(self, query: dict[str, str], body: bytes) -> tuple[int, Any]:
        if query.get("access_token") != ACCESS:
            return 200, {"errcode": 40014, "errmsg": "access_token"}
        found = re.search(rb"\r\n\r\n(.*)\r\n--", body, re.DOTALL)
        name = f"@media{len(self.media) + 1}"
        self.media[name] = found.group(1) if found else b""
        return 200, {"errcode": 0, "errmsg": "ok", "media_id": name}


@contextmanager
def dingtalk() -> Iterator[DingTalkService]:
    """The service on a port of its own until the block ends."""
    service = DingTalkService()

    class Handler(BaseHTTPRequestHandler):
        def do_POST(self) -> None:
            parts = urlsplit(self.path)
            query = {name: values[0] for name, values in parse_qs(parts.query).items()}
            raw = self.rfile.read(int(self.headers.get("content-length", 0)))
            service.calls.append(parts.path)
            if parts.path == "/media/upload":
                status, answer = service.upload(query, raw)
            elif parts.path == "/robot/send":
                status, answer = service.webhook(query, json.loads(raw))
            else:
                status, answer = service.app(parts.path, self.headers, json.loads(raw))
            if service.mood == "lost-answer" and parts.path.endswith("/send"):
                self.close_connection = True
                self.connection.close()
                return
            body = json.dumps(answer).encode()
            self.send_response(status)
            self.send_header("content-length", str(len(body)))
            self.end_headers()
            self.wfile.write(body)

        def log_message(self, format: str, *args: Any) -> None:
            """Quiet."""

    with ThreadingHTTPServer(("127.0.0.1", 0), Handler) as server:
        service.port = server.server_address[1]
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield service
        server.shutdown()


class MailService:
    """One mailbox that takes mail and lets it be read. Moods: good, loses (says yes and keeps nothing), doubles,
    rewrites (stores another text), lost-answer (keeps it, and the line is cut), late (the same, and it is there only
    once `arrive` was called), busy-once, and for the reader `closed`.
    """

    def __init__(self) -> None:
        self.mood = "good"
        self.mails: list[bytes] = []
        self.under_way: list[bytes] = []
        self.smtp_port = self.imap_port = 0

    def take(self, body: bytes) -> str:
        if self.mood == "busy-once":
            self.mood = "good"
            return "451 try again later"
        if self.mood == "rewrites":
            mail = message_from_bytes(body, policy=policy.default)
            text = next(part for part in mail.walk() if part.get_content_type() == "text/plain")
            text.set_payload(base64.b64encode(b"All is well.").decode())
            body = mail.as_bytes()
        if self.mood == "late":
            self.under_way.append(body)
        elif self.mood != "loses":
            self.mails += [body] * (2 if self.mood == "doubles" else 1)
        return "250 OK"

    def arrive(self) -> None:
        """What was under way is in the mailbox."""
        self.mails += self.under_way
        self.under_way.clear()


class _Postman:
    def __init__(self, service: MailService) -> None:
        self._service = service

    async def handle_DATA(self, server: Any, session: Any, envelope: Any) -> str:  # noqa: N802 - the library's name
        answer = self._service.take(envelope.content)
        if self._service.mood in ("lost-answer", "late"):
            server.transport.close()
        return answer


@contextmanager
def mail_service(user: str = "robot", password: str = "mail-secret") -> Iterator[MailService]:
    """SMTP and IMAP on ports of their own until the block ends."""
    service = MailService()

    class Reader(socketserver.StreamRequestHandler):
        def handle(self) -> None:
            self.wfile.write(b"* OK ready\r\n")
            for line in self.rfile:
                tag, _, command = line.decode().strip().partition(" ")
                if not self._answer(tag, command):
                    return

        def _answer(self, tag: str, command: str) -> bool:
            word = command.split(" ", 1)[0].upper()
            lines: list[bytes] = []
            good = True
            if word == "CAPABILITY":
                lines = [b"* CAPABILITY IMAP4rev1\r\n"]
            elif word == "LOGIN":
                good = service.mood != "closed" and [part.strip('"') for part in command.split()[1:]] == [
                    user,
                    password,
                ]
            elif word == "EXAMINE":
                lines = [f"* {len(service.mails)} EXISTS\r\n".encode()]
            elif word == "UID" and " SEARCH " in f" {command.upper()} ":
                wanted = command.rsplit(" ", 1)[1].strip('"').encode()
                found = [str(number) for number, mail in enumerate(service.mails, 1) if wanted in mail]
                lines = [f"* SEARCH {' '.join(found)}\r\n".encode()]
            elif word == "UID":
                number = int(command.split()[2])
                body = service.mails[number - 1]
                head = f"* {number} FETCH (UID {number} BODY[] {{{len(body)}}}\r\n".encode()
                lines = [head, body, b")\r\n"]
            self.wfile.write(b"".join(lines) + f"{tag} {'OK' if good else 'NO'} done\r\n".encode())
            return word != "LOGOUT"

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        service.smtp_port = free.getsockname()[1]
    controller = Controller(_Postman(service), hostname="127.0.0.1", port=service.smtp_port)
    controller.start()
    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Reader) as server:
        server.daemon_threads = True
        service.imap_port = server.server_address[1]
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield service
        server.shutdown()
    controller.stop()
