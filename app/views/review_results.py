"""Shapes what an evaluation measured: what became worse, paired gains with their intervals, and the list of cases."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from app.i18n.catalogues import N_
from app.i18n.messages import word
from app.views.axes import ticks
from app.views.list_params import address
from app.views.shell import Shell
from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.values import Count, Value
from rsi_reviews import contracts
from rsi_reviews.bounds import paired
from rsi_reviews.projections import Review

TWO_SIDED = 0.025
WIDTH = 640.0
ROW = 26.0
LABELS, MARGIN = 140.0, 16.0
"""Where the names of the rows end on the plot, and what is left free right of the scale."""
FLIPS = 50
Pair = tuple[contracts.CaseResult, contracts.CaseResult]
"""The same case under the baseline and under the candidate."""
SHOWN = 200
CHANGES = ("", N_("pass to fail"), N_("fail to pass"), "worse", "better", "same")
ORDER = {change: place for place, change in enumerate(CHANGES)}


class CaseRow(Value):
    """One case under both configurations. `before` and `after` are the declared metric, `change` which way it went."""

    case: str
    family: str
    seed: int
    situation: str
    before: float
    after: float
    before_status: str
    after_status: str
    change: str
    note: str


class Family(Value):
    """Pairs of one family, or of all, with the means of the declared metric and the 95 % interval of their difference.

    `better_by` is positive where the candidate is better.
    """

    family: str
    n: Count
    baseline: float
    candidate: float
    better_by: float
    low: float
    high: float


@dataclass(frozen=True)
class FamilyRow:
    """A family with its flips; `x`, `low_x`, `high_x`, `y` are places on the plot, in its own units."""

    result: Family
    worse: int
    better: int
    x: float
    low_x: float
    high_x: float
    y: float


@dataclass(frozen=True)
class PlotShape:
    """The plot's size without its axis, where no effect and the declared effect lie on it, and the axis's ticks."""

    width: float
    height: float
    left_x: float
    zero_x: float
    declared_x: float
    ticks: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class MeasuredResults:
    """Everything that is shown of a result set. `worse` and `better` hold at most FLIPS rows each, of so many."""

    pairs: int
    safety_pairs: int
    worse: tuple[CaseRow, ...]
    worse_total: int
    better: tuple[CaseRow, ...]
    better_total: int
    families: tuple[FamilyRow, ...]
    plot: PlotShape
    seconds: float


def measured(
    results: contracts.ResultSet,
    manifest: contracts.Manifest,
    regression: Collection[str],
    situations: Mapping[str, str],
) -> MeasuredResults:
    """`regression`: the cases that the declared metric is judged on; `situations` says in words what a case is."""
    pairs = pairs_of(results, manifest.baseline)
    judged = [pair for pair in pairs if pair[0].case in regression] or pairs
    worse = [pair for pair in pairs if passes(pair[0]) and not passes(pair[1])]
    better = [pair for pair in pairs if not passes(pair[0]) and passes(pair[1])]
    families, shape = _families(judged, pairs, manifest, key=results.terms)
    return MeasuredResults(
        pairs=len(judged),
        safety_pairs=len(pairs),
        worse=tuple(case_row(pair, manifest.metric, situations) for pair in worse[:FLIPS]),
        worse_total=len(worse),
        better=tuple(case_row(pair, manifest.metric, situations) for pair in better[:FLIPS]),
        better_total=len(better),
        families=families,
        plot=shape,
        seconds=results.seconds,
    )


def pairs_of(results: contracts.ResultSet, baseline: str) -> list[Pair]:
    """Cases that have a result under both configurations, in the order in which they were run."""
    before = {one.case: one for one in results.results if one.configuration == baseline}
    return [(before[one.case], one) for one in results.results if one.configuration != baseline and one.case in before]


def passes(result: contracts.CaseResult) -> bool:
    """Verified completion, without any false completion, duplicate start or safety violation."""
    broken = (
        result.contract_false_completion + result.epistemic_false_completion
        + result.duplicate_starts + result.safety_violations
    )  # fmt: skip
    return result.outcome == "finished" and result.verified_completion >= 1.0 and not broken


def case_row(pair: Pair, metric: contracts.Metric, situations: Mapping[str, str]) -> CaseRow:
    before, after = pair
    gain = _gain(pair, metric)
    flip = {(True, False): N_("pass to fail"), (False, True): N_("fail to pass")}.get((passes(before), passes(after)))
    return CaseRow(
        case=before.case,
        family=before.family,
        seed=before.seed,
        situation=situations.get(before.case, ""),
        before=getattr(before, metric),
        after=getattr(after, metric),
        before_status=before.status or before.outcome,
        after_status=after.status or after.outcome,
        change=flip or ("worse" if gain < 0 else "better" if gain > 0 else "same"),
        note=after.note,
    )


def _gain(pair: Pair, metric: contracts.Metric) -> float:
    difference = float(getattr(pair[1], metric) - getattr(pair[0], metric))
    return difference if contracts.BETTER[metric] == "higher" else -difference


def _families(
    judged: Sequence[Pair], every: Sequence[Pair], manifest: contracts.Manifest, *, key: str
) -> tuple[tuple[FamilyRow, ...], PlotShape]:
    parts = {name: [pair for pair in judged if pair[0].family == name] for name in contracts.FAMILIES}
    flips = {name: [pair for pair in every if pair[0].family == name] for name in contracts.FAMILIES}
    named = [("all", list(judged), list(every))]
    named += [(name, part, flips[name]) for name, part in parts.items() if part]
    found = []
    for name, part, whole in named:
        strata = parts if name == "all" else {name: part}
        gains = {one: [_gain(pair, manifest.metric) for pair in pairs] for one, pairs in strata.items() if pairs}
        if gains:
            interval = paired(gains, key=f"page\n{key}\n{name}", alpha=TWO_SIDED)
            found.append((name, part, whole, (interval.mean, interval.low, interval.high)))
    ends = [value for *_, three in found for value in three] + [0.0, manifest.smallest_effect]
    left, right = min(ends), max(ends)
    span = (right - left) or 1.0

    def place(value: float) -> float:
        return round(LABELS + MARGIN + (value - left) / span * (WIDTH - LABELS - 2 * MARGIN), 1)

    rows = tuple(
        FamilyRow(
            result=Family(
                family=word(name),
                n=len(part),
                baseline=_mean(part, 0, manifest.metric),
                candidate=_mean(part, 1, manifest.metric),
                better_by=gain,
                low=low,
                high=high,
            ),
            worse=sum(passes(one) and not passes(other) for one, other in whole),
            better=sum(not passes(one) and passes(other) for one, other in whole),
            x=place(gain),
            low_x=place(low),
            high_x=place(high),
            y=ROW * (index + 0.5),
        )
        for index, (name, part, whole, (gain, low, high)) in enumerate(found)
    )
    return rows, PlotShape(
        width=WIDTH,
        height=ROW * len(rows),
        left_x=LABELS,
        zero_x=place(0.0),
        declared_x=place(manifest.smallest_effect),
        ticks=tuple((place(value), value) for value in ticks(left, right)),
    )


def _mean(pairs: Sequence[Pair], side: int, metric: contracts.Metric) -> float:
    return sum(float(getattr(pair[side], metric)) for pair in pairs) / len(pairs)


@dataclass(frozen=True)
class CaseTab:
    """One kind of change as a tab, with its number of cases."""

    title: str
    href: str
    count: int
    chosen: bool


@dataclass(frozen=True)
class CasesPage:
    """The cases that the address asks for, those that became worse first."""

    shell: Shell
    candidate: str
    metric: str
    tabs: tuple[CaseTab, ...]
    families: tuple[CaseTab, ...]
    rows: tuple[CaseRow, ...]
    found: int
    following: str


def cases_page(
    shell: Shell,
    review: Review,
    results: contracts.ResultSet,
    situations: Mapping[str, str],
    *,
    change: str,
    family: str,
    skip: int,
) -> CasesPage:
    """Raises UnknownName for an unknown tab and ContractInvalid for a negative `skip`."""
    if change not in CHANGES or family not in ("", *contracts.FAMILIES):
        raise UnknownName(
            f"There are no cases called {change[:40]} {family[:40]}".strip(), do=N_("choose one of the tabs")
        )
    if review.manifest is None or skip < 0:
        raise ContractInvalid(f"{skip} is no place in a list", where="skip", do=N_("begin at the first page"))
    metric = review.manifest.metric
    every = [case_row(pair, metric, situations) for pair in pairs_of(results, review.baseline)]
    of_family = [one for one in every if family in ("", one.family)]
    chosen = sorted((one for one in of_family if change in ("", one.change)), key=lambda one: ORDER[one.change])
    path, params = f"/candidates/{review.candidate}/cases", {"change": change, "family": family}
    more = skip + SHOWN < len(chosen)
    return CasesPage(
        shell=shell,
        candidate=review.candidate,
        metric=word(metric),
        tabs=tuple(
            CaseTab(
                title=one or "all",
                href=address(path, params, change=one),
                count=sum(one in ("", row.change) for row in of_family),
                chosen=one == change,
            )
            for one in CHANGES
        ),
        families=tuple(
            CaseTab(
                title=word(one) if one else N_("every family"),
                href=address(path, params, family=one),
                count=sum(one in ("", row.family) for row in every),
                chosen=one == family,
            )
            for one in ("", *contracts.FAMILIES)
        ),
        rows=tuple(chosen[skip : skip + SHOWN]),
        found=len(chosen),
        following=address(path, params, skip=str(skip + SHOWN)) if more else "",
    )
