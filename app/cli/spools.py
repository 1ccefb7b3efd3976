"""regen spool: evidence of a robot on a bad link, kept beside it and uploaded, and received near the harness."""

import signal
import threading
from pathlib import Path
from threading import Event
from types import FrameType
from typing import Annotated

import typer
import uvicorn

from harness.adapters.providers.http.robot import HttpRobot
from harness.adapters.secret_values import secret
from harness.provider_protocol.evidence_receiver import EvidenceReceiver, receiver_operations
from harness.provider_protocol.forwarding import EvidenceForwarder
from harness.provider_protocol.service import provider_service
from harness.provider_protocol.spool import EvidenceSpool, SpoolBatch, SpoolHead

app = typer.Typer(no_args_is_help=True, help="Evidence of a robot on a bad link: late, never lost.")
ROBOT_TOKEN, UPLOAD_TOKEN = "ROBOT_TOKEN", "SPOOL_TOKEN"
Robot = Annotated[str, typer.Option(help="The name that the robot gives itself.")]
Folder = Annotated[Path, typer.Option(help="Where the chain is kept; nobody else writes there.")]


@app.command()
def forward(
    robot: Robot,
    folder: Folder,
    source: Annotated[str, typer.Option("--from", help="The robot's own address, beside this process.")],
    target: Annotated[str, typer.Option("--to", help="The receiver's address: https://HOST:PORT.")],
    every_s: Annotated[float, typer.Option("--every", min=0.05, help="Seconds between two readings.")] = 0.5,
) -> None:
    """Beside a robot, until SIGTERM: read its evidence, keep it, upload it. Tokens are in ROBOT_TOKEN and SPOOL_TOKEN.

    It only reads. What the robot does while the link is down was authorised before, and its own watchdog ends it.
    """
    reading = HttpRobot(source, _token(ROBOT_TOKEN))
    uploading = HttpRobot(target, _token(UPLOAD_TOKEN))

    def upload(batch: SpoolBatch) -> SpoolHead:
        return uploading.write("/spool", SpoolHead, batch)

    forwarder = EvidenceForwarder(reading, EvidenceSpool(folder), upload, robot_id=robot)
    ended = Event()

    def end(number: int, frame: FrameType | None) -> None:
        ended.set()

    signal.signal(signal.SIGTERM, end)
    signal.signal(signal.SIGINT, end)
    typer.echo(f"Forwarding the evidence of {robot}")
    while not ended.wait(every_s):
        forwarder.step()
    reading.close()
    uploading.close()


@app.command()
def receive(
    robot: Robot,
    folder: Folder,
    port: Annotated[int, typer.Option(min=0, max=65535)] = 8701,
    host: Annotated[str, typer.Option(help="Another address than loopback's wants a certificate, or a TLS proxy.")] = (
        "127.0.0.1"
    ),
    certificate: Annotated[Path | None, typer.Option(help="TLS certificate, PEM.")] = None,
    key: Annotated[Path | None, typer.Option(help="Its key, PEM.")] = None,
) -> None:
    """Near the harness, until SIGTERM: take uploads and serve them as `evidence` of robots.yaml. Token: SPOOL_TOKEN."""
    receiver = EvidenceReceiver(folder, robot_id=robot)
    turn = threading.Lock()
    service = provider_service(
        receiver_operations(receiver), token=_token(UPLOAD_TOKEN), turn=lambda: turn, title="Spooled evidence"
    )
    config = uvicorn.Config(
        service,
        host=host,
        port=port,
        log_level="warning",
        access_log=False,
        ssl_certfile=certificate,
        ssl_keyfile=key,
        timeout_graceful_shutdown=2,
    )
    typer.echo(f"Receiving the evidence of {robot} at {'https' if certificate else 'http'}://{host}:{port}")
    uvicorn.Server(config).run()


def _token(variable: str) -> str:
    return secret(variable=variable, file="", folder=Path())
