"""Judges a mission from outside: plain JSON in, plain JSON out. Imports nothing of the harness, so it cannot be fooled
by the rules it judges; it reads the robot's truth journal, its start journal, its sensor samples and the routes.

A story holds:
`routes`: node id -> {"kind": "arrival" | "circuit", "target_m": [x, y], "tolerance_m": t, "route_m": [[x, y], ...]},
    in the order in which the mission wants them; what the person meant.
`bound` (optional): the same for what the contract was bound to, where that differs (place aliasing).
`truth`: lines of the robot's truth journal {"kind", "at_s", "x_m", "y_m", "v_mps", "request_id", "text"}.
`starts`: lines of the robot's start journal {"request_id", "node_id", "attempt", "at_s", "moves"}.
`poses`, `odometry`: [[sensor time, x, y], ...] as the robot published them; poses in the map frame.
`claims`: what was accepted as done {"node_id", "at_s", "requests": [request id, ...], "act": "robot"|"outbox"|""}:
    `at_s` is the instant the claim speaks for; `act` says in whose journal one of the requests must stand.
`rejections`: executions found wanting {"node_id", "at_s", "requests", "why", "finished"}; `finished`: it had ended,
    by its own word, well: only such a one can have been refused wrongly.
`declared`: whether the mission was declared a success. `ended_s`: when it ended.
`sent` (optional): request ids that left the outbox.
"""

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rsi_reviews.evaluation import witnesses

BEFORE_S = 3.0
"""Samples from this long before a node's first start count as its own."""
Story = Mapping[str, Any]
LISTS = ("truth", "starts", "poses", "odometry", "claims", "rejections")


class StoryInvalid(ValueError):
    """The story lacks something that the adjudicator needs: a code, and which fields, in no language."""

    def __init__(self, code: str, *fields: str) -> None:
        super().__init__(f"{code}: {', '.join(fields)}")
        self.code, self.fields = code, fields


def adjudicate(story: Story) -> dict[str, Any]:
    """The verdict on one mission; raises StoryInvalid.

    `truly_done`: the body did all that the routes want, in order, by ground truth, whatever anybody claimed.
    `success`: declared and truly done. `false_success`: declared and not. `missed`: truly done and not declared.
    `contract_false`, `epistemic_false`: accepted claims that are not true, with evidence at hand that contradicted
    them or with none. `unsupported`: accepted, true, and not shown by the evidence. `false_rejections`: executions
    that had truly reached their target and were refused. `duplicate_starts`: physical starts that repeat a living or
    unrefuted one. All of these are lists of sentences.
    """
    _check(story)
    lines = _truth_lines(story)
    judged = [_claim(story, claim, lines) for claim in story["claims"]]
    done = truly_done(story["routes"], lines, _starts_of(story))
    declared = bool(story["declared"])
    by_kind = {kind: [text for found, text in judged if found == kind] for kind in KINDS}
    return {
        "truly_done": done,
        "declared": declared,
        "success": declared and done,
        "false_success": declared and not done,
        "missed": done and not declared,
        **by_kind,
        "claims": len(story["claims"]),
        "rejections": len(story["rejections"]),
        "false_rejections": list(_false_rejections(story, lines)),
        "duplicate_starts": list(duplicates(story)),
        "starts": len(story["starts"]),
    }


KINDS = ("contract_false", "epistemic_false", "unsupported")


def truly_done(
    routes: Mapping[str, witnesses.Line], lines: Sequence[witnesses.Line], starts: Mapping[str, float]
) -> bool:
    """Whether every route was walked to its target in order, the next one after the one before; ground truth only.

    The last one must still hold at the end. `starts`: when each node was first started; an unstarted one is not done.
    """
    from_s = -math.inf
    for node_id, route in routes.items():
        if node_id not in starts:
            return False
        found = witnesses.reached_s(route, lines, from_s=max(from_s, starts[node_id] - BEFORE_S))
        if found is None:
            return False
        from_s = found
    last = list(routes)[-1]
    return not witnesses.away(routes[last], lines, from_s=starts[last] - BEFORE_S, at_s=math.inf)


def duplicates(story: Story) -> Iterator[str]:
    """Physical starts that should not have been: of the same request, of the same attempt, or of a stage whose earlier
    execution still ran, or had succeeded with nobody finding it wanting."""
    requests = Counter(start["request_id"] for start in story["starts"])
    yield from (f"request {name[:12]} was started {n} times" for name, n in requests.items() if n > 1)
    once = {start["request_id"]: start for start in story["starts"]}.values()
    attempts = Counter((start["node_id"], start["attempt"]) for start in once)
    yield from (
        f"attempt {n} of {node} was started {times} times" for (node, n), times in attempts.items() if times > 1
    )
    ends = {line["request_id"]: line for line in story["truth"] if line["kind"] == "terminal"}
    moving = sorted((start for start in once if start["moves"]), key=lambda start: start["at_s"])
    for index, later in enumerate(moving):
        for earlier in moving[:index]:
            if earlier["node_id"] == later["node_id"] and (why := _unrefuted(story, earlier, later, ends)):
                yield f"{later['node_id']} was started again although {why}"


def _unrefuted(story: Story, earlier: witnesses.Line, later: witnesses.Line, ends: Mapping[str, witnesses.Line]) -> str:
    end = ends.get(earlier["request_id"])
    if end is None or end["at_s"] > later["at_s"]:
        return "its earlier execution was still running"
    refuted = any(
        one["node_id"] == later["node_id"] and earlier["request_id"] in one["requests"] and one["at_s"] <= later["at_s"]
        for one in story["rejections"]
    )
    return "" if refuted or not end["text"].startswith("succeeded") else "its earlier execution had succeeded"


def _claim(story: Story, claim: witnesses.Line, lines: Sequence[witnesses.Line]) -> tuple[str, str]:
    """The kind of completion that a claim is, and the sentence that says so."""
    node_id: str = claim["node_id"]
    at_s: float = claim["at_s"]
    undone = _undone(story, claim)
    if undone:
        return "contract_false", f"{node_id}: {undone}; no act is on record"
    route = story["routes"].get(node_id)
    if route is None:
        return "true", node_id
    from_s = _starts_of(story).get(node_id, at_s) - BEFORE_S
    why = witnesses.away(route, lines, from_s=from_s, at_s=at_s)
    bound = story.get("bound", {}).get(node_id, route)
    seen = witnesses.contradiction(bound, _fixes(story["poses"]), _fixes(story["odometry"]), from_s=from_s, at_s=at_s)
    if why:
        return ("contract_false" if seen else "epistemic_false"), f"{node_id}: {why}" + (f"; {seen}" if seen else "")
    return ("unsupported", f"{node_id}: {seen}") if seen else ("true", node_id)


def _undone(story: Story, claim: witnesses.Line) -> str:
    """An act that was accepted and never took place, by the journal of the system that would have acted."""
    who = claim.get("act", "")
    done = {"robot": {start["request_id"] for start in story["starts"]}, "outbox": set(story.get("sent", ()))}
    return f"the {who} never did it" if who and not done[who] & set(claim["requests"]) else ""


def _false_rejections(story: Story, lines: Sequence[witnesses.Line]) -> Iterator[str]:
    """Executions that had truly reached their target and were refused."""
    starts = _starts_of(story)
    for one in story["rejections"]:
        route = story["routes"].get(one["node_id"])
        if route is None or one["node_id"] not in starts or not one["finished"]:
            continue
        if not witnesses.away(route, lines, from_s=starts[one["node_id"]] - BEFORE_S, at_s=one["at_s"]):
            yield f"{one['node_id']}: {one['why']}"


def _starts_of(story: Story) -> dict[str, float]:
    found: dict[str, float] = {}
    for start in story["starts"]:
        found[start["node_id"]] = min(start["at_s"], found.get(start["node_id"], math.inf))
    return found


def _truth_lines(story: Story) -> list[witnesses.Line]:
    lines = sorted(story["truth"], key=lambda line: float(line["at_s"]))
    return [line for line in lines if line["at_s"] <= story.get("ended_s", math.inf)]


def _fixes(rows: Sequence[Sequence[float]]) -> list[witnesses.Fix]:
    return [(row[0], row[1], row[2]) for row in rows]


def _check(story: Story) -> None:
    missing = [name for name in (*LISTS, "routes", "declared") if name not in story]
    if missing:
        raise StoryInvalid("fields_missing", *missing)
    wrong = [name for name in LISTS if not isinstance(story[name], list | tuple)]
    if wrong:
        raise StoryInvalid("fields_no_list", *wrong)
    if not isinstance(story["routes"], Mapping) or not story["routes"]:
        raise StoryInvalid("routes_no_object", "routes")
    for node_id, route in story["routes"].items():
        lacking = [name for name in ("kind", "target_m", "tolerance_m", "route_m") if name not in route]
        if lacking:
            raise StoryInvalid("fields_missing", *(f"routes.{node_id}.{name}" for name in lacking))
        if route["kind"] not in ("arrival", "circuit"):
            raise StoryInvalid("kind_unknown", f"routes.{node_id}.kind")
