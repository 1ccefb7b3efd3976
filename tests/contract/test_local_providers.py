"""The provider protocol, kept by every provider beside the harness: same assertions, all four of them."""

import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import msgspec
import numpy as np
import pytest

from harness.adapters.providers.intake import TextIntake
from harness.adapters.providers.local import LocalProvider
from harness.adapters.providers.messaging.channels import MessageChannel, SiteChannels
from harness.adapters.providers.messaging.delivery import OutboxDelivery
from harness.adapters.providers.messaging.folder import FolderOutbox
from harness.adapters.providers.models.analysis import OpenCvAnalysis
from harness.adapters.providers.speech.speaker import PacedSpeaker
from harness.adapters.providers.speech.voice import EspeakVoice
from harness.contracts.errors import FencingRefused, LogDamaged, ProviderFailed, StoreUnavailable
from harness.contracts.observations import Camera
from harness.contracts.ports import Provider
from harness.contracts.protocol import InvocationReport, StartRequest
from tests.saying import raises_saying
from tests.unit.observations.builders import EPOCH_S, Blobs, StillClock, request_to

CAMERA = Camera(
    width_px=64,
    height_px=36,
    fx_px=32.0,
    fy_px=32.0,
    cx_px=32.0,
    cy_px=18.0,
    height_m=0.5,
    forward_m=0.3,
    pitch_rad=0.0,
)


class ProviderBench:
    """One provider with its clock, blobs and journal folder, which can be built again after a crash."""

    def __init__(self, build: Callable[["ProviderBench"], LocalProvider], folder: Path) -> None:
        self.clock, self.blobs, self.folder, self._build = StillClock(), Blobs(), folder, build
        self.provider = build(self)

    def restart(self) -> LocalProvider:
        self.provider = self._build(self)
        return self.provider

    def request(self, **changes: int | float) -> StartRequest:
        return request_to(self.provider.card, parameters=PARAMETERS[self.provider.card.capability](self), **changes)  # type: ignore[arg-type]

    def ended(self, begun: InvocationReport) -> InvocationReport:
        """The terminal report; mission time goes on by half seconds until it is there."""
        for _ in range(100):
            report = self.provider.report(begun.handle)
            if report.status in {"succeeded", "failed", "cancelled"}:
                return report
            self.clock.now_s += 0.5
        raise AssertionError(report)


def intake(bench: ProviderBench) -> LocalProvider:
    return TextIntake(clock=bench.clock, blobs=bench.blobs, journal=bench.folder / "journal.jsonl")


def delivery(bench: ProviderBench) -> LocalProvider:
    outbox = FolderOutbox(bench.folder / "outbox", blobs=bench.blobs)
    channels = SiteChannels(MessageChannel(outbox, None))
    return OutboxDelivery(channels, clock=bench.clock, blobs=bench.blobs, journal=bench.folder / "journal.jsonl")


def voice(bench: ProviderBench) -> LocalProvider:
    return EspeakVoice(PacedSpeaker(), clock=bench.clock, blobs=bench.blobs, journal=bench.folder / "journal.jsonl")


def analysis(bench: ProviderBench) -> LocalProvider:
    return OpenCvAnalysis(CAMERA, clock=bench.clock, blobs=bench.blobs, journal=bench.folder / "journal.jsonl")


def frame(bench: ProviderBench) -> str:
    """A floor up to the horizon and a paler wall behind it: one even picture would be a wall that hides the floor."""
    pixels = np.full((CAMERA.height_px, CAMERA.width_px, 3), 90, np.uint8)
    pixels[: round(CAMERA.cy_px)] = 200
    done, body = cv2.imencode(".png", pixels)
    assert done
    return bench.blobs.put(body.tobytes())


PARAMETERS: dict[str, Callable[[ProviderBench], dict[str, object]]] = {
    "take_request": lambda bench: {"text": "Help me go and check the office storage area"},
    "deliver_message": lambda bench: {"text": "Nothing found.", "images": (frame(bench),)},
    "speak": lambda bench: {"text": "Done."},
    "analyse_passage": lambda bench: {
        "images": (frame(bench),),
        "yaws_rad": ((0.0, 0.0),),
        "passage": ((1.0, -0.5), (3.0, -0.5), (3.0, 0.5), (1.0, 0.5)),
        "position": (0.0, 0.0),
        "heading_rad": 0.0,
    },
}


@pytest.fixture(params=[intake, delivery, voice, analysis])
def bench(request: pytest.FixtureRequest, tmp_path: Path) -> ProviderBench:
    return ProviderBench(request.param, tmp_path)


@pytest.fixture(params=[delivery, voice])
def leased(request: pytest.FixtureRequest, tmp_path: Path) -> ProviderBench:
    """Only the providers that hold a resource."""
    return ProviderBench(request.param, tmp_path)


def test_work_is_accepted_then_ends_with_receipts_that_cite_stored_bytes(bench: ProviderBench) -> None:
    request = bench.request()
    begun = bench.provider.start(request)
    ended = bench.ended(begun)
    assert (begun.status, begun.receipts) == ("accepted", ())
    assert ended.status == "succeeded", ended.message
    assert ended.identity == request.identity
    assert ended.receipts
    for receipt in ended.receipts:
        assert (receipt.source, receipt.request_id) == (bench.provider.card.provider_id, request.identity.request_id)
        assert f"receipt:{receipt.kind}" in bench.provider.card.evidence
        assert receipt.blob is not None
        assert bench.blobs.has(receipt.blob)
        assert EPOCH_S <= receipt.at_s <= bench.clock.now_s


def test_a_repeat_of_a_request_returns_the_same_invocation_whatever_its_state_version(bench: ProviderBench) -> None:
    request = bench.request()
    ended = bench.ended(bench.provider.start(request))
    stored = set(bench.blobs.bodies)
    again = bench.provider.start(msgspec.structs.replace(request, k_ctx=request.k_ctx + 3))
    assert again == ended
    assert bench.provider.find(request.identity.request_id) == ended
    assert set(bench.blobs.bodies) == stored


def test_the_same_request_id_with_other_parameters_is_refused(bench: ProviderBench) -> None:
    request = bench.request()
    ended = bench.ended(bench.provider.start(request))
    name = next(name for name, value in request.parameters.items() if isinstance(value, str | tuple))
    other = "another text" if isinstance(request.parameters[name], str) else ("f" * 64,)
    changed = msgspec.structs.replace(request, parameters={**request.parameters, name: other})
    with raises_saying(ProviderFailed, match="other contents"):
        bench.provider.start(changed)
    assert bench.provider.find(request.identity.request_id) == ended


def test_a_restart_remembers_what_ended_and_does_nothing_twice(bench: ProviderBench) -> None:
    request = bench.request()
    ended = bench.ended(bench.provider.start(request))
    bench.blobs.bodies.clear()
    restarted = bench.restart()
    assert restarted.find(request.identity.request_id) == ended
    assert restarted.start(request) == ended
    assert restarted.report(ended.handle) == ended
    assert bench.blobs.bodies == {}


def test_a_stop_before_the_work_is_acknowledged_and_final(bench: ProviderBench) -> None:
    begun = bench.provider.start(bench.request())
    stopped = bench.provider.stop(begun.handle)
    assert (stopped.status, stopped.receipts) == ("cancelled", ())
    assert bench.provider.report(begun.handle) == stopped
    assert bench.provider.stop(begun.handle) == stopped


def test_a_stop_after_the_end_changes_nothing(bench: ProviderBench) -> None:
    ended = bench.ended(bench.provider.start(bench.request()))
    assert bench.provider.stop(ended.handle) == ended


def test_work_not_done_by_the_deadline_fails_with_timeout(bench: ProviderBench) -> None:
    begun = bench.provider.start(bench.request(deadline_s=5.0))
    bench.clock.now_s += 5.1
    ended = bench.provider.report(begun.handle)
    assert (ended.status, ended.failure, ended.receipts) == ("failed", "timeout", ())


def test_an_older_fencing_token_is_refused_even_after_a_restart(leased: ProviderBench) -> None:
    leased.ended(leased.provider.start(leased.request(token=7)))
    restarted = leased.restart()
    with raises_saying(FencingRefused, match="older than 7"):
        restarted.start(leased.request(attempt=1, token=6))
    assert restarted.start(leased.request(attempt=1, token=7)).status == "accepted"


def test_a_request_without_the_token_of_a_leased_resource_is_refused(leased: ProviderBench) -> None:
    with raises_saying(ProviderFailed, match="fencing token"):
        leased.provider.start(msgspec.structs.replace(leased.request(), fencing={}))


def test_a_request_for_another_provider_or_capability_is_refused(bench: ProviderBench) -> None:
    request = bench.request()
    elsewhere = msgspec.structs.replace(request.identity, provider_id="route-follower")
    for wrong in (
        msgspec.structs.replace(request, identity=elsewhere),
        msgspec.structs.replace(request, capability="navigate"),
    ):
        with pytest.raises(ProviderFailed):
            bench.provider.start(wrong)
    assert bench.provider.find(request.identity.request_id) is None


def test_parameters_that_do_not_fit_the_card_are_refused_by_name(bench: ProviderBench) -> None:
    request = bench.request()
    for name in (parameter.name for parameter in bench.provider.card.parameters if parameter.required):
        missing = {key: value for key, value in request.parameters.items() if key != name}
        for parameters in (missing, {**request.parameters, name: True}, {**request.parameters, "speed": 1.0}):
            with raises_saying(ProviderFailed, match=name if "speed" not in parameters else "speed"):
                bench.provider.start(msgspec.structs.replace(request, parameters=parameters))
    assert bench.provider.find(request.identity.request_id) is None


def test_an_unknown_handle_is_refused(bench: ProviderBench) -> None:
    for ask in (bench.provider.report, bench.provider.stop, bench.provider.keepalive, bench.provider.resume):
        with pytest.raises(ProviderFailed):
            ask("no-such-handle")


def test_the_card_has_every_field_and_moves_nothing(bench: ProviderBench) -> None:
    card = bench.provider.card
    provider: Provider = bench.provider
    assert provider.card is card
    assert not card.moves
    assert card.risk == "low"
    assert card.evidence
    assert "timeout" in card.failure_words
    assert msgspec.json.decode(msgspec.json.encode(card), type=type(card)) == card


def test_a_torn_last_journal_line_is_forgotten_and_a_damaged_one_is_named(bench: ProviderBench) -> None:
    request = bench.request()
    ended = bench.ended(bench.provider.start(request))
    (journal,) = bench.folder.glob("*.jsonl")
    whole = journal.read_bytes()
    journal.write_bytes(whole + b'{"report":{"handle":"torn')
    assert bench.restart().find(request.identity.request_id) == ended
    assert journal.read_bytes() == whole
    journal.write_bytes(b"garbage\n" + whole)
    with raises_saying(LogDamaged, match=":1"):
        bench.restart()


def test_a_journal_that_cannot_be_written_says_where(tmp_path: Path) -> None:
    (tmp_path / "journal").write_text("a file stands where the folder should be")
    with raises_saying(StoreUnavailable, match=r"journal\.jsonl"):
        TextIntake(clock=StillClock(), blobs=Blobs(), journal=tmp_path / "journal" / "journal.jsonl")


KILLED = """
import os, signal, sys
from pathlib import Path
from harness.adapters.providers.messaging.channels import MessageChannel, SiteChannels
from harness.adapters.providers.messaging.delivery import CARD, OutboxDelivery
from harness.adapters.providers.messaging.folder import FolderOutbox
from tests.unit.observations.builders import Blobs, StillClock, request_to

class DyingOutbox(FolderOutbox):
    def send(self, key, text, images):
        super().send(key, text, images)
        os.kill(os.getpid(), signal.SIGKILL)

folder, blobs = Path(sys.argv[1]), Blobs()
image = blobs.put(b"image")
outbox = DyingOutbox(folder / "outbox", blobs=blobs)
channels = SiteChannels(MessageChannel(outbox, None))
provider = OutboxDelivery(channels, clock=StillClock(), blobs=blobs, journal=folder / "journal.jsonl")
provider.report(provider.start(request_to(CARD, parameters={"text": "t", "images": (image,)})).handle)
"""


def test_a_kill_between_delivery_and_receipt_leads_to_one_message_and_its_receipts(tmp_path: Path) -> None:
    killed = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path)], cwd=Path.cwd(), timeout=200, check=False)
    assert killed.returncode == -signal.SIGKILL
    (message,) = (tmp_path / "outbox").iterdir()
    written = {path.name: (path.stat().st_mtime_ns, path.stat().st_ino) for path in message.iterdir()}

    bench = ProviderBench(delivery, tmp_path)
    request = request_to(bench.provider.card, parameters={"text": "t", "images": (bench.blobs.put(b"image"),)})
    found = bench.provider.find(request.identity.request_id)
    assert found is not None
    assert found.status == "accepted"
    ended = bench.ended(bench.provider.start(request))

    assert ended.status == "succeeded"
    assert len(ended.receipts) == 2
    assert os.listdir(tmp_path / "outbox") == [message.name]
    assert {path.name: (path.stat().st_mtime_ns, path.stat().st_ino) for path in message.iterdir()} == written
