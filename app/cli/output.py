"""How the command line answers: JSON or a few lines on standard output, errors and progress on standard error."""

import json
import sys
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer
from pydantic import ValidationError

from app.i18n.reasons import rendering as reasons
from app.i18n.visible_text import escaped, visible_at_terminal
from app.views.readings import question_view
from harness.contracts.decisions import Refused
from harness.contracts.errors import ContractInvalid, GoalNotUnderstood, HarnessError, UnknownName
from harness.contracts.ids import ProviderId, RobotId
from harness.contracts.readings import ReadingQuestion
from harness.contracts.reasons import Reason, because
from harness.projections.mission import Mission
from harness.projections.readings import reading_in_words, unread_in_words
from harness.settings import HarnessSettings

Data = Annotated[Path, typer.Option("--data", help="Data folder; one owner at a time.", envvar="REGEN_DATA_FOLDER")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
Why = Annotated[str, typer.Option("--reason", help="Why; it is stored in the log.")]
DEFAULT_DATA = Path("var")
SITE_DATA = "var"
Site = Annotated[
    Path | None,
    typer.Option(
        "--site",
        help="A site's own folder, as `regen init` writes one; its data are in DIR/var without --data.",
        envvar="REGEN_SITE_FOLDER",
    ),
]
WRONG_ASKED = (ContractInvalid, UnknownName)


def settings(**given: Any) -> HarnessSettings:
    """Settings from the environment and what was given; a value out of bounds is a bad argument."""
    try:
        return HarnessSettings(**{name: value for name, value in given.items() if value is not None})
    except ValidationError as error:
        first = error.errors()[0]
        raise typer.BadParameter(f"{'.'.join(str(part) for part in first['loc'])}: {first['msg']}") from error


def password(*, from_stdin: bool, confirmed: bool = False) -> str:
    """A password from standard input, or typed at the terminal, twice where it is `confirmed`."""
    if from_stdin:
        return sys.stdin.readline().rstrip("\r\n")
    if not sys.stdin.isatty():
        raise ContractInvalid(because("no_terminal"))
    return str(typer.prompt("Password", hide_input=True, confirmation_prompt=confirmed))


def names(text: str | None) -> tuple[str, ...] | None:
    """The names in a list with commas; None where none was given."""
    return tuple(one.strip() for one in text.split(",") if one.strip()) if text else None


def data_of(data: Path, site: Path | None) -> Path:
    """The data folder: the site's own where none was named."""
    return site / SITE_DATA if site is not None and data == DEFAULT_DATA else data


def warn_of_robots(absent: Mapping[RobotId, Reason], unused: Mapping[RobotId, Mapping[ProviderId, Reason]]) -> None:
    """Say on standard error which robots are not connected, and which providers are not used, with the reasons."""
    for robot_id, why in absent.items():
        sys.stderr.write(visible_at_terminal(f"{robot_id} is not connected: {reasons.explained(HarnessError(why))}\n"))
    for robot_id, providers in unused.items():
        for why in providers.values():
            sys.stderr.write(visible_at_terminal(f"{robot_id}: {reasons.explained(HarnessError(why))}\n"))


def show(value: Mapping[str, Any], *, as_json: bool, lines: Iterable[str]) -> None:
    """Print the JSON object, or the lines."""
    if as_json:
        typer.echo(escaped(json.dumps(value, ensure_ascii=False, default=str)))
    else:
        for line in lines:
            typer.echo(visible_at_terminal(line))


def table(rows: Sequence[Sequence[str]]) -> list[str]:
    """Columns padded to their widest cell."""
    if not rows:
        return []
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def refusal(decision: Refused) -> Reason:
    """Why a command was refused, and by which rule."""
    return because("refused_by_rule", reason=decision.reason, rule=decision.rule)


class ActRefused(HarnessError):
    """What was asked is refused; `problem` is the API's document, with the rule, and the reason as code and facts."""

    code = "act_refused"

    def __init__(self, problem: Mapping[str, Any]) -> None:
        message = problem.get("detail") or problem.get("title") or "Refused"
        super().__init__(f"{message} ({problem.get('code', 'refused')})", do=str(problem.get("do", "")))
        self.problem = problem


def complain(error: HarnessError, *, as_json: bool = False) -> int:
    """Say what happened, where, and what to do; the exit code that goes with it. A refusal is JSON for a program."""
    sys.stderr.write(f"regen: {visible_at_terminal(reasons.explained(error))}\n")
    if isinstance(error, GoalNotUnderstood):
        sys.stderr.write("".join(f"{visible_at_terminal(line)}\n" for line in _question_lines(error.question)))
    if as_json and isinstance(error, ActRefused):
        typer.echo(escaped(json.dumps({"refused": error.problem}, ensure_ascii=False)))
    return 2 if isinstance(error, (*WRONG_ASKED, ActRefused)) else 1


def _question_lines(question: ReadingQuestion) -> list[str]:
    """The question for a terminal: the text with its unread words in brackets, and how to confirm the reading."""
    text = "".join(f"[{part.text}]" if part.kind == "unread" else part.text for part in question_view(question).parts)
    lines = [f"  {text}"]
    if question.heard is not None:
        lines.append(f"  heard without the site's words: {question.heard.free or '-'}")
    for one in question.unread:
        why = reasons.sentence(unread_in_words(one.why))
        lines.append(f"    {question.text[one.span.start : one.span.end]!r}: {why}")
    if question.nearest is not None:
        lines.append(f"  nearest reading: {reasons.sentence(reading_in_words(question.nearest))}")
        lines.append(f"  to start that: --confirm-reading {question.nearest.digest}")
    return lines


def exit_code(status: str) -> int:
    """0 succeeded, 4 verified in part only, 3 waits for a person, is paused or has not begun, 1 any other end."""
    waits = ("awaiting_human", "paused", "awaiting_approval", "draft", "compiled")
    codes = {"succeeded": 0, "partly_verified": 4, **dict.fromkeys(waits, 3)}
    return codes.get(status, 1)


class ProgressPrinter:
    """Prints one line on standard error whenever a stage changes."""

    def __init__(self) -> None:
        self._seen: dict[str, str] = {}

    def __call__(self, mission: Mission) -> None:
        for node in mission.nodes.values():
            word = f"{node.status}{f' (attempt {node.attempt})' if node.attempt > 1 else ''}"
            if node.status != "pending" and self._seen.get(node.node_id) != word:
                self._seen[node.node_id] = word
                why = f": {node.failure.failure}, {reasons.sentence(node.failure.reason)}" if node.failure else ""
                sys.stderr.write(visible_at_terminal(f"k {mission.k:>3}  {node.node_id:<10} {word}{why}\n"))
        if mission.status != self._seen.get(""):
            self._seen[""] = mission.status
            sys.stderr.write(f"k {mission.k:>3}  {'mission':<10} {mission.status}\n")
        sys.stderr.flush()
