"""Runs the cells of the protocol on local processes, judges every mission from outside, and stores finished missions.

An interrupted run loses nothing: finished missions are lines of a file and are not run again.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import msgspec

from harness.contracts.errors import ContractInvalid, StoreUnavailable
from harness.contracts.ids import Digest, sha256
from harness.contracts.reasons import because
from harness.contracts.simulation import Simulator
from harness.contracts.values import Count, Name, Value, encode
from rsi_reviews.evaluation.adjudicator import adjudicate
from rsi_reviews.evaluation.arms import ARMS, ArmCase, run
from rsi_reviews.evaluation.measures import JudgedMission
from rsi_reviews.evaluation.missions import CONDITIONS, MISSIONS

CHUNK = 10
AHEAD = 4
STRIDE = 1_000_000
NOTES, NOTE_CHARS = 4, 200
ROOT = Path(__file__).resolve().parents[2]
Key = tuple[str, str, str, int]


class ProtocolRequest(Value):
    """What to run: `missions` per cell, from `seed`, these arms under these conditions."""

    missions: Count
    seed: Count
    arms: tuple[Name, ...] = tuple(one.name for one in ARMS)
    conditions: tuple[Name, ...] = tuple(one.name for one in CONDITIONS)


class ProtocolHeader(Value):
    """The first line of a results file: what its lines belong to."""

    code: Digest
    seed: Count


def cases(ask: ProtocolRequest) -> list[ArmCase]:
    """Every mission of the protocol. Number n of every cell has the same seed and contract: cells are paired."""
    chosen = [one for one in CONDITIONS if one.name in ask.conditions]
    return [
        ArmCase(arm=arm, condition=condition, mission=MISSIONS[n % len(MISSIONS)], seed=ask.seed * STRIDE + n)
        for n in range(ask.missions)
        for condition in chosen
        for arm in ask.arms
    ]


def judged(case: ArmCase, simulator: Simulator) -> JudgedMission:
    """Run one case and let the adjudicator judge it. An arm that raises has declared nothing; its row gives the
    error.
    """
    try:
        went = run(case, simulator)
    except Exception as error:  # noqa: BLE001 - whatever leaves an arm is that arm's result
        return _broken(case, f"{type(error).__name__}: {error}")
    verdict = adjudicate(went.story)
    return JudgedMission(
        arm=case.arm,
        condition=case.condition.name,
        mission=case.mission,
        seed=case.seed,
        status=went.status,
        success=verdict["success"],
        truly_done=verdict["truly_done"],
        declared=verdict["declared"],
        contract_false=len(verdict["contract_false"]),
        epistemic_false=len(verdict["epistemic_false"]),
        unsupported=len(verdict["unsupported"]),
        duplicate_starts=len(verdict["duplicate_starts"]),
        false_rejections=len(verdict["false_rejections"]),
        missed=verdict["missed"],
        handoffs=went.handoffs,
        spent=went.spent,
        recovery=_recovery(verdict, went.spent, went.handoffs),
        claims=verdict["claims"],
        starts=verdict["starts"],
        mission_s=went.mission_s,
        cpu_s=went.cpu_s,
        notes=_notes(verdict),
    )


def _broken(case: ArmCase, why: str) -> JudgedMission:
    return JudgedMission(
        arm=case.arm,
        condition=case.condition.name,
        mission=case.mission,
        seed=case.seed,
        status="broken",
        success=False,
        truly_done=False,
        declared=False,
        contract_false=0,
        epistemic_false=0,
        unsupported=0,
        duplicate_starts=0,
        false_rejections=0,
        missed=False,
        handoffs=0,
        spent=0,
        recovery="broken",
        claims=0,
        starts=0,
        mission_s=0.0,
        cpu_s=0.0,
        notes=(why[:NOTE_CHARS],),
    )


def _recovery(verdict: dict[str, Any], spent: int, handoffs: int) -> str:
    """How it ended, apart from nominal success (R232)."""
    if verdict["false_success"]:
        return "false success"
    if handoffs:
        return "handed off"
    if not verdict["declared"]:
        return "missed" if verdict["truly_done"] else "failed"
    return "recovered" if spent or verdict["rejections"] else "not needed"


def _notes(verdict: dict[str, Any]) -> tuple[str, ...]:
    """The adjudicator's own sentences on violations."""
    found = (*verdict["contract_false"], *verdict["epistemic_false"], *verdict["duplicate_starts"])
    return tuple(sentence[:NOTE_CHARS] for sentence in found[:NOTES])


def rows(
    ask: ProtocolRequest,
    simulator: Simulator,
    *,
    processes: int,
    results: Path | None,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> list[JudgedMission]:
    """All missions of the request, in the order of `cases`; finished ones are read from `kept`, new ones are added to
    it.

    `told` is called with the number of finished missions. Raises ContractInvalid if `kept` belongs to other code or
    another seed, StoreUnavailable if workers cannot be kept alive.
    """
    required = cases(ask)
    done = _read_results(results, ask, simulator) if results else {}
    waiting = [case for case in required if _key(case) not in done]
    progress(len(required) - len(waiting), len(required))
    for fresh in _run(waiting, simulator, processes=processes):
        done.update((_key(row), row) for row in fresh)
        if results is not None:
            _add(results, fresh)
        progress(sum(1 for case in required if _key(case) in done), len(required))
    return [done[_key(case)] for case in required]


def _run(waiting: Sequence[ArmCase], simulator: Simulator, *, processes: int) -> Iterator[list[JudgedMission]]:
    chunks = [list(waiting[start : start + CHUNK]) for start in range(0, len(waiting), CHUNK)]
    if processes < 2 or len(chunks) < 2:
        yield from (_chunk(chunk, simulator) for chunk in chunks)
        return
    with ProcessPoolExecutor(processes, mp_context=get_context("spawn")) as pool:
        try:
            yield from _spread(pool, chunks, simulator, ahead=processes * AHEAD)
        except BrokenProcessPool as error:
            raise StoreUnavailable(because("worker_ended_silently"), where="--processes") from error
        finally:
            pool.shutdown(cancel_futures=True)


def _spread(
    pool: ProcessPoolExecutor, chunks: Iterable[list[ArmCase]], simulator: Simulator, *, ahead: int
) -> Iterator[list[JudgedMission]]:
    open_ones: set[Future[list[JudgedMission]]] = set()
    for chunk in chunks:
        open_ones.add(pool.submit(_chunk, chunk, simulator))
        if len(open_ones) >= ahead:
            finished, open_ones = wait(open_ones, return_when=FIRST_COMPLETED)
            yield from (one.result() for one in finished)
    yield from (one.result() for one in open_ones)


def _chunk(chunk: list[ArmCase], simulator: Simulator) -> list[JudgedMission]:
    return [judged(case, simulator) for case in chunk]


def _key(one: ArmCase | JudgedMission) -> Key:
    condition = one.condition if isinstance(one, JudgedMission) else one.condition.name
    return (one.arm, condition, one.mission, one.seed)


def _read_results(file: Path, ask: ProtocolRequest, simulator: Simulator) -> dict[Key, JudgedMission]:
    heading = ProtocolHeader(code=code(simulator), seed=ask.seed)
    if not file.exists():
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(encode(heading) + b"\n")
        return {}
    first, *lines = file.read_bytes().splitlines()
    if first != encode(heading):
        raise ContractInvalid(
            because("finished_missions_differ"),
            where=str(file),
        )
    found = {}
    for line in lines:
        try:
            row = msgspec.json.decode(line, type=JudgedMission)
        except msgspec.MsgspecError:
            continue
        found[_key(row)] = row
    return found


def _add(file: Path, fresh: Iterable[JudgedMission]) -> None:
    with file.open("ab") as out:
        out.write(b"".join(encode(row) + b"\n" for row in fresh))


def code(simulator: Simulator) -> Digest:
    """SHA-256 over the sources that a result depends on: the harness, this package and the simulator."""
    folders = (ROOT / "harness", ROOT / "rsi_reviews" / "evaluation")
    files = sorted(path for folder in folders for path in folder.rglob("*") if path.suffix in (".py", ".yaml"))
    return sha256(b"".join((*(path.read_bytes() for path in files), simulator.sources().encode())))
