"""regen rsi, for people: submit, approve, reject, authorise, release, adjudicate and roll back candidates."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer

from app.acts import releases as acts
from app.cli import output
from app.cli.api import api_without_robots
from app.cli.rsi import CandidateName, sheet_lines
from app.cli.rsi import app as app

Shown = Annotated[str, typer.Option("--digest", help="The digest that `regen rsi show` printed.")]


def _stated(kind: type[acts.CandidateAct]) -> Callable[..., None]:
    def command(
        candidate: CandidateName,
        reason: output.Why,
        data: output.Data = output.DEFAULT_DATA,
        as_json: output.Json = False,
    ) -> None:
        _post(kind, candidate, {"reason": reason}, data=data, as_json=as_json)

    return command


def _bound(kind: type[acts.CandidateAct]) -> Callable[..., None]:
    def command(
        candidate: CandidateName,
        digest: Shown,
        reason: output.Why,
        data: output.Data = output.DEFAULT_DATA,
        as_json: output.Json = False,
    ) -> None:
        _post(kind, candidate, {"reason": reason, "subject": digest}, data=data, as_json=as_json)

    return command


for make, verbs in (
    (_stated, ("submit", "comment", "recall", "request-changes", "reject", "rollback", "withdraw")),
    (_bound, ("approve", "authorise")),
):
    for verb in verbs:
        app.command(verb, help=acts.ACTS[verb].__doc__)(make(acts.ACTS[verb]))


@app.command()
def release(
    candidate: CandidateName,
    digest: Shown,
    reason: output.Why,
    robot: Annotated[str, typer.Option(help="The robot that tries it first.")] = "vbot-1",
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Release it to one robot, one mission at a time, until its canary is over."""
    given = {"reason": reason, "subject": digest, "robot_id": robot}
    _post(acts.ReleaseCandidateAct, candidate, given, data=data, as_json=as_json)


@app.command()
def adjudicate(
    candidate: CandidateName,
    mission: Annotated[str, typer.Option(help="A mission that ended under it.")],
    reason: output.Why,
    finding: Annotated[str, typer.Option(help="sound, false_completion, duplicate_start, safety_violation.")] = "sound",
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Say what became of one canary mission. Whoever released it cannot."""
    given = {"reason": reason, "mission_id": mission, "finding": finding}
    _post(acts.AdjudicateMissionAct, candidate, given, data=data, as_json=as_json)


@app.command()
def policy(
    kind: Annotated[str, typer.Option(help="two_person or single_operator.")],
    reason: output.Why,
    quorum: Annotated[int, typer.Option(help="Approvals that are needed.", min=1, max=10)] = 1,
    cooling_off_s: Annotated[float, typer.Option(help="What a single operator waits, seconds.", min=0.0)] = 0.0,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Say who must agree before a release. One that the people with accounts here could not satisfy is refused."""
    key = _key("policy", f"{kind}:{quorum}:{cooling_off_s}", reason)
    act = acts.SavePolicyAct.of(kind=kind, quorum=quorum, cooling_off_s=cooling_off_s, reason=reason, key=key)
    with api_without_robots(data) as api:
        api.post("/releases/policy", act.body())
    output.show({"policy": kind, "quorum": quorum}, as_json=as_json, lines=[f"The policy is {kind}, quorum {quorum}."])


def _post(kind: type[acts.CandidateAct], candidate: str, given: dict[str, str], *, data: Path, as_json: bool) -> None:
    """Post the act, bound to what stands there now, and print the candidate after it."""
    with api_without_robots(data) as api:
        candidate_sheet: dict[str, Any] = api.get(f"/candidates/{candidate}")
        bound = (
            {"cycle": candidate_sheet["cycle"], "subject": candidate_sheet["digest"]}
            if "subject" in kind.model_fields
            else {}
        )
        key = _key(kind.verb, candidate_sheet["candidate"], f"{candidate_sheet['cycle']}:{given}")
        act = kind.of(**bound | given, key=key)
        answer: dict[str, Any] = api.post(f"/candidates/{candidate_sheet['candidate']}/{kind.verb}", act.body())
    output.show(answer, as_json=as_json, lines=sheet_lines(answer))


def _key(verb: str, candidate: str, given: str) -> str:
    """The idempotency key of an act: repeating it in the same cycle changes nothing."""
    return f"terminal:{verb}:{hashlib.sha256(f'{candidate}:{given}'.encode()).hexdigest()[:32]}"
