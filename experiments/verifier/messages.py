"""Cases of the predicates on messages, requests and kept pictures, with the channel and the archive as they truly are.

message_stored, recorded_request, kept_picture, same_image, one_image.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from random import Random
from typing import Any

import msgspec
from msgspec.structs import replace

from experiments.verifier.cases import (
    K,
    VerifierCase,
    condition_id_of,
    fact,
    goal_of,
    identity_of,
    packet_of,
    shown_goal,
    shown_packet,
    stage,
)
from harness.adapters.providers.archive import CARD as ARCHIVE
from harness.adapters.providers.archive import Certificate
from harness.adapters.providers.intake import CARD as INTAKE
from harness.adapters.providers.messaging.delivery import CARD as DELIVERY
from harness.adapters.providers.messaging.memory import MemoryOutbox
from harness.adapters.providers.messaging.read_back import MemoryReader, MessageReadBack
from harness.adapters.providers.models.description import CARD as DESCRIBER
from harness.contracts.effects import Relational, Symbolic
from harness.contracts.errors import StoreUnavailable
from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import Digest, NodeId, RequestId, sha256
from harness.contracts.measurements import Measurement, StoredMessage
from harness.contracts.protocol import Receipt
from harness.contracts.values import encode

BEGAN_S = 1_790_000_000.0
WANTED = 4
TEXTS = (
    "The passage is clear: nothing stands on its floor.",
    "The passage is obstructed: one thing stands on its floor, taking 44% of its width.",
    "The passage is obstructed: 2 things stand on its floor, taking 31% and 20% of its width.",
)
GOALS = (
    "Help me go and check the office storage area",
    "Walk the circuit and come back",
    "Please check on the office storage",
    "检查办公室储物区",
    "Go to the dock",
)


@dataclass
class UnreliableOutbox(MemoryOutbox):
    """A channel whose messages are lost or changed after they were acknowledged. `failing`: it cannot be read."""

    change: Callable[[StoredMessage], StoredMessage | None] = field(default=lambda message: message)
    failing: bool = False

    def __post_init__(self) -> None:
        super().__init__()

    def held(self, key: str) -> tuple[str, Sequence[Digest]] | None:
        """The message as the channel holds it now. Raises StoreUnavailable where it cannot be read."""
        if self.failing:
            raise StoreUnavailable("The channel does not answer", where="outbox", do="try again")
        found = super().held(key)
        message = self.change(StoredMessage(text=found[0], images=tuple(found[1]))) if found else None
        return (message.text, message.images) if message else None


def stored_messages(chance: Random, count: int) -> Iterator[VerifierCase]:
    """message_stored at its stage and of the goal: the channel's contents are the truth."""
    for number in range(count):
        yield _message(chance, number, of_goal=chance.random() < 0.35)


def requests(chance: Random, count: int) -> Iterator[VerifierCase]:
    """recorded_request: what a person submitted, what the log says of it, and what the intake took down."""
    names = (
        "none", "none", "none", "condition of another goal", "intake took down another text", "intake altered a letter",
        "goal exchanged after the submission", "record missing", "no receipt", "packet of another attempt",
        "packet of another request", "packet of an earlier state",
    )  # fmt: skip
    for _ in range(count):
        name = chance.choice(names)
        submitted = chance.choice(GOALS) + ("" if chance.random() < 0.5 else f" ({chance.randrange(10_000)})")
        other = submitted + chance.choice((" twice", "!", " "))
        compiled = goal_of(other if name == "goal exchanged after the submission" else submitted)
        if name == "goal exchanged after the submission":
            compiled = replace(compiled, digest=sha256(submitted.encode()))
        tested = goal_of(other).digest if name == "condition of another goal" else compiled.digest
        taken = {"intake took down another text": chance.choice(GOALS) + "?", "intake altered a letter": submitted[:-1]}
        submission = taken.get(name, submitted)
        blobs = {sha256(submission.encode()): submission.encode()}
        effect = Symbolic(predicate="recorded_request", arguments={"digest": tested})
        node = stage(effect, mandatory=("receipts",))
        receipt = _receipt("transcript", BEGAN_S, sha256(submission.encode()), card=INTAKE)
        packet = packet_of(node, INTAKE, from_s=BEGAN_S, until_s=BEGAN_S + 1.0, receipts=(receipt,))
        if name == "no receipt":
            packet = replace(packet, receipts=())
        packet = _misplaced(packet, name)
        changes: dict[str, Any] = {"requested_by": None} if name == "record missing" else {}
        inputs = shown_packet(node, packet, INTAKE, blobs, goal=compiled, **changes)
        truth = compiled.text == submitted == submission and tested == goal_of(submitted).digest
        truth = truth and not name.startswith("packet of")
        yield VerifierCase("recorded_request", name, truth, inputs, condition_id_of(effect))


def kept_pictures(chance: Random, count: int, pictures: Sequence[bytes]) -> Iterator[VerifierCase]:
    """kept_picture: the archive's bytes are the truth, beside the certificate that it gives."""
    names = (
        "none", "none", "none", "archive lost the picture", "archive altered the picture", "another picture kept",
        "certificate of another picture", "certificate of another size", "certificate altered", "no receipt",
        "certificate of nothing", "packet of another request", "picture cut short",
    )  # fmt: skip
    for _ in range(count):
        yield _image_case(chance.choice(names), chance, pictures, predicate="kept_picture")


def same_images(chance: Random, count: int, pictures: Sequence[bytes]) -> Iterator[VerifierCase]:
    """same_image: whether a description was made of the accepted picture is its describer's word alone."""
    names = (
        "none", "none", "none", "report of another picture", "report of another size", "report altered", "no receipt",
        "described without looking at it", "packet of another request",
    )  # fmt: skip
    for _ in range(count):
        yield _image_case(chance.choice(names), chance, pictures, predicate="same_image")


def shared_images(chance: Random, count: int, pictures: Sequence[bytes]) -> Iterator[VerifierCase]:
    """one_image: of a goal, whether all accepted stages worked on the same picture."""
    names = (
        "none", "none", "another picture kept", "another picture described", "a stage names no picture",
        "picture lost since", "picture altered since", "a stage not accepted", "stage of low level",
    )  # fmt: skip
    effect = Relational(predicate="one_image", relation="one_image", subject="persist", object="capture")
    for _ in range(count):
        name = chance.choice(names)
        body, other = chance.sample(list(pictures), 2)
        one, foreign = sha256(body), sha256(other)
        named: dict[str, list[Digest] | None] = {"capture": [one], "persist": [one], "describe": [one]}
        if name == "another picture kept":
            named["persist"] = [foreign]
        if name == "another picture described":
            named["describe"] = [foreign]
        if name == "a stage names no picture":
            named["describe"] = None
        if name == "a stage not accepted":
            named.pop("persist")
        blobs = {one: body, foreign: other}
        if name == "picture lost since":
            blobs.pop(one)
        if name == "picture altered since":
            blobs[one] = body[:-3] + b"abc"
        facts = [
            fact(
                "kept_picture" if stage_name == "persist" else "pictured",
                stage_name,
                {"images": images} if images else {},
                independence=0 if name == "stage of low level" and stage_name == "describe" else 2,
            )
            for stage_name, images in named.items()
        ]
        nodes = [stage(effect, node_id=NodeId(stage_name)) for stage_name in ("capture", "persist", "describe")]
        packets = {
            node.node_id: (packet_of(node, ARCHIVE, from_s=BEGAN_S + at, until_s=BEGAN_S + at + 1.0), K + at)
            for at, node in enumerate(nodes, start=1)
            if node.node_id in named
        }
        inputs = shown_goal((effect,), nodes, packets, blobs, at_s=BEGAN_S + 20.0, facts=facts)
        truth = all(images == [one] for images in named.values()) and len(named) == 3 and blobs.get(one) == body
        yield VerifierCase("one_image", name, truth, inputs, condition_id_of(effect, "goal"))


def _message(chance: Random, number: int, *, of_goal: bool) -> VerifierCase:
    frames = tuple(sha256(f"frame {number} {index}".encode()) for index in range(8))
    sent = tuple(chance.sample(frames, chance.choice((4, 4, 4, 5, 6))))
    text = chance.choice(TEXTS)
    name = chance.choice(tuple(CHANGES) + READS + ("none", "none", "none") + (() if of_goal else STAGE_ONLY))
    outbox = UnreliableOutbox()
    request = identity_of(DELIVERY, NodeId("delivery")).request_id
    outbox.send(request, text, sent)
    blobs: dict[Digest, bytes] = {}

    def keep(body: bytes) -> Digest:
        blobs[sha256(body)] = body
        return sha256(body)

    before = _measured(outbox, request, text, BEGAN_S + 4.0, keep)
    if name in CHANGES:
        outbox.change = lambda message: CHANGES[name](message, chance.random())
    late_s = BEGAN_S + (60.0 if of_goal else 4.0)
    truth = _holds(outbox, request, text, frames)
    outbox.failing = name == "read path does not answer"
    found = _measured(outbox, request, text, late_s, keep)
    found = _misread(name, found, before, outbox, keep, text, late_s)
    reported = fact("passage_checked", "analysis", {"frames": list(frames)}, measured={"blocked": 0.0})
    arguments = {"images": str(WANTED)} | ({"delivery": "delivery"} if of_goal else {})
    effect = Symbolic(predicate="message_stored", arguments=arguments)
    receipts = tuple(
        replace(_receipt("delivery", BEGAN_S + 3.0, blob, card=DELIVERY), receipt_id=f"item-{at}", request_id=request)
        for at, blob in enumerate((*sent, keep(text.encode())))
    )
    node = stage(effect, node_id=NodeId("delivery"), mandatory=("receipts",))
    packet = packet_of(
        node, DELIVERY, from_s=BEGAN_S, until_s=BEGAN_S + 4.0, after=before if of_goal else found, receipts=receipts
    )
    epistemic = name == FORGED_READ
    if of_goal:
        accepted = fact("message_stored", "delivery", {"frames": list(sent), "text_digest": sha256(text.encode())})
        inputs = shown_goal(
            (effect,),
            (stage(effect, node_id=NodeId("analysis")), node),
            {node.node_id: (packet, K + 1)},
            blobs,
            at_s=late_s,
            facts=(reported, accepted),
            measured=found,
        )
        label = f"{name}, since it was accepted" if name in CHANGES else name
        return VerifierCase(
            "message_stored", label, truth, inputs, condition_id_of(effect, "goal"), epistemic=epistemic
        )
    packet = _misplaced(packet, name)
    truth = truth and not name.startswith("packet of") and name != "message of another request"
    inputs = shown_packet(node, packet, DELIVERY, blobs, facts=(reported,))
    return VerifierCase("message_stored", name, truth, inputs, condition_id_of(effect, "delivery"), epistemic=epistemic)


def _holds(outbox: UnreliableOutbox, request: RequestId, text: str, frames: tuple[Digest, ...]) -> bool:
    """Whether the channel truly holds the text, and enough of the analysed images and no other."""
    held = outbox.held(request)
    return held is not None and held[0] == text and len(set(held[1])) >= WANTED and set(held[1]) <= set(frames)


def _measured(
    outbox: UnreliableOutbox, request: RequestId, text: str, at_s: float, keep: Callable[[bytes], Digest]
) -> tuple[EvidenceReference, ...]:
    """What the shipped read path measures of the channel."""
    measurement = Measurement(requests=(request,), text=text, from_s=at_s, until_s=at_s)
    return MessageReadBack(lambda _: MemoryReader(outbox), keep=keep).measure(measurement)


def _misread(
    name: str,
    found: tuple[EvidenceReference, ...],
    before: tuple[EvidenceReference, ...],
    outbox: UnreliableOutbox,
    keep: Callable[[bytes], Digest],
    text: str,
    at_s: float,
) -> tuple[EvidenceReference, ...]:
    """What becomes of a reading on its way to the verifier."""
    match name:
        case "not read back":
            return ()
        case "reading altered":
            return tuple(replace(one, blob=Digest("1" * 64)) for one in found)
        case "message of another request":
            outbox.send("another", text, ())
            return _measured(outbox, RequestId("another"), text, at_s, keep)
        case "deleted, and the read path repeats its first reading":
            return tuple(replace(one, from_s=at_s, until_s=at_s) for one in before)
        case _:
            return found


FORGED_READ = "deleted, and the read path repeats its first reading"
READS = ("read path does not answer", "not read back", "reading altered", FORGED_READ)
STAGE_ONLY = ("message of another request", "packet of another request", "packet of an earlier state")
CHANGES: dict[str, Callable[[StoredMessage, float], StoredMessage | None]] = {
    "deleted": lambda message, share: None,
    FORGED_READ: lambda message, share: None,
    "text altered": lambda message, share: replace(message, text=message.text.replace("clear", "free") + " "),
    "text of the contrary": lambda message, share: replace(
        message, text=TEXTS[1] if "clear" in message.text else TEXTS[0]
    ),
    "text empty": lambda message, share: replace(message, text=""),
    "an image exchanged": lambda message, share: replace(
        message, images=(*message.images[1:], sha256(f"{share}".encode()))
    ),
    "an image too many": lambda message, share: replace(message, images=(*message.images, sha256(f"{share}".encode()))),
    "images lost": lambda message, share: replace(message, images=message.images[: int(4 * share)]),
    "an image repeated": lambda message, share: replace(message, images=(message.images[0],) * len(message.images)),
}


def _image_case(name: str, chance: Random, pictures: Sequence[bytes], *, predicate: str) -> VerifierCase:
    """A certificate or a description of a picture, and the archive as it is when it is judged."""
    body, foreign = chance.sample(list(pictures), 2)
    if name == "picture cut short":
        body = body[:3000]
    accepted, other = sha256(body), sha256(foreign)
    stored_blobs = {accepted: body, other: foreign}
    wide, high = (640, 480) if name in ("certificate of another size", "report of another size") else (1280, 720)
    image_digest = (
        other
        if name in ("another picture kept", "certificate of another picture", "report of another picture")
        else accepted
    )
    report = encode(Certificate(image=image_digest, width_px=wide, height_px=high, size_bytes=len(body)))
    digest = sha256(report)
    truth = name in ("none", "no receipt")
    match name:
        case "archive lost the picture" | "another picture kept":
            stored_blobs.pop(accepted)
        case "archive altered the picture":
            stored_blobs[accepted] = body[:-2] + b"\x00\xff\xd9"
        case "certificate altered" | "report altered":
            report = report.replace(b"1280", b"1281")
        case "certificate of nothing":
            report = msgspec.json.encode({"image": accepted})
            digest = sha256(report)
        case _:
            pass
    blobs = {**stored_blobs, digest: report}
    archives = predicate == "kept_picture"
    card, kind = (ARCHIVE, "keeping") if archives else (DESCRIBER, "analysis")
    effect = Relational(predicate=predicate, relation="same_image", subject="stage", object="capture")
    node = stage(effect, mandatory=("receipts",))
    receipt = _receipt(kind, BEGAN_S + 1.0, digest, card=card)
    packet = packet_of(
        node, card, from_s=BEGAN_S, until_s=BEGAN_S + 2.0, receipts=() if name == "no receipt" else (receipt,)
    )
    inputs = shown_packet(
        node, _misplaced(packet, name), card, blobs, facts=(fact("pictured", "capture", {"images": [accepted]}),)
    )
    return VerifierCase(predicate, name, truth, inputs, condition_id_of(effect))


def _receipt(kind: Any, at_s: float, blob: Digest, *, card: Any) -> Receipt:
    return Receipt(
        receipt_id=f"{kind}-1",
        kind=kind,
        at_s=at_s,
        source=card.provider_id,
        request_id=identity_of(card).request_id,
        blob=blob,
    )


def _misplaced(packet: Any, name: str) -> Any:
    """The packet as another request's, another attempt's or another state's."""
    match name:
        case "packet of another request":
            return replace(packet, identity=replace(packet.identity, request_id=RequestId("another")))
        case "packet of another attempt":
            return replace(packet, identity=replace(packet.identity, attempt=2))
        case "packet of an earlier state":
            return replace(packet, k_ctx=packet.k_ctx - 1)
        case _:
            return packet
