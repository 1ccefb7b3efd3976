"""Lets sixteen people decide on the same release at once, and checks that one is accepted and the pointer moves once.

Every responder has its own gate and connection on one file, as separate processes would: only the log's expected
version keeps them apart. There are three kinds of round, in turn: authorise against reject, release against release,
and two candidates that both want the one canary.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from msgspec.structs import replace

from experiments.campaigns.races import RESPONDERS, RaceReport, together
from harness.adapters.clock import LockstepClock
from harness.adapters.stores.sql import SqlEventStore
from harness.baseline.load import baseline
from harness.contracts.actors import Actor
from harness.contracts.decisions import Accepted
from harness.contracts.ids import Digest, RobotId
from harness.contracts.reasons import plain
from harness.contracts.values import digest
from harness.gate.commit import CommandEnvelope, Gate
from rsi_reviews import commands, contracts
from rsi_reviews.deciders import DECIDERS
from rsi_reviews.pointers import POINTER, Pointer, candidate_stream
from rsi_reviews.projections import Review
from rsi_reviews.rollback import DESK

NOW_S = 1_790_000_000.0
ROBOT = RobotId("vbot-1")
H0 = baseline()
PLAIN = digest("nothing is run here")
LEA = Actor(name="lea", role="operator")
POLICY = contracts.ReleasePolicy()


def release_races(rounds: int) -> RaceReport:
    """What went wrong, one sentence each; the claim holds if the list is empty."""
    offences: list[str] = []
    effective = 0
    with ExitStack() as stack:
        folder = Path(stack.enter_context(TemporaryDirectory(prefix="release-races-")))
        gates = [_gate(stack, folder) for _ in range(RESPONDERS)]
        gates[0].commit(
            [CommandEnvelope(POINTER, commands.OpenPointer(configuration=H0.configuration_id, actor=DESK), None)]
        )
        kinds = (_authorise_or_reject, _release, _one_canary)
        for number in range(rounds):
            wrong, taken = kinds[number % len(kinds)](gates, number)
            effective += taken
            offences += [f"round {number} ({kinds[number % len(kinds)].__name__}): {sentence}" for sentence in wrong]
    return RaceReport(rounds=rounds, effective=effective, responders=RESPONDERS, offences=tuple(offences))


def _gate(stack: ExitStack, folder: Path) -> Gate:
    store = SqlEventStore(f"sqlite:///{folder / 'log.db'}")
    stack.callback(store.close)
    clock = LockstepClock(lambda until_s: until_s, at_s=NOW_S, wall=lambda: NOW_S)
    return Gate(store=store, clock=clock, deciders=DECIDERS)


def _authorise_or_reject(gates: Sequence[Gate], number: int) -> tuple[list[str], bool]:
    name = _reviewed(gates[0], number)
    before = _review(gates[0], name)

    def decide(responder: int) -> Any:
        remark = {**_fields_of(responder), "cycle": before.cycle, "subject": before.subject_digest}
        if responder % 2:
            return gates[responder].commit(
                [CommandEnvelope(candidate_stream(name), commands.RejectCandidate(**remark), None)]
            )
        return gates[responder].commit(_authorising(before, remark))

    winners = _winners(together(decide))
    after = _review(gates[0], name)
    words = [remark.what for remark in after.said if remark.what in ("authorised", "rejected")]
    wrong = [] if len(winners) == 1 else [f"{len(winners)} decisions were taken"]
    wrong += [] if words == [after.status] else [f"the log holds {words}, the candidate is {after.status}"]
    return wrong, bool(winners)


def _release(gates: Sequence[Gate], number: int) -> tuple[list[str], bool]:
    name = _authorised(gates[0], number)
    before = _pointer(gates[0]).revision
    winners = _winners(together(lambda responder: gates[responder].commit(_releasing(gates[0], name, responder))))
    return _moved_once(gates[0], before, winners), bool(winners)


def _one_canary(gates: Sequence[Gate], number: int) -> tuple[list[str], bool]:
    """Half of the responders release one candidate, half another one."""
    names = (_authorised(gates[0], 2 * number + 1_000_000), _authorised(gates[0], 2 * number + 1_000_001))
    before = _pointer(gates[0]).revision
    requests = [_releasing(gates[0], names[responder % 2], responder) for responder in range(RESPONDERS)]
    winners = _winners(together(lambda responder: gates[responder].commit(requests[responder])))
    in_canary = [name for name in names if _review(gates[0], name).status == "canary"]
    wrong = [] if len(in_canary) == 1 else [f"{len(in_canary)} candidates are in canary"]
    return wrong + _moved_once(gates[0], before, winners), bool(winners)


def _moved_once(gate: Gate, before: int, winners: list[int]) -> list[str]:
    """Also rolls back, so that the next round finds the pointer free."""
    pointer = _pointer(gate)
    wrong = [] if len(winners) == 1 else [f"{len(winners)} releases were taken"]
    wrong += [] if pointer.revision == before + 1 else [f"the pointer moved {pointer.revision - before} times"]
    if pointer.trial is not None:
        fields: dict[str, Any] = {"actor": Actor(name="sam", role="releaser"), "reason": "next round", "key": "back"}
        review = _review(gate, pointer.trial)
        back = _move(review, "rolled_back", fields)
        decided = gate.commit(
            [
                CommandEnvelope(candidate_stream(review.candidate), commands.RollBack(**fields), None),
                CommandEnvelope(POINTER, back, None),
            ]
        )
        wrong += [] if isinstance(decided, Accepted) else [f"it could not be rolled back: {plain(decided.reason)}"]
    return wrong


def _authorised(gate: Gate, number: int) -> Digest:
    name = _reviewed(gate, number)
    review = _review(gate, name)
    fields = {**_fields_of(99), "cycle": review.cycle, "subject": review.subject_digest}
    _taken(gate.commit(_authorising(review, fields)))
    return name


def _authorising(review: Review, fields: dict[str, Any]) -> list[CommandEnvelope]:
    command = commands.AuthoriseRelease(policy=POLICY, rollback=review.baseline, proven=review.baseline, **fields)
    return [
        CommandEnvelope(candidate_stream(review.candidate), command, None),
        CommandEnvelope(POINTER, commands.Confirm(baseline=review.baseline), None),
    ]


def _releasing(gate: Gate, name: Digest, responder: int) -> list[CommandEnvelope]:
    review = _review(gate, name)
    fields = _fields_of(responder)
    command = commands.BeginCanary(
        robot_id=ROBOT, policy=POLICY, cycle=review.cycle, subject=review.subject_digest, **fields
    )
    return [
        CommandEnvelope(candidate_stream(name), command, None),
        CommandEnvelope(POINTER, _move(review, "canary", fields), None),
    ]


def _move(review: Review, cause: Any, fields: dict[str, Any]) -> commands.MovePointer:
    return commands.MovePointer(
        cause=cause,
        candidate=review.candidate,
        configuration=review.configuration,
        rollback=review.baseline,
        actor=fields["actor"],
        reason=fields["reason"],
        robot_id=ROBOT,
    )


def _reviewed(gate: Gate, number: int) -> Digest:
    """A candidate in review with one approval. The measurements are made up: only the decisions are raced here."""
    made = _candidate(number)
    name = made.candidate_id
    stream = candidate_stream(name)
    terms = _terms(made)
    results = contracts.ResultSet(
        terms=digest(terms),
        results=tuple(_result(one) for one in (terms.baseline, terms.configuration)),
        held_out=contracts.HeldOutAnswer(answer="pass", look=1, alpha=0.025, cases=1),
    )
    clauses = tuple(
        contracts.ClauseAnswer(clause=clause, answer="pass", sentence="made up") for clause in contracts.CLAUSES[:3]
    )
    report = contracts.AcceptanceReport(
        terms=digest(terms), result_set=digest(results), predicate=terms.predicate, clauses=clauses
    )
    fields: dict[str, Any] = {"actor": LEA, "reason": "a race"}
    for command in (
        commands.ProposeCandidate(candidate=made, baseline=H0, key="propose", **fields),
        commands.BeginEvaluation(terms=terms, key="begin", **fields),
        commands.RecordEvaluation(terms=terms, results=results, report=report, key="record", **fields),
        commands.OpenReview(key="open", **fields),
    ):
        _taken(gate.commit([CommandEnvelope(stream, command, None)]))
    review = _review(gate, name)
    yes = commands.ApproveCandidate(
        policy=POLICY,
        cycle=review.cycle,
        subject=review.subject_digest,
        actor=Actor(name="rob", role="reviewer"),
        reason="it holds",
        key="yes",
    )
    _taken(gate.commit([CommandEnvelope(stream, yes, None)]))
    return name


def _candidate(number: int) -> contracts.Candidate:
    wait_s = 1.0 + number / 100_000.0
    changed = replace(H0, recovery=replace(H0.recovery, wait_s=wait_s))
    manifest = contracts.Manifest(
        component="recovery",
        reason=f"Wait {wait_s:g} s.",
        intended_effect="Shorter waits.",
        metric="recovery_cost",
        direction="lower",
        smallest_effect=0.1,
        baseline=H0.configuration_id,
        rollback=H0.configuration_id,
        author=contracts.Author(name="trace-miner 1", kind="optimiser"),
    )
    return contracts.Candidate(configuration=changed, manifest=manifest, baseline=H0.configuration_id)


def _terms(made: contracts.Candidate) -> contracts.EvaluationTerms:
    return contracts.EvaluationTerms(
        candidate=made.candidate_id,
        configuration=made.configuration.configuration_id,
        manifest=digest(made.manifest),
        baseline=made.baseline,
        predicate=PLAIN,
        suite=PLAIN,
        suite_version="none",
        seeds=PLAIN,
        evaluator="none",
        cases=1,
        launched_by=(LEA.name,),
    )


def _result(configuration: Digest) -> contracts.CaseResult:
    return contracts.CaseResult(case=PLAIN, family="nominal", seed=1, configuration=configuration, outcome="finished")


def _fields_of(responder: int) -> dict[str, Any]:
    actor = Actor(name=f"responder-{responder}", role="reviewer+releaser")
    return {"actor": actor, "reason": "my word", "key": f"key-{responder}"}


def _winners(decisions: Sequence[Any]) -> list[int]:
    return [at for at, decision in enumerate(decisions) if isinstance(decision, Accepted) and decision.events]


def _review(gate: Gate, name: Digest) -> Review:
    review: Review = gate.state(candidate_stream(name))
    return review


def _pointer(gate: Gate) -> Pointer:
    pointer: Pointer = gate.state(POINTER)
    return pointer


def _taken(decision: Any) -> None:
    if not isinstance(decision, Accepted):
        raise RuntimeError(f"{decision.rule}: {plain(decision.reason)}")
