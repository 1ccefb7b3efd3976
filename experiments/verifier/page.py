"""Writes the verifier's matrix as tables and plots into docs/, between the marks of its page."""

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import msgspec

from experiments.verifier.matrix import Confusion, PredicateMatrix, VerifierReport
from rsi_reviews.evaluation.measures import ConfidenceInterval, exact
from rsi_reviews.evaluation.plots import BarGroup, bars

DOCS = Path(__file__).resolve().parents[2] / "docs"
BEGIN, END = "<!-- figures: written by `make campaign` -->", "<!-- end of figures -->"
MOST_REASONS = 8


def summary(report: VerifierReport) -> str:
    """The confusion matrix of all predicates, in Markdown."""
    rows = [
        f"| {one.predicate} | {one.total.cases:,} | {one.total.false:,} | {one.total.satisfied_true:,} "
        f"| {one.total.satisfied_false:,} | {one.total.refused_true:,} | {one.total.refused_false:,} "
        f"| {one.total.at_bound_satisfied:,} / {one.total.at_bound_refused:,} | {100 * one.false_bound:.2f} % |"
        for one in report.predicates
    ]
    head = (
        "| predicate | cases | of them false | satisfied, true | satisfied though false | refused though true "
        "| refused, false | at the bound: satisfied / refused | satisfied though false, at most |"
    )
    return "\n".join([head, "|---|---:|---:|---:|---:|---:|---:|---:|---:|", *rows])


def tables(report: VerifierReport, *, command: str, code: str) -> str:
    """All of the page that is written by code."""
    whole = sum(one.total.cases for one in report.predicates)
    parts = [
        f"{whole:,} cases with a truth, {report.cases:,} or more of each of {len(report.predicates)} predicates, seed "
        f"{report.seed}. Made by `{command}` on code `{code[:12]}`.",
        summary(report),
        _offences(report),
        "![How often a false condition was satisfied](verifier/satisfied-though-false.svg)",
        "![How often a true condition was refused](verifier/refused-though-true.svg)",
        "![What an unsatisfied condition was](verifier/verdicts.svg)",
        "### Faults that no gate can see",
        _epistemic(report),
        "### What is distinct",
        _pools(report),
        *(part for one in report.predicates for part in _predicate(one)),
    ]
    return "\n\n".join(parts)


def plots(report: VerifierReport) -> dict[str, str]:
    """File name without its suffix -> SVG text."""
    return {
        "satisfied-though-false": bars(
            "Satisfied though false",
            "share of the false cases, epistemic faults apart, 95 % Clopper-Pearson",
            list(_groups(report, ("all faults",), _wrongly_satisfied)),
            legend=("all faults",),
            most=0.02,
        ),
        "refused-though-true": bars(
            "Refused though true",
            "share of the true cases, 95 % Clopper-Pearson",
            list(_groups(report, ("no fault", "with a fault"), _wrongly_refused)),
            legend=("no fault", "with a fault"),
        ),
        "verdicts": bars(
            "What a condition was that was not satisfied",
            "share of those cases, 95 % Clopper-Pearson",
            list(_groups(report, VERDICTS, _verdict)),
            legend=VERDICTS,
        ),
    }


VERDICTS = ("violated", "ambiguous", "stale", "unsafe", "refused by the gate")


def publish(report: VerifierReport, *, command: str, code: str, docs: Path = DOCS) -> None:
    """Write the page's tables, the plots and the figures. Raises ValueError for a page without the two marks."""
    page = docs / "verifier.md"
    before, begin, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"{page.name} has no place for figures: {BEGIN} ... {END}")
    page.write_text(
        f"{before}{BEGIN}\n\n{tables(report, command=command, code=code)}\n\n{END}{after}", encoding="utf-8"
    )
    body = msgspec.json.encode({"command": command, "code": code, **msgspec.to_builtins(report)})
    (docs / "results" / "verifier.json").write_bytes(msgspec.json.format(body, indent=1) + b"\n")
    folder = docs / "verifier"
    folder.mkdir(exist_ok=True)
    for name, body_of_plot in plots(report).items():
        (folder / f"{name}.svg").write_text(body_of_plot, encoding="utf-8")


def _groups(
    report: VerifierReport, names: Sequence[str], share: Callable[[PredicateMatrix, str], ConfidenceInterval]
) -> Iterator[BarGroup]:
    for one in report.predicates:
        shares = [(at, f"{one.predicate}, {name}", share(one, name)) for at, name in enumerate(names)]
        yield one.predicate, [part for part in shares if part[2].n]


def _wrongly_satisfied(one: PredicateMatrix, name: str) -> ConfidenceInterval:
    return exact(one.total.satisfied_false, one.total.false)


def _wrongly_refused(one: PredicateMatrix, name: str) -> ConfidenceInterval:
    chosen = [found for fault, found in one.faults.items() if (fault == "none") == (name == "no fault")]
    return exact(sum(found.refused_true for found in chosen), sum(found.true for found in chosen))


def _verdict(one: PredicateMatrix, name: str) -> ConfidenceInterval:
    counts = {verdict: sum(reasons.values()) for verdict, reasons in one.verdicts.items()}
    return exact(counts.get(name, 0), sum(counts.values()))


def _offences(report: VerifierReport) -> str:
    """What must not be, plainly: a run with an offence is no success."""
    if not report.offences:
        return "No false condition was satisfied where a source spoke against it."
    return "\n".join(["What must not be, in this run:", "", *(f"- {line}" for line in report.offences)])


def _epistemic(report: VerifierReport) -> str:
    rows = [
        f"| {one.predicate} | {fault} | {found.satisfied_false:,} of {found.false:,} | {found.refused_true:,} of "
        f"{found.true:,} |"
        for one in report.predicates
        for fault, found in one.epistemic.items()
    ]
    head = "| predicate | fault | satisfied though false | refused though true |\n|---|---|---:|---:|"
    return "\n".join([head, *rows])


def _pools(report: VerifierReport) -> str:
    rows = [f"| {name} | {count:,} |" for name, count in report.pools.items()]
    return "\n".join(["| made once, and combined with faults | how many |", "|---|---:|", *rows])


def _predicate(one: PredicateMatrix) -> Iterator[str]:
    yield f"### {one.predicate}"
    head = "| fault | satisfied, true | satisfied though false | refused though true | refused, false | at the bound |"
    rows = [
        f"| {name} | {found.satisfied_true:,} | {found.satisfied_false:,} | {found.refused_true:,} "
        f"| {found.refused_false:,} | {_at_bound(found):,} |"
        for name, found in one.faults.items()
    ]
    yield "\n".join([head, "|---|---:|---:|---:|---:|---:|", *rows])
    reasons = [
        f"| {verdict} | {reason} | {count:,} |"
        for verdict, counts in one.verdicts.items()
        for reason, count in list(counts.items())[:MOST_REASONS]
    ]
    yield "\n".join(["| not satisfied | reason | cases |", "|---|---|---:|", *reasons])


def _at_bound(found: Confusion) -> int:
    return found.at_bound_satisfied + found.at_bound_refused
