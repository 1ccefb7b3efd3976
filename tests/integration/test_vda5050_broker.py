"""A VDA 5050 vehicle over a real MQTT broker: a mission from the command line, while messages come twice, late, or not.

The broker is a NATS server, from PyPI. Between it and the vehicle stands a relay that damages what passes. The
vehicle's admission is the kit's result on the same card in virtual time.
"""

import itertools
import json
import sys
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

import msgspec
import pytest
from paho.mqtt import client as mqtt
from typer.testing import CliRunner

from app.acts.admissions import RecordCheckAct
from app.cli.api import api_without_robots
from app.cli.main import app
from app.cli.output import complain
from app.i18n.reasons.rendering import explained
from harness.bootstrap import read_harness
from harness.conformance.kit import check
from harness.conformance.provider_setup import fresh_name
from harness.contracts.errors import HarnessError
from harness.contracts.ids import MissionId
from harness.settings import HarnessSettings
from tests.builders.vehicle_sites import nats_broker, process, write_site
from tests.builders.vehicles import VirtualSite, conformance

NATS_SERVER = Path(sys.executable).parent / "nats-server"
RAW, SERVED = "raw/v2/Acme/0001", "uagv/v2/Acme/0001"
VEHICLE = (sys.executable, "docs/examples/vehicle.py")


def regen(*words: str) -> tuple[int, Any, str]:
    done = CliRunner().invoke(app, [*words, "--json"])
    if isinstance(done.exception, HarnessError):
        return complain(done.exception), None, explained(done.exception)
    return done.exit_code, json.loads(done.stdout) if done.stdout else None, done.stderr


@pytest.fixture(scope="module")
def broker(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    with nats_broker(NATS_SERVER, tmp_path_factory.mktemp("broker")) as port:
        yield port


@pytest.fixture(scope="module")
def site(broker: int, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A site whose vehicle was admitted."""
    folder = write_site(tmp_path_factory.mktemp("sites") / "shop", broker)
    tried = VirtualSite(journal=folder.parent / "journal.jsonl", speed_limit_mps=0.6)
    result = check(tried.under_test, conformance(), mission_id=fresh_name())
    act = RecordCheckAct.of(
        address=f"mqtt://127.0.0.1:{broker}/{SERVED}",
        findings=[msgspec.to_builtins(result)],
        stands_clear=True,
        reason="the kit in virtual time",
    )
    with api_without_robots(folder / "var") as api:
        api.post("/robots/agv-1/checks", act.body())
    return folder


class Relay:
    """Carries messages between the vehicle's own topics and those that the harness knows: every second one twice,
    every third one late, and every fifth one of a stream that repeats itself not at all."""

    def __init__(self, port: int) -> None:
        self.orders: list[Any] = []
        self._count = itertools.count()
        self._client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
        self._client.on_message = self._message
        self._client.connect("127.0.0.1", port)
        self._client.subscribe([(f"{RAW}/#", 1), (f"{SERVED}/order", 0), (f"{SERVED}/instantActions", 0)])
        self._client.loop_start()

    def _message(self, client: mqtt.Client, data: Any, message: mqtt.MQTTMessage) -> None:
        name = message.topic.rpartition("/")[2]
        down = name in ("order", "instantActions")
        if down == message.topic.startswith(RAW):
            return
        if name == "order":
            self.orders.append(json.loads(message.payload))
        number = next(self._count)
        if number % 5 == 0 and name in ("visualization", "state"):
            return
        target = f"{RAW if down else SERVED}/{name}"
        for delay_s in (0.3,) if number % 3 == 0 else (0.0, 0.4) if number % 2 == 0 else (0.0,):
            later = threading.Timer(
                delay_s,
                client.publish,
                (target, message.payload),
                {"qos": 0, "retain": name in ("connection", "factsheet")},
            )
            later.start()

    def close(self) -> None:
        self._client.disconnect()
        self._client.loop_stop()


@contextmanager
def vehicle(port: int, folder: Path, *options: str) -> Iterator[None]:
    with process([*VEHICLE, "--broker", f"127.0.0.1:{port}", *options], folder, ready="/Acme/0001"):
        yield


@pytest.mark.ledger(
    "R175", symbol="harness.adapters.providers.vda5050.robot:VehicleRobot.providers", entry="command line"
)
def test_a_mission_succeeds_on_evidence_while_messages_come_twice_late_and_not_at_all(
    site: Path, broker: int, tmp_path: Path
) -> None:
    with closing(Relay(broker)) as relay, vehicle(broker, tmp_path, "--interface", "raw"):
        code, outcome, said = regen("mission", "run", "go-to-place", "--site", str(site), "--speed", "0")
    assert code == 0, said
    assert (outcome["status"], outcome["goal_verdict"], outcome["robot_id"]) == ("succeeded", "satisfied", "agv-1")
    assert outcome["segments"][0]["measured_distance_m"] < 0.4
    assert len({one["orderId"] for one in relay.orders}) == 1, "one stage, one order"
    with read_harness(HarnessSettings(data_folder=site / "var", site_folder=site)) as runtime:
        mission = runtime.mission(MissionId(outcome["mission_id"]))
        assert mission.nodes["go"].provider_id == "vda5050"  # type: ignore[index]


def test_a_vehicle_that_is_switched_off_is_named_by_its_last_will(site: Path, broker: int, tmp_path: Path) -> None:
    with vehicle(broker, tmp_path):
        pass
    code, _, said = regen("mission", "run", "go-to-place", "--site", str(site), "--speed", "0")
    assert code == 1 and "Acme/0001 is not connected to its broker (CONNECTIONBROKEN)" in said


def test_a_broker_that_is_off_is_named(tmp_path: Path) -> None:
    site = write_site(tmp_path / "shop", 9)
    code, _, said = regen("mission", "run", "go-to-place", "--site", str(site), "--speed", "0")
    assert code == 1 and "The MQTT broker did not answer (ConnectionRefusedError)" in said


def test_a_vehicle_that_nobody_checked_starts_nothing(broker: int, tmp_path: Path) -> None:
    site = write_site(tmp_path / "shop", broker)
    with vehicle(broker, tmp_path):
        code, outcome, said = regen("mission", "run", "go-to-place", "--site", str(site), "--speed", "0")
    assert code == 3 and outcome["status"] == "awaiting_human"
    assert "vda5050 was never checked at this address" in said


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"address": "http://127.0.0.1:1"}, "address"),
        ({"serial_number": "a/b"}, "serial_number"),
        ({"version": "1.1"}, "version"),
        ({"password": {"environment": "A", "file": "b"}}, "name one of them"),
    ],
)
def test_an_entry_that_cannot_be_meant_is_refused_with_its_line(
    tmp_path: Path, changed: dict[str, Any], said: str
) -> None:
    site = write_site(tmp_path / "shop", 1883, **changed)
    code, answer, _ = regen("check", str(site))
    assert code == 2 and said in answer["problems"][0]["text"] and "robots.yaml" in answer["problems"][0]["where"]
