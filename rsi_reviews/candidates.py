"""Reads candidates and manifests that come from outside (a file, a person's editor, a model): strict, bounded, typed.

Text from outside is data. It is never an instruction, and no model's answer approves anything.
"""

import json
from typing import Any, TypeVar

import msgspec
import msgspec.inspect

from harness.contracts.configuration import Configuration
from harness.contracts.listed_values import why_invalid
from harness.contracts.reasons import because
from harness.contracts.values import decode
from rsi_reviews.contracts import SECTIONS, Candidate, Manifest
from rsi_reviews.errors import CandidateInvalid

LARGEST_BYTES = 1_048_576
DEEPEST = 24
OUTSIDE: dict[str, str] = {
    "gate": "names_the_gate", "commit_gate": "names_the_gate", "rules": "names_the_gate",
    "gate_rules": "names_the_gate", "verifier": "names_the_gate", "verification": "names_the_gate",
    "predicate": "names_the_predicate", "acceptance": "names_the_predicate", "clauses": "names_the_predicate",
    "acceptance_predicate": "names_the_predicate", "evaluator": "names_the_predicate",
    "suite": "names_the_suite", "suites": "names_the_suite", "regression": "names_the_suite",
    "held_out": "names_the_suite", "safety": "names_a_safety_limit", "safety_limits": "names_a_safety_limit",
    "limits": "names_a_safety_limit", "interlocks": "names_a_safety_limit",
}  # fmt: skip
"""What lies outside every configuration, and the rule by which naming it is refused."""
T = TypeVar("T")


def read_candidate(configuration: bytes, manifest: bytes) -> Candidate:
    """A candidate from its two JSON texts. Raises CandidateInvalid with the rule and the path of what is wrong."""
    stated = read_manifest(manifest)
    return Candidate(configuration=read_configuration(configuration), manifest=stated, baseline=stated.baseline)


def read_configuration(body: bytes) -> Configuration:
    """Strict JSON of a configuration: four sections and nothing else (R154). Raises CandidateInvalid."""
    tree = _tree(body, "candidate")
    for path, name in _keys(tree):
        if name in OUTSIDE:
            raise CandidateInvalid(
                because("candidate_outside", name=name, sections=tuple(SECTIONS)), rule=OUTSIDE[name], where=path
            )
    return _typed(body, Configuration, "candidate")


def read_manifest(body: bytes) -> Manifest:
    """Strict JSON of a manifest. Raises CandidateInvalid."""
    _tree(body, "manifest")
    return _typed(body, Manifest, "manifest")


def _keys(tree: Any) -> list[tuple[str, str]]:
    """Keys of the top and of the sections that are plain values, with their paths."""
    if not isinstance(tree, dict):
        return []
    found = [(f"$.{key}", key) for key in tree]
    for section in ("context_rules", "routing", "recovery"):
        if isinstance(tree.get(section), dict):
            found += [(f"$.{section}.{key}", key) for key in tree[section]]
    return found


def _tree(body: bytes, where: str) -> Any:
    if len(body) > LARGEST_BYTES:
        raise CandidateInvalid(
            because("candidate_too_large", size_bytes=len(body), limit_bytes=LARGEST_BYTES),
            rule="too_large",
            where=where,
        )
    if _depth(body) > DEEPEST:
        raise CandidateInvalid(because("candidate_too_deep", limit=DEEPEST), rule="too_deep", where=where)
    _check_keys(body, where)
    try:
        return msgspec.json.decode(body)
    except (msgspec.DecodeError, UnicodeDecodeError, RecursionError) as error:
        raise CandidateInvalid(because("candidate_not_json", error=str(error)), rule="not_json", where=where) from error


def _check_keys(body: bytes, where: str) -> None:
    """Raise CandidateInvalid for a key that stands twice in one object: readers differ in which of the two they take.

    Text that is no JSON at all passes: it is refused where it is read.
    """

    def unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        tree: dict[str, Any] = {}
        for name, value in pairs:
            if name in tree:
                raise CandidateInvalid(because("candidate_key_twice", name=name[:80]), rule="key_twice", where=where)
            tree[name] = value
        return tree

    try:
        json.loads(body, object_pairs_hook=unique)
    except (ValueError, RecursionError):
        return


def _depth(body: bytes) -> int:
    """How deep brackets nest, brackets inside strings included, so that the check can only be too strict."""
    deepest = depth = 0
    for byte in body:
        if byte in b"[{":
            depth += 1
            deepest = max(deepest, depth)
        elif byte in b"]}":
            depth -= 1
    return deepest


def _typed(body: bytes, kind: type[T], where: str) -> T:
    try:
        return decode(body, kind)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        what, place = why_invalid(error, kind)
        rule = "unknown_key" if "unknown field" in str(error) else "wrong_type"
        reason = because("field_invalid", error=what) if isinstance(what, str) else what
        raise CandidateInvalid(reason, rule=rule, where=f"{where}, {place}") from error
