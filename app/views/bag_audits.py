"""Shapes an audit of recordings: how many declared successes lack evidence, and of which kind."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import msgspec

from app.i18n.catalogues import N_
from app.i18n.reasons import rendering as reasons
from harness.contracts.declared_successes import (
    LACKS,
    AuditedRecording,
    BagAudit,
    Lack,
    SuccessFinding,
    SuccessVerdict,
)

KINDS: Mapping[Lack, str] = MappingProxyType(
    {
        "target": N_("a target: nothing in the recording says where it was to be"),
        "position": N_("a position of the second before"),
        "arrival": N_("being within 0.40 m of the target"),
        "standstill": N_("standing still in the 2 s after it"),
        "second_source": N_("a second source: position and motion come from one estimator"),
    }
)
VERDICTS: Mapping[SuccessVerdict, str] = MappingProxyType(
    {"backed": N_("backed"), "lacking": N_("lacks evidence"), "contradicted": N_("contradicted")}
)


@dataclass(frozen=True)
class AuditCounts:
    """The figures of one audit. `lacks` counts successes by the kind that they lack; one may lack several."""

    recordings: int
    unreadable: int
    incomplete: int
    successes: int
    verdicts: dict[SuccessVerdict, int]
    lacks: dict[Lack, int]


@dataclass(frozen=True)
class AuditShown:
    """One audit on the page."""

    audit: BagAudit
    counts: AuditCounts


def counted(audit: BagAudit) -> AuditCounts:
    """Counts over every recording that could be read."""
    return AuditCounts(
        recordings=len(audit.recordings),
        unreadable=len(audit.unreadable),
        incomplete=sum(one.incomplete is not None for one in audit.recordings),
        successes=len(audit.findings),
        verdicts=verdict_counts(audit.findings),
        lacks=lack_counts(audit.findings),
    )


def verdict_counts(findings: tuple[SuccessFinding, ...]) -> dict[SuccessVerdict, int]:
    """How many of each verdict, with zeros."""
    found = Counter(one.verdict for one in findings)
    return {verdict: found[verdict] for verdict in VERDICTS}


def lack_counts(findings: tuple[SuccessFinding, ...]) -> dict[Lack, int]:
    """How many successes lack each kind, with zeros."""
    found = Counter(lack for one in findings for lack in one.lacks)
    return {lack: found[lack] for lack in LACKS}


def audit_json(audit: BagAudit) -> dict[str, Any]:
    """The audit for the command line and the API, reasons as text beside their codes."""
    counts = counted(audit)
    return {
        "folder": audit.folder,
        "recordings": counts.recordings,
        "unreadable": counts.unreadable,
        "incomplete": counts.incomplete,
        "successes": counts.successes,
        "verdicts": counts.verdicts,
        "lacks": counts.lacks,
        "audited": [_recording_json(one) for one in audit.recordings],
    }


def _recording_json(one: AuditedRecording) -> dict[str, Any]:
    return {
        "path": one.path,
        "sha256": one.sha256,
        "duration_s": one.duration_s,
        **reasons.stated("problem", one.problem or ""),
        **reasons.stated("incomplete", one.incomplete or ""),
        "successes": msgspec.to_builtins(one.successes),
    }
