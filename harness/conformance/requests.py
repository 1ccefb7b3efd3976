"""Rows about requests: accepted once under one id, or refused without starting anything."""

import math
from collections.abc import Iterator
from functools import partial

import msgspec
from msgspec.structs import replace

from harness.conformance.findings import RuleObservation, judged, refusal, unless
from harness.conformance.test_bench import Bench
from harness.contracts.capabilities import CapabilityCard
from harness.contracts.errors import FencingRefused, HarnessError
from harness.contracts.ids import ProviderId, RequestId
from harness.contracts.protocol import StartRequest
from harness.contracts.reasons import Reason, because
from harness.contracts.values import decode, encode

UNKNOWN = RequestId("f" * 64)
NOWHERE = "no-such-handle"
EVIDENCE = ("pose", "odometry", "imu", "scan", "image", "battery")


def card_complete(bench: Bench) -> RuleObservation:
    """The twelve fields are filled in, bounds are bounds, and the card is the same when read again."""
    card = bench.card
    try:
        reread = decode(encode(card), CapabilityCard) == card
    except msgspec.MsgspecError as error:
        return RuleObservation(met=False, text=because("kit_card_misshapen", error=str(error)))
    fields = {"embodiments": card.embodiments, "failure_words": card.failure_words, "evidence": card.evidence}
    names = [parameter.name for parameter in card.parameters]
    bounded = [p for p in card.parameters if p.minimum is not None and p.maximum is not None]
    crossed = [p.name for p in bounded if (p.minimum or 0.0) > (p.maximum or 0.0)]
    odd = [word for word in card.evidence if word not in EVIDENCE and not word.startswith(("receipt:", "instrument:"))]
    return judged(
        because(
            "kit_card",
            version=card.version,
            parameters=len(card.parameters),
            risk=card.risk,
            within_s=card.cancel.within_s,
        ),
        unless(reread, because("kit_card_changes")),
        *(unless(bool(words), because("kit_field_empty", name=name)) for name, words in fields.items()),
        unless(len(set(names)) == len(names), because("kit_parameter_twice")),
        unless(not crossed, because("kit_bounds_crossed", names=tuple(crossed))),
        unless(not odd, because("kit_evidence_unknown", kinds=tuple(odd))),
        unless("timeout" in card.failure_words, because("kit_timeout_missing")),
        unless(bool(card.resources and card.side_effects) or not card.moves, because("kit_moves_without_resource")),
        unless(not card.moves or bool(card.preconditions), because("kit_moves_without_precondition")),
    )


def idempotent_start(bench: Bench) -> RuleObservation:
    """The same request again, at a later state version too, is the same execution."""
    request = bench.request(long=True)
    first = bench.start(request)
    bench.wait(0.5, keep=first.handle)
    again = bench.start(replace(request, k_ctx=request.k_ctx + 3))
    starts = bench.starts_of(request)
    return judged(
        because("kit_one_start", starts=starts) if starts is not None else because("kit_one_handle"),
        unless(again.handle == first.handle, because("kit_repeat_started", handle=again.handle)),
        unless(starts in (None, 1), because("kit_starts_counted", starts=starts or 0)),
    )


def other_parameters_refused(bench: Bench) -> RuleObservation:
    """The same request id with other parameters is refused; the first execution goes on."""
    request = bench.request(long=True)
    first = bench.start(request)
    other = next(_others(bench, request), None)
    if other is None:
        return RuleObservation(met=False, text=because("kit_no_second_parameters"))
    wrong = refusal(lambda: bench.provider.start(other))
    report = bench.report(first.handle)
    return judged(
        because("kit_other_refused"),
        wrong and because("kit_other_contents", reason=wrong),
        unless(
            report.identity == request.identity and report.status != "failed",
            because("kit_first_disturbed", status=report.status),
        ),
        unless(bench.starts_of(request) in (None, 1), because("kit_other_started")),
    )


def unfit_request_refused(bench: Bench) -> RuleObservation:
    """What the card does not declare is refused by name, and nothing begins."""
    wrongs: list[Reason] = []
    attempts = 0
    for what, unfit in _unfit(bench):
        attempts += 1
        wrong = refusal(partial(bench.provider.start, unfit))
        if wrong:
            wrongs.append(because("kit_unfit", what=what, reason=wrong))
        elif bench.starts_of(unfit):
            wrongs.append(because("kit_unfit", what=what, reason=because("kit_refused_and_started")))
        elif bench.card.reattach == "by_request" and bench.provider.find(unfit.identity.request_id) is not None:
            wrongs.append(because("kit_unfit", what=what, reason=because("kit_refused_and_remembered")))
    return judged(because("kit_unfit_refused", attempts=attempts), *wrongs)


def found_by_request(bench: Bench) -> RuleObservation:
    """An execution is found by its request id, and a request that never came is not."""
    request = bench.request(long=True)
    first = bench.start(request)
    found = bench.provider.find(request.identity.request_id)
    if found is not None:
        bench.noted(request, found)
    return judged(
        because("kit_found_by_request"),
        unless(found is not None and found.handle == first.handle, because("kit_not_found")),
        unless(bench.provider.find(UNKNOWN) is None, because("kit_unknown_found")),
    )


def reattach(bench: Bench) -> RuleObservation:
    """A supervisor that restarted finds the execution again, and begins nothing."""
    request = bench.request(long=True)
    first = bench.start(request)
    again = bench.subject.reattached()
    try:
        by_handle = bench.card.reattach == "by_handle"
        found = again.report(first.handle) if by_handle else again.find(request.identity.request_id)
    except HarnessError as error:
        return RuleObservation(met=False, text=because("kit_after_restart", reason=error.reason))
    if found is None:
        return RuleObservation(met=False, text=because("kit_unknown_after_restart"))
    bench.noted(request, found)
    repeated = again.start(request)
    return judged(
        because("kit_reattached", how=bench.card.reattach, status=found.status),
        unless(found.handle == repeated.handle == first.handle, because("kit_other_handle_after_restart")),
        unless(bench.starts_of(request) in (None, 1), because("kit_begun_again")),
    )


def fencing(bench: Bench) -> RuleObservation:
    """A request under an older token than the newest seen is refused, and nothing begins."""
    report = bench.start(bench.request(long=True))
    bench.close()
    older = bench.request(long=True, token=bench.fencing - 1)
    wrong = refusal(lambda: bench.provider.start(older), FencingRefused)
    equal = bench.start(bench.request(long=True))
    return judged(
        because("kit_fenced", older=bench.fencing - 1, newest=bench.fencing),
        wrong and because("kit_older_token", reason=wrong),
        unless(not bench.starts_of(older), because("kit_older_token_started")),
        unless(equal.handle != report.handle, because("kit_handle_reused")),
    )


def lease_required(bench: Bench) -> RuleObservation:
    """A request without a token for each of the card's resources is refused."""
    bare = replace(bench.request(long=True), fencing={})
    wrong = refusal(lambda: bench.provider.start(bare))
    return judged(
        because("kit_refused_without_token", resources=bench.card.resources),
        wrong and because("kit_without_lease", reason=wrong),
        unless(not bench.starts_of(bare), because("kit_started_without_lease")),
    )


def unknown_handle(bench: Bench) -> RuleObservation:
    """A handle that was never given out is refused by every act."""
    provider = bench.provider
    answers = {
        "report": refusal(lambda: provider.report(NOWHERE)),
        "stop": refusal(lambda: provider.stop(NOWHERE)),
        "keepalive": refusal(lambda: provider.keepalive(NOWHERE)),
        "resume": refusal(lambda: provider.resume(NOWHERE)),
    }
    return judged(
        because("kit_unknown_handle_refused", acts=tuple(answers)),
        *(because("kit_unknown_handle", act=name, reason=wrong) for name, wrong in answers.items() if wrong),
    )


def _others(bench: Bench, request: StartRequest) -> Iterator[StartRequest]:
    for parameters in map(bench.filled, (*bench.declaration.done, *bench.declaration.long)):
        if parameters != request.parameters:
            yield replace(request, parameters=parameters)


def _unfit(bench: Bench) -> Iterator[tuple[Reason, StartRequest]]:
    """(what is wrong with it, the request), each under a request id of its own."""
    for parameter in bench.card.parameters:
        fit = bench.request(long=True)
        if parameter.required:
            left = {name: value for name, value in fit.parameters.items() if name != parameter.name}
            yield because("kit_without_parameter", name=parameter.name), replace(fit, parameters=left)
        wrong_type = "text" if parameter.type in ("number", "boolean", "point", "points") else True
        yield because("kit_parameter_type", name=parameter.name), _with(bench, parameter.name, wrong_type)
        if parameter.type == "number":
            yield because("kit_parameter_nan", name=parameter.name), _with(bench, parameter.name, math.nan)
            if parameter.maximum is not None:
                over = _with(bench, parameter.name, parameter.maximum + 1.0)
                yield because("kit_parameter_over", name=parameter.name), over
            if parameter.minimum is not None:
                under = _with(bench, parameter.name, parameter.minimum - 1.0)
                yield because("kit_parameter_under", name=parameter.name), under
    yield because("kit_parameter_undeclared"), _with(bench, "not_on_the_card", 1.0)
    yield because("kit_capability_other"), replace(bench.request(long=True), capability="no_such_capability")
    request = bench.request(long=True)
    stranger = replace(request.identity, provider_id=ProviderId("no-such-provider"))
    yield because("kit_provider_other"), replace(request, identity=stranger)


def _with(bench: Bench, name: str, value: float | str | bool) -> StartRequest:
    request = bench.request(long=True)
    return replace(request, parameters={**request.parameters, name: value})
