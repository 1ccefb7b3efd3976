"""Values of successes that somebody else declared, and of what samples show of them. None of them is a fact."""

from typing import Literal, get_args

from harness.contracts.ids import Digest
from harness.contracts.reasons import Explanation, Reason
from harness.contracts.values import Count, NonNegative, Point, Value

Lack = Literal["target", "position", "arrival", "standstill", "second_source"]
"""What a success may lack: anything that says where it was to be; a position at that moment; its being there; its
standing there; a second source beside the one that declares the position.
"""
LACKS: tuple[Lack, ...] = get_args(Lack)
SuccessVerdict = Literal["backed", "lacking", "contradicted"]


class DeclaredSuccess(Value):
    """What was declared: at which moment (mission seconds), of which leg, and where it was to be, if that is known."""

    name: str
    at_s: float
    text: str = ""
    target_m: Point | None = None
    declared_distance_m: NonNegative | None = None


class SuccessFinding(Value):
    """The judgement. `distance_m` is from the target at that moment, `moved_m` how far it went in the 2 s after it."""

    success: DeclaredSuccess
    verdict: SuccessVerdict
    lacks: tuple[Lack, ...]
    distance_m: float | None
    moved_m: float | None


class AuditedRecording(Value):
    """One recording. `problem` says why it could not be read; then there is nothing else.

    `size_bytes` and `changed_ns` are those of its files together; `incomplete` says what a cut one lacks.
    """

    path: str
    size_bytes: Count
    changed_ns: Count
    settings: Digest
    sha256: str = ""
    duration_s: float = 0.0
    problem: Explanation | None = None
    incomplete: Reason | None = None
    successes: tuple[SuccessFinding, ...] = ()


class BagAudit(Value):
    """What an audit of one folder found so far."""

    folder: str
    recordings: tuple[AuditedRecording, ...]

    @property
    def unreadable(self) -> tuple[AuditedRecording, ...]:
        """Recordings that could not be read, with the reasons."""
        return tuple(one for one in self.recordings if one.problem is not None)

    @property
    def findings(self) -> tuple[SuccessFinding, ...]:
        """Every declared success of every recording."""
        return tuple(finding for one in self.recordings for finding in one.successes)
