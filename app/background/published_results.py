"""Reads the published evaluation and recursion documents in docs/results when they change. Writes nothing."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import msgspec

from app.i18n.languages import explained
from harness.contracts.errors import ContractInvalid, UnknownName
from harness.contracts.reasons import because
from rsi_reviews.evaluation.report import load

Document = Mapping[str, Any]


@dataclass(frozen=True)
class PublishedResults:
    """Both documents as JSON values; None where there is none yet. `wrong` says why one cannot be read."""

    evaluation: Document | None
    recursion: Document | None
    wrong: tuple[str, ...]


def published_results(folder: Path) -> PublishedResults:
    """What docs/results holds now."""
    wrong = []
    found: dict[str, Document | None] = {}
    for name, read in (("evaluation", _evaluation), ("recursion", _recursion)):
        path = folder / f"{name}.json"
        try:
            found[name] = read(path, path.stat().st_mtime_ns) if path.is_file() else None
        except (ContractInvalid, UnknownName) as error:
            found[name] = None
            wrong.append(explained(error))
    return PublishedResults(evaluation=found["evaluation"], recursion=found["recursion"], wrong=tuple(wrong))


@lru_cache(maxsize=2)
def _evaluation(path: Path, changed: int) -> Document:
    made: Document = msgspec.to_builtins(load(path))
    return made


@lru_cache(maxsize=2)
def _recursion(path: Path, changed: int) -> Document:
    try:
        found = json.loads(path.read_bytes())
    except ValueError as error:
        raise ContractInvalid(because("results_unreadable", error=str(error)), where=str(path)) from error
    if not isinstance(found, dict) or not isinstance(found.get("rows"), list):
        raise ContractInvalid(because("results_empty"), where=str(path))
    return found
