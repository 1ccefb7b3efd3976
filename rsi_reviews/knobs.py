"""Lists what a person may turn in a configuration: each knob with its unit, its meaning and how far the rules let
it go. Pure.
"""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, get_args

import msgspec

from harness.contracts.configuration import SPENDING, Configuration, FailureClass, RecoveryAction
from harness.contracts.fields import Section, fields
from harness.contracts.values import Value
from rsi_reviews.restrictions import (
    HALF_LIFE_CEILING,
    ITEM_CEILINGS,
    LOCKED_LADDERS,
    LONGEST_LADDER,
    WAIT_CEILING_S,
    WEIGHT_CEILING,
    loosened,
)
from rsi_reviews.runnable import ITEM_FLOORS, unrunnable
from rsi_reviews.template_restrictions import MISSION_CEILING, TIMEOUT_CEILING_S

LADDERS = "recovery.ladders"
TEMPLATES = "templates"
Ladder = tuple[RecoveryAction, ...]
ADDED: tuple[RecoveryAction, ...] = (*SPENDING, "verify_again", "wait")


class Knob(Value):
    """One value of a configuration that a candidate may set.

    `least` and `most` bound a number, both included; with `above` it has to lie above `least`. `whole`: without a
    fraction. A ladder has neither: what it may become, `ladders_from` lists.
    """

    path: str
    section: Section
    unit: str
    meaning: str
    now: float | Ladder
    least: float = 0.0
    most: float | None = None
    above: bool = False
    whole: bool = False
    of: str = ""

    @property
    def is_ladder(self) -> bool:
        """Whether it holds steps, not a number."""
        return isinstance(self.now, tuple)

    @property
    def name(self) -> str:
        """Its own name, without where it stands."""
        return self.path.rpartition(".")[2].removesuffix("_s")


class _Range(NamedTuple):
    least: float = 0.0
    most: float | None = None
    above: bool = False


def knobs(current: Configuration) -> tuple[Knob, ...]:
    """Every knob, in the order of the sections; what no candidate may change is left out."""
    return (*_recovery(current), *_routing(current), *_context_rules(current), *_templates(current))


def ladders_from(current: Configuration, failure: FailureClass) -> tuple[Ladder, ...]:
    """What the ladder of a failure may become by one step: one left out, two swapped, or one added. Checked against the
    rules, so that each could be proposed.
    """
    now = current.recovery.ladders[failure]
    rungs = now[:-1]
    found: list[Ladder] = [rungs[:at] + rungs[at + 1 :] for at in range(len(rungs))]
    found += [(*rungs[:at], rungs[at + 1], rungs[at], *rungs[at + 2 :]) for at in range(len(rungs) - 1)]
    if len(now) < LONGEST_LADDER:
        found += [(*rungs[:at], step, *rungs[at:]) for step in ADDED for at in range(len(rungs) + 1)]
    ladders: list[Ladder] = [(*one, "human") for one in dict.fromkeys(found) if one != rungs]
    return tuple(one for one in ladders if not _broken(current, failure, one))


def turned(current: Configuration, typed: Mapping[str, str]) -> str:
    """The configuration with the typed values in it, as JSON. A number that cannot be read stays text, which reading
    refuses by its position.
    """
    tree: dict[str, Any] = msgspec.to_builtins(current)
    for knob in knobs(current):
        text = typed.get(knob.path, "").strip()
        if text and text != value_text(knob.now):
            owner, name = _owner(tree, knob)
            owner[name] = _typed(text, knob)
    return msgspec.json.encode(tree).decode()


def value_text(value: float | Ladder) -> str:
    """The value as a person types it."""
    return " > ".join(value) if isinstance(value, tuple) else f"{value:g}"


def _recovery(current: Configuration) -> Iterator[Knob]:
    policy = current.recovery
    for failure in get_args(FailureClass):
        if failure in policy.ladders and failure not in LOCKED_LADDERS:
            meaning = _MEANINGS[LADDERS]
            yield Knob(path=f"{LADDERS}.{failure}", section="recovery", unit="", meaning=meaning,
                       now=policy.ladders[failure])  # fmt: skip
    yield _number(current, "recovery.wait_s", _Range(most=min(policy.wait_s, WAIT_CEILING_S), above=True))
    yield _number(current, "recovery.approval_share", _Range(most=policy.approval_share))


def _routing(current: Configuration) -> Iterator[Knob]:
    for name in current.routing.__struct_fields__:
        half_life = name == "history_half_life"
        most = HALF_LIFE_CEILING if half_life else WEIGHT_CEILING
        yield _number(current, f"routing.{name}", _Range(most=most, above=half_life))


def _context_rules(current: Configuration) -> Iterator[Knob]:
    rules = current.context_rules
    for name, most in ITEM_CEILINGS.items():
        least = float(min(ITEM_FLOORS.get(name, 0), getattr(rules, name)))
        yield _number(current, f"context_rules.{name}", _Range(least=least, most=float(most)))
    yield _number(current, "context_rules.minimum_confidence", _Range(least=rules.minimum_confidence, most=1.0))
    for name in ("pose_age_s", "image_age_s"):
        yield _number(current, f"context_rules.{name}", _Range(most=getattr(rules, name), above=True))


def _templates(current: Configuration) -> Iterator[Knob]:
    for template in current.templates:
        path = f"{TEMPLATES}.{template.name}"
        spends = any(node.get("recovery", {}).get("total", 0) for node in template.nodes)
        yield Knob(
            path=f"{path}.recovery_total", section="templates", unit="steps", of=template.name, whole=True,
            meaning=_MEANINGS["templates[].recovery_total"], now=float(template.recovery_total),
            least=float(spends), most=float(MISSION_CEILING),
        )  # fmt: skip
        for node in template.nodes:
            timeout_s = node.get("timeout_s")
            if isinstance(timeout_s, int | float) and timeout_s <= TIMEOUT_CEILING_S:
                yield Knob(
                    path=f"{path}.nodes.{node['node_id']}.timeout_s", section="templates", unit="s", of=template.name,
                    meaning=_MEANINGS["templates[].nodes[].timeout_s"], now=float(timeout_s), most=TIMEOUT_CEILING_S,
                    above=True,
                )  # fmt: skip


def _number(current: Configuration, path: str, reach: _Range) -> Knob:
    section, _, name = path.partition(".")
    value = getattr(getattr(current, section), name)
    return Knob(
        path=path,
        section=section,  # type: ignore[arg-type]
        unit=_UNITS[path],
        meaning=_MEANINGS[path],
        now=float(value),
        least=reach.least,
        most=reach.most,
        above=reach.above,
        whole=isinstance(value, int),
    )


def _broken(current: Configuration, failure: FailureClass, ladder: Ladder) -> bool:
    recovery = msgspec.structs.replace(current.recovery, ladders={**current.recovery.ladders, failure: ladder})
    other = msgspec.structs.replace(current, recovery=recovery)
    return bool(loosened(current, other) or unrunnable(current, other))


def _owner(tree: dict[str, Any], knob: Knob) -> tuple[dict[str, Any], str]:
    """The part of the configuration that holds a knob's value, and under which name."""
    if knob.is_ladder:
        return tree["recovery"]["ladders"], knob.path.rpartition(".")[2]
    name = knob.path.rpartition(".")[2]
    if knob.section != "templates":
        return tree[knob.section], name
    template = next(one for one in tree["templates"] if one["name"] == knob.of)
    if name == "recovery_total":
        return template, name
    stage = knob.path.split(".")[-2]
    return next(node for node in template["nodes"] if node["node_id"] == stage), name


def _typed(text: str, knob: Knob) -> Any:
    if knob.is_ladder:
        return [one.strip() for one in text.split(">") if one.strip()]
    try:
        return int(text) if knob.whole else float(text)
    except ValueError:
        return text


_FIELDS = {one.path: one for one in fields()}
_UNITS = {path: one.unit for path, one in _FIELDS.items()}
_MEANINGS = {path: one.meaning for path, one in _FIELDS.items()}
