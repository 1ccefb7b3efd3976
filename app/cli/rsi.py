"""regen rsi: propose a change to the harness itself, and inspect candidates; `releases` has the decisions."""

from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, get_args

import msgspec
import typer

from app.acts.releases import ProposeCandidateAct
from app.cli import output
from app.cli.api import api_without_robots
from app.i18n.reasons.rendering import stating
from app.routes.candidate_json import row, sheet
from harness.bootstrap import read_harness
from harness.contracts.errors import HarnessError, UnknownName
from harness.contracts.ids import RobotId
from harness.contracts.listed_values import values_at
from harness.contracts.reasons import because
from rsi_reviews.candidate_queries import CandidateQueries, selected
from rsi_reviews.candidates import LARGEST_BYTES
from rsi_reviews.contracts import BETTER, SECTIONS, Direction, Manifest
from rsi_reviews.deciders import DECIDERS
from rsi_reviews.difference import NAMES

app = typer.Typer(no_args_is_help=True, help="Propose, evaluate, review, release and roll back configurations.")
MANIFEST_HELP = (
    f"Its manifest, JSON: component ({' | '.join(SECTIONS)}), reason, intended_effect, metric ({' | '.join(BETTER)}), "
    f"direction ({' | '.join(get_args(Direction))}), smallest_effect, baseline, rollback, author (name, and kind: "
    + " | ".join(values_at(Manifest, "$.author.kind"))
    + "), and, if wanted, motives and canary. docs/reference/candidates.md says what they mean."
)
CandidateName = Annotated[str, typer.Argument(help="The candidate's digest, or a beginning of it.")]


@app.command()
def propose(
    file: Annotated[Path, typer.Option("--file", help="The candidate configuration, JSON.")],
    manifest: Annotated[Path, typer.Option(help=MANIFEST_HELP)],
    supersedes: Annotated[str, typer.Option(help="The candidate that this one edits.")] = "",
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Put a candidate on record with its manifest. What loosens anything is refused before anything runs."""
    act = ProposeCandidateAct.of(configuration=_read(file), manifest=_read(manifest), supersedes=supersedes)
    with api_without_robots(data) as api:
        answer: dict[str, Any] = api.post("/candidates", act.body())
    output.show(answer, as_json=as_json, lines=sheet_lines(answer))


@app.command("list")
def list_candidates(data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False) -> None:
    """All candidates, newest first."""
    with reading(data) as queries:
        rows = [row(review) for review in queries.reviews()]
    columns = ("candidate", "status", "component", "metric", "author", "cycle")
    lines = output.table([[str(one[name])[:16] for name in columns] for one in rows])
    output.show({"candidates": rows}, as_json=as_json, lines=lines or ["No candidate was proposed here."])


@app.command("show")
def show_candidate(
    candidate: CandidateName, data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False
) -> None:
    """One candidate: manifest, the acceptance clauses, what persons said, and the digest that a decision must name."""
    with reading(data) as queries:
        answer = sheet(queries, candidate)
    output.show(answer, as_json=as_json, lines=sheet_lines(answer))


@app.command()
def diff(candidate: CandidateName, data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False) -> None:
    """What it changes against its baseline: by component, then the raw difference of both texts."""
    with reading(data) as queries:
        found = queries.diff(candidate)
    lines = []
    for section, title in NAMES.items():
        changes = [change for change in found.changes if change.section == section]
        lines += [f"{title}: {'unchanged' if not changes else ''}".rstrip(": ") if not changes else f"{title}:"]
        for one in changes:
            unit = f" {one.unit}" if one.unit else ""
            lines.append(f"  {one.path}: {one.before or 'nothing'} -> {one.after or 'nothing'}{unit}. {one.meaning}")
    output.show(msgspec.to_builtins(found), as_json=as_json, lines=[*lines, "", *found.raw.splitlines()])


@app.command()
def history(
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
    at: Annotated[str, typer.Option(help="What was current at this instant: 2026-11-20T09:30:00Z.")] = "",
    robot: Annotated[str, typer.Option(help="On this robot, where a canary may run.")] = "",
) -> None:
    """The pointer's history, what is pinned to what, quarantine, looks and workers' uptake."""
    with reading(data) as queries:
        pointer = queries.pointer()
        answer: dict[str, Any] = {
            "revision": pointer.revision,
            "configuration": queries.current(),
            "canary": pointer.canary,
            "canary_robot": pointer.robot_id,
            "history": [stating(move) for move in pointer.history],
            "versions": queries.versions(),
            "pins": {name: list(missions) for name, missions in queries.pins().items()},
            "quarantined": [stating(one) for one in pointer.quarantined.values()],
            "looks": [msgspec.to_builtins(one) for one in pointer.looks],
            "uptakes": [msgspec.to_builtins(one) for one in pointer.uptakes],
            "policy": msgspec.to_builtins(pointer.policy),
        }
        if at:
            answer["at"] = at
            answer["current_at"] = queries.current_at(_instant(at), robot_id=RobotId(robot) if robot else None)
    output.show(answer, as_json=as_json, lines=_history_lines(answer))


@contextmanager
def reading(data: Path) -> Iterator[CandidateQueries]:
    """Queries on candidates without owning the folder: a console may run on it meanwhile."""
    with read_harness(output.settings(data_folder=data), deciders=DECIDERS, select=selected) as runtime:
        yield CandidateQueries(runtime)


def sheet_lines(answer: dict[str, Any]) -> list[str]:
    """A sheet as a few lines."""
    lines = [f"{answer['candidate']}  {answer['status']}  cycle {answer['cycle']}"]
    if answer["digest"]:
        lines.append(f"digest {answer['digest']}")
    lines += [f"{one['clause']}: {one['answer']}. {one['sentence']}" for one in answer["clauses"]]
    for entry in answer["said"]:
        lines.append(f"{entry['by']['actor']['name']}: {entry['what'].replace('_', ' ')}, “{entry['by']['reason']}”")
    lines += [
        f"canary {one['measured']['mission_id']}: {one['finding'] or 'not adjudicated'}" for one in answer["canary"]
    ]
    return lines


def _history_lines(answer: dict[str, Any]) -> list[str]:
    lines = [f"revision {answer['revision']}: {answer['configuration']}"]
    lines += output.table([_move(move) for move in answer["history"]])
    lines += [f"{name[:16]}  {state}" for name, state in answer["versions"].items()]
    if "current_at" in answer:
        lines.append(f"at {answer['at']}: {answer['current_at'] or 'nothing was released yet'}")
    return lines


def _move(move: dict[str, Any]) -> list[str]:
    digest = move["canary"] or move["configuration"]
    return [str(move["revision"]), move["cause"], digest[:16], move["actor"]["name"], move["reason"]]


def _instant(text: str) -> float:
    try:
        found = datetime.fromisoformat(text)
    except ValueError as error:
        raise UnknownName(because("instant_invalid", text=text), where="--at") from error
    return (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()


def _read(path: Path) -> bytes:
    """A file's bytes, no more than a candidate may have. Raises HarnessError if it cannot be read."""
    try:
        with path.open("rb") as file:
            return file.read(LARGEST_BYTES + 1)
    except OSError as error:
        raise HarnessError(because("file_unreadable", error=error.strerror or str(error)), where=str(path)) from error
