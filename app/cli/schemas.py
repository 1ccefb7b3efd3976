"""regen schemas: writes the published JSON Schemas of evidence packets, verdicts, contracts and dossiers."""

from pathlib import Path
from typing import Annotated

import typer

from app.cli import output
from harness.contracts.published_schemas import schema_files


def schemas(
    folder: Annotated[Path, typer.Argument(help="Where to write them.")] = Path("docs/schemas"),
    as_json: output.Json = False,
) -> None:
    """Write one file for each published value, named with its version."""
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / name for name in schema_files()]
    for file, body in zip(files, schema_files().values(), strict=True):
        file.write_bytes(body)
    output.show({"files": [str(one) for one in files]}, as_json=as_json, lines=[f"wrote {one}" for one in files])
