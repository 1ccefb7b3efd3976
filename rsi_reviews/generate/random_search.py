"""Draws one legal change at random, without reading any record: the baseline that shows what mining the records
is worth.
"""

import hashlib
from collections.abc import Iterator
from itertools import islice

from harness.contracts.configuration import SPENDING, Configuration
from harness.contracts.ids import Digest
from rsi_reviews.contracts import Author, Candidate, Metric, Section
from rsi_reviews.generate import changes
from rsi_reviews.generate.interface import GenerationBudget
from rsi_reviews.generate.ladders import SMALLEST_EFFECT
from rsi_reviews.generate.miner import ranked
from rsi_reviews.generate.times import SMALLEST_S
from rsi_reviews.generate.trace import Trace
from rsi_reviews.restrictions import LOCKED_LADDERS, WAIT_CEILING_S, WEIGHT_CEILING, loosened

FACTORS = (0.5, 2.0, 4.0)
TIMEOUT_FACTORS = (0.4, 0.6, 0.8)
WEIGHTS = ("success", "risk", "uncertainty", "latency", "cost", "history")


class RandomSearch:
    """Implements `Generator`: draws from all single changes of H that the miner could make too. Same seed, same draws.

    `template` is the one whose timeouts it may change.
    """

    name = "random-search-1"

    def __init__(self, seed: str, *, template: str) -> None:
        self._seed, self._template = seed, template

    def propose(self, trace: Trace, current: Configuration, budget: GenerationBudget) -> tuple[Candidate, ...]:
        """As many different changes as the budget allows."""
        author = Author(name=self.name, kind="optimiser")
        legal = (change for change in self._all(current) if not loosened(current, change.configuration))
        shuffled = sorted(legal, key=lambda change: self._order(change, budget.seen))
        found = ranked(tuple(shuffled), current, budget)
        return tuple(changes.candidate(change, current, author=author) for change in islice(found, budget.candidates))

    def _order(self, change: changes.ProposedChange, seen: tuple[Digest, ...]) -> bytes:
        key = f"{self._seed}\n{len(seen)}\n{change.configuration.configuration_id}"
        return hashlib.sha256(key.encode()).digest()

    def _all(self, current: Configuration) -> Iterator[changes.ProposedChange]:
        for failure, ladder in current.recovery.ladders.items():
            if failure not in LOCKED_LADDERS and ladder[0] not in ("stop", "safe_stop"):
                for other in _ladders(ladder):
                    yield _drawn("recovery", changes.with_ladder(current, failure, other), f"the ladder of {failure}")
        for factor in FACTORS:
            wait_s = min(WAIT_CEILING_S, factor * current.recovery.wait_s)
            yield _drawn("recovery", changes.with_wait(current, wait_s), "the longest wait")
            for name in WEIGHTS:
                weight = min(WEIGHT_CEILING, factor * getattr(current.routing, name))
                yield _drawn("routing", changes.with_weight(current, **{name: weight}), f"the weight of {name}")
        yield from self._timeouts(current)

    def _timeouts(self, current: Configuration) -> Iterator[changes.ProposedChange]:
        nodes = [node for one in current.templates if one.name == self._template for node in one.nodes]
        for node in nodes:
            for factor in TIMEOUT_FACTORS:
                shorter_s = float(round(factor * float(node["timeout_s"])))
                changed = changes.with_timeout(
                    current, template=self._template, node_id=str(node["node_id"]), timeout_s=shorter_s
                )
                yield _drawn("templates", changed, f"the timeout of {node['node_id']}", metric="mission_s")


def _ladders(ladder: changes.Ladder) -> list[changes.Ladder]:
    """Every ladder with one step more, one less, or two neighbours swapped."""
    rungs = ladder[:-1]
    found = [rungs[:at] + rungs[at + 1 :] for at in range(len(rungs))]
    found += [(*rungs[:at], action, *rungs[at:]) for action in SPENDING for at in range(len(rungs) + 1)]
    found += [(*rungs[:at], rungs[at + 1], rungs[at], *rungs[at + 2 :]) for at in range(len(rungs) - 1)]
    return [(*other, "human") for other in dict.fromkeys(found) if other and other != rungs]


def _drawn(
    section: Section, changed: Configuration, what: str, *, metric: Metric = "recovery_cost"
) -> changes.ProposedChange:
    return changes.ProposedChange(
        section=section,
        configuration=changed,
        reason=f"Drawn at random: {what}.",
        intended="None in particular: a random change that the suite judges.",
        metric=metric,
        smallest_effect=SMALLEST_S if metric == "mission_s" else SMALLEST_EFFECT,
        worth=1.0,
    )
