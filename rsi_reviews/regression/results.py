"""Stores results so that they survive a crash: one JSON line per case and configuration, written as soon as it
is known.
"""

import os
from collections.abc import Iterable, Iterator
from functools import lru_cache
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import TypeVar

import msgspec

from harness.contracts.ids import Digest, sha256
from harness.contracts.reasons import because
from harness.contracts.values import Value, encode
from rsi_reviews.contracts import CaseResult
from rsi_reviews.regression.errors import ResultsDamaged

T = TypeVar("T")
Key = tuple[Digest, Digest]
"""Case and configuration."""


class ResultsHeader(Value):
    """The first line: the evaluator that measured what follows. Results of two evaluators are never in one file."""

    evaluator: str


class ResultsFile:
    """The results of one evaluator in one file; only finished ones are kept, so what failed is run again.

    A last line that a crash cut short is dropped. Raises ResultsDamaged for any other unreadable line, or for a file
    of another evaluator.
    """

    def __init__(self, path: Path, *, evaluator: str) -> None:
        self.path = path
        self._results: dict[Key, CaseResult] = {}
        path.parent.mkdir(parents=True, exist_ok=True)
        sound = self._read(path.read_bytes(), evaluator) if path.exists() else 0
        if sound:
            os.truncate(path, sound)
        else:
            path.write_bytes(encode(ResultsHeader(evaluator=evaluator)) + b"\n")

    def get(self, key: Key) -> CaseResult | None:
        """The finished result of a case under a configuration."""
        return self._results.get(key)

    def add(self, results: Iterable[CaseResult]) -> None:
        """Store results that are finished and not yet stored; on the disk when this returns."""
        new = {(one.case, one.configuration): one for one in results if one.outcome == "finished"}
        new = {key: one for key, one in new.items() if key not in self._results}
        self._results |= new
        with self.path.open("ab") as file:
            file.writelines(encode(one) + b"\n" for one in new.values())
            file.flush()
            os.fsync(file.fileno())

    def __len__(self) -> int:
        return len(self._results)

    def _read(self, body: bytes, evaluator: str) -> int:
        """Read every whole line; returns the number of bytes that are valid."""
        lines = body.split(b"\n")
        whole = lines[:-1]
        if not whole:
            return 0
        heading = self._line(whole[0], ResultsHeader, 1)
        if heading.evaluator != evaluator:
            raise ResultsDamaged(
                because("results_of_another_evaluator", measured_by=heading.evaluator, evaluator=evaluator),
                where=str(self.path),
            )
        for number, line in enumerate(whole[1:], start=2):
            result = self._line(line, CaseResult, number)
            self._results[result.case, result.configuration] = result
        return len(body) - len(lines[-1])

    def _line(self, line: bytes, kind: type[T], number: int) -> T:
        try:
            return msgspec.json.decode(line, type=kind)
        except msgspec.MsgspecError as error:
            raise ResultsDamaged(
                because("results_line_unreadable", number=number, error=str(error)), where=str(self.path)
            ) from error


def results_path(folder: Path, evaluator: str) -> Path:
    """Where an evaluator's folder keeps the results of this version of it."""
    return folder / f"results-{evaluator.rpartition('+')[2]}.jsonl"


@lru_cache(maxsize=1)
def evaluator_version(simulator: Digest) -> str:
    """Identifies the evaluator by its sources: any source that can change a result changes it, the harness included.

    `simulator` names the sources of the simulator that the cases run on.
    """
    reviews, harness = files("rsi_reviews"), files("harness")
    judging = [reviews.joinpath("evaluation", name) for name in ("adjudicator.py", "story.py", "witnesses.py")]
    texts = [*_texts(harness), *_texts(reviews.joinpath("regression")), *(one.read_bytes() for one in judging)]
    return f"regression-1+{sha256(b''.join((*texts, simulator.encode())))[:16]}"


def _texts(folder: Traversable) -> Iterator[bytes]:
    """Name and contents of every source and shipped text under a folder, in order of their names."""
    for entry in sorted(folder.iterdir(), key=lambda one: one.name):
        if entry.is_dir():
            yield from _texts(entry)
        elif entry.name.endswith((".py", ".yaml")):
            yield entry.name.encode() + b"\n" + entry.read_bytes()
