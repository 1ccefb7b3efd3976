"""Pure: every case of an evaluation, baseline and candidate side by side, what changed first."""

from collections.abc import Mapping
from dataclasses import dataclass

from app.i18n.catalogues import N_
from app.i18n.messages import word
from app.views.list_params import address
from app.views.review_results import CaseRow, case_row, pairs_of
from app.views.shell import Shell
from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.reasons import because
from rsi_reviews.contracts import FAMILIES, ResultSet
from rsi_reviews.projections import Review

SHOWN = 200
CHANGES = ("", N_("pass to fail"), N_("fail to pass"), "worse", "better", "same")
ORDER = {change: place for place, change in enumerate(CHANGES)}


@dataclass(frozen=True)
class CaseTab:
    """One kind of change with how many cases it holds."""

    title: str
    href: str
    count: int
    chosen: bool


@dataclass(frozen=True)
class CasesPage:
    """Cases as the address asks for them."""

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
    results: ResultSet,
    situations: Mapping[str, str],
    *,
    change: str,
    family: str,
    skip: int,
) -> CasesPage:
    """Raises UnknownName or ContractInvalid for an address that no page ever gave."""
    if change not in CHANGES or family not in ("", *FAMILIES):
        raise UnknownName(because("unknown_cases_tab", change=change[:40], family=family[:40]))
    if review.manifest is None or skip < 0:
        raise ContractInvalid(because("list_offset_invalid", skip=skip), where="skip")
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
            for one in ("", *FAMILIES)
        ),
        rows=tuple(chosen[skip : skip + SHOWN]),
        found=len(chosen),
        following=address(path, params, skip=str(skip + SHOWN)) if more else "",
    )
