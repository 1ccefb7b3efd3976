"""relational analysis_of: a report is bound to the accepted frames. The binding does not prove the report right."""

import msgspec

from harness.contracts.effects import AnyEffect, Relational
from harness.contracts.ids import Digest
from harness.contracts.reasons import because, several
from harness.verification.finding import RECEIPTS, Finding, Undecidable, ambiguous
from harness.verification.reading import Evidence

MOST_SHARES = 3


class Obstruction(msgspec.Struct, frozen=True):
    """One finding of a report: the frame that shows it, and its share of the passage's width where stated."""

    frame: Digest
    share_of_passage: float | None = None


class AnalysisReport(msgspec.Struct, frozen=True):
    """What any analysis provider's report must hold: the frames it looked at, those it cites, its verdict."""

    frames: tuple[Digest, ...]
    cited: tuple[Digest, ...]
    findings: tuple[Obstruction, ...]
    blocked: bool


def analysis_of(effect: AnyEffect, evidence: Evidence) -> Finding:
    """The report of `subject` covers exactly the accepted frames of `object` and cites nothing else.

    `evidence` = the report, then its frames. measured: obstructions, blocked, share_<i> of the largest findings.
    """
    if not isinstance(effect, Relational):
        raise Undecidable(because("effect_not_testable", predicate="analysis_of"))
    committed = tuple(evidence.fact("panorama", node_id=effect.object).arguments["frames"])
    digest = next((one.blob for one in reversed(evidence.receipts) if one.kind == "analysis" and one.blob), None)
    if digest is None:
        return ambiguous(because("no_analysis_receipt"))
    report = evidence.decoded(digest, AnalysisReport)
    cited = {*report.frames, *report.cited, *(finding.frame for finding in report.findings)}
    foreign, missing = cited - set(committed), set(committed) - set(report.frames)
    problems = [because("report_cites_foreign_images", images=len(foreign))] if foreign else []
    problems += [because("report_leaves_out_frames", missing=len(missing), frames=len(committed))] if missing else []
    if report.blocked != bool(report.findings):
        problems.append(because("report_verdict_does_not_follow"))
    shares = sorted((one.share_of_passage or 0.0 for one in report.findings), reverse=True)[:MOST_SHARES]
    return Finding(
        verdict="violated" if problems else "satisfied",
        reason=several(problems) or because("report_covers_frames", frames=len(committed)),
        measured={
            "frames": float(len(report.frames)),
            "foreign": float(len(foreign)),
            "obstructions": float(len(report.findings)),
            "blocked": float(report.blocked),
            **{f"share_{index}": share for index, share in enumerate(shares)},
        },
        bounds={"frames": float(len(committed)), "foreign": 0.0},
        sources=(RECEIPTS,),
        evidence=(digest, *report.frames),
    )
