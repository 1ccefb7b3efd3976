"""Shapes the list of candidates: the status of each, what it changes, and who proposed it."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from app.i18n.catalogues import N_
from app.i18n.messages import lazy_gettext, listed, reasoned, word
from app.views.list_params import Filter, Option, Paging, address
from app.views.refused_proposals import RefusedRow, refused_rows
from app.views.shell import Shell
from harness.contracts.ids import Digest
from harness.contracts.reasons import Explanation
from rsi_reviews.clause_reasons import clause_reason
from rsi_reviews.contracts import ClauseAnswer, Manifest
from rsi_reviews.difference import NAMES
from rsi_reviews.evaluation_jobs import EvaluationJob
from rsi_reviews.pointers import Pointer
from rsi_reviews.projections import Review
from rsi_reviews.refused_proposals import ProposalRefused

SHOWN = 100
REFUSED = "refused"
"""The tab of proposals that a rule refused: no candidates, and kept."""
EVALUATION_CANCELLED, EVALUATION_FAILED = N_("evaluation cancelled"), N_("evaluation failed")
GROUPS: tuple[tuple[str, str, tuple[str, ...]], ...] = (
    ("", "all", ()),
    ("draft", "drafts", ("draft", EVALUATION_CANCELLED, EVALUATION_FAILED)),
    ("evaluating", "evaluating", ("evaluating",)),
    ("accepted", "accepted", ("accepted",)),
    ("in_review", N_("in review"), ("in_review",)),
    ("authorised", "authorised", ("authorised",)),
    ("canary", "canary", ("canary",)),
    ("current", "current", ("current",)),
    ("not_accepted", N_("rejected, inconclusive"), ("rejected", "inconclusive")),
    ("taken_back", N_("rolled back, withdrawn"), ("rolled_back", "withdrawn")),
    (REFUSED, "refused", (REFUSED,)),
)
TONES = {"in_review": "warn", "authorised": "warn", "rejected": "bad", "rolled_back": "bad", "current": "good"}


@dataclass(frozen=True)
class CandidateRow:
    """One candidate in the list, with the status that people see.

    `stale`: its baseline is no longer current, so nobody can approve it.
    """

    review: Review
    manifest: Manifest
    note: str
    stale: bool
    status: str


@dataclass(frozen=True)
class Tab:
    """One tab of the list with its number of candidates."""

    title: str
    href: str
    count: int
    chosen: bool


@dataclass(frozen=True)
class BoardPage:
    """The list that the address asks for. `total` counts all candidates, `query` is the query string of the address.

    `refused` are the proposals that a rule refused, shown in a tab of their own.
    """

    shell: Shell
    tabs: tuple[Tab, ...]
    rows: tuple[CandidateRow, ...]
    refused: tuple[RefusedRow, ...]
    words: str
    group: str
    filters: tuple[Filter, ...]
    total: int
    query: str
    paging: Paging


@dataclass(frozen=True)
class CandidateListParams:
    """What the address asks for; `skip` rows were shown on earlier pages."""

    words: str = ""
    group: str = ""
    component: str = ""
    metric: str = ""
    skip: int = 0

    @property
    def params(self) -> dict[str, str]:
        return {"q": self.words, "status": self.group, "component": self.component, "metric": self.metric}


def board_page(
    shell: Shell,
    reviews: Sequence[Review],
    pointer: Pointer,
    params: CandidateListParams,
    progress: Mapping[Digest, str],
    refused: Sequence[ProposalRefused] = (),
    jobs: Mapping[Digest, EvaluationJob | None] = MappingProxyType({}),
) -> BoardPage:
    """`reviews` newest first; `progress` says of a candidate under evaluation how far it is, `jobs` are the newest."""
    known = [one for one in reviews if one.manifest is not None]
    alike = [one for one in known if _like(one, params)]
    refusals = refused_rows(refused, params.words)
    status_of = {one.candidate: status_shown(one, jobs.get(one.candidate)) for one in reviews}
    statuses = Counter({REFUSED: len(refusals)}) + Counter(status_of[one.candidate] for one in alike)
    chosen = _statuses(params.group, Counter(status_of.values()))
    rows = [one for one in alike if status_of[one.candidate] in chosen]
    part = rows[params.skip : params.skip + SHOWN]
    more = params.skip + SHOWN < len(rows)
    return BoardPage(
        shell=shell,
        tabs=tuple(_tab(params, value, title, statuses) for value, title, _ in GROUPS),
        rows=tuple(
            CandidateRow(
                review=one,
                manifest=one.manifest,
                note=progress.get(one.candidate) or note_of(one),
                stale=stale(one, pointer),
                status=status_of[one.candidate],
            )
            for one in part
            if one.manifest is not None
        ),
        refused=refusals[:SHOWN] if params.group == REFUSED else (),
        words=params.words,
        group=params.group,
        filters=_filters(known, params),
        total=len(known),
        query=address("", params.params),
        paging=Paging(
            shown=len(part),
            found=str(len(rows)),
            following=address("/candidates", params.params, skip=str(params.skip + SHOWN)) if more else "",
            first=address("/candidates", params.params) if params.skip else "",
        ),
    )


def chosen(reviews: Sequence[Review], params: CandidateListParams) -> list[Review]:
    """The candidates that the address asks for, in the given order."""
    statuses = _statuses(params.group, Counter(str(one.status) for one in reviews))
    return [one for one in reviews if one.status in statuses and _like(one, params)]


def title_of(review: Review) -> str:
    """The intended effect from the manifest; the digest if there is none."""
    return review.manifest.intended_effect.strip().rstrip(".") if review.manifest else review.candidate[:12]


def status_shown(review: Review, job: EvaluationJob | None) -> str:
    """The status as people see it: where the newest evaluation was cancelled or failed, nothing evaluates any more."""
    if review.status == "evaluating" and job is not None:
        return {"cancelled": EVALUATION_CANCELLED, "failed": EVALUATION_FAILED}.get(job.status, str(review.status))
    return str(review.status)


def clause_sentence(answer: ClauseAnswer, review: Review, job: EvaluationJob | None) -> Explanation:
    """Why a clause was answered so, with the status that people see."""
    return clause_reason(answer, review, status=status_shown(review, job))


def tone(status: str) -> str:
    return TONES.get(status, "plain")


def metric(manifest: Manifest) -> str:
    """What must get better, and which way."""
    return listed((word(manifest.metric), manifest.direction))


def stale(review: Review, pointer: Pointer) -> bool:
    """Whether it still waits for somebody although its baseline is no longer current."""
    waits = review.status in ("draft", "evaluating", "accepted", "in_review", "authorised")
    return waits and bool(pointer.version) and review.baseline != pointer.configuration


def note_of(review: Review) -> str:
    """A short remark beside the status."""
    match review.status:
        case "in_review":
            if not review.approvals:
                return lazy_gettext("cycle {cycle}. No approvals yet", cycle=review.cycle)
            return lazy_gettext("cycle {cycle}, approvals: {count}", cycle=review.cycle, count=len(review.approvals))
        case "canary":
            needed = review.manifest.canary.missions if review.manifest else 0
            return lazy_gettext(
                "on {robot_id}, exercised in {count} of {needed} missions",
                robot_id=review.robot_id,
                count=len(review.exercised),
                needed=needed,
            )
        case "rejected" | "rolled_back" | "withdrawn" | "current":
            return reasoned(review.ended_reason)
        case "inconclusive":
            open_clause = next((one for one in _clauses(review) if one.answer != "pass"), None)
            return reasoned(clause_reason(open_clause, review)) if open_clause else ""
        case _:
            return ""


def _clauses(review: Review) -> tuple[ClauseAnswer, ...]:
    return review.evaluation.report.clauses if review.evaluation else ()


def _statuses(group: str, counted: Counter[str]) -> set[str]:
    stands_for = next((statuses for value, _, statuses in GROUPS if value == group), ())
    return set(stands_for) or set(counted) - {REFUSED}


def _like(review: Review, params: CandidateListParams) -> bool:
    manifest = review.manifest
    if manifest is None:
        return False
    text = f"{review.candidate} {manifest.reason} {manifest.intended_effect} {' '.join(sorted(review.authors))}".lower()
    return (
        all(word in text for word in params.words.lower().split())
        and params.component in ("", manifest.component)
        and params.metric in ("", manifest.metric)
    )


def _tab(params: CandidateListParams, value: str, title: str, statuses: Counter[str]) -> Tab:
    return Tab(
        title=title,
        href=address("/candidates", params.params, status=value),
        count=sum(statuses[one] for one in _statuses(value, statuses)),
        chosen=value == params.group,
    )


def _filters(known: Sequence[Review], params: CandidateListParams) -> tuple[Filter, ...]:
    components = Counter(one.manifest.component for one in known if one.manifest)
    metrics = Counter(one.manifest.metric for one in known if one.manifest)
    named = [(value, NAMES[value], count) for value, count in sorted(components.items())]
    measured = [(value, word(value), count) for value, count in sorted(metrics.items())]
    return (
        Filter(name="component", title="component", options=_options(named, params.component)),
        Filter(name="metric", title="metric", options=_options(measured, params.metric)),
    )


def _options(values: Sequence[tuple[str, str, int]], chosen: str) -> tuple[Option, ...]:
    first = Option(value="", title="any", count=0, chosen=not chosen)
    return (first, *(Option(value=value, title=title, count=n, chosen=value == chosen) for value, title, n in values))
