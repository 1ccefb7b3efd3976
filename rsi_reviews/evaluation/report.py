"""Builds the evaluation report from judged missions, loads and saves it as JSON, and renders it as Markdown tables.

A console page shows `load(path)`; every cell names the command and the seeds that reproduce it.
"""

from collections.abc import Sequence
from pathlib import Path

import msgspec

from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.ids import Digest
from harness.contracts.reasons import because
from harness.contracts.values import Count, Name, Value
from rsi_reviews.evaluation.arms import ABLATIONS, ARMS, COMPARED
from rsi_reviews.evaluation.measures import Cell, ConfidenceInterval, JudgedMission, cell
from rsi_reviews.evaluation.missions import CONDITIONS
from rsi_reviews.evaluation.protocol import ProtocolRequest
from rsi_reviews.evaluation.roles import RoleReport
from rsi_reviews.evaluation.suites import Check

BEGIN, END = "<!-- figures: written by `regen evaluate --publish` -->", "<!-- end of figures -->"
RATES = (
    ("contract_false", "contract false completion"),
    ("epistemic_false", "epistemic false completion"),
    ("duplicate_starts", "duplicate physical start"),
    ("false_rejection", "false rejection"),
    ("handoff", "handoff"),
)


class Label(Value):
    """A name and its meaning, for readers."""

    name: Name
    text: str


class EvaluationReport(Value):
    """One run of the protocol. `cells` in the order of conditions, then arms; `suites` the two check suites (R226)."""

    command: str
    seed: Count
    missions_per_cell: Count
    code: Digest
    arms: tuple[Label, ...]
    conditions: tuple[Label, ...]
    cells: tuple[Cell, ...]
    roles: RoleReport
    suites: tuple[Check, ...] = ()
    worst: tuple[str, ...] = ()

    def cell(self, arm: str, condition: str) -> Cell | None:
        """The row of an arm under a condition, if it was run."""
        return next((one for one in self.cells if (one.arm, one.condition) == (arm, condition)), None)


def evaluation(
    rows: Sequence[JudgedMission], ask: ProtocolRequest, *, code: Digest, roles: RoleReport, suites: tuple[Check, ...]
) -> EvaluationReport:
    """All rows of one run, added up."""
    cells = []
    for condition in CONDITIONS:
        for arm in ask.arms:
            mine = [row for row in rows if (row.arm, row.condition) == (arm, condition.name)]
            if mine:
                cells.append(cell(mine, command=_command(ask, arms=(arm,), conditions=(condition.name,))))
    return EvaluationReport(
        command=_command(ask, arms=ask.arms, conditions=ask.conditions),
        seed=ask.seed,
        missions_per_cell=ask.missions,
        code=code,
        arms=tuple(Label(name=one.name, text=one.text) for one in ARMS if one.name in ask.arms),
        conditions=tuple(Label(name=one.name, text=one.text) for one in CONDITIONS if one.name in ask.conditions),
        cells=tuple(cells),
        roles=roles,
        suites=suites,
        worst=_worst(rows),
    )


def load(path: Path) -> EvaluationReport:
    """A published evaluation. Raises UnknownName where there is none, ContractInvalid where it cannot be read."""
    if not path.exists():
        raise UnknownName(because("no_published_evaluation"), where=str(path))
    try:
        return msgspec.json.decode(path.read_bytes(), type=EvaluationReport)
    except msgspec.MsgspecError as error:
        raise ContractInvalid(because("published_evaluation_unreadable", error=str(error)), where=str(path)) from error


def save(found: EvaluationReport, path: Path) -> None:
    """Write indented JSON, for readers and for a console."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(msgspec.json.format(msgspec.json.encode(found), indent=1) + b"\n")


def with_figures(page: str, found: EvaluationReport) -> str:
    """The page with these figures between its two marks; raises ContractInvalid without the marks."""
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ContractInvalid(because("page_without_figures", begin=BEGIN, end=END), where=f"{BEGIN} ... {END}")
    return f"{before}{BEGIN}\n\n{figures(found)}\n{END}{after}"


def figures(found: EvaluationReport) -> str:
    """Everything that was measured, as Markdown."""
    parts = [
        f"Made by `{found.command}`; code {found.code[:12]}; {found.missions_per_cell} missions per cell.",
        "",
        "### The arms",
        "",
        *(line for condition in found.conditions for line in _condition(found, condition, COMPARED)),
        "### The ablations",
        "",
        *(line for condition in found.conditions for line in _condition(found, condition, ABLATIONS)),
        *_roles(found.roles),
        *_overhead(found),
        *_recovery(found),
        *_suites(found.suites),
        *_sentences(found),
    ]
    return "\n".join(parts)


def _condition(found: EvaluationReport, condition: Label, arms: Sequence[str]) -> list[str]:
    cells = [one for name in arms if (one := found.cell(name, condition.name)) is not None]
    if not cells:
        return []
    lines = [f"**{condition.name}**: {condition.text}.", ""]
    lines += ["| arm | success | " + " | ".join(title for _, title in RATES) + " | recovery spent | n |"]
    lines += ["|---" * (len(RATES) + 4) + "|"]
    for one in cells:
        rates = " | ".join(rate_text(getattr(one, name)) for name, _ in RATES)
        broken = f" ({one.recovery['broken']} broken)" if one.recovery.get("broken") else ""
        lines.append(f"| {one.arm}{broken} | {rate_text(one.success)} | {rates} | {mean(one.spent_mean)} | {one.n} |")
    again = cells[0].command.replace(f"--arms {cells[0].arm}", "--arms ARM")
    return [*lines, "", f"A row again, mission by mission the same: `{again}`, seeds {cells[0].seeds}.", ""]


def rate_text(rate: ConfidenceInterval) -> str:
    """A share in percent with its exact interval."""
    return f"{100 * rate.value:.0f} % ({100 * rate.low:.1f}..{100 * rate.high:.1f})"


def mean(figure: ConfidenceInterval, *, digits: int = 2) -> str:
    """A mean with its bootstrap interval."""
    return f"{figure.value:.{digits}f} ({figure.low:.{digits}f}..{figure.high:.{digits}f})"


def _roles(roles: RoleReport) -> list[str]:
    lines = ["**no role-isolated contexts** (a model as verifier over adversarial contexts):", ""]
    shares = (roles.isolated_fooled, roles.isolated_refused, roles.shared_fooled, roles.shared_refused)
    texts = [rate_text(share) for share in shares if share is not None]
    if not roles.tested or len(texts) < len(shares):
        return [*lines, "not tested: it needs a model (`regen evaluate --model NAME --model-url URL`).", ""]
    return [
        *lines,
        f"Model {roles.model}, {roles.trials} adversarial contexts, {roles.controls} controls, "
        f"{roles.unanswered} unanswered.",
        "",
        "| contexts | talked into accepting | refused though shown |",
        "|---|---|---|",
        f"| isolated (C3 alone) | {texts[0]} | {texts[1]} |",
        f"| shared with planner and provider | {texts[2]} | {texts[3]} |",
        "",
    ]


def _overhead(found: EvaluationReport) -> list[str]:
    cells = [one for one in found.cells if one.condition == "nominal"]
    if not cells:
        return []
    lines = ["### Overhead, nominal", "", "| arm | mission seconds | CPU seconds per start |", "|---|---|---|"]
    for one in cells:
        lines.append(
            f"| {one.arm} | {mean(one.mission_s_mean, digits=1)} | {mean(one.cpu_per_stage_s_mean, digits=4)} |"
        )
    note = "CPU includes the simulated robot, which is the same for all; the difference to `direct` is the arm's own."
    return [*lines, "", note, ""]


def _recovery(found: EvaluationReport) -> list[str]:
    """How recovery ended, apart from nominal success (R232)."""
    lines = ["### How recovery ended", "", "| arm | condition | missions by end |", "|---|---|---|"]
    for one in found.cells:
        if one.condition != "nominal":
            ends = ", ".join(f"{name} {count}" for name, count in one.recovery.items())
            lines.append(f"| {one.arm} | {one.condition} | {ends} |")
    return [*lines, ""]


def _suites(suites: Sequence[Check]) -> list[str]:
    if not suites:
        return []
    lines = ["### The two check suites", "", "| suite | check | holds | seen |", "|---|---|---|---|"]
    lines += [f"| {one.suite} | {one.text} | {'yes' if one.holds else 'NO'} | {one.seen} |" for one in suites]
    return [*lines, ""]


def _sentences(found: EvaluationReport) -> list[str]:
    if not found.worst:
        return []
    return ["### In the adjudicator's words", "", *(f"- {sentence}" for sentence in found.worst), ""]


def _worst(rows: Sequence[JudgedMission]) -> tuple[str, ...]:
    """One example sentence per arm and condition that has a finding."""
    first: dict[tuple[str, str], str] = {}
    for row in rows:
        if row.notes:
            text = f"{row.arm}, {row.condition}, {row.mission}, seed {row.seed}: {row.notes[0]}"
            first.setdefault((row.arm, row.condition), text)
    return tuple(first.values())


def _command(ask: ProtocolRequest, *, arms: Sequence[str], conditions: Sequence[str]) -> str:
    words = ["regen evaluate", f"--missions {ask.missions}", f"--seed {ask.seed}"]
    if len(arms) < len(ARMS):
        words.append(f"--arms {','.join(arms)}")
    if len(conditions) < len(CONDITIONS):
        words.append(f"--faults {','.join(conditions)}")
    return " ".join(words)
