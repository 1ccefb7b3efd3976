"""Cases of heard: reports that were spoken into the simulated room, recorded and recognised; truth is what was spoken.

Synthesis, room, microphone and recogniser are the shipped ones, so that a recording costs a second; the recordings are
made once, and judged beside drawn findings and places.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from random import Random

import numpy as np
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
from harness.adapters.providers.speech.espeak import synthesise
from harness.adapters.providers.speech.microphone import RoomMicrophone
from harness.adapters.providers.speech.voice import CARD as VOICE
from harness.adapters.providers.speech.voice import wav
from harness.baseline.load import site
from harness.contracts.effects import Symbolic
from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import Digest, NodeId, RequestId, sha256
from harness.contracts.measurements import Measurement, Recognition, Sound
from harness.contracts.protocol import Receipt
from harness.contracts.values import decode, encode
from simulator.room import SimulatedRoom

BEGAN_S = 1_790_000_000.0
NAMES = tuple(place.name for place in site().places)
BESIDE_S = 0.4
WHOLE = 0.97
TOLD_AT = 0.62
"""By this share of a report its place and its finding were said; what follows is how many images were sent."""


@dataclass(frozen=True)
class SpokenReport:
    """One recording: what the harness asked to be said, and what truly was: which place, whether blocked, how much."""

    asked: str
    place: str
    blocked: bool | None
    share: float
    said_as_asked: bool
    kind: str
    evidence: tuple[EvidenceReference, ...]
    blobs: dict[Digest, bytes]
    wav: Digest
    until_s: float


def recordings(seed: int, *, kinds: Sequence[str]) -> tuple[SpokenReport, ...]:
    """One report of each kind, of which some are not said as they were asked, or not heard as they were said."""
    chance = Random(seed)
    return tuple(_recorded(chance, kind) for kind in kinds)


def reports(chance: Random, count: int, pool: Sequence[SpokenReport]) -> Iterator[VerifierCase]:
    """heard, at its stage and of the goal."""
    for _ in range(count):
        one = chance.choice(pool)
        name = one.kind if chance.random() < 0.6 else chance.choice(FAULTS)
        yield _case(name, one, chance, of_goal=chance.random() < 0.3)


KINDS = (
    "none", "none", "none", "none", "says the contrary", "says another place", "says something else", "stopped early",
    "loudspeaker unplugged", "noise in the room", "another voice over it", "another place and the contrary",
)  # fmt: skip
FEW = ("none", "says the contrary", "says another place", "stopped early")
"""A recording of each costs a second: enough for a slice."""
FAULTS = (
    "heard before the analysis", "recording lost", "recording altered", "no recognition", "synthesised, not recorded",
    "recognition of another recording", "packet of another request", FORGED := "recogniser gives out what was asked",
)  # fmt: skip


def _recorded(chance: Random, kind: str) -> SpokenReport:
    place, other = chance.sample(NAMES, 2)
    finding, blocked = _finding(chance)
    request = _text(place, finding, other)
    spoken, true_place, true_blocked = request, place, blocked
    contrary, opposite = _finding(chance, not blocked)
    match kind:
        case "says the contrary":
            spoken, true_blocked = _text(place, contrary, other), opposite
        case "says another place":
            spoken, true_place = _text(other, finding, place), other
        case "another place and the contrary":
            spoken, true_place, true_blocked = _text(other, contrary, place), other, opposite
        case "says something else":
            spoken = chance.choice(("Bring me a coffee, please.", "Everything is fine.", "I am going home now."))
        case _:
            pass
    recording = recorded(chance, kind, request, spoken, over=_text(other, contrary, place))
    silent = kind in ("says something else", "loudspeaker unplugged")
    return SpokenReport(
        asked=request,
        place="" if silent else true_place,
        blocked=None if silent else true_blocked,
        share=recording.share,
        said_as_asked=spoken == request,
        kind=kind,
        evidence=recording.evidence,
        blobs=recording.blobs,
        wav=recording.wav,
        until_s=recording.until_s,
    )


@dataclass(frozen=True)
class RoomRecording:
    """What the microphone made of one playback, of which `share` was played; `wav` is what was synthesised."""

    share: float
    evidence: tuple[EvidenceReference, ...]
    blobs: dict[Digest, bytes]
    wav: Digest
    until_s: float


def recorded(chance: Random, kind: str, request: str, spoken: str, *, over: str) -> RoomRecording:
    """Play `spoken` into the simulated room where `request` was to be said, and have it recorded and recognised.

    Some kinds are cut off, not played, drowned in noise, or in the voice of somebody who says `over`.
    """
    samples, rate_hz = synthesise(spoken)
    share = chance.uniform(0.1, 0.9) if kind == "stopped early" else 0.0 if kind == "loudspeaker unplugged" else 1.0
    pcm = samples[: int(share * len(samples))].astype("<i2").tobytes()
    room = SimulatedRoom()
    room.play(Sound(at_s=BEGAN_S + BESIDE_S, rate_hz=rate_hz, pcm=pcm))
    if kind == "noise in the room":
        hum = np.random.default_rng(chance.randrange(2**32)).normal(0, chance.choice((300, 1500, 6000)), 16_000 * 25)
        room.play(Sound(at_s=BEGAN_S, rate_hz=16_000, pcm=hum.clip(-32000, 32000).astype("<i2").tobytes()))
    if kind == "another voice over it":
        voice, voice_hz = synthesise(over)
        room.play(Sound(at_s=BEGAN_S + chance.uniform(0.0, 3.0), rate_hz=voice_hz, pcm=voice.astype("<i2").tobytes()))
    blobs: dict[Digest, bytes] = {}

    def keep(body: bytes) -> Digest:
        blobs[sha256(body)] = body
        return sha256(body)

    until_s = BEGAN_S + BESIDE_S + len(samples) / rate_hz + BESIDE_S
    asking = Measurement(
        requests=(identity_of(VOICE).request_id,), text=request, from_s=BEGAN_S, until_s=until_s, names=NAMES
    )
    evidence = RoomMicrophone(room, keep=keep, read=blobs.__getitem__).measure(asking)
    return RoomRecording(share, evidence, blobs, keep(wav(samples, rate_hz=rate_hz)), until_s)


def _finding(chance: Random, blocked: bool | None = None) -> tuple[str, bool]:
    blocked = chance.random() < 0.5 if blocked is None else blocked
    if not blocked:
        return "The passage is clear: nothing stands on its floor.", False
    share = chance.randint(8, 95)
    things = chance.choice(("one thing stands", "2 things stand"))
    more = "" if things.startswith("one") else f" and {chance.randint(5, 60)}%"
    return f"The passage is obstructed: {things} on its floor, taking {share}%{more} of its width.", True


def _text(place: str, finding: str, home: str) -> str:
    return f"Inspection report, {place}. {finding} 4 images and this finding were sent. I am back at {home}."


def _case(name: str, one: SpokenReport, chance: Random, *, of_goal: bool) -> VerifierCase:
    place = one.place if one.place and chance.random() < 0.75 else chance.choice(NAMES)
    answer = one.blocked if one.blocked is not None else True
    blocked = answer if chance.random() < 0.75 else not answer
    truth = _true_state(one, place, blocked)
    from_s, blobs, evidence = BEGAN_S, dict(one.blobs), one.evidence
    early = name == "heard before the analysis"
    analysis = fact(
        "passage_checked", "analysis", {}, measured={"blocked": float(blocked)}, at_s=BEGAN_S + (5.0 if early else -5.0)
    )
    match name:
        case "recording lost":
            blobs.pop(evidence[0].blob)
        case "recording altered":
            blobs[evidence[0].blob] += b"\x00\x00"
        case "no recognition":
            evidence = evidence[:1]
        case "synthesised, not recorded":
            evidence = evidence[1:]
        case "recognition of another recording":
            recognition = replace(decode(blobs[evidence[1].blob], Recognition), sound=sha256(b"another"))
            evidence = (evidence[0], replace(evidence[1], blob=_store(blobs, encode(recognition))))
        case "recogniser gives out what was asked":
            found = decode(blobs[evidence[1].blob], Recognition)
            evidence = (
                evidence[0],
                replace(evidence[1], blob=_store(blobs, encode(replace(found, heard=found.asked)))),
            )
        case _:
            pass
    truth = False if early or name == "packet of another request" else truth
    arguments = {"analysis": "analysis", "place": place}
    receipt = Receipt(
        receipt_id="playback-1",
        kind="playback",
        at_s=one.until_s,
        source="espeak-voice",
        request_id=identity_of(VOICE, NodeId("report")).request_id,
        blob=one.wav,
    )
    stated = Symbolic(predicate="heard", arguments=arguments)
    node = stage(stated, node_id=NodeId("report"), mandatory=("receipts",))
    packet = packet_of(node, VOICE, from_s=from_s, until_s=one.until_s, after=evidence, receipts=(receipt,))
    epistemic = name == FORGED
    if of_goal and len(evidence) == 2 and name != "packet of another request":
        effect = replace(stated, arguments=arguments | {"report": "report"})
        accepted = fact(
            "heard", "report", {"sound": evidence[0].blob, "recognition": evidence[1].blob}, at_s=one.until_s - BESIDE_S
        )
        if early:
            analysis = replace(analysis, at_s=one.until_s + 5.0)
        nodes = (stage(effect, node_id=NodeId("analysis")), node)
        inputs = shown_goal(
            (effect,), nodes, {node.node_id: (packet, K + 1)}, blobs, at_s=one.until_s + 9.0, facts=(analysis, accepted)
        )
        return VerifierCase("heard", name, truth, inputs, condition_id_of(effect, "goal"), epistemic=epistemic)
    if name == "packet of another request":
        packet = replace(packet, identity=replace(packet.identity, request_id=RequestId("another")))
    inputs = shown_packet(node, packet, VOICE, blobs, facts=(analysis,))
    return VerifierCase("heard", name, truth, inputs, condition_id_of(stated, "report"), epistemic=epistemic)


def _true_state(one: SpokenReport, place: str, blocked: bool) -> bool | None:
    """Whether what was truly spoken names this place and tells this finding. None where it was drowned, or cut off
    only after the finding.
    """
    if one.place != place or one.blocked is not blocked or one.share < TOLD_AT:
        return False
    drowned = one.kind in ("noise in the room", "another voice over it")
    return None if drowned or one.share < WHOLE else True


def _store(blobs: dict[Digest, bytes], body: bytes) -> Digest:
    blobs[sha256(body)] = body
    return sha256(body)
