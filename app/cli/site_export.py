"""regen site: what was changed in the console, written back to the site's folder."""

from collections.abc import Iterator, Mapping
from difflib import unified_diff
from pathlib import Path
from typing import Annotated

import typer

from app.cli import output
from harness.baseline.load import workspace_in
from harness.bootstrap import read_harness
from harness.contracts.errors import HarnessError
from harness.workspace.reading import ROBOTS, SITE
from harness.workspace.site_export import exported, exported_missions, exported_robots

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
    """Show, and with --write make, the changes from the console in site.yaml (places, routes; comments stay),
    robots.yaml and the missions' files.

    Nothing is written where the folder would not pass `regen check` then, such as for a route whose end was moved away.
    Exit 1: there are changes that were not written.
    """
    workspace = workspace_in(folder)
    with read_harness(output.settings(data_folder=output.data_of(data, folder), site_folder=folder)) as runtime:
        now, changed_here = runtime.site, runtime.site_changes()
    file = folder / SITE
    places = exported(_text(file) or "", before=workspace.site, now=now)
    robots = {folder / ROBOTS: exported_robots(workspace, changed_here)}
    texts = {file: places, **robots, **exported_missions(workspace, changed_here)}
    changed = {one: text for one, text in texts.items() if text != _text(one)}
    changes = [line for one, text in changed.items() for line in _difference(one, text or "")]
    if write and changed:
        _replace(folder, changed)
    lines = [*changes, *(f"wrote {one}" for one in changed if write)] or ["Nothing was changed in the console."]
    output.show({"changes": changes, "written": bool(write and changed)}, as_json=as_json, lines=lines)
    raise typer.Exit(1 if changed and not write else 0)


def _text(file: Path) -> str | None:
    return file.read_text(encoding="utf-8") if file.exists() else None


def _difference(file: Path, after: str) -> Iterator[str]:
    before = (_text(file) or "").splitlines()
    return unified_diff(before, after.splitlines(), str(file), f"{file} (now)", lineterm="")


def _replace(folder: Path, texts: Mapping[Path, str | None]) -> None:
    """Write the files, and delete those without a text; where the folder cannot be read then, put back what stood there
    and raise the problem."""
    before = {file: _text(file) for file in texts}
    _write(texts)
    try:
        workspace_in(folder)
    except HarnessError:
        _write(before)
        raise


def _write(texts: Mapping[Path, str | None]) -> None:
    for file, text in texts.items():
        if text is None:
            file.unlink(missing_ok=True)
        else:
            file.parent.mkdir(exist_ok=True)
            file.write_text(text, encoding="utf-8")
