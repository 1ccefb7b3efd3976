"""What an installed predicate is: its declaration, the evidence it is shown, and its answer; for packages beside us.

A package names its predicates as entry points of the group `regenharness.predicates`, each an `EvidencePredicate`:

    from harness.contracts.predicates import PredicateAnswer, EvidencePredicate, PredicateEvidence

    def held(effect: dict[str, Any], evidence: PredicateEvidence) -> PredicateAnswer: ...

    HELD = EvidencePredicate(name="acme.held", version="1", effect="symbolic", sources=("gripper width",), test=held)

The function is asked in a process of its own, with the evidence of its declared sources and nothing else, twice with
the same question; both answers must be equal. What it says is a finding: only the harness derives its independence, and
only the gate decides what it may change.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Any, Literal

import msgspec

from harness.contracts.errors import ContractInvalid, HarnessError
from harness.contracts.ids import Digest
from harness.contracts.observations import InstrumentReading, Odometry, Pose
from harness.contracts.protocol import Receipt
from harness.contracts.reasons import because
from harness.contracts.values import Name, Value
from harness.contracts.verdicts import PredicateVerdict

GROUP = "regenharness.predicates"
PredicateName = Annotated[str, msgspec.Meta(pattern=r"^[a-z][a-z0-9_]{0,40}\.[a-z][a-z0-9_]{0,40}$")]
"""An installed predicate is always `vendor.name`; a name without a dot is the harness's own."""
EffectType = Literal["symbolic", "metric", "relational", "visual", "temporal"]


class PredicateEvidence(Value):
    """The evidence of the declared sources, oldest first: of the execution from `from_s` on, or of the last seconds.

    `instruments` has the readings of every declared instrument by its name; instants are mission seconds. `receipts`
    are the provider's own word; they are shown only where the predicate declares "receipts".
    """

    at_s: float
    from_s: float
    instruments: dict[str, tuple[InstrumentReading, ...]] = msgspec.field(default_factory=dict)
    poses: tuple[Pose, ...] = ()
    odometry: tuple[Odometry, ...] = ()
    receipts: tuple[Receipt, ...] = ()


class PredicateAnswer(Value):
    """A predicate's answer: its verdict, why in one sentence, and what it measured against which bounds."""

    verdict: PredicateVerdict
    why: Annotated[str, msgspec.Meta(max_length=300)]
    measured: dict[str, float] = msgspec.field(default_factory=dict)
    bounds: dict[str, float] = msgspec.field(default_factory=dict)


@dataclass(frozen=True)
class EvidencePredicate:
    """What an entry point names. `test` must be a pure function of its two arguments."""

    name: str
    version: str
    effect: EffectType
    sources: tuple[str, ...]
    test: Callable[[dict[str, Any], PredicateEvidence], PredicateAnswer]


class InstalledPredicate(Value):
    """A predicate as it is installed: what it declares, which package brought it, and the digest of its module."""

    name: PredicateName
    version: Name
    effect: EffectType
    sources: Annotated[tuple[Name, ...], msgspec.Meta(min_length=1, max_length=16)]
    package: Name
    code: Digest


class PinnedPredicate(Value):
    """The predicate that a mission is judged by (D57). `vouched`: its site vouches for it, so that it may be decisive.

    Under another version, or other code of the same version, its conditions are undecided.
    """

    installed: InstalledPredicate
    vouched: bool


class PredicateQuestion(Value):
    """What is asked of one installed predicate."""

    effect: dict[str, Any]
    evidence: PredicateEvidence


class NoPredicates:
    """An installation without further predicates. Implements `contracts.ports.Predicates`."""

    installed: Mapping[str, InstalledPredicate] = MappingProxyType({})
    problems: tuple[HarnessError, ...] = ()

    def ask(self, name: str, question: PredicateQuestion) -> PredicateAnswer:
        """Raises ContractInvalid: there is none."""
        raise ContractInvalid(because("predicate_not_installed", name=name), where=name)


NO_PREDICATES = NoPredicates()


def is_installed_name(name: str) -> bool:
    """Whether a predicate's name is one of an installed package, and not the harness's own."""
    return "." in name
