"""Reads the published goal set and prints what starts: `python -m experiments.goals.run`.

Each goal is read, planned and compiled exactly as a start would be; nothing is run. A goal may start only with the
expected clauses; anything else that starts is a wrong start. Exit 1 for a wrong start in the frozen part, for more than
a tenth of it refused, or where its digest is not the one that was committed before the grammar.
"""

import argparse
import hashlib
import json
import sys
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from harness.baseline.load import baseline, shipped_workspace, site
from harness.contracts.errors import HarnessError
from harness.contracts.readings import Clause, Reading
from harness.goals.understanding import GoalRequest, compiled, understand

FOLDER = Path(__file__).parent
FROZEN = 210
MOST_REFUSED = 0.10
Answer = Literal["right start", "wrong start", "refused", "right ask"]
ANSWERS: tuple[Answer, ...] = ("right start", "wrong start", "refused", "right ask")
ComparedClause = tuple[str, str | None, bool, int, int | None]
"""A clause to compare: act, object, negated, count, seconds."""
LOOKS = ("inspect", "photograph", "describe", "wait")
PART_OF = ("inspect", "describe", "explore")


@dataclass(frozen=True)
class GoalOutcome:
    """What became of one goal; `read` are the clauses that would have started, `why` the refusal."""

    goal: dict[str, Any]
    answer: Answer
    read: tuple[ComparedClause, ...]
    why: str


def outcome(goal: dict[str, Any]) -> GoalOutcome:
    """One goal, read and compiled as a start would be."""
    expectation = goal["expect"]
    templates = (*baseline().templates, *shipped_workspace().missions)
    try:
        found = understand(GoalRequest(text=goal["text"]), templates=templates, site=site())
        contract = compiled(found, templates=templates, site=site(), arguments={})
    except HarnessError as error:
        return GoalOutcome(
            goal, "refused" if expectation["outcome"] == "start" else "right ask", (), f"{error.code}: {error}"
        )
    read = compared_clauses(contract.reading) if isinstance(contract.reading, Reading) else ()
    right = expectation["outcome"] == "start" and same(read, [expected(one) for one in expectation["clauses"]])
    return GoalOutcome(goal, "right start" if right else "wrong start", read, "")


def compared_clauses(reading: Reading) -> tuple[ComparedClause, ...]:
    """A reading's clauses for the comparison."""
    return tuple(_compared_clause(clause) for clause in reading.clauses)


def _compared_clause(clause: Clause) -> ComparedClause:
    named = clause.object.id if clause.object and clause.object.id else None
    seconds = clause.seconds if isinstance(clause.seconds, int) else None
    return clause.act, named, clause.negated, clause.count, seconds


def expected(clause: dict[str, Any]) -> ComparedClause:
    """A clause of the goal set."""
    count = clause.get("count", 1)
    return clause["act"], clause.get("object"), clause.get("negated", False), count, clause.get("seconds")


def same(one: Sequence[ComparedClause], other: Sequence[ComparedClause]) -> bool:
    """Whether two readings are the same, by the rules of `experiments/goals/README.md`."""
    negated = [{clause for clause in clauses if clause[2]} for clauses in (one, other)]
    return negated[0] == negated[1] and plain(one) == plain(other)


def plain(clauses: Iterable[ComparedClause]) -> list[ComparedClause]:
    """The clauses to be done, without what is told in two ways."""
    found: list[ComparedClause] = []
    names = [_named(clause) for clause in clauses if not clause[2]]
    for index, clause in enumerate(names):
        act, named, _, count, seconds = clause
        following = names[index + 1] if index + 1 < len(names) else None
        if act == "go" and following and following[0] in LOOKS and following[1] == named:
            continue
        if act == "report" and named is None and any(one[0] in PART_OF for one in names[:index]):
            continue
        if found and found[-1][:2] == (act, named):
            found[-1] = (act, named, False, found[-1][3] + count, seconds)
            continue
        found.append(clause)
    if found and found[-1][:2] == ("go", "anchor_a"):
        found[-1] = ("return", None, False, found[-1][3], None)
    return found


def _named(clause: ComparedClause) -> ComparedClause:
    act, named, negated, count, seconds = clause
    if act == "inspect" and named == "storage_passage":
        named = "office_storage"
    if act == "return" and named == "anchor_a":
        named = None
    return act, named, negated, count, seconds


def table(outcomes: Sequence[GoalOutcome]) -> list[str]:
    """The confusion matrix by language and kind, as Markdown."""
    lines = ["| kind | language | " + " | ".join(ANSWERS) + " |", "|---|---|" + "---|" * len(ANSWERS)]
    kinds = dict.fromkeys((str(one.goal["kind"]), str(one.goal["language"])) for one in outcomes)
    for kind, language in sorted(kinds):
        mine = Counter(one.answer for one in outcomes if (one.goal["kind"], one.goal["language"]) == (kind, language))
        lines.append(f"| {kind} | {language} | " + " | ".join(str(mine[answer]) for answer in ANSWERS) + " |")
    every = Counter(one.answer for one in outcomes)
    return [*lines, "| all | | " + " | ".join(str(every[answer]) for answer in ANSWERS) + " |"]


def refused_share(outcomes: Sequence[GoalOutcome]) -> float:
    """How much of what should be understood was refused."""
    startable = [one for one in outcomes if one.goal["expect"]["outcome"] == "start"]
    return sum(one.answer == "refused" for one in startable) / len(startable) if startable else 0.0


def goals(text: str) -> list[dict[str, Any]]:
    """The goals of a file with one JSON object a line."""
    return [json.loads(line) for line in text.splitlines() if line]


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the matrices of both parts and, with `--misses`, every goal that went wrong."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--misses", choices=("frozen", "open", "all"))
    chosen = parser.parse_args(arguments)
    text = (FOLDER / "goals.jsonl").read_text(encoding="utf-8")
    body = "".join(text.splitlines(keepends=True)[:FROZEN]).encode()
    frozen_digest = (FOLDER / "frozen.sha256").read_text(encoding="utf-8").split()[0]
    outcomes = [outcome(goal) for goal in goals(text)]
    parts = {part: [one for one in outcomes if one.goal["split"] == part] for part in ("frozen", "open")}
    for part, found in parts.items():
        wrong = sum(one.answer == "wrong start" for one in found)
        print(f"\n## {part}: {len(found)} goals, {wrong} wrong starts, {refused_share(found):.1%} refused\n")
        print("\n".join(table(found)))
        for one in found if chosen.misses in (part, "all") else ():
            if one.answer in ("wrong start", "refused"):
                print(f"{one.answer}: {one.goal['id']} {one.goal['text']!r} wanted {one.goal['expect']}", end=" ")
                print(one.read or one.why)
    held = hashlib.sha256(body).hexdigest() == frozen_digest
    print(f"\nfrozen part {'as committed before the grammar' if held else 'CHANGED'}: {frozen_digest}")
    good = held and all(one.answer != "wrong start" for one in parts["frozen"])
    return 0 if good and refused_share(parts["frozen"]) <= MOST_REFUSED else 1


if __name__ == "__main__":
    sys.exit(main())
