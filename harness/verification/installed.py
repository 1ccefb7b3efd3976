"""Asks a predicate of an installed package: shows it its declared sources, and takes its answer as a finding.

A predicate that is another one than the mission is pinned to, that its site does not vouch for, that breaks, takes too
long or lacks one of its sources leaves its condition undecided.
"""

from collections.abc import Sequence
from typing import get_args

import msgspec
from msgspec import UnsetType

from harness.contracts.effects import AnyEffect
from harness.contracts.errors import HarnessError
from harness.contracts.observations import InstrumentReading, Odometry, Pose, Source
from harness.contracts.ports import Predicates
from harness.contracts.predicates import PinnedPredicate, PredicateEvidence, PredicateQuestion
from harness.contracts.protocol import Receipt
from harness.contracts.reasons import Reason, because
from harness.verification.finding import RECEIPTS, Finding, Undecidable, ambiguous
from harness.verification.reading import Evidence

ROBOT_SOURCES = frozenset(get_args(Source))
"""What a predicate may declare beside instruments and receipts; only poses and odometry of it can be shown so far."""


def installed_finding(effect: AnyEffect, evidence: Evidence, predicates: Predicates) -> tuple[Finding, bool]:
    """The finding, and whether the predicate was absent or broke."""
    name = effect.predicate
    pinned = _pinned(name, evidence)
    if pinned is None:
        return ambiguous(because("predicate_not_pinned", predicate=name)), True
    if predicates.installed.get(name) != pinned.installed:
        return ambiguous(_changed(pinned, predicates)), True
    material = _evidence_for(pinned, evidence)
    silent = [one for one in pinned.installed.sources if not _samples(one, material)]
    if silent:
        return ambiguous(because("declared_source_silent", predicate=name, sources=tuple(silent))), False
    try:
        answer = predicates.ask(name, PredicateQuestion(effect=msgspec.to_builtins(effect), evidence=material))
    except HarnessError as error:
        return ambiguous(because("installed_predicate_failed", predicate=name, reason=error.reason)), True
    why = because("installed_predicate_says", predicate=name, version=pinned.installed.version, why=answer.why)
    verdict = answer.verdict
    if verdict == "satisfied" and not pinned.vouched:
        verdict, why = "ambiguous", because("predicate_not_vouched", predicate=name, reason=why)
    newest = [_samples(one, material)[-1].at_s for one in pinned.installed.sources if one != RECEIPTS]
    finding = Finding(
        verdict=verdict,
        reason=why,
        measured=answer.measured,
        bounds=answer.bounds,
        sources=pinned.installed.sources,
        evidence=tuple(track.blob for track in evidence.tracks if track.current and track.blob is not None),
        age_s=evidence.speaks_at_s - min(newest) if newest else None,
    )
    return finding, False


def _pinned(name: str, evidence: Evidence) -> PinnedPredicate | None:
    try:
        known = evidence.policy.predicates
    except Undecidable:
        return None
    return None if isinstance(known, UnsetType) else known.get(name)


def _changed(pinned: PinnedPredicate, predicates: Predicates) -> Reason:
    """Why the predicate that is installed now may not judge this mission."""
    own, now = pinned.installed, predicates.installed.get(pinned.installed.name)
    if now is None:
        return because("predicate_not_installed", name=own.name)
    return because(
        "predicate_of_another_version",
        predicate=own.name,
        version=own.version,
        code=own.code[:12],
        now=now.version,
        now_code=now.code[:12],
    )


def _evidence_for(pinned: PinnedPredicate, evidence: Evidence) -> PredicateEvidence:
    sources = pinned.installed.sources
    current = [track for track in evidence.tracks if track.current]
    readings = [one for track in current for one in track.instruments]
    instruments = {
        name: tuple(one for one in readings if one.source == name) for name in sources if name not in ROBOT_SOURCES
    }
    return PredicateEvidence(
        at_s=evidence.speaks_at_s,
        from_s=min((track.dispatched_s for track in current), default=evidence.speaks_at_s),
        instruments={name: found for name, found in instruments.items() if name != RECEIPTS},
        poses=tuple(one for track in current for one in track.poses) if "localiser" in sources else (),
        odometry=tuple(one for track in current for one in track.odometry) if "odometry" in sources else (),
        receipts=evidence.receipts if RECEIPTS in sources else (),
    )


def _samples(source: str, material: PredicateEvidence) -> Sequence[Pose | Odometry | InstrumentReading | Receipt]:
    match source:
        case "localiser":
            return material.poses
        case "odometry":
            return material.odometry
        case "receipts":
            return material.receipts
        case _:
            return material.instruments.get(source, ())
