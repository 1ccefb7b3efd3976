"""Sends a recording to the console that owns a data folder, in pieces, and waits for its replay there."""

import time
from pathlib import Path
from typing import Any

import typer

from app.acts.uploads import BeginUploadAct, ReplayUploadAct
from app.cli.api_client import Api
from app.i18n.visible_text import visible_at_terminal
from harness.contracts.errors import RecordingInvalid, UnknownName
from harness.contracts.reasons import because

POLL_S = 0.3
OPEN = ("waiting", "reading", "running")
OCTETS = "application/octet-stream"


def uploaded(api: Api, file: Path) -> str:
    """The id of the file there. Raises RecordingInvalid for a folder, UnknownName for a file that cannot be read."""
    if file.is_dir():
        raise RecordingInvalid(because("upload_is_folder"), where=str(file))
    try:
        size = file.stat().st_size
        upload = api.post("/uploads", BeginUploadAct.of(name=file.name, size_bytes=size).body())
        with file.open("rb") as opened:
            while piece := opened.read(upload["piece_bytes"]):
                at = opened.tell() - len(piece)
                api.upload(f"/uploads/{upload['upload_id']}?offset={at}", piece, kind=OCTETS)
    except OSError as error:
        raise UnknownName(because("file_unreadable", error=error.strerror or ""), where=str(file)) from error
    return str(upload["upload_id"])


def replayed_there(api: Api, file: Path, act: ReplayUploadAct) -> dict[str, Any]:
    """The outcome of the mission that the recording became there. Raises RecordingInvalid where it became none."""
    upload_id = uploaded(api, file)
    job = api.post(f"/uploads/{upload_id}/replay", act.body())
    state = ""
    try:
        while job["state"] in OPEN:
            if job["state"] != state:
                state = job["state"]
                typer.echo(visible_at_terminal(f"{file.name}: {state}"), err=True)
            time.sleep(POLL_S)
            job = api.get(f"/replays/{job['replay_id']}")
    except KeyboardInterrupt:
        api.delete(f"/replays/{job['replay_id']}")
        raise
    api.delete(f"/uploads/{upload_id}")
    if not job["mission_id"]:
        raise RecordingInvalid(job["problem"] or job["state"], where=str(file))
    outcome: dict[str, Any] = api.get(f"/missions/{job['mission_id']}")
    return outcome
