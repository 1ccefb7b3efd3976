"""regen site: what was changed in the console, written back to the site's folder."""

from difflib import unified_diff
from pathlib import Path
from typing import Annotated

import typer

from app.cli import output
from harness.baseline.load import workspace_in
from harness.bootstrap import read_harness
from harness.contracts.errors import HarnessError
from harness.workspace.reading import SITE
from harness.workspace.site_export import exported

app = typer.Typer(no_args_is_help=True, help="The site's own folder.")


@app.callback()
def site() -> None:
    """Commands on a site's folder."""


@app.command("export")
def export(
    folder: Annotated[Path, typer.Argument(help="The site's folder.")],
    write: Annotated[
        bool, typer.Option("--write", help="Write the file; without it the changes are only shown.")
    ] = False,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Show, and with --write make, the changes of places from the console in site.yaml. Comments stay.

    Nothing is written where the folder would not pass `regen check` then, such as for a route whose end was moved away.
    Exit 1: there are changes that were not written.
    """
    workspace = workspace_in(folder)
    with read_harness(output.settings(data_folder=output.data_of(data, folder), site_folder=folder)) as runtime:
        now = runtime.site
    file = folder / SITE
    before = file.read_text(encoding="utf-8")
    after = exported(before, before=workspace.site, now=now)
    changes = list(unified_diff(before.splitlines(), after.splitlines(), str(file), f"{file} (now)", lineterm=""))
    if write and changes:
        _replace(file, after)
    lines = [*changes, *([f"wrote {file}"] if write and changes else [])] or ["Nothing was changed in the console."]
    output.show({"changes": changes, "written": bool(write and changes)}, as_json=as_json, lines=lines)
    raise typer.Exit(1 if changes and not write else 0)


def _replace(file: Path, text: str) -> None:
    """Write the file; where the folder cannot be read with it, put back what stood there and raise the problem."""
    before = file.read_bytes()
    file.write_text(text, encoding="utf-8")
    try:
        workspace_in(file.parent)
    except HarnessError:
        file.write_bytes(before)
        raise
