"""Explores the site with several proposers of targets beside each other: the frontier rule, and models by the port.

Every proposer is asked the same questions and has no authority. The stand-ins answer by rule in the chat-completions
protocol; a real model answers where an endpoint is given.
"""

import json
import math
import random
import statistics
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from itertools import pairwise
from typing import Any

from experiments.campaigns.recovery_steps import ACTOR, ROBOT
from harness.adapters.models.chat import ChatModel
from harness.bootstrap import Harness, simulated
from harness.contracts import exploration
from harness.contracts.decisions import Accepted
from harness.contracts.ids import Digest
from harness.contracts.models import ModelEndpoint
from harness.contracts.ports import BlobStore
from harness.contracts.reasons import Reason
from harness.contracts.values import Count, Value, decode
from harness.exploration.targets import NEAREST_EDGE
from harness.projections.exploration import decisions, updates
from harness.projections.floor import coverage
from harness.projections.mission import Mission
from harness.runtime import Start
from harness.settings import HarnessSettings
from simulator.in_process import SIMULATOR

Answer = Callable[[dict[str, Any]], dict[str, Any]]
"""The question's document, as `model_proposer.question_text` makes it, to a proposed point."""


class ExplorerFigures(Value):
    """One proposer over its missions. `admitted` of its proposals were taken; the others by the rule that refused them.

    `share` and `travelled_m`: medians over missions of the reachable floor that was seen, and of the true way.
    """

    proposer: str
    missions: Count
    succeeded: Count
    share: float
    least_share: float
    targets: float
    travelled_m: float
    asked: Count
    admitted: Count
    refused: dict[str, Count]


class Exploration(Value):
    """One mission. `refused`: the rule of each proposal that was refused, in order."""

    status: str
    share: float
    travelled_m: float
    targets: Count
    asked: Count
    refused: tuple[str, ...]


class RuleTransport:
    """Implements `ChatTransport`: a stand-in that reads the question's text and answers by a rule."""

    def __init__(self, rule: Answer) -> None:
        self._rule = rule

    def send(self, body: bytes, *, recorded: Digest, within_s: float) -> bytes:
        request = json.loads(body)
        content = [one["content"] for one in request["messages"] if one["role"] == "user"][-1]
        text = content if isinstance(content, str) else "\n".join(part.get("text", "") for part in content)
        answer = self._rule(json.loads(text[text.index("{") : text.rindex("}") + 1]))
        message = {"role": "assistant", "content": json.dumps(answer)}
        return json.dumps({"choices": [{"message": message, "finish_reason": "stop"}]}).encode()


def longest_edge(question: dict[str, Any]) -> dict[str, Any]:
    """The edge behind which most is unknown, however far; the body's own place where there is none."""
    best = max(question["edges"], key=lambda one: one["length_m"], default=None)
    x, y = best["approach_m"] if best else question["position_m"]
    return {"x_m": x, "y_m": y, "reason": "most is unknown behind this edge"}


def stays(question: dict[str, Any]) -> dict[str, Any]:
    """Where the body stands already: admissible, and of no use."""
    x, y = question["position_m"]
    return {"x_m": x, "y_m": y, "reason": "here"}


def anywhere(seed: int) -> Answer:
    """Points drawn within 15 m of the body, walls or not: what the rules of admission are there for."""
    draw = random.Random(seed)

    def rule(question: dict[str, Any]) -> dict[str, Any]:
        x, y = question["position_m"]
        return {"x_m": x + draw.uniform(-15, 15), "y_m": y + draw.uniform(-15, 15), "reason": "somewhere"}

    return rule


def ruled(name: str, rule: Answer) -> Callable[[BlobStore], ChatModel]:
    """Opens a stand-in on a mission's own blob store."""
    endpoint = ModelEndpoint(name=name, base_url="http://127.0.0.1:1/v1", model="a rule", images=True, retries=0)
    return lambda blobs: ChatModel(endpoint, RuleTransport(rule), keep=blobs.put, read=blobs.get)


def explored(
    proposer: str,
    model: Callable[[int], Callable[[BlobStore], ChatModel]] | None,
    *,
    seeds: Sequence[int],
    until_s: float,
) -> ExplorerFigures:
    """Whole exploration missions with one proposer, one for each seed, until the time is over. `model`: by seed."""
    found: list[Exploration] = []
    for seed in seeds:
        if found and time.monotonic() > until_s:
            break
        found.append(_explore(model(seed) if model else None, seed=seed))
        print(f"{proposer} seed {seed}: {found[-1].status}, {found[-1].share:.1%} seen", file=sys.stderr, flush=True)
    proposals = sum(one.asked for one in found)
    refused = Counter(rule for one in found for rule in one.refused)
    return ExplorerFigures(
        proposer=proposer,
        missions=len(found),
        succeeded=sum(one.status == "succeeded" for one in found),
        share=round(statistics.median(one.share for one in found), 4),
        least_share=round(min(one.share for one in found), 4),
        targets=statistics.median(one.targets for one in found),
        travelled_m=round(statistics.median(one.travelled_m for one in found), 1),
        asked=proposals,
        admitted=proposals - refused.total(),
        refused=dict(sorted(refused.items())),
    )


def _explore(model: Callable[[BlobStore], ChatModel] | None, *, seed: int) -> Exploration:
    with simulated(
        HarnessSettings(speed=0, fidelity="kinematic"),
        simulator=SIMULATOR,
        seed=seed,
        models=(lambda blobs: {"target_proposer": model(blobs)}) if model else None,
    ) as harness:
        decision = harness.runtime.start(Start(actor=ACTOR, robot_id=ROBOT, template="exploration", seed=seed))
        assert isinstance(decision, Accepted)
        mission = harness.supervisor.run(next(harness.runtime.newest_missions()).mission_id)
        made = decisions(mission)
        return Exploration(
            status=mission.status,
            share=_share(harness, mission),
            travelled_m=_travelled_m(harness),
            targets=len(made),
            asked=sum(model is None or one.planner != NEAREST_EDGE.name for one in made),
            refused=tuple(_rule(one.refused) for one in made if one.refused),
        )


def _rule(refused: object) -> str:
    if not isinstance(refused, Reason):
        return "refused"
    return str(refused.facts.get("rule", refused.code))


def _share(harness: Harness, mission: Mission) -> float:
    known = updates(mission)
    if not known:
        return 0.0
    return coverage(decode(harness.runtime.blob(known[-1][1].after), exploration.GridMap)).share


def _travelled_m(harness: Harness) -> float:
    records = harness.robots[ROBOT].world.truth.records  # type: ignore[attr-defined]
    places = [(one.x_m, one.y_m) for one in records if one.kind == "pose"]
    return sum(math.dist(one, two) for one, two in pairwise(places))


def explorers(
    model: Callable[[BlobStore], ChatModel] | None, name: str, *, missions: int, seed: int, until_s: float
) -> tuple[ExplorerFigures, ...]:
    """The frontier rule, three stand-ins and, where one is given, the real model on a fifth of the seeds."""
    seeds = range(seed, seed + missions)

    longest = ruled("longest-edge", longest_edge)
    found = [
        explored("nearest edge (deterministic)", None, seeds=seeds, until_s=until_s),
        explored("stand-in: longest edge", lambda number: longest, seeds=seeds, until_s=until_s),
        explored("stand-in: stays", lambda number: ruled("stays", stays), seeds=seeds, until_s=until_s),
        explored(
            "stand-in: anywhere", lambda number: ruled("anywhere", anywhere(number)), seeds=seeds, until_s=until_s
        ),
    ]
    if model is not None:
        few = seeds[: max(1, missions // 5)]
        found.append(explored(name, lambda number: model, seeds=few, until_s=until_s))
    return tuple(found)


def table(found: Sequence[ExplorerFigures]) -> Iterable[str]:
    """The section of docs/models.md."""
    yield "## Exploration: proposers of targets beside each other"
    yield ""
    yield (
        "Each explores the site until 95 % of its reachable floor is seen. The stand-ins answer by rule through the "
        "model port. A proposal that is refused is replaced by the harness's own edge, and a proposer two of whose "
        "targets in a row opened no floor is not asked again in that mission. *Seen* and *way* are medians; the way is "
        "the true one."
    )
    yield ""
    yield "| proposer | missions | succeeded | seen | least seen | targets | way (m) | asked | admitted | refused |"
    yield "|---|---|---|---|---|---|---|---|---|---|"
    for one in found:
        rules = ", ".join(f"{rule} {count}" for rule, count in one.refused.items()) or "none"
        yield (
            f"| {one.proposer} | {one.missions} | {one.succeeded} | {one.share:.1%} | {one.least_share:.1%} | "
            f"{one.targets:g} | {one.travelled_m} | {one.asked} | {one.admitted} | {rules} |"
        )
    yield ""
