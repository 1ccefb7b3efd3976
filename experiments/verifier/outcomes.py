"""Cases of outcome_heard: what missions achieved, spoken into the simulated room, recorded and recognised.

Truth is what was spoken: the very outcome that was to be told, of the same places, after its stages were accepted.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from random import Random

from msgspec.structs import replace

from experiments.verifier.cases import (
    K,
    VerifierCase,
    condition_id_of,
    fact,
    identity_of,
    packet_of,
    shown_goal,
    shown_packet,
    stage,
)
from experiments.verifier.speech import BEGAN_S, BESIDE_S, NAMES, WHOLE, RoomRecording, recorded
from harness.adapters.providers.speech.voice import CARD as VOICE
from harness.contracts.effects import Symbolic
from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import Digest, NodeId, RequestId, sha256
from harness.contracts.measurements import Recognition
from harness.contracts.protocol import Receipt
from harness.contracts.values import decode, encode

OUTCOMES = (
    "I walked the circuit from {place} and came back.", "I came to {place}.",
    "I came to {place} and waited there for {time}.", "I looked around the site.", "I looked around {place}.",
    "I came to {place}. I took a picture and kept it.", "I came to {place}. I came to {other}.",
)  # fmt: skip
TIMES = ("1 minute", "30 seconds", "2 minutes", "1 minute and 20 seconds", "45 seconds")
DENIALS = (
    "I did not walk the circuit.", "I did not come to {place}.", "I could not do it.", "I was stopped on the way.",
)  # fmt: skip
UNVERIFIED = " Declared, and unverified: The description is of the accepted picture."
KINDS = (
    "none", "none", "none", "none", "none", "with an unverified part", "denies it", "says another place",
    "says another outcome", "says something else", "says it was verified", "stopped early", "loudspeaker unplugged",
    "noise in the room", "another voice over it", "another time",
)  # fmt: skip
FEW = ("none", "none", "denies it", "says another place", "says another outcome", "stopped early")
"""A recording of each costs a second: enough for a slice."""
FAULTS = (
    "heard before the stage", "recording lost", "recording altered", "no recognition", "synthesised, not recorded",
    "recognition of another recording", "packet of another request", "stage not accepted", "another outcome asked",
    FORGED := "recogniser gives out what was asked",
)  # fmt: skip


@dataclass(frozen=True)
class SpokenOutcome:
    """One recording: the outcome that was to be told, and whether it is what was said."""

    statement: str
    places: tuple[str, ...]
    said: bool
    kind: str
    recording: RoomRecording


def recordings(seed: int, *, kinds: Sequence[str]) -> tuple[SpokenOutcome, ...]:
    """One report of each kind, of which some are not said as they were asked, or not heard as they were said."""
    chance = Random(seed)
    return tuple(_recorded(chance, kind) for kind in kinds)


def outcomes(chance: Random, count: int, pool: Sequence[SpokenOutcome]) -> Iterator[VerifierCase]:
    """outcome_heard, at its stage and of the goal."""
    for _ in range(count):
        one = chance.choice(pool)
        name = one.kind if chance.random() < 0.6 else chance.choice(FAULTS)
        yield _case(name, one, chance, of_goal=chance.random() < 0.3)


def _recorded(chance: Random, kind: str) -> SpokenOutcome:
    place, other = chance.sample(NAMES, 2)
    written = chance.choice(OUTCOMES if kind != "another time" else OUTCOMES[2:3])
    if kind == "says another place":
        written = chance.choice([one for one in OUTCOMES if "{place}" in one])
    time, wrong_time = chance.sample(TIMES, 2)
    statement = written.format(place=place, other=other, time=time)
    more = UNVERIFIED if kind in ("with an unverified part", "says it was verified") else ""
    request = f"Mission report. {statement}{more}"
    elsewhere = written.format(place=other, other=place, time=time)
    differing = [one for one in OUTCOMES if one != written]
    another = chance.choice(differing).format(place=place, other=other, time=time)
    contrary = chance.choice(DENIALS).format(place=place)
    spoken = {
        "denies it": f"Mission report. {contrary}",
        "says another place": f"Mission report. {elsewhere}",
        "says another outcome": f"Mission report. {another}",
        "says something else": "Everything is fine here, and the coffee is ready in the kitchen.",
        "says it was verified": request.replace("unverified", "verified"),
        "another time": request.replace(time, wrong_time),
    }.get(kind, request)
    recording = recorded(chance, kind, request, spoken, over=f"Mission report. {contrary} {elsewhere}")
    places = tuple(name for name in (place, other) if name in statement)
    as_asked = spoken == request and recording.share >= WHOLE
    return SpokenOutcome(statement, places, as_asked, kind, recording)


def _case(name: str, one: SpokenOutcome, chance: Random, *, of_goal: bool) -> VerifierCase:
    recording = one.recording
    drowned = one.kind in ("noise in the room", "another voice over it")
    truth: bool | None = None if drowned and one.said else one.said
    if name in ("heard before the stage", "packet of another request", "stage not accepted", "another outcome asked"):
        truth = False
    blobs = dict(recording.blobs)
    evidence = _altered(name, recording.evidence, blobs)
    early = name == "heard before the stage"
    achieved = fact("arrival", "go", {}, at_s=BEGAN_S + (5.0 if early else -5.0))
    facts = tuple(done for done in (achieved,) if name != "stage not accepted")
    effect = _effect(name, one)
    node = stage(effect, node_id=NodeId("report"), mandatory=("receipts",))
    receipts = (_playback(recording),)
    packet = packet_of(node, VOICE, from_s=BEGAN_S, until_s=recording.until_s, after=evidence, receipts=receipts)
    epistemic = name == FORGED
    if of_goal and len(evidence) == 2 and name != "packet of another request":
        goal = replace(effect, arguments={**effect.arguments, "report": "report"})
        named = {"sound": evidence[0].blob, "recognition": evidence[1].blob}
        accepted = fact("outcome_heard", "report", named, at_s=recording.until_s - BESIDE_S)
        facts = tuple(replace(done, at_s=recording.until_s + 5.0) if early else done for done in facts)
        nodes = (stage(goal, node_id=NodeId("go")), node)
        packets = {node.node_id: (packet, K + 1)}
        inputs = shown_goal((goal,), nodes, packets, blobs, at_s=recording.until_s + 9.0, facts=(*facts, accepted))
        return VerifierCase("outcome_heard", name, truth, inputs, condition_id_of(goal, "goal"), epistemic=epistemic)
    if name == "packet of another request":
        packet = replace(packet, identity=replace(packet.identity, request_id=RequestId("another")))
    inputs = shown_packet(node, packet, VOICE, blobs, facts=facts)
    return VerifierCase("outcome_heard", name, truth, inputs, condition_id_of(effect, "report"), epistemic=epistemic)


def _effect(name: str, one: SpokenOutcome) -> Symbolic:
    more = " I walked around the moon." if name == "another outcome asked" else ""
    named = {f"name_{number}": place for number, place in enumerate(one.places, start=1)}
    arguments = {"statement": f"{one.statement}{more}", "stage_1": "go", **named}
    return Symbolic(predicate="outcome_heard", arguments=arguments)


def _playback(recording: RoomRecording) -> Receipt:
    return Receipt(
        receipt_id="playback-1",
        kind="playback",
        at_s=recording.until_s,
        source="espeak-voice",
        request_id=identity_of(VOICE, NodeId("report")).request_id,
        blob=recording.wav,
    )


def _altered(
    name: str, evidence: tuple[EvidenceReference, ...], blobs: dict[Digest, bytes]
) -> tuple[EvidenceReference, ...]:
    """The recording and its recognition after a fault of the evidence."""
    sound, recognition = evidence
    found = decode(blobs[recognition.blob], Recognition)
    match name:
        case "recording lost":
            blobs.pop(sound.blob)
        case "recording altered":
            blobs[sound.blob] += b"\x00\x00"
        case "no recognition":
            return (sound,)
        case "synthesised, not recorded":
            return (recognition,)
        case "recognition of another recording":
            changed = encode(replace(found, sound=sha256(b"another")))
            return sound, replace(recognition, blob=_store(blobs, changed))
        case "recogniser gives out what was asked":
            forged = encode(replace(found, heard=found.asked))
            return sound, replace(recognition, blob=_store(blobs, forged))
        case _:
            pass
    return evidence


def _store(blobs: dict[Digest, bytes], body: bytes) -> Digest:
    blobs[sha256(body)] = body
    return sha256(body)
