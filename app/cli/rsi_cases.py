"""regen rsi case: a disputed mission becomes a case of the regression suite."""

from typing import Annotated

import msgspec
import typer

from app.cli import output
from app.cli.data_folder import deciding
from app.cli.owner_api import owner_api
from app.cli.person import me
from harness.contracts.decisions import Refused
from harness.contracts.errors import ContractInvalid
from harness.contracts.ids import MissionId
from rsi_reviews.release_service import SignedBy
from rsi_reviews.suite_growth import AddedCase


def case(
    mission_id: Annotated[str, typer.Argument(help="A mission with a disputed completion.")],
    reason: Annotated[str, typer.Option(help="Why; it stands in the log.")],
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Add a disputed mission to the regression suite of this folder: every later candidate is run on it too.

    You become an author of what is evaluated on it, and so may not approve that.
    """
    api = owner_api(data)
    if api is not None:
        added = msgspec.convert(api.post(f"/missions/{mission_id}/case", {"reason": reason})["case"], AddedCase)
    else:
        with deciding(output.settings(data_folder=data)) as releases:
            decision = releases.add_case(MissionId(mission_id), SignedBy(actor=me(), reason=reason, key=mission_id))
            if isinstance(decision, Refused):
                raise ContractInvalid(output.refusal(decision), where=mission_id, do="see `regen rsi`")
            added = next(one.case for one in releases.growth().added if one.mission_id == mission_id)
    under = f" under {', '.join(added.faults)}" if added.faults else ""
    lines = [f"{mission_id} is a case of family {added.family}: {added.template}{under}, seed {added.seed}."]
    output.show({"mission_id": mission_id, "case": msgspec.to_builtins(added)}, as_json=as_json, lines=lines)
