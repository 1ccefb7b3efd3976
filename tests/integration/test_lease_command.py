"""`regen lease`: what is in quarantine is listed with its reason, and freed by a named person at measured rest."""

from pathlib import Path

import pytest

from app.cli.person import host_user
from harness.bootstrap import Harness, open_harness
from harness.contracts.commands import AcquireLease, QuarantineLease
from harness.contracts.decisions import Accepted
from harness.contracts.ids import InvocationId, ResourceId, lease_stream
from harness.contracts.lease_events import LeaseEvent, LeaseFreed
from harness.gate.commit import CommandEnvelope
from harness.gate.leases import DECIDER
from harness.settings import HarnessSettings
from tests.builders.consoles import console_stand
from tests.builders.missions_run import begin
from tests.integration.runs import answer, regen

BASE = lease_stream(ResourceId("vbot-1/mobile_base"))


@pytest.fixture
def settings(tmp_path: Path) -> HarnessSettings:
    """A data folder whose base was left in quarantine by an execution that nobody can account for."""
    chosen = HarnessSettings(data_folder=tmp_path, speed=0, fidelity="kinematic")
    with open_harness(chosen) as harness:
        quarantine(harness)
    return chosen


def quarantine(harness: Harness) -> None:
    """Leave the base with an execution that nobody can account for."""
    lost = InvocationId("inv_lost")
    mission_id = begin(harness, "circuit")
    acquire = AcquireLease(
        resource=ResourceId("vbot-1/mobile_base"), mission_id=mission_id, invocation_id=lost, token=1, expires_s=9e9
    )
    for command in (acquire, QuarantineLease(invocation_id=lost, reason="the line was cut")):
        assert isinstance(harness.runtime.commit([CommandEnvelope(BASE, command, None)]), Accepted)


def events(settings: HarnessSettings) -> list[LeaseEvent]:
    with open_harness(settings) as harness:
        return [DECIDER.codec.decode(event) for event in harness.runtime.log(0, 100) if event.stream == BASE]


@pytest.mark.ledger("R84", "R86", symbol="app.cli.leases:free")
def test_a_quarantined_base_is_listed_and_freed_by_name_on_measured_rest(settings: HarnessSettings) -> None:
    data = ("--data", settings.data_folder)
    (listed,) = answer(regen("lease", "list", *data, "--json"))["leases"]
    assert (listed["resource"], listed["status"], listed["token"]) == ("vbot-1/mobile_base", "quarantined", 1)
    assert listed["reason"] == "the line was cut"
    freed = regen(
        "lease", "free", "vbot-1/mobile_base", "--reason", "beside it", *data,
        REGEN_FIDELITY="kinematic", LOGNAME="ada",
    )  # fmt: skip
    assert freed.returncode == 0, freed.stderr
    assert "vbot-1/mobile_base is free: beside it" in freed.stdout
    last = events(settings)[-1]
    assert isinstance(last, LeaseFreed)
    assert (last.actor.name, last.actor.role) == (f"host:{host_user()}", "host"), "whatever the environment says"
    assert 0.0 <= last.static["displacement_m"] < 0.02
    again = regen(
        "lease", "free", "vbot-1/mobile_base", "--reason", "again", *data, "--json", REGEN_FIDELITY="kinematic"
    )
    assert again.returncode == 2
    assert "not quarantined" in again.stderr
    told = answer(again)["refused"]
    assert (told["rule"], told["reason"]["code"]) == ("not_quarantined", "not_quarantined"), "what the API answers too"


def test_the_console_that_owns_the_folder_frees_it_in_the_name_of_who_asks() -> None:
    with console_stand() as stand:
        quarantine(stand.harness)
        client, path = stand.owner(), "/api/v1/leases/vbot-1/mobile_base/free"
        assert client.post(path, json={"reason": ""}).status_code == 422
        assert client.post("/api/v1/leases/arm/free", json={"reason": "beside it"}).status_code == 404
        (listed,) = [one for one in client.get("/api/v1/leases").json() if one["status"] == "quarantined"]
        assert listed["resource"] == "vbot-1/mobile_base"
        freed = client.post(path, json={"reason": "beside it"})
        assert (freed.status_code, freed.json()["status"]) == (200, "free")
        last = DECIDER.codec.decode(stand.harness.runtime.stream(BASE)[-1])
        assert isinstance(last, LeaseFreed) and last.actor.name == "operator"
        again = client.post(path, json={"reason": "again"})
        assert (again.status_code, again.json()["rule"]) == (409, "not_quarantined")


def test_an_unknown_resource_and_a_folder_with_an_owner_are_refused(settings: HarnessSettings) -> None:
    data = ("--data", settings.data_folder)
    with open_harness(settings):
        owned = regen("lease", "free", "vbot-1/mobile_base", "--reason", "now", *data)
    assert owned.returncode == 1
    assert "owns this data folder" in owned.stderr
    unknown = regen("lease", "free", "arm", "--reason", "now", *data, REGEN_FIDELITY="kinematic")
    assert unknown.returncode == 2
    assert "arm was never leased" in unknown.stderr
