"""Derives the next generation's configuration in each of the six arms from what the arm's fleet recorded.

frozen keeps H_0. gated mines its own records and releases what the gate accepts. ungated takes what its own generator
likes best, without any check. random draws changes and sends them through the same gate. batch mines as many missions
of H_0 as the others ran in all, once, at the end, through the same gate. expert is written by hand for the site.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Literal, get_args

from msgspec.structs import replace

from harness.baseline.load import baseline
from harness.contracts.configuration import Configuration
from harness.contracts.ids import Digest
from harness.contracts.regularities import HiddenSite
from rsi_reviews.generate.changes import with_timeout
from rsi_reviews.generate.interface import GenerationBudget, Generator
from rsi_reviews.generate.miner import TraceMiner
from rsi_reviews.generate.random_search import RandomSearch
from rsi_reviews.generate.trace import Trace, joined
from rsi_reviews.generate.ungated_arm import EagerMiner
from rsi_reviews.hidden_sites import Expert
from rsi_reviews.recursion.gating import GateJudgement, SiteGate, judgement
from rsi_reviews.recursion.missions import TEMPLATE

Arm = Literal["frozen", "gated", "ungated", "random", "batch", "expert"]
ARMS: tuple[Arm, ...] = get_args(Arm)
Recorded = Callable[[Configuration, int], Trace]
"""What missions of one generation recorded under a configuration."""


@dataclass
class ArmLineage:
    """One arm of one fleet: its configuration, what it may learn from, and what was proposed before."""

    arm: Arm
    current: Configuration = field(default_factory=baseline)
    traces: list[Trace] = field(default_factory=list)
    seen: list[Digest] = field(default_factory=list)
    judgements: list[tuple[int, GateJudgement]] = field(default_factory=list)
    recorded_missions: int = 0

    def learn(self, trace: Trace) -> None:
        """More records under the current configuration."""
        self.traces.append(trace)
        self.recorded_missions += len(trace.missions)

    def adopt(self, configuration: Configuration) -> None:
        """Another version is current; D_j begins again, because records belong to one version (R155)."""
        self.current = configuration
        self.traces.clear()


@dataclass(frozen=True)
class Setting:
    """The inputs of an arm's step. `proposals` is how many candidates a generation may send to the gate."""

    gate: SiteGate
    recorded: Recorded
    site: HiddenSite
    proposals: int
    generations: int
    key: str


def step(line: ArmLineage, generation: int, setting: Setting) -> None:
    """The lineage in the next generation."""
    match line.arm:
        case "gated":
            line.learn(setting.recorded(line.current, generation))
            _gated(line, TraceMiner(), generation, setting)
        case "random":
            search = RandomSearch(f"{setting.key}/{generation}", template=TEMPLATE)
            _gated(line, search, generation, setting)
        case "ungated":
            line.learn(setting.recorded(line.current, generation))
            _ungated(line, generation)
        case "batch":
            line.learn(setting.recorded(baseline(), generation))
            if generation == setting.generations - 1:
                _batch(line, generation, setting)
        case "frozen" | "expert":
            return


def _gated(line: ArmLineage, generator: Generator, generation: int, setting: Setting) -> None:
    """Releases the first candidate that the gate accepts; the others of this generation are dropped."""
    budget = GenerationBudget(candidates=setting.proposals, seen=tuple(line.seen))
    for candidate in generator.propose(joined(line.traces), line.current, budget):
        line.seen.append(candidate.configuration.configuration_id)
        judgement = setting.gate.judge(candidate, line.current, setting.site)
        line.judgements.append((generation, judgement))
        if judgement.accepted:
            line.adopt(candidate.configuration)
            return


def _ungated(line: ArmLineage, generation: int) -> None:
    """Makes the most promising candidate current at once."""
    budget = GenerationBudget(candidates=1, seen=tuple(line.seen))
    for candidate in EagerMiner().propose(joined(line.traces), line.current, budget):
        line.seen.append(candidate.configuration.configuration_id)
        unjudged = replace(judgement(candidate, clause="", sentence="Nobody looked."), clause="unchecked")
        line.judgements.append((generation, unjudged))
        line.adopt(candidate.configuration)


def _batch(line: ArmLineage, generation: int, setting: Setting) -> None:
    """Mines all records of H_0 at once, with as many candidates as the recursive arm may send in all its
    generations.
    """
    trace = joined(line.traces)
    for _ in range(setting.proposals * setting.generations):
        budget = GenerationBudget(candidates=1, seen=tuple(line.seen))
        found = TraceMiner().propose(trace, line.current, budget)
        if not found:
            return
        line.seen.append(found[0].configuration.configuration_id)
        judgement = setting.gate.judge(found[0], line.current, setting.site)
        line.judgements.append((generation, judgement))
        if judgement.accepted:
            line.current = found[0].configuration


def written_by_hand(expert: Expert | None) -> Configuration:
    """H_0 with what somebody who knows the site would change; H_0 where there is nothing to change."""
    current = baseline()
    if expert is None:
        return current
    recovery = replace(
        current.recovery,
        ladders={**current.recovery.ladders, **expert.ladders},
        wait_s=expert.wait_s or current.recovery.wait_s,
    )
    current = replace(current, recovery=recovery, routing=replace(current.routing, **expert.routing))
    for template, nodes in expert.timeouts_s.items():
        for node_id, timeout_s in nodes.items():
            current = with_timeout(current, template=template, node_id=node_id, timeout_s=timeout_s)
    return current
