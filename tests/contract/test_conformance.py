"""The conformance kit: every installed provider passes, and a provider that breaks one promise is caught by its row."""

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace as reissued
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path
from threading import Thread

import msgspec
import pytest

from app.i18n.reasons.rendering import sentence
from harness.adapters.providers.http.process import RobotProcess, RobotSettings
from harness.conformance.address import addressed
from harness.conformance.conformance_file import ConformanceFile, read, shipped
from harness.conformance.findings import ConformanceResult
from harness.conformance.kit import check
from harness.conformance.provider_setup import fresh_name, installed, installed_cards, protocol
from harness.conformance.rows import NAMES, ROWS
from harness.conformance.subject import ProviderUnderTest, Stand
from harness.contracts.errors import ContractInvalid, ProviderFailed, ProviderUnreachable, UnknownName
from harness.contracts.ids import ProviderId
from harness.settings import ROBOT_COMMAND, HarnessSettings
from simulator.cards import OBSERVER
from simulator.in_process import SIMULATOR
from tests.fakes import broken
from tests.fakes.passing import Passing
from tests.integration.runs import ROOT, answer, regen
from tests.saying import raises_saying

CREW = (
    *("route-follower", "careful-local-planner", "panorama-camera", "observer", "text-intake", "opencv-analysis"),
    *("message-outbox", "espeak-voice", "evidence-keeper", "opencv-description", "recording-navigator"),
)
SETTINGS = HarnessSettings(speed=0, fidelity="kinematic")
Stands = dict[ProviderId, Stand]
Break = Callable[[ProviderUnderTest], ProviderUnderTest]


@pytest.fixture
def stands(tmp_path: Path) -> Iterator[Stands]:
    with installed(tmp_path, SETTINGS, SIMULATOR) as found:
        yield found


def wrapped(kind: Callable[..., Passing]) -> Break:
    return lambda subject: reissued(subject, provider=kind(subject.provider))


def only(row: str, stand: Stand, declaration: ConformanceFile) -> ConformanceResult:
    rows = [one for one in ROWS if one.name == row]
    return check(stand, declaration, mission_id=fresh_name(), rows=rows)


def failed(checked: ConformanceResult) -> dict[str, str]:
    return {finding.row: sentence(finding.text) for finding in checked.findings if finding.outcome == "not met"}


def test_the_crew_of_these_tests_is_the_installed_one(stands: Stands, tmp_path: Path) -> None:
    assert tuple(stands) == CREW
    assert tuple(card.provider_id for card in installed_cards(tmp_path / "cards", SIMULATOR)) == CREW


@pytest.mark.ledger("R190", "R23", symbol="harness.conformance.kit:check")
@pytest.mark.parametrize("name", CREW)
def test_an_installed_provider_meets_every_row_it_is_not_exempt_from(stands: Stands, name: str) -> None:
    declaration = shipped(ProviderId(name))
    checked = check(stands[ProviderId(name)], declaration, mission_id=fresh_name())
    assert failed(checked) == {}
    assert set(checked.rows("met")) == set(declaration.meets)
    assert set(checked.rows("exempt")) == set(declaration.exempt)
    assert {*declaration.meets, *declaration.exempt} == set(NAMES)


BROKEN: tuple[tuple[str, str, Break], ...] = (
    ("card_complete", "route-follower", wrapped(broken.Unversioned)),
    ("completes", "observer", wrapped(broken.Failing)),
    ("idempotent_start", "observer", wrapped(broken.Restarting)),
    ("idempotent_start", "text-intake", wrapped(broken.Restarting)),
    ("other_parameters_refused", "route-follower", wrapped(broken.Careless)),
    ("unfit_request_refused", "text-intake", wrapped(broken.Greedy)),
    ("found_by_request", "observer", wrapped(broken.Lost)),
    ("reattach", "route-follower", broken.forgotten),
    ("unknown_handle", "message-outbox", wrapped(broken.Polite)),
    ("fencing", "route-follower", wrapped(broken.Unfenced)),
    ("lease_required", "espeak-voice", wrapped(broken.Unleased)),
    ("acknowledged_stop", "route-follower", wrapped(broken.Hasty)),
    ("acknowledged_stop", "panorama-camera", wrapped(broken.Hasty)),
    ("stop_is_final", "observer", wrapped(broken.Reviving)),
    ("deadline", "careful-local-planner", wrapped(broken.Timeless)),
    ("dead_man", "route-follower", broken.tireless),
    ("dead_man", "panorama-camera", broken.tireless),
    ("resume", "route-follower", wrapped(broken.Immovable)),
    ("late_repeat", "text-intake", wrapped(broken.Forgetting)),
    ("evidence_promised", "route-follower", wrapped(broken.Unproven)),
    ("evidence_promised", "observer", broken.falsified),
    ("receipts_bound", "message-outbox", wrapped(broken.Borrowing)),
    ("receipts_bound", "text-intake", broken.falsified),
    ("proposes_facts", "text-intake", wrapped(broken.Silent)),
    ("proposes_facts", "route-follower", wrapped(broken.Elsewhere)),
    ("proposes_facts", "observer", wrapped(broken.Earlier)),
    ("failure_words", "observer", wrapped(broken.Inventive)),
    ("progress", "route-follower", wrapped(broken.Boasting)),
    ("identity_echo", "observer", wrapped(broken.Confused)),
)


def test_every_row_has_a_provider_that_breaks_it() -> None:
    assert {row for row, _, _ in BROKEN} == set(NAMES)


@pytest.mark.parametrize(("row", "name", "broke"), BROKEN, ids=[f"{row}-{name}" for row, name, _ in BROKEN])
def test_a_provider_that_breaks_a_promise_is_caught_by_its_row(
    stands: Stands, row: str, name: str, broke: Break
) -> None:
    declaration, whole = shipped(ProviderId(name)), stands[ProviderId(name)]
    assert only(row, whole, declaration).ok
    caught = only(row, lambda: broke(whole()), declaration)
    assert list(failed(caught)) == [row]
    assert "untyped" not in failed(caught)[row]


def test_a_body_that_brakes_too_late_is_seen_in_its_odometry(stands: Stands) -> None:
    caught = only(
        "dead_man",
        lambda: broken.tireless(stands[ProviderId("route-follower")]()),
        shipped(ProviderId("route-follower")),
    )
    assert "still moving" in failed(caught)["dead_man"]
    hasty = only(
        "acknowledged_stop",
        lambda: wrapped(broken.Hasty)(stands[ProviderId("route-follower")]()),
        shipped(ProviderId("route-follower")),
    )
    assert "the lease would be quarantined" in failed(hasty)["acknowledged_stop"]


def test_an_untyped_failure_of_a_provider_is_a_row_that_is_not_met(stands: Stands) -> None:
    class Crashing(Passing):
        def report(self, handle: str) -> object:  # type: ignore[override]
            raise KeyError(handle)

    whole = stands[ProviderId("observer")]
    caught = only("unknown_handle", lambda: wrapped(Crashing)(whole()), shipped(ProviderId("observer")))
    assert "untyped KeyError" in failed(caught)["unknown_handle"]


def test_no_file_exempts_a_provider_from_what_its_card_binds_it_to(stands: Stands) -> None:
    declared = shipped(ProviderId("route-follower"))
    lenient = msgspec.structs.replace(declared, meets=(), exempt={"dead_man": "we are careful"})
    caught = only("dead_man", stands[ProviderId("route-follower")], lenient)
    assert "binds it" in failed(caught)["dead_man"]


@pytest.mark.parametrize(
    ("text", "what"),
    [
        ("provider_id: x\ndone: []\nlong: []\nmeets: []\n", "no request"),
        ("provider_id: x\ndone: [{a: 1}]\nlong: [{a: 1}]\nmeets: [resume]\nexempt: {resume: no}\n", "exempt"),
        ("provider_id: x\ndone: [{a: 1}]\nlong: [{a: 1}]\nmeets: []\nblobs: {f: '***'}\n", "base64"),
        ("provider_id: x\ndone: [{a: 1}]\nlong: [{a: 1}]\nmeets: []\nfoo: 1\n", "foo"),
    ],
)
def test_a_bad_conformance_file_is_refused_by_name(tmp_path: Path, text: str, what: str) -> None:
    file = tmp_path / "x.yaml"
    file.write_text(text)
    with raises_saying(ContractInvalid, match=what):
        read(file)


def test_a_file_with_an_unknown_row_and_a_missing_file_are_refused(stands: Stands, tmp_path: Path) -> None:
    declared = msgspec.structs.replace(shipped(ProviderId("observer")), meets=("dancing",))
    with raises_saying(ContractInvalid, match="dancing"):
        only("completes", stands[ProviderId("observer")], declared)
    with raises_saying(UnknownName, match="stranger"):
        shipped(ProviderId("stranger"))
    with raises_saying(ContractInvalid, match="cannot be read"):
        read(tmp_path / "nowhere.yaml")


def test_the_command_checks_the_simulated_robot_behind_http(tmp_path: Path) -> None:
    process = RobotProcess(
        RobotSettings(command=ROBOT_COMMAND, folder=str(tmp_path / "r"), speed=0.0, fidelity="kinematic", linger_s=0.2)
    )
    try:
        token = process.attachment.token
        some = ("--provider", "route-follower", "--provider", "observer", "--allow-motion", "--stands-clear", "vbot-1")
        done = regen("provider", "check", process.attachment.base_url, *some, "--json", REGEN_ROBOT_TOKEN=token)
    finally:
        process.robot.close()
        process.kill()
    assert done.returncode == 0, done.stdout
    found = answer(done)
    assert found["ok"] is True
    assert {one["provider_id"]: one["ok"] for one in found["providers"]} == {"route-follower": True, "observer": True}
    assert "stand clear" in done.stderr


@pytest.fixture
def waiter() -> Iterator[str]:
    """The example of the provider guide, as a process of its own; its address."""
    serving = [sys.executable, "docs/examples/provider.py", "--token", "secret"]
    with subprocess.Popen(serving, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        yield process.stdout.readline().strip()
        process.kill()


class Twins(BaseHTTPRequestHandler):
    """A robot that serves one provider twice and nothing else."""

    def do_GET(self) -> None:
        card = json.loads(msgspec.json.encode(OBSERVER))
        body = json.dumps(
            [card, card] if self.path == "/providers" else {"code": "unknown_name", "what": "no"}
        ).encode()
        self.send_response(200 if self.path == "/providers" else 404)
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def do_POST(self) -> None:
        self.do_GET()

    def log_message(self, *words: object) -> None:
        """Quiet."""


@pytest.mark.ledger("R187", symbol="harness.conformance.address:addressed")
def test_a_robot_with_two_providers_of_one_name_is_refused() -> None:
    with HTTPServer(("127.0.0.1", 0), Twins) as server:
        thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        try:
            named = raises_saying(ProviderFailed, match="one name")
            with named, addressed(f"http://127.0.0.1:{server.server_port}", "x"):
                raise AssertionError("twins came in")
        finally:
            server.shutdown()
            thread.join()


@pytest.mark.ledger("R187", symbol="harness.conformance.address:addressed")
def test_a_provider_written_from_the_guide_alone_passes_at_its_address(waiter: str) -> None:
    file = ("--file", "docs/examples/wait.yaml")
    done = regen("provider", "check", waiter, "--token", "secret", *file, "--json")
    assert done.returncode == 0, done.stdout
    (found,) = answer(done)["providers"]
    assert found["provider_id"] == "waiter"
    assert sorted(row["row"] for row in found["rows"] if row["outcome"] == "met") == sorted(
        read(ROOT / "docs" / "examples" / "wait.yaml").meets
    )
    assert (found["rows"][0]["title"], found["rows"][0]["title_code"]) == (
        "The card is complete and valid",
        "kit_row_card_complete",
    )
    with raises_saying(ProviderFailed, match="token"), addressed(waiter, "guess"):
        raise AssertionError("a stranger came in")


def test_the_command_names_what_it_cannot_check() -> None:
    unknown = regen("provider", "check", "nobody")
    assert unknown.returncode == 2
    assert "route-follower" in unknown.stderr
    with raises_saying(ProviderUnreachable, match="did not answer"), addressed("http://127.0.0.1:9", "x"):
        raise AssertionError("nobody answered")


def test_the_list_shows_every_provider_with_its_exemptions() -> None:
    found = answer(regen("provider", "list", "--json"))["providers"]
    assert tuple(one["provider_id"] for one in found) == CREW
    assert all(reason for one in found for reason in one["exempt"].values())


def test_the_published_openapi_document_is_the_one_that_is_served() -> None:
    assert json.loads((ROOT / "docs" / "provider-openapi.json").read_text()) == json.loads(
        json.dumps(protocol(SIMULATOR))
    )
