"""Shapes what a person is shown before a decision: typed data, the same in every language and under every template."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from msgspec import UnsetType, to_builtins

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, word
from app.views.budgets import Budget, budget, spent_of_limits
from app.views.history import ShownDifference
from app.views.measures import quantity
from harness.contracts.handoff_events import HandoffOpened, ProposedAction
from harness.contracts.ids import PlaceId, sha256
from harness.contracts.tasks import TaskContract
from harness.contracts.values import Value, encode
from harness.contracts.verdicts import NodeVerdict
from harness.projections.mission import Mission, Spend

NO_NAMES: Mapping[PlaceId, str] = {}
ACTIONS = {
    "verify_again": N_("Judge the stage again, without motion"),
    "re_perceive": N_("Look again with its own sensors"),
    "adjust_view": N_("Turn a little and look again"),
    "retry": N_("Try the same stage again"),
    "local_replan": N_("Plan a way round and go on"),
    "switch_skill": N_("Let another provider do the stage"),
}


@dataclass(frozen=True)
class ActionView:
    """What would run, read back from the very bytes whose digest is approved. `sound` is false if they differ."""

    title: str
    cost: str
    rows: tuple[tuple[str, str], ...]
    parameters: tuple[tuple[str, str], ...]
    limits: tuple[tuple[str, str], ...]
    digest: str
    body: str
    sound: bool


@dataclass(frozen=True)
class ShownQuestion:
    """Subject and evidence of one cycle, as they stand on the screen."""

    opened: HandoffOpened
    verdict: NodeVerdict | None
    budget: Budget
    action: ActionView | None
    contract: TaskContract | None


class ShownRecord(Value, frozen=True, kw_only=True):
    """What a person had before them, as data; its digest binds the approval, its bytes are kept for an auditor.

    `action` is the canonical text whose digest is approved. A budget is (whose, spent, limit).
    """

    schema_version: int = 1
    opened: HandoffOpened
    verdict: NodeVerdict | None
    action: str | None
    tries: tuple[Spend, ...]
    budgets: tuple[tuple[str, int, int], ...]


def shown_record(opened: HandoffOpened, mission: Mission) -> ShownRecord:
    """From the question and the mission's state alone: the same in every language and under every template."""
    question = shown_question(opened, mission)
    return ShownRecord(
        opened=opened,
        verdict=question.verdict,
        action=question.action.body if question.action else None,
        tries=question.budget.tries,
        budgets=spent_of_limits(mission, opened.node_id),
    )


def shown_question(opened: HandoffOpened, mission: Mission, names: Mapping[PlaceId, str] = NO_NAMES) -> ShownQuestion:
    """The question as it stands, from the handoff and the mission's state alone; `names` are those of places."""
    state = mission.nodes.get(opened.node_id)
    return ShownQuestion(
        opened=opened,
        verdict=state.verdicts[-1] if state and state.verdicts else None,
        budget=budget(mission, opened.node_id),
        action=action_view(opened.proposal, subject=opened.subject, names=names),
        contract=mission.contract,
    )


def action_view(
    proposal: ProposedAction | None, *, subject: str, names: Mapping[PlaceId, str] = NO_NAMES
) -> ActionView | None:
    """The rows are read from the canonical bytes, so that only what is digested can be shown."""
    if proposal is None:
        return None
    body = encode(proposal)
    arguments: dict[str, Any] = json.loads(body)
    action, parameters, limits = arguments.pop("action"), arguments.pop("parameters"), arguments.pop("limits")
    limits |= {"wait_s": arguments.pop("wait_s")} if "wait_s" in arguments else {}
    first = action == "retry" and arguments["attempt"] == 1
    return ActionView(
        title=_title(N_("Begin this stage") if first else ACTIONS.get(action, word(action)), proposal, names),
        cost=N_("one of the recovery budget") if arguments["spends"] else N_("nothing of the recovery budget"),
        rows=(("action", action), *((name.replace("_", " "), _text(value)) for name, value in arguments.items())),
        parameters=tuple((quantity(name, "")[0], _valued(name, value)) for name, value in parameters.items()),
        limits=tuple(quantity(name, value) for name, value in limits.items()),
        digest=sha256(body),
        body=body.decode(),
        sound=sha256(body) == subject,
    )


def _title(title: str, proposal: ProposedAction, names: Mapping[PlaceId, str]) -> str:
    """What would start, and after which wait."""
    if isinstance(proposal.wait_s, UnsetType):
        return title
    if not isinstance(proposal.waiting_place, UnsetType):
        place = proposal.waiting_place
        return waits_aside(names.get(place, word(place)), proposal.wait_s)
    return lazy_gettext("{what}, after {seconds:g} s", what=title, seconds=proposal.wait_s)


def waits_aside(place: str, wait_s: float) -> str:
    """Going to another place, waiting there, and going on with the stage."""
    return lazy_gettext("Wait {seconds:g} s at {place}, then go on", seconds=wait_s, place=place)


def differences(was: HandoffOpened, now: HandoffOpened) -> tuple[ShownDifference, ...]:
    """What changed between the question that was answered and the question as it is: subject first, then the robot."""
    before, after = _flat(was), _flat(now)
    return tuple(
        ShownDifference(name=name, was=before.get(name, "nothing"), now=after.get(name, "nothing"))
        for name in dict.fromkeys((*before, *after))
        if before.get(name) != after.get(name)
    )


def _flat(opened: HandoffOpened) -> dict[str, str]:
    proposal = to_builtins(opened.proposal) if opened.proposal else {}
    found = {"cycle": str(opened.cycle), N_("state version k"): str(opened.k)}
    for name, value in proposal.items():
        if isinstance(value, dict):
            found |= {
                lazy_gettext("action: {name}", name=quantity(key, "")[0]): _valued(key, one)
                for key, one in value.items()
            }
        else:
            found[lazy_gettext("action: {name}", name=word(name))] = _text(value)
    snapshot = opened.snapshot
    found[N_("robot stands at")] = f"{snapshot.x_m:.2f} m, {snapshot.y_m:.2f} m, {snapshot.yaw_rad * 57.29578:.0f}°"
    found["body"] = N_("measured static") if snapshot.static else N_("not shown static")
    found[N_("results of the conditions")] = snapshot.results[:12]
    found["picture"] = (snapshot.image or "none")[:12]
    return found


def _text(value: Any) -> str:
    return value if isinstance(value, str) else json.dumps(value)


def _valued(name: str, value: Any) -> str:
    if isinstance(value, float | int) and not isinstance(value, bool):
        return quantity(name, value)[1]
    if isinstance(value, list) and len(value) > 6:
        return lazy_gettext(
            "{count} points, from {first} to {last}", count=len(value), first=_text(value[0]), last=_text(value[-1])
        )
    return _text(value)
