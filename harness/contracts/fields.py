"""Lists every field of a configuration with its unit, bound and meaning, read from the types that enforce them.

A template's stages, conditions and constraints are open text until they are bound; they are listed as their bound
types.
"""

from collections.abc import Iterator, Mapping
from typing import Any, Literal, get_args

import msgspec
from msgspec import inspect

from harness.contracts import tasks
from harness.contracts.configuration import Configuration
from harness.contracts.effects import Condition, Precondition
from harness.contracts.values import Value

Section = Literal["context_rules", "templates", "routing", "recovery"]
SECTIONS: tuple[Section, ...] = get_args(Section)


class Field(Value):
    """One field. `path` as in JSON, with `[]` for each item of a list: `templates[].nodes[].timeout_s`."""

    path: str
    section: Section
    unit: str
    bound: str
    meaning: str


OPEN: Mapping[str, Any] = {
    "templates[].nodes[]": tasks.Node,
    "templates[].completion_conditions[]": Condition,
    "templates[].constraints": tasks.Constraints,
}
"""What the open parts of a template become when they are bound."""

Owner = tuple[type[msgspec.Struct], str]
Words = Mapping[str, tuple[str, str]]
MEANINGS: Mapping[type[msgspec.Struct], Words] = {
    tasks.TaskTemplate: {
        "name": ("name", "What the template is chosen by"),
        "version": ("name", "Its author's version"),
        "title": ("text", "How people see it"),
        "goal": ("text", "The goal where the person says none of their own"),
        "phrases": ("text", "Words by which a goal finds this template, in the order of the templates"),
        "recovery_total": ("steps", "Recovery steps of all stages together"),
        "serves": ("clauses", "For which clauses of a goal the template is taken"),
        "stages": ("names", "The stage that answers a further act, such as a return"),
        "outcome": ("sentence", "What a spoken report says of it once its stages were accepted"),
        "outcomes": ("sentences", "What a report says of templates that state no outcome themselves, by their names"),
    },
    tasks.Serves: {
        "act": ("name", "What a clause asks for"),
        "object": ("kind", "What kind of thing it is about"),
        "parameter": ("name", "Which parameter takes the place"),
    },
    tasks.TemplateParameter: {
        "name": ("name", "What the template refers to it by"),
        "type": ("name", "What it is bound to: a place of the site, a text or a number"),
        "title": ("text", "How people see it"),
        "default": ("as its type", "What is taken where the person gives nothing"),
    },
    tasks.Node: {
        "node_id": ("name", "The stage's name in its graph"),
        "subgoal": ("text", "What the stage is for"),
        "capabilities": ("names", "What a provider must be able to do to serve the stage"),
        "parameters": ("as the card says", "What the provider is given"),
        "resources": ("names", "What the stage holds alone while it runs"),
        "timeout_s": ("s", "Longest time from dispatch to a terminal report"),
        "depends_on": ("names", "Stages that are accepted before this one starts"),
        "required": ("yes or no", "Whether the goal needs the stage"),
        "risk": ("class", "How dangerous the stage is; high risk needs a person's approval"),
        "runs_after_failure": ("yes or no", "Whether the stage still runs once a required one has failed"),
    },
    tasks.EvidencePolicy: {
        "mandatory": ("kinds", "What a packet must hold"),
        "pose_age_s": ("s", "Age beyond which a pose proves nothing"),
        "image_age_s": ("s", "Age beyond which an image proves nothing"),
        "minimum_confidence": ("share", "Confidence below which an observation proves nothing"),
        "attestation": ("yes or no", "Whether a person's own observation may stand in"),
        "declared": ("names", "Conditions that may rest on the provider's word alone; the stage then ends declared"),
    },
    tasks.RecoveryLimits: {
        "re_perceive": ("steps", "Looks again without moving"),
        "adjust_view": ("steps", "Looks again for longer, without moving"),
        "retry": ("steps", "The stage again as it was"),
        "local_replan": ("steps", "The stage again by a way planned anew"),
        "switch_skill": ("steps", "Another provider"),
        "total": ("steps", "All of these together"),
    },
    tasks.Constraints: {
        "speed_cap_mps": ("m/s", "Fastest the body may be asked to move"),
        "keep_out": ("places", "Where the body may not go"),
        "resources": ("names", "All that may be used; none named states no limit"),
        "minimum_charge": ("share", "Battery charge below which nothing starts"),
    },
    Condition: {
        "condition_id": ("name", "The condition's name"),
        "text": ("text", "What must have become true, for people"),
        "effect": ("as its kind", "What is measured, against which target and bound"),
        "fact": ("kind", "Whether its truth is permanent or lasts only while it holds"),
        "independence": ("level", "How independent of the provider the evidence must be"),
        "clause": ("name", "The act of a goal that it is tested for"),
    },
    Precondition: {
        "predicate": ("name", "What must hold at every dispatch"),
        "target_m": ("m", "Where the body must stand, in the contract's frame"),
        "tolerance_m": ("m", "How near to it"),
    },
}


def fields() -> tuple[Field, ...]:
    """All fields of all four sections, in the order of their types."""
    return tuple(_of_struct(Configuration, ""))


def _of_struct(kind: type[msgspec.Struct], path: str) -> Iterator[Field]:
    info = inspect.type_info(kind)
    if not isinstance(info, inspect.StructType):
        raise TypeError(f"{kind.__name__} is no struct")
    for field in info.fields:
        yield from _of(field.type, f"{path}.{field.encode_name}" if path else field.encode_name, (kind, field.name))


def _of(kind: inspect.Type, path: str, owner: Owner) -> Iterator[Field]:
    bare = kind.type if isinstance(kind, inspect.Metadata) else kind
    if isinstance(bare, inspect.VarTupleType):
        item = bare.item_type
        if isinstance(item, inspect.StructType) or f"{path}[]" in OPEN:
            yield from _of(item, f"{path}[]", owner)
            return
    if path in OPEN:
        yield from _of_struct(OPEN[path], path)
    elif isinstance(bare, inspect.StructType):
        yield from _of_struct(bare.cls, path)
    else:
        yield _leaf(kind, bare, path, owner)


def _leaf(kind: inspect.Type, bare: inspect.Type, path: str, owner: Owner) -> Field:
    section = next(one for one in SECTIONS if path.partition(".")[0].partition("[")[0] == one)
    if isinstance(kind, inspect.Metadata) and kind.extra and kind.extra_json_schema:
        unit, meaning = str(kind.extra["unit"]), str(kind.extra_json_schema["description"])
    else:
        unit, meaning = MEANINGS[owner[0]][owner[1]]
    return Field(path=path, section=section, unit=unit, bound=bound(bare), meaning=meaning)


def bound(kind: inspect.Type) -> str:
    """The bound of a value of this type, in words; empty where the type alone is the bound."""
    match kind:
        case inspect.Metadata():
            return bound(kind.type)
        case inspect.LiteralType():
            return "one of " + ", ".join(str(value) for value in kind.values)
        case inspect.UnionType():
            return " or ".join(dict.fromkeys(words for one in kind.types if (words := bound(one))))
        case inspect.IntType() | inspect.FloatType():
            return _range(kind)
        case inspect.StrType(pattern=str(pattern)):
            return f"matches {pattern}"
        case inspect.StrType(min_length=int(least), max_length=int(most)):
            return f"{least} to {most} characters"
        case inspect.VarTupleType():
            at_least = f"at least {kind.min_length}; " if kind.min_length else ""
            return f"{at_least}each {bound(kind.item_type)}" if bound(kind.item_type) else at_least.rstrip("; ")
        case inspect.DictType():
            return f"by {bound(kind.key_type)}: {bound(kind.value_type)}" if bound(kind.key_type) else ""
        case _:
            return ""


def _range(kind: inspect.IntType | inspect.FloatType) -> str:
    whole = "whole number" if isinstance(kind, inspect.IntType) else "number"
    if kind.ge is not None and kind.le is not None:
        return f"{whole} from {kind.ge:g} to {kind.le:g}"
    if kind.gt is not None:
        return f"{whole} above {kind.gt:g}"
    return f"{whole} of at least {kind.ge:g}" if kind.ge is not None else ""
