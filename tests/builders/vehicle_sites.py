"""A site's own folder with one VDA 5050 vehicle, brokers as processes of their own, and the command line against
them."""

import socket
import subprocess
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import yaml

from harness.workspace.new_folder import write_folder

ROOT = Path(__file__).resolve().parents[2]
NATS = """\
server_name: broker
listen: 127.0.0.1:{inner}
jetstream {{ store_dir: "{folder}/jetstream" }}
mqtt {{ listen: 127.0.0.1:{port} }}
"""
MOSQUITTO = """\
listener {port} 127.0.0.1
allow_anonymous true
persistence false
"""


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def answers(port: int) -> bool:
    with socket.socket() as one:
        one.settimeout(0.5)
        return one.connect_ex(("127.0.0.1", port)) == 0


@contextmanager
def process(words: Sequence[str | Path], folder: Path, *, ready: str = "") -> Iterator[subprocess.Popen[bytes]]:
    """A child that is killed with the block; with `ready`, once it printed that."""
    log = folder / f"{Path(words[0]).name}-{free_port()}.log"
    with (
        log.open("wb") as output,
        subprocess.Popen([*map(str, words)], cwd=ROOT, stdout=output, stderr=output) as child,
    ):
        try:
            until_s = time.monotonic() + 20.0
            while ready not in log.read_text() and time.monotonic() < until_s:
                assert child.poll() is None, log.read_text()
                time.sleep(0.05)
            assert ready in log.read_text(), log.read_text()
            yield child
        finally:
            child.kill()
            child.wait()


@contextmanager
def nats_broker(program: Path, folder: Path) -> Iterator[int]:
    """The MQTT port of a NATS server."""
    port = free_port()
    (folder / "nats.conf").write_text(NATS.format(inner=free_port(), port=port, folder=folder))
    with process([program, "-c", folder / "nats.conf"], folder, ready="Server is ready"):
        yield port


@contextmanager
def mosquitto_broker(program: Path, folder: Path) -> Iterator[int]:
    """The port of a mosquitto."""
    port = free_port()
    (folder / "mosquitto.conf").write_text(MOSQUITTO.format(port=port))
    with process([program, "-c", folder / "mosquitto.conf"], folder):
        until_s = time.monotonic() + 10.0
        while not answers(port) and time.monotonic() < until_s:
            time.sleep(0.05)
        yield port


def write_site(folder: Path, port: int, **changed: object) -> Path:
    """The folder that `regen init` writes, with the vehicle Acme/0001 at this broker and its conformance file."""
    write_folder(folder, name="shop")
    entry = {
        "name": "agv-1", "kind": "vda5050", "address": f"mqtt://127.0.0.1:{port}", "manufacturer": "Acme",
        "serial_number": "0001", "map_id": "hall-1", "velocity": "measured", "speed_limit_mps": 0.6,
    }  # fmt: skip
    (folder / "robots.yaml").write_text(yaml.safe_dump({"robots": [entry | changed]}))
    (folder / "conformance").mkdir()
    text = (ROOT / "docs" / "examples" / "drive-vehicle.yaml").read_text()
    (folder / "conformance" / "drive-vehicle.yaml").write_text(text)
    return folder
