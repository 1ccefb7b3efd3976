"""regen blob: erase photographs and voice, and list what was erased."""

from typing import Annotated, Any

import msgspec
import typer

from app.acts.erasures import EraseBlobAct
from app.cli import output
from app.cli.api import api_without_robots
from app.i18n.reasons.rendering import stating
from harness.bootstrap import read_harness
from harness.contracts.erasure_events import ERASURES, BlobErased
from harness.contracts.ids import Digest

app = typer.Typer(no_args_is_help=True, help="Erase photographs and voice; list what was erased, by whom and why.")


@app.command()
def erase(
    digest: Annotated[str, typer.Argument(help="SHA-256 of the photograph or voice, as the evidence page shows it.")],
    reason: output.Why,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Erase a photograph or a voice for good. Its tombstone stays in the log; what was decided on it stays too.

    Refused for other evidence, and while a mission that is not over builds on it.
    """
    act = EraseBlobAct.of(reason=reason)
    with api_without_robots(data) as api:
        found = msgspec.convert(api.post(f"/evidence/{digest}/erase", act.body()), BlobErased)
    output.show(stating(found), as_json=as_json, lines=[f"The {found.medium} {digest} is erased: {reason}"])


@app.command("list")
def list_erased(data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False) -> None:
    """Every erased blob, oldest first."""
    with read_harness(output.settings(data_folder=data)) as runtime:
        erased = [runtime.erasure(Digest(one.removeprefix(ERASURES))) for one in runtime.streams(ERASURES)]
    rows: list[dict[str, Any]] = [stating(one) for one in erased if one is not None]
    lines = output.table(
        [["blob", "medium", "by", "reason"]]
        + [[row["digest"], row["medium"], row["actor"]["name"], row["reason"]] for row in rows]
    )
    output.show({"erased": rows}, as_json=as_json, lines=lines if rows else ["Nothing was erased."])
