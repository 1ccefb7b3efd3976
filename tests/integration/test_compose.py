"""docker-compose.yml: the commands and environments of its services, run as plain processes of this machine."""

import json
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import pytest
import yaml

from harness.projections.mission import TERMINAL_MISSION
from tests.builders.object_store import ObjectStore, object_store
from tests.builders.vehicle_sites import free_port
from tests.integration.runs import ROOT, environment
from tools.postgres import running_server

PROGRAMS = {"regen": (sys.executable, "-m", "app.cli.main"), "python": (sys.executable,)}
NAME = "localhost:8443"
LONGEST_S = 240.0
QUICK = {"REGEN_FIDELITY": "kinematic", "REGEN_SPEED": "20"}
"""What is not of the file: the machine of the tests is slow."""


@dataclass
class Service:
    """One service's process and what it has printed so far."""

    process: "subprocess.Popen[str]"
    printed: list[str] = field(default_factory=list)

    def says(self, word: str) -> str:
        """The first line with this word. Fails if the process ends before."""
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.printed.append(line)
            if word in line:
                return line
        raise AssertionError(f"ended with {self.process.wait(10)}: {self.printed}")


class Compose:
    """The file with its variables filled in."""

    def __init__(self, variables: Mapping[str, str]) -> None:
        text = (ROOT / "docker-compose.yml").read_text(encoding="utf-8")

        def filled(found: re.Match[str]) -> str:
            return variables.get(found["name"], found["default"] or "")

        whole = re.sub(r"\$\{(?P<name>\w+)(?::-(?P<default>[^}]*))?\}", filled, text)
        self.services: dict[str, Any] = yaml.safe_load(whole)["services"]

    @contextmanager
    def running(self, name: str, folder: Path, **changes: str) -> Iterator[Service]:
        """A service's command in its environment, ended with SIGTERM as compose does."""
        service = self.services[name]
        program, *rest = service["command"]
        words = [*PROGRAMS[program], *map(str, rest)]
        given = {key: str(value) for key, value in service.get("environment", {}).items()}
        with (
            (folder / f"{name}.log").open("w") as log,
            subprocess.Popen(
                words,
                cwd=folder,
                env=environment(**(given | changes)),
                stdout=subprocess.PIPE,
                stderr=log,
                text=True,
            ) as process,
        ):
            try:
                yield Service(process)
            finally:
                process.send_signal(signal.SIGTERM)
                process.wait(60)


@dataclass
class Site:
    """The console as the proxy reaches it, signed in by its one-time link."""

    client: httpx.Client

    def get(self, path: str) -> Any:
        answer = self.client.get(path)
        assert answer.status_code == 200, answer.text
        return answer.json()

    def until(self, what: Callable[["Site"], Any]) -> Any:
        """The first answer of `what` that is something."""
        until_s = time.monotonic() + LONGEST_S
        while not (found := what(self)):
            assert time.monotonic() < until_s, "it did not come"
            time.sleep(0.2)
        return found


@contextmanager
def signed_in(console: Service, port: int) -> Iterator[Site]:
    """As the TLS proxy asks: with the site's name, and with the cookie that a browser would send over TLS."""
    link = console.says("Sign in once").split("once: ")[1].strip()
    assert link.startswith(f"https://{NAME}/")
    headers = {"Host": NAME, "X-Forwarded-Proto": "https", "X-Forwarded-For": "127.0.0.1", "Origin": f"https://{NAME}"}
    with httpx.Client(base_url=f"http://127.0.0.1:{port}", headers=headers, timeout=30.0) as client:
        entered = client.get(link.removeprefix(f"https://{NAME}"))
        cookie = next(one for one in entered.headers.get_list("set-cookie") if "session" in one)
        assert "Secure" in cookie
        client.headers["Cookie"] = cookie.partition(";")[0]
        yield Site(client)


@pytest.fixture
def objects(monkeypatch: pytest.MonkeyPatch) -> Iterator[ObjectStore]:
    with object_store(monkeypatch) as service:
        yield service


@pytest.mark.long
@pytest.mark.xdist_group("postgres")
def test_console_worker_and_simulator_run_by_the_commands_of_the_file(objects: ObjectStore, tmp_path: Path) -> None:
    objects.make("evidence")
    console_port, robot_port = free_port(), free_port()
    variables = {
        "POSTGRES_PASSWORD": "unused",
        "AWS_ACCESS_KEY_ID": "testing",
        "AWS_SECRET_ACCESS_KEY": "testing",
        "OBJECTS_PORT": objects.endpoint.rpartition(":")[2],
        "CONSOLE_PORT": str(console_port),
        "ROBOT_PORT": str(robot_port),
    }
    compose = Compose(variables)
    with ExitStack() as stack:
        database = {"REGEN_DATABASE": stack.enter_context(running_server()).database()}
        console = stack.enter_context(compose.running("console", tmp_path, **database))
        worker = stack.enter_context(compose.running("worker-1", tmp_path, **database, **QUICK))
        simulator = stack.enter_context(compose.running("simulator", tmp_path))
        assert json.loads(simulator.says("token"))["port"] == robot_port
        assert httpx.get(f"http://127.0.0.1:{robot_port}/healthz").status_code == 200
        site = stack.enter_context(signed_in(console, console_port))
        worker.says("Worker drives vbot-1, vbot-2")

        def both(site: Site) -> Sequence[dict[str, Any]]:
            found: Sequence[dict[str, Any]] = site.get("/api/v1/fleet")
            return found if len(found) == 2 and all(one["charge"] is not None for one in found) else ()

        fleet = site.until(both)
        assert [(one["robot_id"], one["worker"], one["here"]) for one in fleet] == [
            ("vbot-1", "worker-1", False),
            ("vbot-2", "worker-1", False),
        ]
        page = site.client.get("/fleet?q=vbot-2").text
        assert 'id="fleet-vbot-2"' in page and 'id="fleet-vbot-1"' not in page and "worker-1" in page
        created = site.client.post("/api/v1/missions", json={"robot_id": "vbot-2", "template": "circuit"})
        assert created.status_code == 201, created.text
        mission_id = created.json()["mission_id"]

        def over(site: Site) -> dict[str, Any]:
            mission: dict[str, Any] = site.get(f"/api/v1/missions/{mission_id}")
            return mission if mission["status"] in TERMINAL_MISSION else {}

        assert site.until(over)["status"] == "succeeded"
        assert objects.keys("evidence"), "its evidence is in the bucket"
        refused = site.client.post("/api/v1/robots/vbot-2/posture", json={"posture": "lying", "reason": "why not"})
        assert refused.status_code == 409 and "worker-1" in refused.text


def test_every_service_of_ours_is_confined_and_ends_at_sigterm() -> None:
    for name, service in Compose({}).services.items():
        if service["image"] != "regenharness":
            continue
        assert service["read_only"] and service["cap_drop"] == ["ALL"], name
        assert service["command"][0] in PROGRAMS, name
