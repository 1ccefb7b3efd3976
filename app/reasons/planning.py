"""Why a plan, a target or a recovery action is refused, by code."""

from collections.abc import Mapping

from app.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "action_unpaid": N_("{action:word} is refused: {why}."),
    "plan_unpaid": N_("A plan costs a local_replan: {why}."),
}
