"""regen backup and regen restore: a data folder copied and checked, with its keys apart."""

from pathlib import Path
from typing import Annotated

import typer

from app.cli import output
from harness.backups import BackupManifest, back_up
from harness.backups import restore as restored


def backup(
    to: Annotated[Path, typer.Option("--to", help="A new folder for the backup.")],
    keys: Annotated[
        Path | None,
        typer.Option("--keys", help="A new folder for the keys, kept apart; else none are copied."),
    ] = None,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Copy log, blobs and accounts, also while a console runs, and verify the copy."""
    manifest = back_up(data, to, keys=keys)
    _show(manifest, to, as_json=as_json, report="backed up to")


def restore(
    source: Annotated[Path, typer.Option("--from", help="A folder that `regen backup` made.")],
    keys: Annotated[Path | None, typer.Option("--keys", help="The folder its keys were copied to.")] = None,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Make a new data folder from a backup: every file is compared with its digest, and the log verified."""
    manifest = restored(source, data, keys=keys)
    _show(manifest, data, as_json=as_json, report="restored to")


def _show(manifest: BackupManifest, folder: Path, *, as_json: bool, report: str) -> None:
    found = {
        "folder": str(folder),
        "position": manifest.head.position,
        "digest": manifest.head.digest,
        "blobs": manifest.blobs,
        "files": len(manifest.files),
    }
    line = f"{manifest.head.position} events, {manifest.blobs} blobs {report} {folder}; head {manifest.head.digest}."
    output.show(found, as_json=as_json, lines=[line])
