"""Shapes what several pages show of the past: one event of a stream as a sentence, and what changed since a reading."""

from dataclasses import dataclass


@dataclass(frozen=True)
class HistoryLine:
    """One stored event as a sentence, with its position in the log and its wall time in seconds since the epoch."""

    position: int
    at_s: float
    text: str


@dataclass(frozen=True)
class ShownDifference:
    """One field that is no longer as the person saw it when they decided."""

    name: str
    was: str
    now: str
