"""regen rsi case: a disputed or failed mission becomes a case of the regression suite."""

from typing import Annotated

import msgspec
import typer

from app.acts.releases import AddCaseAct
from app.cli import output
from app.cli.api import api_without_robots
from rsi_reviews.suite_growth import AddedCase


def case(
    mission_id: Annotated[str, typer.Argument(help="A failed mission, or one with a disputed completion.")],
    reason: output.Why,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Add a disputed or failed mission to the regression suite of this folder: every later candidate is run on it too.

    You become an author of what is evaluated on it, and so may not approve that.
    """
    act = AddCaseAct.of(reason=reason)
    with api_without_robots(data) as api:
        added = msgspec.convert(api.post(f"/missions/{mission_id}/case", act.body())["case"], AddedCase)
    under = f" under {', '.join(added.faults)}" if added.faults else ""
    lines = [f"{mission_id} is a case of family {added.family}: {added.template}{under}, seed {added.seed}."]
    output.show({"mission_id": mission_id, "case": msgspec.to_builtins(added)}, as_json=as_json, lines=lines)
