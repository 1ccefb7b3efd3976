"""The lies of the kit about exchanges, requests and identities; those about evidence stand in `evidence_lies`."""

import json
import zlib
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from hashlib import sha256
from typing import Any, Literal

from harness.conformance.hostile.proxy import Answer, Ask, Forward, Lie, ProxyState

Group = Literal["bounds", "outcome", "identity", "receipts", "sensors", "images"]
Change = Callable[[Any, ProxyState], Any]
WHOLE = "warehouse-inspection"
MANY_BYTES = 60 << 20
PART = b" " * (1 << 16)
UNKNOWN = json.dumps({"code": "unknown_name", "what": "No such thing", "where": "here", "do": "ask another"}).encode()
REFUSED = json.dumps({"code": "provider_failed", "what": "Not now", "where": "here", "do": "ask later"}).encode()
PAGE = b"<html><body>502 Bad Gateway</body></html>"


@dataclass(frozen=True)
class Mode:
    """One lie and the mission that meets it. `may_succeed`: the mission's effects are real in spite of the lie, so that
    success is no false completion where the simulated truth agrees. `undetectable`: every source is forged consistently
    (D17): counted as epistemic. `second`: an honest mission goes before.
    """

    name: str
    group: Group
    text: str
    lie: Lie
    template: str = "circuit"
    may_succeed: bool = False
    undetectable: bool = False
    patience_s: float = 5.0
    second: bool = False


def instead(kind: str, answer: Answer, *, forwarded: bool = True, moving: bool = True) -> Lie:
    """Another answer to every request of one kind, once a motion was begun; the request itself may get through."""

    def lie(ask: Ask, forward: Forward, seen: ProxyState) -> Answer:
        starting = kind == "start" and ask.kind == "start" and ask.provider not in LOCAL
        if ask.kind != kind or (moving and not starting and not seen.in_motion):
            return forward(ask)
        if forwarded:
            forward(ask)
        return answer

    return lie


def rewritten(kind: str, change: Change, *, moving: bool = True) -> Lie:
    """Answers of one kind with their JSON changed, once a motion was begun."""

    def lie(ask: Ask, forward: Forward, seen: ProxyState) -> Answer:
        answer = forward(ask)
        if ask.kind != kind or not answer.ok or (moving and not seen.in_motion):
            return answer
        return replace(answer, body=json.dumps(change(answer.json(), seen)).encode())

    return lie


def garbled(kind: str, garble: Callable[[bytes], bytes]) -> Lie:
    """Answers of one kind with their bytes changed, once a motion was begun."""

    def lie(ask: Ask, forward: Forward, seen: ProxyState) -> Answer:
        answer = forward(ask)
        return (
            replace(answer, body=garble(answer.body)) if ask.kind == kind and answer.ok and seen.in_motion else answer
        )

    return lie


def garbled_type(kind: str, content_type: str) -> Lie:
    """Answers of one kind under another content type, once a motion was begun."""

    def lie(ask: Ask, forward: Forward, seen: ProxyState) -> Answer:
        answer = forward(ask)
        return replace(answer, content_type=content_type) if ask.kind == kind and seen.in_motion else answer

    return lie


def together(*lies: Lie) -> Lie:
    """Several lies, the first nearest to the robot."""

    def lie(ask: Ask, forward: Forward, seen: ProxyState) -> Answer:
        step = forward
        for one in lies:
            step = _within(one, step, seen)
        return step(ask)

    return lie


def _within(lie: Lie, forward: Forward, seen: ProxyState) -> Forward:
    return lambda ask: lie(ask, forward, seen)


LOCAL = frozenset({"observer"})
"""Providers of the robot whose starts move nothing."""


def _endless() -> Iterator[bytes]:
    yield b'{"samples":['
    while True:
        yield PART


def _long() -> Iterator[bytes]:
    yield from (PART for _ in range(MANY_BYTES // len(PART)))


def _batches(*, short_by: int = 0, silent_s: float = 0.0) -> Lie:
    """Batches of charges in place of samples, for ever: full ones, or those that lack a few; each after a while."""

    def lie(ask: Ask, forward: Forward, seen: ProxyState) -> Answer:
        if ask.kind != "observations" or not seen.in_motion:
            return forward(ask)
        after = int(ask.query.get("after", "0"))
        newest = after + int(ask.query.get("limit", "5000")) - short_by
        at_s = json.loads(forward(Ask("GET", "/robot", {}, b"")).body)["at_s"]
        text = ",".join(
            f'{{"kind":"battery","seq":{seq},"at_s":{at_s!r},"source":"battery","charge":0.5}}'
            for seq in range(after + 1, newest + 1)
        )
        body = f'{{"samples":[{text}],"next_seq":{newest},"at_s":{at_s!r}}}'.encode()
        return Answer(body=body, silent_s=silent_s)

    return lie


def _padded(answer: Any, seen: ProxyState) -> Any:
    """The last sample so often that the batch is nearly full."""
    last = answer["samples"][-1:]
    return {**answer, "samples": [*answer["samples"], *last * (4999 - len(answer["samples"]))]}


def _sweeps(count: int, answer: Callable[[int], Answer]) -> Lie:
    """So many sweeps more in every batch, each with bytes of its own that `answer` gives out."""

    def lie(ask: Ask, forward: Forward, seen: ProxyState) -> Answer:
        bodies: dict[str, int] = seen.kept.setdefault("sweeps", {})
        if ask.kind == "blob" and ask.path.rpartition("/")[2] in bodies:
            return answer(bodies[ask.path.rpartition("/")[2]])
        honest = forward(ask)
        if ask.kind != "observations" or not honest.ok or not seen.in_motion or not honest.json()["samples"]:
            return honest
        batch, numbers = honest.json(), range(len(bodies), len(bodies) + count)
        digests = {sha256(answer(number).body).hexdigest(): number for number in numbers}
        bodies |= digests
        last = batch["samples"][-1]
        sweep = {"kind": "scan", "seq": last["seq"], "at_s": last["at_s"], "source": "lidar", "frame": "body"}
        more = [{**sweep, "blob": digest, "points": 1} for digest in digests]
        return replace(honest, body=json.dumps({**batch, "samples": [*batch["samples"], *more]}).encode())

    return lie


def _late(number: int) -> Answer:
    return Answer(status=404, body=b"%d" % number, silent_s=0.3)


def _large(number: int) -> Answer:
    return Answer(body=b"%08d" % number * (1 << 20), content_type="application/octet-stream")


def _figure(name: bytes, value: bytes) -> Callable[[bytes], bytes]:
    def garble(body: bytes) -> bytes:
        head, found, tail = body.partition(b'"' + name + b'":')
        if not found:
            return body
        rest = tail.lstrip(b"-+.0123456789eE")
        return head + found + value + rest

    return garble


def _share(answer: Any, seen: ProxyState) -> Any:
    return {**answer, "status": "sleeping"}


def _other_request(answer: Any, seen: ProxyState) -> Any:
    return {**answer, "identity": {**answer["identity"], "request_id": "e" * 64}}


def _other_mission(answer: Any, seen: ProxyState) -> Any:
    return {**answer, "identity": {**answer["identity"], "mission_id": "msn_other"}}


def _stranger(answer: Any, seen: ProxyState) -> Any:
    return {**answer, "robot_id": "vbot-9"}


def _over(answer: Any, seen: ProxyState) -> Any:
    extra = [answer["samples"][-1]] * 6000 if answer["samples"] else []
    return {**answer, "samples": [*answer["samples"], *extra]}


def _never_ends(answer: Any, seen: ProxyState) -> Any:
    return {**answer, "status": "running", "failure": "", "receipts": []}


def _done_at_once(answer: Any, seen: ProxyState) -> Any:
    return {**answer, "status": "succeeded", "failure": ""}


def _flips(answer: Any, seen: ProxyState) -> Any:
    seen.kept["flip"] = not seen.kept.get("flip", False)
    return {**answer, "status": "failed" if seen.kept["flip"] else "running"}


def _receipts_without_end(answer: Any, seen: ProxyState) -> Any:
    one = {"receipt_id": "r", "kind": "arrival", "at_s": answer["at_s"], "source": "x", "request_id": "0" * 64}
    return {**answer, "receipts": [one] * 3000}


def _map(answer: Any, seen: ProxyState) -> Any:
    seen.kept["n"] = seen.kept.get("n", 0) + 1
    return {**answer, "map_version": f"map-{seen.kept['n']}"}


def _unarmed(ask: Ask, forward: Forward, seen: ProxyState) -> Answer:
    """Keepalives are acknowledged and not passed on."""
    if ask.kind != "keepalive":
        return forward(ask)
    return Answer(body=json.dumps({"handle": ask.path.split("/")[2]}).encode())


def _stop_ignored(ask: Ask, forward: Forward, seen: ProxyState) -> Answer:
    """Stops are acknowledged and not passed on."""
    if ask.kind != "stop":
        return forward(ask)
    return forward(Ask("GET", ask.path.removesuffix("/stop"), {}, b""))


def _forgets(ask: Ask, forward: Forward, seen: ProxyState) -> Answer:
    """After the first reports the robot knows neither handle nor request: as after a restart without its journal."""
    if seen.in_motion and ask.kind in ("report", "find", "stop", "keepalive", "resume") and seen.asks["report"] > 4:
        return Answer(status=404, body=UNKNOWN)
    return forward(ask)


def _hidden(ask: Ask, forward: Forward, seen: ProxyState) -> Answer:
    """The start is refused in words, carried out in fact, and denied by journal and query."""
    if ask.kind == "start" and ask.provider not in LOCAL:
        forward(ask)
        return Answer(status=409, body=REFUSED)
    if ask.kind == "find" and seen.in_motion:
        return Answer(status=404, body=UNKNOWN)
    if ask.kind == "starts":
        return Answer(body=b"[]")
    return forward(ask)


def _denied(ask: Ask, forward: Forward, seen: ProxyState) -> Answer:
    """The start arrives, a gateway's page comes back, and the query denies it."""
    if ask.kind == "start" and ask.provider not in LOCAL:
        forward(ask)
        return Answer(status=504, body=PAGE, content_type="text/html")
    if ask.kind == "find" and seen.in_motion:
        return Answer(status=404, body=UNKNOWN)
    return forward(ask)


def _moved_away(ask: Ask, forward: Forward, seen: ProxyState) -> Answer:
    """Samples are redirected elsewhere."""
    if ask.kind == "observations" and seen.in_motion:
        return Answer(status=302, headers=(("Location", "http://127.0.0.1:9/steal"),))
    return forward(ask)


LATER = 253_402_300_799.0
"""The last second of the year 9999."""
LOOKALIKES = str.maketrans("aceopx_", "\u0430\u0441\u0435\u043e\u0440\u0445\uff3f")
"""Latin letters and what looks like them."""


def _packed(parts: Iterable[bytes]) -> bytes:
    """In the format of gzip, without all parts in memory at once."""
    packer = zlib.compressobj(9, zlib.DEFLATED, zlib.MAX_WBITS | 16)
    return b"".join([*map(packer.compress, parts), packer.flush()])


BOMB = _packed(_long())


def _informed() -> Iterator[bytes]:
    while True:
        yield b"HTTP/1.1 100 Continue\r\n\r\n" * 64


def _chunked_without_end() -> Iterator[bytes]:
    while True:
        yield b"1\r\n \r\n" * 4096


def _trailers_without_end() -> Iterator[bytes]:
    yield b"2\r\n{}\r\n0\r\n"
    while True:
        yield b"X-More: 1\r\n" * 4096


def _repeated_key(name: bytes, value: bytes) -> Callable[[bytes], bytes]:
    """A second value for a key, at the end of the object."""
    return lambda body: body.rstrip()[:-1] + b',"' + name + b'":' + value + b"}"


def _nested(answer: Any, seen: ProxyState) -> Any:
    deep: Any = 1.0
    for _ in range(400):
        deep = {"a": deep}
    return {**answer, "declared": {"depth": deep}}


def _lookalike_request(answer: Any, seen: ProxyState) -> Any:
    identity = answer["identity"]
    return {**answer, "identity": {**identity, "request_id": identity["request_id"].translate(LOOKALIKES)}}


def _lookalike_mission(answer: Any, seen: ProxyState) -> Any:
    identity = answer["identity"]
    return {**answer, "identity": {**identity, "mission_id": identity["mission_id"].translate(LOOKALIKES)}}


def _another_end(answer: Any, seen: ProxyState) -> Any:
    """The first report that ended, in place of every one after it."""
    if answer["status"] == "succeeded":
        return seen.kept.setdefault("ended", answer)
    return seen.kept.get("ended", answer)


def _done_and_running(answer: Any, seen: ProxyState) -> Any:
    seen.kept["turn"] = seen.kept.get("turn", 0) + 1
    return {**answer, "status": ("succeeded", "running", "succeeded")[seen.kept["turn"] % 3], "failure": ""}


def _stopping_in_turn(answer: Any, seen: ProxyState) -> Any:
    seen.kept["stop"] = not seen.kept.get("stop", False)
    return {**answer, "hardware_stop": seen.kept["stop"]}


def _other_cards(answer: Any, seen: ProxyState) -> Any:
    return [{**card, "moves": False, "resources": [], "version": "99", "risk": "low"} for card in answer]


def _numbered_back(answer: Any, seen: ProxyState) -> Any:
    return {**answer, "samples": [{**one, "seq": 1} for one in answer["samples"]], "next_seq": 1}


def _stop_refused(ask: Ask, forward: Forward, seen: ProxyState) -> Answer:
    """Stops are refused in the words of the protocol, and not passed on."""
    return Answer(status=409, body=REFUSED) if ask.kind == "stop" else forward(ask)


def _kept_alive_elsewhere(answer: Any, seen: ProxyState) -> Any:
    return {**answer, "handle": "another"}


def _started_twice(ask: Ask, forward: Forward, seen: ProxyState) -> Answer:
    """The journal holds every start twice."""
    answer = forward(ask)
    if ask.kind != "starts" or not answer.ok:
        return answer
    return replace(answer, body=json.dumps([one for one in answer.json() for _ in range(2)]).encode())


HTML = Answer(status=200, body=PAGE, content_type="text/html")
BOUNDS = (
    Mode("robot-one-byte-a-second", "bounds", "The robot's condition comes one byte a second",
         instead("status", Answer(body=b" " * 4000, drip_s=1.0)), patience_s=0.3),
    Mode("samples-one-byte-a-second", "bounds", "Samples come one byte a second",
         instead("observations", Answer(body=b" " * 4000, drip_s=1.0)), patience_s=0.3),
    Mode("report-one-byte-a-second", "bounds", "Reports come one byte a second",
         instead("report", Answer(body=b" " * 4000, drip_s=1.0)), patience_s=0.3, may_succeed=True),
    Mode("headers-one-byte-a-second", "bounds", "Headers come one byte a second",
         instead("observations", Answer(body=b"{}", head_drip=True, drip_s=1.0)), patience_s=0.3),
    Mode("start-never-answered", "bounds", "A start is carried out and never answered",
         instead("start", Answer(silent_s=600.0)), patience_s=0.3, may_succeed=True),
    Mode("samples-sixty-megabytes", "bounds", "60 MB of samples in mid motion",
         instead("observations", Answer(parts=_long))),
    Mode("report-sixty-megabytes", "bounds", "A report of 60 MB", instead("report", Answer(parts=_long)),
         may_succeed=True),
    Mode("samples-without-end", "bounds", "A body without an end", instead("observations", Answer(parts=_endless))),
    Mode("batches-always-full", "bounds", "Every batch of samples is full", _batches()),
    Mode("batches-full-and-slow", "bounds", "Every batch of samples is full, and each comes half a second late",
         _batches(silent_s=0.5)),
    Mode("batches-nearly-full", "bounds", "4,999 samples in every batch", _batches(short_by=1)),
    Mode("samples-repeated", "bounds", "The last sample of every batch thousands of times",
         rewritten("observations", _padded), may_succeed=True),
    Mode("sweeps-each-late", "bounds", "200 sweeps in every batch, none of which comes in less than 0.3 s",
         _sweeps(200, _late), may_succeed=True),
    Mode("sweeps-of-eight-megabytes", "bounds", "Eight sweeps of 8 MiB in every batch", _sweeps(8, _large),
         may_succeed=True),
    Mode("batch-over-its-limit", "bounds", "More samples than were asked for", rewritten("observations", _over)),
    Mode("samples-nan", "bounds", "NaN among the samples", garbled("observations", _figure(b"at_s", b"NaN"))),
    Mode("samples-infinite", "bounds", "Infinity among the samples",
         garbled("observations", _figure(b"at_s", b"Infinity"))),
    Mode("samples-huge", "bounds", "A figure of 1e300", garbled("observations", _figure(b"at_s", b"1e300"))),
    Mode("samples-overflow", "bounds", "A figure of 1e999", garbled("observations", _figure(b"at_s", b"1e999"))),
    Mode("sequence-beyond-count", "bounds", "A sequence number of 30 digits",
         garbled("observations", _figure(b"seq", b"9" * 30))),
    Mode("samples-deep", "bounds", "100,000 brackets in each other",
         instead("observations", Answer(body=b"[" * 100_000))),
    Mode("samples-html", "bounds", "A page in place of samples", instead("observations", HTML)),
    Mode("samples-redirected", "bounds", "A redirect in place of samples", _moved_away),
    Mode("samples-500", "bounds", "500 in place of samples", instead("observations", Answer(status=500, body=PAGE))),
    Mode("samples-404", "bounds", "404 in place of samples", instead("observations", Answer(status=404, body=UNKNOWN))),
    Mode("samples-speak-of-our-log", "bounds", "The robot says that the harness's log is damaged",
         instead("observations", Answer(status=409, body=REFUSED.replace(b"provider_failed", b"log_damaged")))),
    Mode("samples-speak-of-our-store", "bounds", "The robot says that the harness's store is unavailable",
         instead("observations", Answer(status=409, body=REFUSED.replace(b"provider_failed", b"store_unavailable")))),
    Mode("samples-not-utf8", "bounds", "Bytes that are no text",
         garbled("observations", lambda body: body.replace(b"odom", b"\xff\xfe\xff\xfe"))),
    Mode("samples-empty", "bounds", "An empty body", instead("observations", Answer(body=b""))),
    Mode("samples-cut-short", "bounds", "Fewer bytes than the headers say",
         instead("observations", Answer(body=b'{"samples":', claimed=5000)), patience_s=1.0),
    Mode("samples-packed", "bounds", "A packed body that nobody asked for",
         instead("observations", Answer(body=b"\x1f\x8b" + b"0" * 500, headers=(("Content-Encoding", "gzip"),)))),
    Mode("samples-packed-bomb", "bounds", "60 MB packed into 60 kB",
         instead("observations", Answer(body=BOMB, headers=(("Content-Encoding", "gzip"),)))),
    Mode("samples-chunked-without-end", "bounds", "Chunks of one byte without an end",
         instead("observations", Answer(parts=_chunked_without_end, headers=(("Transfer-Encoding", "chunked"),))),
         patience_s=0.3),
    Mode("samples-chunk-beyond-memory", "bounds", "A chunk that claims 2^63 bytes",
         instead("observations", Answer(parts=lambda: (b"7fffffffffffffff\r\n{}",),
                                        headers=(("Transfer-Encoding", "chunked"),))), patience_s=0.3),
    Mode("samples-trailers-without-end", "bounds", "Trailers behind the last chunk without an end",
         instead("observations", Answer(parts=_trailers_without_end, headers=(("Transfer-Encoding", "chunked"),))),
         patience_s=0.3),
    Mode("samples-of-two-lengths", "bounds", "Two lengths for one body",
         instead("observations", Answer(body=b'{"samples":[]}', headers=(("Content-Length", "4"),)))),
    Mode("samples-informational-without-end", "bounds", "100 Continue for ever",
         instead("observations", Answer(status=100, parts=_informed)), patience_s=0.3),
    Mode("samples-ten-thousand-headers", "bounds", "10,000 headers",
         instead("observations", Answer(body=b"{}", headers=tuple((f"X-{n}", "1") for n in range(10_000))))),
    Mode("samples-header-of-a-megabyte", "bounds", "A header of a megabyte",
         instead("observations", Answer(body=b"{}", headers=(("X-Long", "1" * 1_000_000),)))),
    Mode("samples-redirected-in-a-circle", "bounds", "A redirect to itself",
         instead("observations", Answer(status=302, headers=(("Location", "/observations"),)))),
    Mode("samples-utf16", "bounds", "Text in UTF-16",
         garbled("observations", lambda body: body.decode().encode("utf-16"))),
    Mode("samples-numbered-back", "bounds", "Sequence numbers that begin again at 1",
         rewritten("observations", _numbered_back)),
    Mode("report-deep", "bounds", "400 objects in each other in a report", rewritten("report", _nested),
         may_succeed=True),
    Mode("report-integer-of-5000-digits", "bounds", "An integer of 5,000 digits",
         garbled("report", _figure(b"share", b"9" * 5000)), may_succeed=True),
    Mode("report-of-another-type", "bounds", "A report that calls itself a picture",
         garbled_type("report", "image/png"), may_succeed=True),
    Mode("receipts-without-end", "bounds", "3,000 receipts in one report", rewritten("report", _receipts_without_end),
         may_succeed=True),
)  # fmt: skip
OUTCOMES = (
    Mode("start-504", "outcome", "504 from a gateway after a start that arrived",
         instead("start", Answer(status=504, body=PAGE, content_type="text/html")), may_succeed=True),
    Mode("start-504-and-denied", "outcome", "504 after a start that arrived, and the query denies it", _denied),
    Mode("start-504-lost", "outcome", "504 in place of every start; none arrives",
         instead("start", Answer(status=504, body=PAGE, content_type="text/html"), forwarded=False)),
    Mode("start-html", "outcome", "A page after a start that arrived", instead("start", HTML), may_succeed=True),
    Mode("start-redirected", "outcome", "A redirect after a start that arrived",
         instead("start", Answer(status=307, headers=(("Location", "http://127.0.0.1:9/"),))), may_succeed=True),
    Mode("start-unreadable", "outcome", "The first report is cut in half",
         instead("start", Answer(body=b'{"handle": "rou')), may_succeed=True),
    Mode("start-empty", "outcome", "An empty first report", instead("start", Answer(body=b"")), may_succeed=True),
    Mode("start-nan-share", "outcome", "A first report with NaN for its progress",
         garbled("start", _figure(b"share", b"NaN")), may_succeed=True),
    Mode("start-unknown-status", "outcome", "A first report with an unknown status",
         rewritten("start", _share), may_succeed=True),
    Mode("start-503-store", "outcome", "503 after a start that arrived",
         instead("start", Answer(status=503, body=REFUSED.replace(b"provider_failed", b"store_unavailable"))),
         may_succeed=True),
    Mode("start-reset", "outcome", "The connection breaks after a start that arrived",
         instead("start", Answer(reset=True)), may_succeed=True),
    Mode("start-other-request", "outcome", "The first report is about another request",
         rewritten("start", _other_request), may_succeed=True),
    Mode("start-refused-and-done", "outcome", "A start is refused and carried out",
         instead("start", Answer(status=409, body=REFUSED)), may_succeed=True),
    Mode("start-refused-done-and-hidden", "outcome", "A start is refused, carried out, and hidden", _hidden),
    Mode("start-refused", "outcome", "Every start is refused, and none is carried out",
         instead("start", Answer(status=409, body=REFUSED), forwarded=False)),
    Mode("report-forgotten", "outcome", "404 for handle and request in mid motion", _forgets),
    Mode("report-nan-share", "outcome", "NaN for the progress", garbled("report", _figure(b"share", b"NaN")),
         may_succeed=True),
    Mode("report-unknown-status", "outcome", "A status that the protocol does not have", rewritten("report", _share),
         may_succeed=True),
    Mode("report-html", "outcome", "A page in place of a report", instead("report", HTML), may_succeed=True),
    Mode("report-504", "outcome", "504 in place of a report",
         instead("report", Answer(status=504, body=PAGE, content_type="text/html")), may_succeed=True),
    Mode("reports-and-queries-unreadable", "outcome", "Neither handle nor request can be asked about",
         together(instead("report", HTML), instead("find", HTML))),
    Mode("report-of-two-statuses", "outcome", "Two statuses in one report: running, then succeeded",
         garbled("report", _repeated_key(b"status", b'"succeeded"')), may_succeed=True),
    Mode("report-done-and-running", "outcome", "Succeeded, running and succeeded in turn",
         rewritten("report", _done_and_running), may_succeed=True),
    Mode("report-of-the-year-9999", "outcome", "Reports dated in the year 9999",
         rewritten("report", lambda answer, seen: {**answer, "at_s": LATER}), may_succeed=True),
    Mode("stop-refused", "outcome", "Running for ever, and stops are refused",
         together(_stop_refused, rewritten("report", _never_ends)), may_succeed=True),
    Mode("keepalive-of-another-handle", "outcome", "Keepalives are acknowledged for another handle",
         rewritten("keepalive", _kept_alive_elsewhere), may_succeed=True),
    Mode("journal-holds-starts-twice", "outcome", "The start journal holds every start twice", _started_twice,
         may_succeed=True),
    Mode("hardware-stop-in-turn", "outcome", "The hardware stop is pressed and released in turn",
         rewritten("status", _stopping_in_turn), may_succeed=True),
    Mode("report-flips", "outcome", "Failed and running in turn", rewritten("report", _flips)),
    Mode("report-never-ends", "outcome", "Running for ever", rewritten("report", _never_ends)),
    Mode("report-done-at-once", "outcome", "Succeeded at once, while the body still moves",
         rewritten("report", _done_at_once), may_succeed=True),
    Mode("keepalive-504", "outcome", "504 to every keepalive",
         instead("keepalive", Answer(status=504, body=PAGE), forwarded=False)),
    Mode("keepalive-dropped", "outcome", "Keepalives are acknowledged and dropped", _unarmed, may_succeed=True),
    Mode("stop-ignored", "outcome", "Running for ever, and stops are dropped",
         together(_stop_ignored, rewritten("report", _never_ends))),
    Mode("query-500", "outcome", "504 to a start that arrived, 500 to the query",
         together(instead("start", Answer(status=504, body=PAGE)), instead("find", Answer(status=500, body=PAGE)))),
)  # fmt: skip
IDENTITIES = (
    Mode("another-robot", "identity", "Another robot answers in mid motion", rewritten("status", _stranger)),
    Mode("another-robot-at-once", "identity", "Another robot answers from the begin",
         rewritten("status", _stranger, moving=False)),
    Mode("report-of-another-request", "identity", "Reports are about another request",
         together(rewritten("report", _other_request), rewritten("find", _other_request))),
    Mode("report-of-another-mission", "identity", "Reports are about another mission",
         together(rewritten("report", _other_mission), rewritten("find", _other_mission))),
    Mode("report-of-a-lookalike-request", "identity", "Cyrillic letters in the request that a report names",
         together(rewritten("report", _lookalike_request), rewritten("find", _lookalike_request))),
    Mode("report-of-a-lookalike-mission", "identity", "Cyrillic letters in the mission that a report names",
         together(rewritten("report", _lookalike_mission), rewritten("find", _lookalike_mission))),
    Mode("report-of-another-invocation", "identity", "The first stage's report for every stage after it",
         together(rewritten("report", _another_end), rewritten("find", _another_end)), template=WHOLE),
    Mode("cards-change", "identity", "Cards that change under way: nothing moves, no resources, another version",
         rewritten("cards", _other_cards), may_succeed=True),
    Mode("map-changes", "identity", "Another map at each look", rewritten("status", _map)),
)  # fmt: skip
