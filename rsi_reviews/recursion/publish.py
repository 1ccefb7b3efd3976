"""Writes the results of a run: JSON, the figures of docs/recursion.md, and plots, with the command that
reproduces them.
"""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from harness.contracts.errors import ContractInvalid
from harness.contracts.reasons import because
from rsi_reviews.recursion.experiment import FleetOutcome, Terms
from rsi_reviews.recursion.plots import plot
from rsi_reviews.recursion.report import answers, by_kind, contrasts, rows
from rsi_reviews.recursion.run import blind_digest

BEGIN, END = "<!-- figures: written by `regen rsi recursion --publish` -->", "<!-- end of figures -->"
PLOTS = {
    "recovery_cost": ("Recovery cost on held-out missions", "per mission, with the whole budget of 8 for giving up"),
    "verified_completion": ("Verified completion on held-out missions", "share of missions"),
    "false_completion": ("Contract false completions on held-out missions", "per mission"),
}
COLUMNS = (
    "arm", "n", "verified_completion", "false_completion", "epistemic_false_completion", "handoffs", "recovery_cost",
    "mission_s", "proposed", "accepted", "gate_missions_per_release",
)  # fmt: skip
WORDS = {True: "**Refuted**", False: "Not refuted", None: "Not answered"}
Found = Mapping[str, Any]


def found(outcomes: Sequence[FleetOutcome], blind: Sequence[FleetOutcome], terms: Terms, *, fleets: int) -> Found:
    """The whole result as JSON values. `complete` says whether every fleet that was asked for is in it."""
    return {
        "seed": terms.seed,
        "command": command(terms, fleets),
        "terms": msgspec.to_builtins(terms),
        "fleets": len(outcomes),
        "fleets_asked": fleets,
        "complete": len(outcomes) == fleets,
        "simulated_missions": sum(outcome.simulated for outcome in (*outcomes, *blind)),
        "rows": rows(outcomes),
        "by_kind": by_kind(outcomes),
        "contrasts": msgspec.to_builtins(contrasts(outcomes)),
        "answers": msgspec.to_builtins(answers(outcomes)),
        "sites": [{"fleet": one.task.fleet, "site": one.task.site, "kind": one.kind} for one in outcomes],
        "steps": [_step(outcome, step) for outcome in outcomes for step in outcome.steps],
        "blind": _blind(blind),
    }


def command(terms: Terms, fleets: int) -> str:
    """The command that reproduces these figures."""
    return (
        f"regen rsi recursion --generations {terms.generations} --fleets {fleets} --missions {terms.measured} "
        f"--seed {terms.seed} --blind"
    )


def publish(result: Found, *, docs: Path) -> None:
    """Write JSON, page and plots under `docs`. Raises ContractInvalid if the page has lost its place for figures."""
    page = docs / "recursion.md"
    text = page.read_text(encoding="utf-8")
    if BEGIN not in text or END not in text:
        raise ContractInvalid(because("page_without_figures", begin=BEGIN, end=END), where=str(page))
    head, _, rest = text.partition(BEGIN)
    page.write_text(f"{head}{BEGIN}\n{figures(result)}\n{END}{rest.partition(END)[2]}", encoding="utf-8")
    (docs / "results").mkdir(parents=True, exist_ok=True)
    (docs / "results" / "recursion.json").write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    (docs / "recursion").mkdir(parents=True, exist_ok=True)
    for name, (title, unit) in PLOTS.items():
        svg = plot(result["rows"], measure=name, title=title, unit=unit)
        (docs / "recursion" / f"{name.replace('_', '-')}.svg").write_text(svg, encoding="utf-8")


def figures(result: Found) -> str:
    """The part of the page that a run writes."""
    last = max((row["generation"] for row in result["rows"]), default=0)
    lines = [
        "",
        f"`{result['command']}`: {result['fleets']} of {result['fleets_asked']} fleets, "
        f"{result['simulated_missions']} missions simulated. Per fleet and generation, "
        f"{result['terms']['recorded']} missions recorded and {result['terms']['measured']} measured; the gate took "
        f"{result['terms']['scale']['per_family']} pairs per family and "
        f"{result['terms']['scale']['held_out_per_family']} held out (20 and 20 at the desk). "
        "Intervals: 95 %, over fleets.",
        "",
        *(f"![{title}](recursion/{name.replace('_', '-')}.svg)\n" for name, (title, _) in PLOTS.items()),
        f"### After generation {last}",
        "",
        *_table([row for row in result["rows"] if row["generation"] == last]),
        "",
        "### What would have refuted the claim",
        "",
        *(f"- {WORDS[one['refuted']]}: {one['refutes']}. {one['sentence']}" for one in result["answers"]),
        "",
        "### Along the way",
        "",
        *(f"- {_contrast(one)}" for one in result["contrasts"] if one["over"] == "all"),
        "",
        "### Why candidates were refused",
        "",
        *_refused(result["rows"], last),
        "",
        "### By kind of site",
        "",
        *_table(result["by_kind"], first="kind"),
    ]
    if result["blind"]:
        lines += ["", "### The final test, opened once", "", f"Digest {result['blind']['digest']}.", ""]
        lines += _table(result["blind"]["last"])
        lines += ["", *(f"- {_contrast(one)}" for one in result["blind"]["contrasts"])]
    return "\n".join(lines) + "\n"


def _table(found: Sequence[Found], *, first: str = "") -> list[str]:
    columns = ((first,) if first else ()) + COLUMNS
    lines = [f"| {' | '.join(column.replace('_', ' ') for column in columns)} |", "|" + "---|" * len(columns)]
    for row in found:
        lines.append(f"| {' | '.join(_cell(row, column) for column in columns)} |")
    return lines


def _cell(row: Found, column: str) -> str:
    value = row.get(column)
    if value is None:
        return ""
    if f"{column}_ci" in row:
        low, high = row[f"{column}_ci"]
        digits = 0 if column == "mission_s" else 3
        return f"{value:.{digits}f} ({low:.{digits}f} to {high:.{digits}f})"
    return str(value)


def _refused(found: Sequence[Found], last: int) -> list[str]:
    lines = []
    for row in found:
        if row["generation"] == last and row["proposed"]:
            whys = ", ".join(f"{why} {count}" for why, count in row["rejected_why"].items()) or "none was refused"
            lines.append(f"- {row['arm']}: {row['accepted']} of {row['proposed']} accepted; {whys}.")
    return lines


def _contrast(one: Found) -> str:
    measure = one["measure"].replace("_", " ")
    when = "after the last generation" if one["over"] == "last" else "over all generations"
    return (
        f"gated against {one['against']}, {when}: {measure} better by {one['gain']:.3f} "
        f"({one['low']:.3f} to {one['high']:.3f}, {one['fleets']} fleets)"
    )


def _step(outcome: FleetOutcome, step: Any) -> dict[str, Any]:
    judged = step.judgement
    return {
        "fleet": outcome.task.fleet,
        "site": outcome.task.site,
        "arm": step.arm,
        "generation": step.generation,
        "accepted": judged.accepted,
        "clause": judged.clause,
        "reason": judged.reason,
        "sentence": judged.sentence,
        "metric": judged.metric,
        "missions": judged.missions,
    }


def _blind(blind: Sequence[FleetOutcome]) -> dict[str, Any]:
    if not blind:
        return {}
    last = max(one.generation for outcome in blind for one in outcome.measured)
    every = rows(blind)
    return {
        "digest": blind_digest(),
        "rows": every,
        "last": [row for row in every if row["generation"] == last],
        "contrasts": msgspec.to_builtins(contrasts(blind)),
        "sites": [{"fleet": one.task.fleet, "site": one.task.site} for one in blind],
        "steps": [_step(outcome, step) for outcome in blind for step in outcome.steps],
    }
