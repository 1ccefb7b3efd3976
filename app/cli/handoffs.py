"""regen handoff: everything a person can do with a question; `list` observes again, so its digest is current."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any, NoReturn

import msgspec
import typer
from msgspec import to_builtins

from app.acts import handoffs as acts
from app.acts.base import Act
from app.cli import output
from app.cli.api import api_with_robots
from app.cli.api_client import Api
from app.i18n.reasons import rendering as reasons
from harness.contracts.errors import UnknownName
from harness.contracts.reasons import because
from harness.contracts.values import encode
from harness.projections.handoffs import Handoff

app = typer.Typer(no_args_is_help=True, help="Answer the questions that missions ask people.")
Claim = Annotated[str, typer.Option("--claim", help="Your token: any word; name it again to act on your claim.")]
Claimed = Annotated[str, typer.Option("--claim", help="Your token, if you claimed it.")]
ActOf = Callable[[Handoff], Act]


@app.command("list")
def list_handoffs(
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
    everything: Annotated[bool, typer.Option("--all", help="Answered ones too.")] = False,
) -> None:
    """Handoffs that wait, each observed again, with the digest that an approval must name."""
    with api_with_robots(data) as api:
        for handoff in api.handoffs():
            if handoff.status == "open":
                api.observe(_mission_of(handoff))
                api.post(f"/handoffs/{handoff.handoff_id}/look", acts.LookAgainAct().body())
        rows = [_row(handoff) for handoff in api.handoffs() if everything or handoff.waits]
    lines = output.table([[r["handoff_id"], r["status"], r["mission_id"], r["node_id"], r["digest"]] for r in rows])
    lines += [f"{row['handoff_id']}: {row['reason']}" for row in rows]
    output.show({"handoffs": rows}, as_json=as_json, lines=lines or ["No mission waits for a person."])


@app.command("show")
def show_one(handoff_id: str, data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False) -> None:
    """One question as it stands: what would run, what else could, who has it, how long it waits."""
    with api_with_robots(data) as api:
        handoff = _handoff(api, handoff_id)
    row = _row(handoff)
    lines = [f"{name.replace('_', ' ')}: {value}" for name, value in row.items() if value not in ("", None, [])]
    proposal = handoff.opened.proposal if handoff.opened else None
    lines.append(f"would run: {encode(proposal).decode()}" if proposal else "would run: nothing")
    output.show(row | {"proposal": to_builtins(proposal)}, as_json=as_json, lines=lines)


def _claimed(verb: str) -> Callable[..., None]:
    def command(
        handoff_id: str,
        data: output.Data = output.DEFAULT_DATA,
        as_json: output.Json = False,
        token: Claim = "terminal",
    ) -> None:
        _post(data, handoff_id, verb, lambda _: acts.ACTS[verb].of(claim=token), as_json=as_json)

    return command


def _held(verb: str, success: str) -> Callable[..., None]:
    def command(
        handoff_id: str,
        reason: output.Why,
        data: output.Data = output.DEFAULT_DATA,
        as_json: output.Json = False,
        token: Claim = "terminal",
    ) -> None:
        def act_of(_: Handoff) -> Act:
            return acts.ACTS[verb].of(claim=token, key=_key(handoff_id, verb, reason), reason=reason)

        _end(data, handoff_id, verb, act_of, as_json=as_json, success=success)

    return command


for verb in ("claim", "release"):
    app.command(verb, help=acts.ACTS[verb].__doc__)(_claimed(verb))
for verb, end in (("hand-back", "succeeded"), ("close", "handed_off")):
    app.command(verb, help=acts.ACTS[verb].__doc__)(_held(verb, end))


@app.command()
def look(handoff_id: str, data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False) -> None:
    """Observe again without motion."""
    _post(data, handoff_id, "look", lambda _: acts.LookAgainAct(), as_json=as_json)


@app.command("extend")
@app.command("on-my-way", hidden=True)
def extend(
    handoff_id: str,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
    reason: output.Why = "on my way",
) -> None:
    """Let it wait longer: once, as long as the zone allows."""
    _post(data, handoff_id, "on-my-way", lambda _: acts.ExtendDeadlineAct.of(reason=reason), as_json=as_json)


@app.command("ask-colleague")
def ask_colleague(
    handoff_id: str,
    reason: output.Why,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Ask the next person now."""
    _post(data, handoff_id, "ask-colleague", lambda _: acts.AskColleagueAct.of(reason=reason), as_json=as_json)


@app.command()
def choose(
    handoff_id: str,
    action: Annotated[str, typer.Option(help="Another action of the ladder; `show` lists them as choices.")],
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
    token: Claimed = "",
    wait_s: Annotated[float, typer.Option("--wait", help="How many seconds it waits after the approval.")] = 0.0,
    speed_cap_mps: Annotated[float | None, typer.Option("--speed", help="At most so many m/s, this once.")] = None,
    waiting_place: Annotated[
        str | None, typer.Option("--at", help="Go to this place first and wait there; `show` lists waiting places.")
    ] = None,
) -> None:
    """Ask anew with another action, later, slower or after a wait elsewhere. Its own digest needs an approval."""

    def act_of(handoff: Handoff) -> Act:
        given = {"wait_s": wait_s, "speed_cap_mps": speed_cap_mps, "waiting_place": waiting_place}
        return acts.ChooseActionAct.of(action=action, cycle=handoff.cycle, claim=token, **given)

    _post(data, handoff_id, "choose", act_of, as_json=as_json)


@app.command()
def approve(
    handoff_id: str,
    digest: Annotated[str, typer.Option(help="The digest that `regen handoff list` printed.")],
    reason: output.Why,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
    token: Claimed = "",
) -> None:
    """Let the proposed action run once, and follow the mission. It is verified like any other attempt."""

    def act_of(handoff: Handoff) -> Act:
        view = _approval_fields(handoff) | {"subject": digest}
        key = _key(handoff_id, "approve", reason)
        return acts.ApproveHandoffAct.of(decision="approve", reason=reason, key=key, claim=token, **view)

    _end(data, handoff_id, "decision", act_of, as_json=as_json, success="succeeded")


@app.command()
def reject(
    handoff_id: str,
    reason: output.Why,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
    token: Claimed = "",
) -> None:
    """Refuse: the mission ends safely stopped."""

    def act_of(handoff: Handoff) -> Act:
        key = _key(handoff_id, "reject", reason)
        return acts.RejectHandoffAct.of(
            decision="reject", reason=reason, key=key, claim=token, **_approval_fields(handoff)
        )

    _end(data, handoff_id, "decision", act_of, as_json=as_json, success="safe_stopped")


@app.command("take-control")
@app.command("take-over", hidden=True)
def take_control(
    handoff_id: str,
    device: Annotated[str, typer.Option(help="What you drive it from; everybody sees it.")],
    reason: output.Why,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
    token: Claim = "terminal",
) -> None:
    """Drive it yourself; claim it first. The deadline pauses as long as the claim is renewed."""

    def act_of(_: Handoff) -> Act:
        key = _key(handoff_id, "take-over", reason)
        return acts.TakeControlAct.of(claim=token, device=device, key=key, reason=reason)

    _post(data, handoff_id, "take-over", act_of, as_json=as_json)


@app.command()
def attest(
    handoff_id: str,
    condition: Annotated[str, typer.Option(help="The condition that you saw met with your own eyes.")],
    statement: Annotated[str, typer.Option(help="What you saw; it is kept as evidence.")],
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
    token: Claimed = "",
) -> None:
    """Say what you saw. It opens one look without motion and satisfies nothing by itself."""

    def act_of(handoff: Handoff) -> Act:
        return acts.AttestHandoffAct.of(
            condition_id=condition,
            statement=statement,
            key=_key(handoff_id, "attest", statement),
            cycle=handoff.cycle,
            claim=token,
        )

    _end(data, handoff_id, "attest", act_of, as_json=as_json, success="succeeded")


def _approval_fields(handoff: Handoff) -> dict[str, Any]:
    """What stands there now: the cycle and the digests that a decision is bound to."""
    opened = handoff.opened
    view = {"subject": opened.subject, "evidence": opened.evidence} if opened else {}
    return {"cycle": handoff.cycle, **view}


def _post(data: Path, handoff_id: str, word: str, act_of: ActOf, *, as_json: bool) -> None:
    """Post the act and print the handoff after it."""
    with api_with_robots(data) as api:
        row = _row(_posted(api, handoff_id, word, act_of))
    held = f", claimed by {row['holder']}" if row["holder"] else ""
    output.show(row, as_json=as_json, lines=[f"{row['handoff_id']}  {row['status']}, cycle {row['cycle']}{held}"])


def _end(data: Path, handoff_id: str, word: str, act_of: ActOf, *, as_json: bool, success: str) -> NoReturn:
    """Post the act and follow the mission until it is over or waits again: exit 0 where it ended as the act asks."""
    with api_with_robots(data) as api:
        outcome: Mapping[str, Any] = api.follow(_mission_of(_posted(api, handoff_id, word, act_of)))
    lines = [f"{outcome['mission_id']}  {outcome['status']}  {outcome.get('reason', '')}".rstrip()]
    output.show(outcome, as_json=as_json, lines=lines)
    raise typer.Exit(0 if outcome["status"] == success else output.exit_code(outcome["status"]))


def _posted(api: Api, handoff_id: str, word: str, act_of: ActOf) -> Handoff:
    """The handoff after the act. Raises UnknownName, or HarnessError with the rule that refused."""
    handoff = _handoff(api, handoff_id)
    if handoff.waits:
        api.observe(_mission_of(handoff))
    return msgspec.convert(api.post(f"/handoffs/{handoff_id}/{word}", act_of(handoff).body()), Handoff)


def _handoff(api: Api, handoff_id: str) -> Handoff:
    return msgspec.convert(api.get(f"/handoffs/{handoff_id}"), Handoff)


def _mission_of(handoff: Handoff) -> str:
    if handoff.opened is None:
        raise UnknownName(because("unknown_handoff", handoff_id=handoff.handoff_id))
    return handoff.opened.mission_id


def _row(handoff: Handoff) -> dict[str, Any]:
    opened = handoff.opened
    return {
        "handoff_id": handoff.handoff_id,
        "status": handoff.status,
        "mission_id": opened.mission_id if opened else "",
        "node_id": opened.node_id if opened else "",
        "cycle": handoff.cycle,
        "digest": opened.subject if opened else "",
        "evidence": opened.evidence if opened else "",
        **reasons.stated("reason", opened.reason if opened else ""),
        "deadline_at_s": opened.deadline_at_s if opened else None,
        "no_answer": opened.no_answer if opened else "",
        "choices": list(opened.choices) if opened else [],
        "waiting_places": list(opened.waiting_places) if opened else [],
        "holder": handoff.claim.actor.name if handoff.claim else "",
    }


def _key(handoff_id: str, decision: str, reason: str) -> str:
    """The idempotency key of an answer: repeating it with the same words changes nothing."""
    return f"terminal:{handoff_id}:{decision}:{reason}"[:200]
