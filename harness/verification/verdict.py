"""Judges an evidence packet, and the goal. Pure: reads no clock, writes nothing, commits nothing."""

from collections.abc import Callable, Sequence

from msgspec import UNSET, UnsetType
from msgspec.structs import replace

from harness.contracts import verdicts
from harness.contracts.contexts import Blobs, Context
from harness.contracts.effects import Condition
from harness.contracts.errors import ContractInvalid, HarnessError
from harness.contracts.evidence import EvidenceReference
from harness.contracts.ids import NodeId
from harness.contracts.ports import Predicates
from harness.contracts.predicates import NO_PREDICATES, is_installed_name
from harness.contracts.reasons import Reason, because, several
from harness.contracts.rules import FIRST_RULES, LINEAGE, WITNESSES, RulesVersion
from harness.contracts.tasks import named_nodes
from harness.contracts.verifier_inputs import Origins
from harness.verification.admission import missing, stale, unsafe
from harness.verification.finding import FACTS, RECEIPTS, UNAVAILABLE, Finding, Undecidable, ambiguous
from harness.verification.images import images_denied
from harness.verification.independence import derived_independence, independence, labelled
from harness.verification.installed import installed_finding
from harness.verification.predicates.registry import predicate_of
from harness.verification.reading import Evidence, read
from harness.verification.witnesses import contradicted

VERIFIER = "predicates-1"
Verifier = Callable[[Context, Blobs], verdicts.NodeVerdict]
"""Whoever judges one packet from its C3. Only the gate decides what the verdict may change (R110)."""


def judged(context: Context, blobs: Blobs, *, verifier: Verifier) -> verdicts.NodeVerdict:
    """The verifier's verdict; ambiguous, with the reason, from one that is absent, crashed or late (R45).

    Raises ContractInvalid if the context is not one of a packet: that is not the verifier's failure.
    """
    try:
        return verifier(context, blobs)
    except ContractInvalid:
        raise
    except Exception as error:  # noqa: BLE001 - a verifier that breaks has decided nothing, whatever broke it
        evidence = Evidence(context, blobs)
        why = because("verifier_did_not_answer", kind=type(error).__name__, error=_why(error))
        results = tuple(_result(one, evidence, ambiguous(why)) for one in evidence.conditions)
        return verdicts.NodeVerdict(
            packet_id=evidence.execution.identity.packet_id,
            verdict="ambiguous",
            results=tuple(replace(one, verdict="ambiguous", reason=why) for one in results),
            reason=why,
            verifier=UNAVAILABLE,
            context=context.digest,
            at_s=context.at_s,
        )


def verify(context: Context, blobs: Blobs, predicates: Predicates = NO_PREDICATES) -> verdicts.NodeVerdict:
    """Every declared postcondition of one packet. C3 is the only state; `blobs` are the immutable bytes it cites.

    `predicates` asks those of installed packages.

    Raises ContractInvalid if the context is not one of a packet.
    """
    evidence = Evidence(context, blobs)
    if context.role != "verifier" or context.one("execution") is None:
        raise ContractInvalid(because("context_without_execution"), where=context.role)
    tested = _results(evidence, predicates)
    results = tuple(result for result, _ in tested)
    verdict, reason = _overall(results)
    untested = verdict == "ambiguous" and any(broken for _, broken in tested)
    return verdicts.NodeVerdict(
        packet_id=evidence.execution.identity.packet_id,
        verdict=verdict,
        results=results,
        reason=reason,
        verifier=UNAVAILABLE if untested else VERIFIER,
        context=context.digest,
        at_s=context.at_s,
    )


def verify_goal(context: Context, blobs: Blobs, predicates: Predicates = NO_PREDICATES) -> verdicts.GoalVerdict:
    """The original completion conditions, on what was committed and what is seen now (R118)."""
    results = tuple(result for result, _ in _results(Evidence(context, blobs), predicates))
    verdict, reason = _overall(results)
    return verdicts.GoalVerdict(
        mission_id=context.mission_id,
        verdict=verdict,
        results=results,
        reason=reason,
        verifier=VERIFIER,
        context=context.digest,
        at_s=context.at_s,
    )


def _results(evidence: Evidence, predicates: Predicates) -> tuple[tuple[verdicts.ConditionResult, bool], ...]:
    """Each condition's result, and whether its predicate was absent or broke."""
    try:
        conditions = evidence.conditions
    except Undecidable as error:
        raise ContractInvalid(error.reason, where="context", do=because("compile_context_again")) from error
    results = []
    for condition in conditions:
        own = evidence.within(condition.condition_id)
        own.lineage.levels.clear()
        finding, broken = _found(condition, own, predicates)
        results.append((_result(condition, own, finding), broken))
    return tuple(results)


def _result(condition: Condition, evidence: Evidence, finding: Finding) -> verdicts.ConditionResult:
    """The result of a predicate's answer, whose lineage the evidence still holds."""
    rules = _rules(evidence)
    traced = rules >= LINEAGE
    denied = None
    if rules >= WITNESSES and finding.verdict == "satisfied":
        denied = contradicted(finding, evidence) or images_denied(finding, evidence)
    if denied is not None:
        finding = replace(finding, verdict="ambiguous", reason=denied)
    declared = _declared_stages(condition, evidence) if traced else ()
    level = (
        _level(condition, finding, evidence) if traced else independence(finding.sources, provider=_or_none(evidence))
    )
    level, finding = _attested(condition, finding, evidence, level=level)
    required = _required(condition, evidence)
    labelling = replace(finding, reason=labelled(finding, level=level, required=required))
    if declared and finding.verdict == "ambiguous":
        labelling = replace(finding, reason=because("rests_on_declared", stages=declared, reason=finding.reason))
    verdict, reason = _admitted(labelling, evidence, short=level < required)
    only_short = traced and finding.verdict == "satisfied" and verdict == "ambiguous" and reason == labelling.reason
    return verdicts.ConditionResult(
        condition_id=condition.condition_id,
        text=condition.text,
        verdict=verdict,
        reason=reason,
        measured=finding.measured,
        bounds=finding.bounds,
        sources=finding.sources,
        independence=level,
        required_independence=required,
        age_s=finding.age_s,
        evidence=finding.evidence,
        short=True if only_short else UNSET,
        rests_on=tuple(sorted(evidence.lineage.levels)) if traced and evidence.lineage.levels else UNSET,
    )


def _level(condition: Condition, finding: Finding, evidence: Evidence) -> int:
    """Of the goal, the receipts are those of the stages, and as well shown as these are."""
    sources = finding.sources
    if RECEIPTS in sources and evidence.context.one("execution") is None:
        requests = {receipt.request_id for receipt in evidence.receipts}
        evidence.build_on(node.node_id for node in evidence.ended if requests & set(node.requests))
        sources = tuple(source for source in sources if source != RECEIPTS)
    if FACTS in sources and not evidence.lineage.levels:
        return 0
    provider, origins = _executing(condition, evidence)
    return derived_independence(sources, provider=provider, origins=origins, lineage=evidence.lineage)


def _executing(condition: Condition, evidence: Evidence) -> tuple[tuple[str, ...] | None, Origins]:
    """The sources that the provider uses itself, and all origins; of the goal, those of the condition's own stages."""
    try:
        policy = evidence.policy
    except Undecidable:
        return _or_none(evidence), Origins()
    if evidence.context.one("execution") is None and not isinstance(policy.executors, UnsetType):
        executors = policy.executors.get(condition.condition_id)
        if executors is not None:
            return executors.sources, replace(policy.origins, provider=executors.origins)
    return _or_none(evidence), policy.origins


def _declared_stages(condition: Condition, evidence: Evidence) -> tuple[NodeId, ...]:
    """Stages that the condition names and that are only declared: it rests on their providers' word."""
    declared = {effect.node_id for effect in evidence.declared_effects}
    named = tuple(name for name in named_nodes(condition.effect) if name in declared)
    evidence.build_on(named)
    return named


def _rules(evidence: Evidence) -> RulesVersion:
    try:
        return evidence.policy.rules
    except Undecidable:
        return FIRST_RULES


def _found(condition: Condition, evidence: Evidence, predicates: Predicates) -> tuple[Finding, bool]:
    """The predicate's answer, and whether it was absent or broke: either is ambiguous, with the reason (R45)."""
    if is_installed_name(condition.effect.predicate):
        return installed_finding(condition.effect, evidence, predicates)
    predicate = predicate_of(condition.effect)
    if predicate is None:
        return ambiguous(because("no_predicate", predicate=condition.effect.predicate)), True
    try:
        return predicate(condition.effect, evidence), False
    except Undecidable as error:
        return ambiguous(error.reason), False
    except Exception as error:  # noqa: BLE001 - a verifier that breaks has decided nothing, whatever broke it
        return ambiguous(
            because(
                "predicate_failed", predicate=condition.effect.predicate, kind=type(error).__name__, error=_why(error)
            )
        ), True


def _admitted(finding: Finding, evidence: Evidence, *, short: bool) -> tuple[verdicts.Verdict, Reason]:
    """By precedence: unsafe, stale, then the predicate's own answer, made ambiguous where evidence falls short."""
    try:
        forbidden = unsafe(evidence)
        lacking, aged = missing(evidence)
        old = stale(finding, evidence)
    except Undecidable as error:
        return "ambiguous", error.reason
    if forbidden:
        return "unsafe", forbidden
    if worn := old or (lacking if aged else None):
        return "stale", worn
    if finding.verdict == "satisfied" and (lacking or short):
        return "ambiguous", lacking or finding.reason
    return finding.verdict, finding.reason


def _attested(condition: Condition, finding: Finding, evidence: Evidence, *, level: int) -> tuple[int, Finding]:
    """A person's attestation supplies the missing source of a condition that is satisfied without it (D17)."""
    words = [read(record, EvidenceReference) for record in evidence.context.all("attestation")]
    seen = [one for one in words if one.values.get("condition_id") == condition.condition_id and one.origin == "human"]
    if not seen or finding.verdict != "satisfied" or not _attestable(evidence):
        return level, finding
    return 2, replace(finding, sources=(*finding.sources, f"attested by {seen[-1].source}"))


def _attestable(evidence: Evidence) -> bool:
    """Whether the evidence policy names a person's attestation; contexts of older rules hold none where it does not."""
    return _rules(evidence) < LINEAGE or evidence.policy.evidence.attestation


def _required(condition: Condition, evidence: Evidence) -> int:
    try:
        return evidence.policy.required[condition.condition_id]
    except (Undecidable, KeyError):
        return 2


def _or_none(evidence: Evidence) -> tuple[str, ...] | None:
    try:
        return evidence.provider_sources
    except Undecidable:
        return None


def _overall(results: Sequence[verdicts.ConditionResult]) -> tuple[verdicts.Verdict, Reason]:
    verdict = verdicts.strictest(tuple(result.verdict for result in results))
    if verdict == "satisfied":
        return verdict, because("all_conditions_hold", count=len(results))
    failing = [one for one in results if one.verdict == verdict]
    reasons = [because("of_condition", condition=one.condition_id, reason=one.reason) for one in failing]
    return verdict, several(reasons) or because("nothing_tested")


def _why(error: Exception) -> Reason | str:
    return error.reason if isinstance(error, HarnessError) else str(error)
