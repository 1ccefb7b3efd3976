"""Finds the predicates of installed packages and asks them, always in a process of their own with limits.

Nothing of such a package is imported here: the child reads what it declares, and runs its function.
"""

import os
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from inspect import getsourcefile
from pathlib import Path

import msgspec

from harness.adapters.limited_process import Limits, run_limited
from harness.contracts.errors import ContractInvalid, HarnessError
from harness.contracts.ids import sha256
from harness.contracts.predicates import (
    GROUP,
    EvidencePredicate,
    InstalledPredicate,
    PredicateAnswer,
    PredicateQuestion,
)
from harness.contracts.reasons import because
from harness.contracts.values import Value, decode, encode

LIMITS = Limits(memory_bytes=256 * 2**20, cpu_s=2.0, wall_s=5.0, output_bytes=64 * 1024)
MOST_PREDICATES = 64


class LoadRequest(Value):
    """One entry point, where its package is found, and the question; none asks for its declaration."""

    name: str
    value: str
    package: str
    path: tuple[str, ...]
    question: PredicateQuestion | None = None


@dataclass(frozen=True)
class Found:
    """The usable predicates with their entry points, and why others are not usable."""

    usable: Mapping[str, tuple[InstalledPredicate, EntryPoint]]
    problems: tuple[HarnessError, ...]


class InstalledPredicates:
    """Implements `contracts.ports.Predicates` on the entry points of this installation, read when first needed."""

    @property
    def installed(self) -> Mapping[str, InstalledPredicate]:
        """What packages bring, by name; a predicate that cannot be loaded is among `problems`."""
        return {name: declared for name, (declared, _) in _found(tuple(sys.path)).usable.items()}

    @property
    def problems(self) -> tuple[HarnessError, ...]:
        """Entry points that bring nothing usable, and why."""
        return _found(tuple(sys.path)).problems

    def ask(self, name: str, question: PredicateQuestion) -> PredicateAnswer:
        """Raises ContractInvalid: it is not installed, broke, took too long or answers two ways."""
        known = _found(tuple(sys.path)).usable.get(name)
        if known is None:
            raise ContractInvalid(because("predicate_not_installed", name=name), where=name)
        try:
            return decode(run_limited(load, encode(_request(known[1], question)), LIMITS, where=name), PredicateAnswer)
        except msgspec.MsgspecError as error:
            raise ContractInvalid(because("parser_answer_unreadable"), where=name) from error


INSTALLED = InstalledPredicates()
"""Those of this installation."""


@lru_cache(maxsize=4)
def _found(path: tuple[str, ...]) -> Found:
    """What is installed where Python looks for packages; loaded once."""
    usable: dict[str, tuple[InstalledPredicate, EntryPoint]] = {}
    problems: list[HarnessError] = []
    for point in sorted(entry_points(group=GROUP), key=lambda one: (one.name, one.value))[:MOST_PREDICATES]:
        try:
            declared = decode(run_limited(load, encode(_request(point)), LIMITS, where=point.value), InstalledPredicate)
            if declared.name != point.name or declared.name in usable:
                raise ContractInvalid(because("predicate_misnamed", name=declared.name), where=point.value)
        except (HarnessError, msgspec.MsgspecError) as error:
            reason = error.reason if isinstance(error, HarnessError) else str(error)
            unusable = because("predicate_unusable", name=point.name, reason=reason)
            problems.append(ContractInvalid(unusable, where=point.value))
            continue
        usable[declared.name] = (declared, point)
    return Found(usable, tuple(problems))


def _request(point: EntryPoint, question: PredicateQuestion | None = None) -> LoadRequest:
    path = tuple(os.path.abspath(one) for one in sys.path if one)
    package = f"{point.dist.name} {point.dist.version}" if point.dist else "unknown"
    return LoadRequest(name=point.name, value=point.value, package=package, path=path, question=question)


def load(request: bytes) -> bytes:
    """In the child: the declaration of one entry point, or its answer to a question. Raises ContractInvalid."""
    loading = decode(request, LoadRequest)
    sys.path.extend(one for one in loading.path if one not in sys.path)
    found = EntryPoint(name=loading.name, value=loading.value, group=GROUP).load()
    if not isinstance(found, EvidencePredicate):
        raise ContractInvalid(because("predicate_is_none", kind=type(found).__name__), where=loading.value)
    return encode(_declared(found, loading) if loading.question is None else _answer(found, loading.question))


def _declared(found: EvidencePredicate, loading: LoadRequest) -> InstalledPredicate:
    source = getsourcefile(found.test)
    if source is None:
        raise ContractInvalid(because("predicate_without_source"), where=loading.value)
    body = {
        "name": found.name,
        "version": found.version,
        "effect": found.effect,
        "sources": found.sources,
        "package": loading.package,
        "code": sha256(Path(source).read_bytes()),
    }
    return msgspec.convert(body, InstalledPredicate)


def _answer(found: EvidencePredicate, question: PredicateQuestion) -> PredicateAnswer:
    """Asked twice with the same question: a function that changes it, or remembers the first time, is not pure."""
    body = encode(question)
    answers = []
    for _ in range(2):
        own = decode(body, PredicateQuestion)
        answer = found.test(own.effect, own.evidence)
        if not isinstance(answer, PredicateAnswer):
            raise ContractInvalid(because("predicate_answers_nothing", kind=type(answer).__name__), where=found.name)
        if encode(own) != body:
            raise ContractInvalid(because("predicate_changes_evidence"), where=found.name)
        answers.append(encode(answer))
    if answers[0] != answers[1]:
        raise ContractInvalid(because("predicate_answers_two_ways"), where=found.name)
    return decode(answers[0], PredicateAnswer)
