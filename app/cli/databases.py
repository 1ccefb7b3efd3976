"""regen data: move the event log between an SQLite file and a PostgreSQL database."""

from typing import Annotated

import typer

from app.cli.output import Json, show
from harness.bootstrap import move_log

app = typer.Typer(no_args_is_help=True, help="Where the event log lies.")

Address = "sqlite:///FILE or postgresql://USER:PASSWORD@HOST/DATABASE"


@app.command()
def move(
    source: Annotated[str, typer.Option("--from", help=f"The log as it is: {Address}.")],
    target: Annotated[str, typer.Option("--to", help=f"An empty one: {Address}.")],
    as_json: Json = False,
) -> None:
    """Copy every event and record, verify both ends, and leave the old log as it was. Blobs stay where they are."""
    head = move_log(source, target)
    show(
        {"moved": head.position, "digest": head.digest},
        as_json=as_json,
        lines=[
            f"{head.position} events moved and verified, head {head.digest}.",
            "From now on set REGEN_DATABASE to the new address (leave it out for the data folder's own events.db).",
        ],
    )
