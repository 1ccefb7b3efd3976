"""regen handoff: everything a person can say to a question. `list` observes again, so that its digest is of now."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer
from msgspec import to_builtins

from app.reasons import rendering as reasons
from app.terminal.answers import DEFAULT_DATA, Data, Json, show, table
from app.terminal.handoff_words import Word, ended_as, looked_at, said, said_and_followed
from app.terminal.handoff_words import shown as as_it_stands
from app.terminal.missions import me
from app.views.handoff_shown import action_of
from harness.contracts.handoff_commands import (
    AttestCondition,
    ChooseAction,
    ClaimHandoff,
    CloseHandoff,
    DecideHandoff,
    HandBack,
    LookAgain,
    OnMyWay,
    PersonCommand,
    ReleaseHandoff,
    TakeOver,
)
from harness.contracts.ids import ConditionId, Digest
from harness.contracts.values import encode
from harness.projections.handoffs import Handoff

app = typer.Typer(no_args_is_help=True, help="Answer the questions that missions ask people.")
Reason = Annotated[str, typer.Option(help="Why; it stands in the log.")]
Claim = Annotated[str, typer.Option("--claim", help="Your token: any word; name it again to act on your claim.")]


@app.command("list")
def list_handoffs(
    data: Data = DEFAULT_DATA,
    as_json: Json = False,
    everything: Annotated[bool, typer.Option("--all", help="Answered ones too.")] = False,
) -> None:
    """Handoffs that wait, each observed again, with the digest that an approval must name."""
    rows = [_row(handoff) for handoff in looked_at(data) if everything or handoff.waits]
    lines = table([[r["handoff_id"], r["status"], r["mission_id"], r["node_id"], r["digest"]] for r in rows])
    lines += [f"{row['handoff_id']}: {row['reason']}" for row in rows]
    show({"handoffs": rows}, as_json=as_json, lines=lines or ["No mission waits for a person."])


@app.command("show")
def show_one(handoff_id: str, data: Data = DEFAULT_DATA, as_json: Json = False) -> None:
    """One question as it stands: what would run, what else could, who has it, how long it waits."""
    handoff = as_it_stands(data, handoff_id)
    row = _row(handoff)
    lines = [f"{name.replace('_', ' ')}: {value}" for name, value in row.items() if value not in ("", None, [])]
    proposal = handoff.opened.proposal if handoff.opened else None
    lines.append(f"would run: {encode(proposal).decode()}" if proposal else "would run: nothing")
    show(row | {"proposal": to_builtins(proposal)}, as_json=as_json, lines=lines)


@app.command()
def claim(handoff_id: str, data: Data = DEFAULT_DATA, as_json: Json = False, token: Claim = "terminal") -> None:
    """Yours to answer for a minute; the same token again renews it."""

    def command(handoff: Handoff) -> PersonCommand:
        return ClaimHandoff(handoff_id=handoff.handoff_id, actor=me(), claim=token)

    _say(data, handoff_id, Word("claim", lambda _: {"claim": token}, command), as_json=as_json)


@app.command()
def release(handoff_id: str, data: Data = DEFAULT_DATA, as_json: Json = False, token: Claim = "terminal") -> None:
    """Somebody else may answer it."""

    def command(handoff: Handoff) -> PersonCommand:
        return ReleaseHandoff(handoff_id=handoff.handoff_id, actor=me(), claim=token)

    _say(data, handoff_id, Word("release", lambda _: {"claim": token}, command), as_json=as_json)


@app.command()
def look(handoff_id: str, data: Data = DEFAULT_DATA, as_json: Json = False) -> None:
    """Observe again without motion."""

    def command(handoff: Handoff) -> PersonCommand:
        return LookAgain(handoff_id=handoff.handoff_id, actor=me())

    _say(data, handoff_id, Word("look", lambda _: {}, command), as_json=as_json)


@app.command("on-my-way")
def on_my_way(handoff_id: str, data: Data = DEFAULT_DATA, as_json: Json = False, reason: Reason = "on my way") -> None:
    """Let it wait longer: once, as long as the zone allows."""

    def command(handoff: Handoff) -> PersonCommand:
        return OnMyWay(handoff_id=handoff.handoff_id, actor=me(), reason=reason)

    _say(data, handoff_id, Word("on-my-way", lambda _: {"reason": reason}, command), as_json=as_json)


@app.command()
def choose(
    handoff_id: str,
    action: Annotated[str, typer.Option(help="Another action of the ladder; `show` lists them as choices.")],
    data: Data = DEFAULT_DATA,
    as_json: Json = False,
    token: Annotated[str, typer.Option("--claim", help="Your token, if you claimed it.")] = "",
) -> None:
    """Ask anew with another action. Nothing runs until its own digest is approved."""

    def body(handoff: Handoff) -> dict[str, Any]:
        return {"action": action, "cycle": handoff.cycle, "claim": token}

    def command(handoff: Handoff) -> PersonCommand:
        wanted = action_of(action)
        return ChooseAction(handoff_id=handoff.handoff_id, actor=me(), action=wanted, cycle=handoff.cycle, claim=token)

    _say(data, handoff_id, Word("choose", body, command), as_json=as_json)


@app.command()
def approve(
    handoff_id: str,
    digest: Annotated[str, typer.Option(help="The digest that `regen handoff list` printed.")],
    reason: Reason,
    data: Data = DEFAULT_DATA,
    as_json: Json = False,
    token: Annotated[str, typer.Option("--claim", help="Your token, if you claimed it.")] = "",
) -> None:
    """Let the proposed action run once, and follow the mission. It is verified like any other attempt."""
    outcome = said_and_followed(data, handoff_id, _decision("approve", digest=digest, reason=reason, token=token))
    _end(outcome, as_json=as_json)


@app.command()
def reject(
    handoff_id: str,
    reason: Reason,
    data: Data = DEFAULT_DATA,
    as_json: Json = False,
    token: Annotated[str, typer.Option("--claim", help="Your token, if you claimed it.")] = "",
) -> None:
    """Refuse: the mission ends safely stopped."""
    outcome = said_and_followed(data, handoff_id, _decision("reject", digest="", reason=reason, token=token))
    _end(outcome, as_json=as_json, wanted="safe_stopped")


@app.command("take-over")
def take_over(
    handoff_id: str,
    device: Annotated[str, typer.Option(help="What you drive it from; everybody sees it.")],
    reason: Reason,
    data: Data = DEFAULT_DATA,
    as_json: Json = False,
    token: Claim = "terminal",
) -> None:
    """Drive it yourself; claim it first. The deadline pauses as long as the claim is renewed."""
    key = _key(handoff_id, "take-over", reason)

    def command(handoff: Handoff) -> PersonCommand:
        return TakeOver(handoff_id=handoff.handoff_id, actor=me(), claim=token, device=device, key=key, reason=reason)

    body = {"claim": token, "device": device, "key": key, "reason": reason}
    _say(data, handoff_id, Word("take-over", lambda _: body, command), as_json=as_json)


@app.command("hand-back")
def hand_back(
    handoff_id: str, reason: Reason, data: Data = DEFAULT_DATA, as_json: Json = False, token: Claim = "terminal"
) -> None:
    """Give the robot back; the harness looks afresh, without motion, and the mission goes on from what it finds."""
    key = _key(handoff_id, "hand-back", reason)

    def command(handoff: Handoff) -> PersonCommand:
        return HandBack(handoff_id=handoff.handoff_id, actor=me(), claim=token, key=key, reason=reason)

    body = {"claim": token, "key": key, "reason": reason}
    _end(said_and_followed(data, handoff_id, Word("hand-back", lambda _: body, command)), as_json=as_json)


@app.command()
def close(
    handoff_id: str, reason: Reason, data: Data = DEFAULT_DATA, as_json: Json = False, token: Claim = "terminal"
) -> None:
    """Keep the robot: the mission ends handed off."""
    key = _key(handoff_id, "close", reason)

    def command(handoff: Handoff) -> PersonCommand:
        return CloseHandoff(handoff_id=handoff.handoff_id, actor=me(), claim=token, key=key, reason=reason)

    body = {"claim": token, "key": key, "reason": reason}
    outcome = said_and_followed(data, handoff_id, Word("close", lambda _: body, command))
    _end(outcome, as_json=as_json, wanted="handed_off")


@app.command()
def attest(
    handoff_id: str,
    condition: Annotated[str, typer.Option(help="The condition that you saw met with your own eyes.")],
    statement: Annotated[str, typer.Option(help="What you saw; it is kept as evidence.")],
    data: Data = DEFAULT_DATA,
    as_json: Json = False,
    token: Annotated[str, typer.Option("--claim", help="Your token, if you claimed it.")] = "",
) -> None:
    """Say what you saw. It opens one look without motion and satisfies nothing by itself."""
    key = _key(handoff_id, "attest", statement)

    def body(handoff: Handoff) -> dict[str, Any]:
        words = {"condition_id": condition, "statement": statement, "key": key}
        return words | {"cycle": handoff.cycle, "claim": token}

    def command(handoff: Handoff) -> PersonCommand:
        return AttestCondition(
            handoff_id=handoff.handoff_id,
            condition_id=ConditionId(condition),
            actor=me(),
            statement=statement,
            key=key,
            cycle=handoff.cycle,
            claim=token,
        )

    _end(said_and_followed(data, handoff_id, Word("attest", body, command)), as_json=as_json)


def _decision(decision: str, *, digest: str, reason: str, token: str) -> Word:
    """Bound to the digest that was named, or to the one that stands there now."""

    def command(handoff: Handoff) -> DecideHandoff:
        opened = handoff.opened
        return DecideHandoff(
            handoff_id=handoff.handoff_id,
            decision="approve" if decision == "approve" else "reject",
            actor=me(),
            reason=reason,
            key=_key(handoff.handoff_id, decision, reason),
            cycle=handoff.cycle,
            subject=Digest(digest) if digest else opened.subject if opened else Digest(""),
            evidence=opened.evidence if opened else Digest(""),
            claim=token,
        )

    def body(handoff: Handoff) -> dict[str, Any]:
        asked = command(handoff)
        names = ("decision", "reason", "key", "cycle", "subject", "evidence", "claim")
        return {name: getattr(asked, name) for name in names}

    return Word("decision", body, command)


def _say(data: Path, handoff_id: str, word: Word, *, as_json: bool) -> None:
    row = _row(said(data, handoff_id, word))
    held = f", claimed by {row['holder']}" if row["holder"] else ""
    show(row, as_json=as_json, lines=[f"{row['handoff_id']}  {row['status']}, cycle {row['cycle']}{held}"])


def _end(outcome: Mapping[str, Any], *, as_json: bool, wanted: str = "succeeded") -> None:
    lines = [f"{outcome['mission_id']}  {outcome['status']}  {outcome.get('reason', '')}".rstrip()]
    show(outcome, as_json=as_json, lines=lines)
    raise typer.Exit(ended_as(outcome, wanted=wanted))


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
        "holder": handoff.claim.actor.name if handoff.claim else "",
    }


def _key(handoff_id: str, decision: str, reason: str) -> str:
    """The same words again are the same answer."""
    return f"terminal:{handoff_id}:{decision}:{reason}"[:200]
