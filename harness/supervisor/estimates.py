"""Asks estimating providers to score the targets of the stages that may come next. Nothing waits for or rests on them.

The request goes through the provider protocol as every other: idempotent by its id, with a deadline, stopped when that
has passed. It leases nothing and moves nothing. The answer is recorded in C1 and read by the planner alone.
"""

import msgspec

from harness.contexts.planner import frontier
from harness.contexts.view import StateView
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.contexts import ContextRecord
from harness.contracts.errors import HarnessError
from harness.contracts.estimates import ESTIMATE, TargetEstimates
from harness.contracts.ids import Digest, NodeId, request_id
from harness.contracts.protocol import InvocationIdentity, InvocationReport, Parameters, StartRequest
from harness.contracts.reasons import because
from harness.contracts.tasks import targets_of
from harness.contracts.values import Point, Share, digest, raw
from harness.supervisor.roles import RoleContexts

ASKING = NodeId("estimate")
"""What a request for estimates names as its stage: no stage of any graph has this name and an estimating provider."""
PATIENCE_S, POLL_S = 2.0, 0.1
"""Mission seconds that an answer may take; then the stages keep their order."""
LEAST = 2
"""With fewer candidates there is no order to choose."""
SCORE = "score_"


class TargetScores:
    """The estimates for one robot's missions; the same candidates are asked for once."""

    def __init__(self, roles: RoleContexts) -> None:
        self._roles, self._connection = roles, roles.connection
        self._known: tuple[Digest, tuple[ContextRecord, ...]] | None = None

    def records(self, view: StateView) -> tuple[ContextRecord, ...]:
        """One record of each estimating provider; empty where there is none, or nothing to choose between."""
        cards = self._connection.estimators
        candidates = _candidates(view) if cards else {}
        if len(candidates) < LEAST:
            return ()
        key = digest((view.mission.mission_id, sorted(candidates.items())))
        if self._known is None or self._known[0] != key:
            found = tuple(self._record(card, view, candidates, key) for card in cards)
            self._known = (key, found)
        return self._known[1]

    def _record(
        self, card: CapabilityCard, view: StateView, candidates: dict[NodeId, Point], key: Digest
    ) -> ContextRecord:
        identity = InvocationIdentity(
            mission_id=view.mission.mission_id,
            node_id=ASKING,
            attempt=1,
            request_id=request_id(view.mission.mission_id, NodeId(f"{ASKING}/{key}"), 1),
            provider_id=card.provider_id,
        )
        estimates = TargetEstimates(
            provider_id=card.provider_id, provider_version=card.version, request_id=identity.request_id
        )
        try:
            report = self._answer(card, identity, view, candidates)
            estimates = msgspec.structs.replace(estimates, scores=_scores(report, tuple(candidates)))
        except HarnessError as error:
            estimates = msgspec.structs.replace(estimates, missing=error.reason)
        except msgspec.ValidationError as error:
            estimates = msgspec.structs.replace(estimates, missing=because("estimate_unusable", error=str(error)[:200]))
        return ContextRecord(
            kind=ESTIMATE,
            origin="provider",
            source=card.provider_id,
            at_s=self._connection.clock.now().mission_s,
            value=raw(estimates),
        )

    def _answer(
        self, card: CapabilityCard, identity: InvocationIdentity, view: StateView, candidates: dict[NodeId, Point]
    ) -> InvocationReport:
        """The last report of the request. Raises ProviderFailed."""
        provider, clock = self._connection.provider(card.provider_id), self._connection.clock
        until_s = clock.now().mission_s + PATIENCE_S
        offered: Parameters = {"candidates": tuple(candidates.values()), "frame": view.contract.frame}
        request = StartRequest(
            identity=identity,
            capability=card.capability,
            parameters={one.name: offered[one.name] for one in card.parameters if one.name in offered},
            k_ctx=view.mission.k,
            configuration=view.mission.configuration,
            deadline_s=until_s,
            fencing={},
        )
        report = provider.start(request)
        while report.status not in ("succeeded", "failed", "cancelled") and clock.now().mission_s < until_s:
            clock.wait_until(min(until_s, clock.now().mission_s + POLL_S))
            report = provider.report(report.handle)
        if report.status not in ("succeeded", "failed", "cancelled"):
            provider.stop(report.handle)
        return report


def _candidates(view: StateView) -> dict[NodeId, Point]:
    """The stages that wait for nothing and have one target in the map, with that target."""
    found = {one.node_id: targets_of(view.node(one.node_id)) for one in frontier(view) if not one.waiting_for}
    return {node_id: next(iter(targets)) for node_id, targets in found.items() if len(targets) == 1}


def _scores(report: InvocationReport, names: tuple[NodeId, ...]) -> dict[NodeId, float]:
    """The declared scores by stage. Raises msgspec.ValidationError for an answer that is not one score each."""
    if report.status != "succeeded":
        raise msgspec.ValidationError(f"the request ended as {report.status} {report.failure}".strip())
    found = {name: report.declared.get(f"{SCORE}{place}") for place, name in enumerate(names)}
    return msgspec.convert(found, dict[NodeId, Share])
