"""regen handoff: list, approve, reject, attest. `list` observes again, so that its digest is of what is there now."""

from typing import Annotated, Any

import typer

from app.history import Histories
from app.terminal.answers import DEFAULT_DATA, Data, Json, Progress, exit_code, settings, show, table
from app.terminal.missions import me
from app.terminal.owner import OwnerApi, owner_api
from app.views.outcome import mission_outcome
from harness.bootstrap import Harness, open_harness
from harness.contracts.commands import AttestCondition, DecideHandoff, LookAgain
from harness.contracts.decisions import Refused
from harness.contracts.errors import HarnessError, UnknownName
from harness.contracts.ids import ConditionId, Digest, HandoffId
from harness.projections.handoffs import Handoff

app = typer.Typer(no_args_is_help=True, help="Answer the questions that missions ask people.")
Reason = Annotated[str, typer.Option(help="Why; it stands in the log.")]


@app.command("list")
def list_handoffs(
    data: Data = DEFAULT_DATA,
    as_json: Json = False,
    everything: Annotated[bool, typer.Option("--all", help="Answered ones too.")] = False,
) -> None:
    """Open handoffs, each observed again, with the digest that an approval must name."""
    api = owner_api(data)
    if api is not None:
        found = _asked(api)
    else:
        with open_harness(settings(data_folder=data, speed=0.0)) as harness:
            found = _observed(harness)
    rows = [_row(handoff) for handoff in found if everything or handoff.status == "open"]
    lines = table([[r["handoff_id"], r["status"], r["mission_id"], r["node_id"], r["digest"]] for r in rows])
    lines += [f"{row['handoff_id']}: {row['reason']}" for row in rows]
    show({"handoffs": rows}, as_json=as_json, lines=lines or ["No mission waits for a person."])


def _asked(api: OwnerApi) -> list[Handoff]:
    for handoff in api.handoffs():
        if handoff.status == "open":
            api.post(f"/handoffs/{handoff.handoff_id}/look", {})
    return api.handoffs()


def _observed(harness: Harness) -> list[Handoff]:
    for handoff in harness.runtime.handoffs():
        if handoff.status == "open" and handoff.opened is not None:
            _look(harness, handoff.opened.mission_id)
            harness.runtime.answer(LookAgain(handoff_id=handoff.handoff_id, actor=me()))
    return harness.runtime.handoffs()


def _look(harness: Harness, mission_id: Any) -> None:
    """Let the robot's sensors speak for two seconds of mission time."""
    for _ in range(4):
        wake_s = harness.supervisor.step(mission_id)
        now_s = harness.clock.now().mission_s
        harness.clock.wait_until(max(now_s + 0.5, wake_s or 0.0))
    harness.supervisor.step(mission_id)


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
        "reason": opened.reason if opened else "",
        "deadline_at_s": opened.deadline_at_s if opened else None,
    }


@app.command()
def approve(
    handoff_id: str,
    digest: Annotated[str, typer.Option(help="The digest that `regen handoff list` printed.")],
    reason: Reason,
    data: Data = DEFAULT_DATA,
    as_json: Json = False,
) -> None:
    """Let the proposed action run once, and follow the mission. It is verified like any other attempt."""
    _decide(handoff_id, "approve", digest=digest, reason=reason, data=data, as_json=as_json)


@app.command()
def reject(handoff_id: str, reason: Reason, data: Data = DEFAULT_DATA, as_json: Json = False) -> None:
    """Refuse: the mission ends safely stopped."""
    _decide(handoff_id, "reject", digest="", reason=reason, data=data, as_json=as_json)


@app.command()
def attest(
    handoff_id: str,
    condition: Annotated[str, typer.Option(help="The condition that you saw met with your own eyes.")],
    statement: Annotated[str, typer.Option(help="What you saw; it is kept as evidence.")],
    data: Data = DEFAULT_DATA,
    as_json: Json = False,
) -> None:
    """Say what you saw. It opens one look without motion and satisfies nothing by itself."""
    if owner_api(data) is not None:
        raise HarnessError(
            "A console owns this data folder", where=str(data), do="stop that process, then attest from here"
        )
    with open_harness(settings(data_folder=data, speed=0.0)) as harness:
        handoff = harness.runtime.handoff(HandoffId(handoff_id))
        if handoff.opened is None:
            raise UnknownName(f"There is no handoff {handoff_id}", do="list them with `regen handoff list`")
        word = AttestCondition(
            handoff_id=handoff.handoff_id,
            condition_id=ConditionId(condition),
            actor=me(),
            statement=statement,
            key=_key(handoff_id, "attest", statement),
            cycle=handoff.cycle,
        )
        _look(harness, handoff.opened.mission_id)
        said = harness.runtime.answer(word)
        if isinstance(said, Refused):
            raise HarnessError(f"{said.message} ({said.rule})", do="see `regen handoff list`")
        mission = harness.supervisor.run(handoff.opened.mission_id, watch=Progress())
        outcome = mission_outcome(
            mission, Histories(harness.runtime).of(mission.mission_id), harness.starts(mission.mission_id)
        )
    line = f"{outcome['mission_id']}  {outcome['status']}  {outcome.get('reason', '')}".rstrip()
    show(outcome, as_json=as_json, lines=[line])
    raise typer.Exit(exit_code(outcome["status"]))


def _decide(handoff_id: str, decision: str, *, digest: str, reason: str, data: Any, as_json: bool) -> None:
    api = owner_api(data)
    if api is not None:
        outcome = _decide_there(api, handoff_id, decision, digest=digest, reason=reason)
    else:
        with open_harness(settings(data_folder=data, speed=0.0)) as harness:
            outcome = _decide_here(harness, HandoffId(handoff_id), decision, digest=digest, reason=reason)
    lines = [f"{outcome['mission_id']}  {outcome['status']}  {outcome.get('reason', '')}".rstrip()]
    show(outcome, as_json=as_json, lines=lines)
    ended_as_asked = decision == "reject" and outcome["status"] == "safe_stopped"
    raise typer.Exit(0 if ended_as_asked else exit_code(outcome["status"]))


def _decide_there(api: OwnerApi, handoff_id: str, decision: str, *, digest: str, reason: str) -> dict[str, Any]:
    handoff = next((one for one in api.handoffs() if one.handoff_id == handoff_id), None)
    if handoff is None or handoff.opened is None:
        raise UnknownName(f"There is no handoff {handoff_id}", do="list them with `regen handoff list`")
    body = {
        "decision": decision,
        "reason": reason,
        "key": _key(handoff_id, decision, reason),
        "cycle": handoff.cycle,
        "subject": digest or handoff.opened.subject,
        "evidence": handoff.opened.evidence,
    }
    api.post(f"/handoffs/{handoff_id}/decision", body)
    return api.follow(handoff.opened.mission_id, lambda _: None)


def _decide_here(harness: Harness, handoff_id: HandoffId, decision: str, *, digest: str, reason: str) -> dict[str, Any]:
    runtime = harness.runtime
    handoff = runtime.handoff(handoff_id)
    if handoff.opened is None:
        raise UnknownName(f"There is no handoff {handoff_id}", do="list them with `regen handoff list`")
    mission_id = handoff.opened.mission_id
    if handoff.status == "open":
        _look(harness, mission_id)
    answer = DecideHandoff(
        handoff_id=handoff_id,
        decision="approve" if decision == "approve" else "reject",
        actor=me(),
        reason=reason,
        key=_key(handoff_id, decision, reason),
        cycle=handoff.cycle,
        subject=Digest(digest) if digest else handoff.opened.subject,
        evidence=handoff.opened.evidence,
    )
    decided = runtime.answer(answer)
    if isinstance(decided, Refused):
        raise HarnessError(
            f"{decided.message} ({decided.rule})", do="look again with `regen handoff list`, then decide"
        )
    mission = harness.supervisor.run(mission_id, watch=Progress())
    return mission_outcome(mission, Histories(runtime).of(mission_id), harness.starts(mission_id))


def _key(handoff_id: str, decision: str, reason: str) -> str:
    """The same words again are the same answer."""
    return f"terminal:{handoff_id}:{decision}:{reason}"[:200]
