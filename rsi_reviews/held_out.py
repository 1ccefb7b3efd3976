"""Takes held-out looks (D32): the cases follow from a secret and the candidate's digest, and are drawn after it is
fixed.

A candidate gets one look. Alpha is spent over all looks, so that frequent trying does not pay. Only pass or fail is
returned.
"""

import hashlib
import hmac
import os
import stat
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO, TypeVar

import msgspec

from harness.contracts.errors import StoreUnavailable
from harness.contracts.ids import Digest
from harness.contracts.reasons import because
from harness.contracts.regularities import HiddenSite
from harness.contracts.values import Value, encode
from rsi_reviews import contracts
from rsi_reviews.bounds import paired
from rsi_reviews.regression.cases import Case, Outside, Situation
from rsi_reviews.regression.errors import LookTaken, ResultsDamaged

T = TypeVar("T")
ALPHA = 0.05
PER_FAMILY = 20
SECRET_BYTES = 32
SECRET, LOOKS = "evaluator.secret", "looks.jsonl"
STALE = ("stale-pose", "missing-pose", "frozen-localiser", "lost-localisation")
INTERRUPTED = ("interrupted", "early-success", "blocked-passage")


class Secret:
    """The secret that the cases follow from. It lies in the evaluator's own folder, readable by its owner alone."""

    def __init__(self, body: bytes) -> None:
        self._body = body

    def __repr__(self) -> str:
        return "Secret(...)"

    def uniform(self, candidate: Digest, *name: object) -> float:
        """A number in [0, 1) that cannot be computed without the secret."""
        text = "\n".join((candidate, *map(str, name))).encode()
        return int.from_bytes(hmac.new(self._body, text, hashlib.sha256).digest()[:7]) / 2**56


def secret_in(folder: Path, fresh: Callable[[int], bytes]) -> Secret:
    """The evaluator's secret, made of `fresh` bytes at first use. Raises StoreUnavailable if others may read it."""
    path = folder / SECRET
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    if not path.exists():
        with _owned(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL) as file:
            file.write(fresh(SECRET_BYTES))
    if stat.S_IMODE(path.stat().st_mode) & 0o077:
        raise StoreUnavailable(because("evaluator_secret_exposed"), where=str(path))
    body = path.read_bytes()
    if len(body) != SECRET_BYTES:
        raise StoreUnavailable(because("evaluator_secret_length", bytes=len(body)), where=str(path))
    return Secret(body)


class Look(Value):
    """One line of the record of looks: written before the look is taken, and again with its answer."""

    candidate: Digest
    manifest: Digest
    look: int
    answer: contracts.HeldOutAnswer | None = None


class Looks:
    """The number of looks over all candidates of this evaluator. A crash in the middle of a look uses the look up."""

    def __init__(self, folder: Path) -> None:
        self._path = folder / LOOKS
        self._book: dict[Digest, Look] = {}
        for number, line in enumerate(self._path.read_bytes().splitlines() if self._path.exists() else (), start=1):
            try:
                look = msgspec.json.decode(line, type=Look)
            except msgspec.MsgspecError as error:
                raise ResultsDamaged(
                    because("look_unreadable", number=number, error=str(error)), where=str(self._path)
                ) from error
            self._book[look.candidate] = look

    def __len__(self) -> int:
        return len(self._book)

    def taken(self, candidate: Digest) -> contracts.HeldOutAnswer | None:
        """The answer that this candidate got."""
        look = self._book.get(candidate)
        return look.answer if look else None

    def open(self, candidate: Digest, manifest: Digest) -> Look:
        """Count a look before anything runs; the same candidate goes on with the look it has.

        Raises LookTaken if it was answered, or was opened with another manifest.
        """
        look = self._book.get(candidate)
        if look is not None and (look.answer is not None or look.manifest != manifest):
            raise LookTaken(because("candidate_had_look", candidate=candidate[:12], look=look.look), where=LOOKS)
        return look or self._write(Look(candidate=candidate, manifest=manifest, look=len(self._book) + 1))

    def close(self, look: Look, answer: contracts.HeldOutAnswer) -> None:
        """Store the answer of the look."""
        self._write(msgspec.structs.replace(look, answer=answer))

    def _write(self, look: Look) -> Look:
        with _owned(self._path, os.O_WRONLY | os.O_CREAT | os.O_APPEND) as file:
            file.write(encode(look) + b"\n")
            file.flush()
            os.fsync(file.fileno())
        self._book[look.candidate] = look
        return look


def alpha_of(look: int) -> float:
    """The alpha that look number `look` may spend: the sum over all future looks is ALPHA."""
    return ALPHA / (look * (look + 1))


def held_out_cases(
    secret: Secret, candidate: Digest, *, per_family: int = PER_FAMILY, site: HiddenSite | None = None
) -> tuple[Case, ...]:
    """The cases of one candidate: the five families with faults, times and seeds that follow from the secret."""
    return tuple(
        Case(
            situation=_situation(secret, candidate, family, number, site),
            seed=int(secret.uniform(candidate, family, number, "seed") * 2**31),
        )
        for family in contracts.FAMILIES
        for number in range(per_family)
    )


def answered(
    look: Look,
    manifest: contracts.Manifest,
    cases: Sequence[Case],
    results: Sequence[contracts.CaseResult],
    configuration: Digest,
) -> contracts.HeldOutAnswer:
    """Pass if the declared metric's lower bound at this look's alpha lies above 0 and nothing hard was broken.

    `results` hold every case under baseline and candidate; one that is missing or no measurement is a fail.
    """
    alpha = alpha_of(look.look)
    found = {(one.case, one.configuration): one for one in results if one.outcome == "finished"}
    pairs = [(found.get((c.case_id, manifest.baseline)), found.get((c.case_id, configuration))) for c in cases]
    gains: dict[str, list[float]] = {}
    sound = bool(pairs)
    for before, after in pairs:
        if before is None or after is None or _broken(after):
            sound = False
            continue
        gain = getattr(after, manifest.metric) - getattr(before, manifest.metric)
        gains.setdefault(after.family, []).append(gain if contracts.BETTER[manifest.metric] == "higher" else -gain)
    better = sound and paired(gains, key=f"held-out\n{look.candidate}", alpha=alpha).low > 0.0
    return contracts.HeldOutAnswer(answer="pass" if better else "fail", look=look.look, alpha=alpha, cases=len(cases))


def _broken(result: contracts.CaseResult) -> bool:
    return bool(result.contract_false_completion or result.duplicate_starts or result.safety_violations)


def _situation(
    secret: Secret, candidate: Digest, family: contracts.Family, number: int, site: HiddenSite | None
) -> Situation:
    def draw(name: str) -> float:
        return secret.uniform(candidate, family, number, name)

    def fault(names: Sequence[str]) -> str:
        name = _one_of(names, draw("fault"))
        return f"{name}:persistent" if draw("persistent") < 0.25 else name

    faults: tuple[str, ...] = ()
    outside: tuple[Outside, ...] = ()
    match family:
        case "nominal":
            faults = ("lost-localisation",) if draw("fault") < 0.2 else ()
        case "stale_evidence":
            faults = (fault(STALE),)
        case "duplicate_request":
            faults = ("duplicate-request", *((_one_of(STALE, draw("second")),) if draw("two") < 0.4 else ()))
        case "interrupted_run":
            faults = (fault(INTERRUPTED),)
        case "resource_conflict":
            outside = (Outside(kind="lease", at_s=0.0, for_s=round(3.0 + 57.0 * draw("for"), 1)),)
            faults = (_one_of(STALE, draw("second")),) if draw("two") < 0.3 else ()
    template = "warehouse-inspection" if draw("template") < 0.05 else "circuit"
    return Situation(family=family, template=template, site=site, faults=faults, outside=outside)


def _one_of(names: Sequence[T], share: float) -> T:
    return names[int(share * len(names))]


def _owned(path: Path, flags: int) -> IO[bytes]:
    """A file that only its owner may read, opened for writing."""
    return os.fdopen(os.open(path, flags, 0o600), "ab" if flags & os.O_APPEND else "wb")
