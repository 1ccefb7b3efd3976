"""Adds up findings over many missions, and computes how much each count proves. Pure."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

from experiments.campaigns.findings import Findings
from experiments.campaigns.plan import DISTURBANCES, ROBOT_FAULTS
from rsi_reviews.bounds import upper_bound

EXAMPLES = 20
COUNTED = ("contract_false", "epistemic_false", "false_rejections", "duplicate_starts", "unauthorised", "breaches")


@dataclass
class Tally:
    """Counts over `missions`. `hit` counts missions with at least one finding of a kind; `found` counts findings."""

    missions: int = 0
    quiet: int = 0
    struck: Counter[str] = field(default_factory=Counter)
    missions_struck: Counter[str] = field(default_factory=Counter)
    ends: Counter[str] = field(default_factory=Counter)
    hit: Counter[str] = field(default_factory=Counter)
    found: Counter[str] = field(default_factory=Counter)
    acts: Counter[str] = field(default_factory=Counter)
    offences: list[tuple[int, str]] = field(default_factory=list)

    def add(self, seed: int, findings: Findings, *, struck: dict[str, int], end: str) -> None:
        """Add a mission."""
        self.missions += 1
        self.quiet += not struck
        self.struck.update(struck)
        self.missions_struck.update(dict.fromkeys(struck, 1))
        self.ends[end] += 1
        for name in COUNTED:
            sentences = getattr(findings, name)
            self.found[name] += len(sentences)
            self.hit[name] += bool(sentences)
        for act in ("commits", "rejections", "starts", "dispatches"):
            self.acts[act] += getattr(findings, act)
        self.offences += [(seed, sentence) for sentence in findings.offences]
        self.offences = sorted(self.offences)[:EXAMPLES]

    def join(self, other: "Tally") -> None:
        """Add another tally; the order of joining makes no difference."""
        self.missions += other.missions
        self.quiet += other.quiet
        for mine, theirs in (
            (self.struck, other.struck),
            (self.missions_struck, other.missions_struck),
            (self.ends, other.ends),
            (self.hit, other.hit),
            (self.found, other.found),
            (self.acts, other.acts),
        ):
            mine.update(theirs)
        self.offences = sorted([*self.offences, *other.offences])[:EXAMPLES]


def counted(tally: Tally, name: str) -> dict[str, float]:
    """Findings of a kind, and the upper 95 % bound of the share of missions that have one."""
    return {"count": tally.found[name], "upper_bound": upper_bound(tally.hit[name], tally.missions)}


def summary(tally: Tally) -> dict[str, Any]:
    """The published part of a tally."""
    return {
        "missions": tally.missions,
        "missions_without_a_strike": tally.quiet,
        "faults_struck": dict(sorted(_complete(tally.struck).items())),
        "missions_struck": dict(sorted(_complete(tally.missions_struck).items())),
        "ends": dict(sorted(tally.ends.items())),
        **dict(sorted(tally.acts.items())),
        "contract_false_completions": counted(tally, "contract_false"),
        "epistemic_false_completions": counted(tally, "epistemic_false"),
        "false_rejections": counted(tally, "false_rejections"),
        "duplicate_starts": counted(tally, "duplicate_starts"),
        "unauthorised_commits": counted(tally, "unauthorised"),
        "other_breaches": counted(tally, "breaches"),
    }


def _complete(struck: Counter[str]) -> dict[str, int]:
    """With a zero for whatever never struck, so that its absence is not read as a pass."""
    return {name: struck[name] for name in (*ROBOT_FAULTS, *DISTURBANCES)}


def tallied(tallies: Iterable[Tally]) -> Tally:
    """One tally of many."""
    whole = Tally()
    for tally in tallies:
        whole.join(tally)
    return whole
