"""regen rsi, the words of persons: submit, approve, reject, authorise, release, adjudicate, roll back."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer
from msgspec.structs import replace

from app.cli import output
from app.cli.data_folder import deciding
from app.cli.owner_api import owner_api
from app.cli.person import me
from app.cli.rsi import CandidateName, reading, sheet_lines
from app.cli.rsi import app as app
from app.routes.candidate_json import sheet
from harness.contracts.decisions import Accepted, Refused
from harness.contracts.errors import HarnessError
from harness.contracts.ids import Digest, MissionId, RobotId
from rsi_reviews.contracts import Finding, ReleasePolicy
from rsi_reviews.projections import Review
from rsi_reviews.release_service import ReleaseService, SeenSubject, SignedBy

Reason = Annotated[str, typer.Option(help="Why; it stands in the log.")]
Shown = Annotated[str, typer.Option("--digest", help="The digest that `regen rsi show` printed.")]
ReleaseStep = Callable[[ReleaseService, Review, SignedBy, SeenSubject], Accepted[Any] | Refused]


@app.command()
def submit(
    candidate: CandidateName, reason: Reason, data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False
) -> None:
    """Ask persons to review an accepted candidate, in a new cycle."""
    _word("submit", candidate, lambda releases, review, say, seen: releases.submit(review.candidate, say),
          {"reason": reason}, data=data, as_json=as_json)  # fmt: skip


@app.command()
def comment(
    candidate: CandidateName, reason: Reason, data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False
) -> None:
    """Say something about it; nothing else changes."""
    _word("comment", candidate, lambda releases, review, say, seen: releases.comment(review.candidate, say),
          {"reason": reason}, data=data, as_json=as_json)  # fmt: skip


@app.command("request-changes")
def request_changes(
    candidate: CandidateName, reason: Reason, data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False
) -> None:
    """Send it back to its authors: every approval is void."""
    _word("request_changes", candidate,
          lambda releases, review, say, seen: releases.request_changes(review.candidate, say, seen),
          {"reason": reason}, data=data, as_json=as_json)  # fmt: skip


@app.command()
def approve(
    candidate: CandidateName,
    digest: Shown,
    reason: Reason,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Say yes to exactly what `show` printed. An author's own yes is refused."""
    _word("approve", candidate, lambda releases, review, say, seen: releases.approve(review.candidate, say, seen),
          {"reason": reason, "subject": digest}, data=data, as_json=as_json)  # fmt: skip


@app.command()
def reject(
    candidate: CandidateName, reason: Reason, data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False
) -> None:
    """Refuse it for good."""
    _word("reject", candidate, lambda releases, review, say, seen: releases.reject(review.candidate, say, seen),
          {"reason": reason}, data=data, as_json=as_json)  # fmt: skip


@app.command()
def authorise(
    candidate: CandidateName,
    digest: Shown,
    reason: Reason,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Authorise the release; the rollback target is loaded first and fixed with it."""
    _word("authorise", candidate, lambda releases, review, say, seen: releases.authorise(review.candidate, say, seen),
          {"reason": reason, "subject": digest}, data=data, as_json=as_json)  # fmt: skip


@app.command()
def release(
    candidate: CandidateName,
    digest: Shown,
    reason: Reason,
    robot: Annotated[str, typer.Option(help="The robot that tries it first.")] = "vbot-1",
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Release it to one robot, one mission at a time, until its canary is over."""
    robot_id = RobotId(robot)
    _word("release", candidate,
          lambda releases, review, say, seen: releases.release(review.candidate, say, seen, robot_id=robot_id),
          {"reason": reason, "subject": digest, "robot_id": robot}, data=data, as_json=as_json)  # fmt: skip


@app.command()
def adjudicate(
    candidate: CandidateName,
    mission: Annotated[str, typer.Option(help="A mission that ended under it.")],
    reason: Reason,
    finding: Annotated[str, typer.Option(help="sound, false_completion, duplicate_start, safety_violation.")] = "sound",
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Say what became of one canary mission. Whoever released it cannot."""
    found = _finding(finding)
    _word("adjudicate", candidate,
          lambda releases, review, say, seen: releases.adjudicate(review.candidate, MissionId(mission), found, say),
          {"reason": reason, "mission_id": mission, "finding": finding}, data=data, as_json=as_json)  # fmt: skip


@app.command()
def rollback(
    candidate: CandidateName, reason: Reason, data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False
) -> None:
    """Back to the version before it, at once; its configuration is quarantined."""
    _word("rollback", candidate, lambda releases, review, say, seen: releases.rollback(review.candidate, say),
          {"reason": reason}, data=data, as_json=as_json)  # fmt: skip


@app.command()
def withdraw(
    candidate: CandidateName, reason: Reason, data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False
) -> None:
    """Take it back without a fault."""
    _word("withdraw", candidate, lambda releases, review, say, seen: releases.withdraw(review.candidate, say),
          {"reason": reason}, data=data, as_json=as_json)  # fmt: skip


@app.command()
def policy(
    kind: Annotated[str, typer.Option(help="two_person or single_operator.")],
    reason: Reason,
    quorum: Annotated[int, typer.Option(help="Approvals that are needed.", min=1, max=10)] = 1,
    cooling_off_s: Annotated[float, typer.Option(help="What a single operator waits, seconds.", min=0.0)] = 0.0,
    person: Annotated[list[str] | None, typer.Option(help="Who may decide; may be given again.")] = None,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Say who must agree before a release. One that nobody could satisfy is refused."""
    people = tuple(person or [me().name])
    chosen = ReleasePolicy(
        kind="single_operator" if kind == "single_operator" else "two_person",
        quorum=quorum,
        cooling_off_s=cooling_off_s,
    )
    if kind not in ("two_person", "single_operator"):
        raise typer.BadParameter(f"{kind!r} is neither two_person nor single_operator", param_hint="--kind")
    if (api := owner_api(data)) is not None:
        body = {"kind": kind, "quorum": quorum, "cooling_off_s": cooling_off_s, "reason": reason}
        output.show(api.post("/releases/policy", body), as_json=as_json, lines=[f"The policy is {kind}."])
        return
    with deciding(output.settings(data_folder=data)) as releases:
        say = SignedBy(me(), reason, _key("policy", f"{kind}:{quorum}:{cooling_off_s}", reason))
        _taken(releases.save_policy(chosen, say, reviewers=people, releasers=people))
    output.show({"policy": kind, "quorum": quorum}, as_json=as_json, lines=[f"The policy is {kind}, quorum {quorum}."])


ROLES = {"authorise": "releaser", "release": "releaser", "rollback": "releaser", "submit": "operator"}


def _word(what: str, candidate: str, word: ReleaseStep, said: dict[str, str], *, data: Path, as_json: bool) -> None:
    """One word on one candidate, through the owner's API where a process owns the folder; then the sheet after it."""
    api = owner_api(data)
    with reading(data) as queries:
        review = queries.review(candidate)
    key = _key(what, review.candidate, f"{review.cycle}:{said}")
    if api is not None:
        body = {**said, "key": key, "cycle": review.cycle, "subject": said.get("subject") or review.subject_digest}
        answer: dict[str, Any] = api.post(f"/candidates/{review.candidate}/{what}", body)
    else:
        seen = SeenSubject(cycle=review.cycle, subject=Digest(said.get("subject") or review.subject_digest))
        actor = replace(me(), role=ROLES.get(what, "reviewer"))
        with deciding(output.settings(data_folder=data)) as releases:
            _taken(word(releases, review, SignedBy(actor, said["reason"], key), seen))
            answer = sheet(releases, review.candidate)
    output.show(answer, as_json=as_json, lines=sheet_lines(answer))


def _taken(decision: Accepted[Any] | Refused) -> None:
    if isinstance(decision, Refused):
        raise HarnessError(output.refusal(decision), do="see `regen rsi show`")


def _finding(text: str) -> Finding:
    known: dict[str, Finding] = {
        "sound": "sound", "false_completion": "false_completion", "duplicate_start": "duplicate_start",
        "safety_violation": "safety_violation",
    }  # fmt: skip
    if text not in known:
        raise typer.BadParameter(f"{text!r} is none of {', '.join(known)}", param_hint="--finding")
    return known[text]


def _key(what: str, candidate: str, words: str) -> str:
    """The same words in the same cycle are the same answer."""
    return f"terminal:{what}:{hashlib.sha256(f'{candidate}:{words}'.encode()).hexdigest()[:32]}"
