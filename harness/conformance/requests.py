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
        return RuleObservation(met=False, text=f"the card breaks its own types ({error})")
    fields = {"embodiments": card.embodiments, "failure_words": card.failure_words, "evidence": card.evidence}
    names = [parameter.name for parameter in card.parameters]
    bounded = [p for p in card.parameters if p.minimum is not None and p.maximum is not None]
    crossed = [p.name for p in bounded if (p.minimum or 0.0) > (p.maximum or 0.0)]
    odd = [word for word in card.evidence if word not in EVIDENCE and not word.startswith(("receipt:", "instrument:"))]
    return judged(
        f"version {card.version}, {len(card.parameters)} parameters, risk {card.risk}, "
        f"stops within {card.cancel.within_s:g} s",
        unless(reread, "the card is another when read again"),
        *(unless(bool(words), f"{name} is empty") for name, words in fields.items()),
        unless(len(set(names)) == len(names), "a parameter stands twice"),
        unless(not crossed, f"bounds are crossed: {', '.join(crossed)}"),
        unless(not odd, f"evidence of an unknown kind: {', '.join(odd)}"),
        unless("timeout" in card.failure_words, "failure_words lack timeout, which every deadline needs"),
        unless(
            bool(card.resources and card.side_effects) or not card.moves, "it moves and lacks a resource or an effect"
        ),
        unless(not card.moves or bool(card.preconditions), "it moves without a precondition"),
    )


def idempotent_start(bench: Bench) -> RuleObservation:
    """The same request again, at a later state version too, is the same execution."""
    request = bench.request(long=True)
    first = bench.start(request)
    bench.wait(0.5, keep=first.handle)
    again = bench.start(replace(request, k_ctx=request.k_ctx + 3))
    starts = bench.starts_of(request)
    return judged(
        f"two starts, one handle, {starts if starts is not None else 'no journal of'} physical start",
        unless(again.handle == first.handle, f"the repeat became another execution ({again.handle})"),
        unless(starts in (None, 1), f"the robot's journal counts {starts} physical starts"),
    )


def other_parameters_refused(bench: Bench) -> RuleObservation:
    """The same request id with other parameters is refused; the first execution goes on."""
    request = bench.request(long=True)
    first = bench.start(request)
    other = next(_others(bench, request), None)
    if other is None:
        return RuleObservation(met=False, text="the conformance file names no second set of parameters")
    wrong = refusal(lambda: bench.provider.start(other))
    report = bench.report(first.handle)
    return judged(
        "refused, and the first execution is untouched",
        unless(not wrong, f"other contents under the same request id: {wrong}"),
        unless(report.identity == request.identity and report.status != "failed", f"the first is now {report.status}"),
        unless(bench.starts_of(request) in (None, 1), "the other contents were started too"),
    )


def unfit_request_refused(bench: Bench) -> RuleObservation:
    """What the card does not declare is refused by name, and nothing begins."""
    wrongs, attempts = [], 0
    for what, unfit in _unfit(bench):
        attempts += 1
        wrong = refusal(partial(bench.provider.start, unfit))
        if wrong:
            wrongs.append(f"{what}: {wrong}")
        elif bench.starts_of(unfit):
            wrongs.append(f"{what}: refused, but the robot's journal holds a start")
        elif bench.card.reattach == "by_request" and bench.provider.find(unfit.identity.request_id) is not None:
            wrongs.append(f"{what}: refused, but the request is remembered")
    return judged(f"{attempts} unfit requests refused, nothing begun", *wrongs)


def found_by_request(bench: Bench) -> RuleObservation:
    """An execution is found by its request id, and a request that never came is not."""
    request = bench.request(long=True)
    first = bench.start(request)
    found = bench.provider.find(request.identity.request_id)
    if found is not None:
        bench.noted(request, found)
    return judged(
        "found by its request id; an unknown request is not",
        unless(found is not None and found.handle == first.handle, "the request is not found under its handle"),
        unless(bench.provider.find(UNKNOWN) is None, "a request that never came is found"),
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
        return RuleObservation(met=False, text=f"after a restart of the supervisor: {error.what}")
    if found is None:
        return RuleObservation(met=False, text="after a restart of the supervisor the request is unknown")
    bench.noted(request, found)
    repeated = again.start(request)
    return judged(
        f"found again {bench.card.reattach.replace('_', ' ')} as {found.status}",
        unless(found.handle == repeated.handle == first.handle, "it has another handle after a restart"),
        unless(bench.starts_of(request) in (None, 1), "it was begun again"),
    )


def fencing(bench: Bench) -> RuleObservation:
    """A request under an older token than the newest seen is refused, and nothing begins."""
    report = bench.start(bench.request(long=True))
    bench.close()
    older = bench.request(long=True, token=bench.fencing - 1)
    wrong = refusal(lambda: bench.provider.start(older), FencingRefused)
    equal = bench.start(bench.request(long=True))
    return judged(
        f"token {bench.fencing - 1} after {bench.fencing} refused, {bench.fencing} again taken",
        unless(not wrong, f"an older fencing token: {wrong}"),
        unless(not bench.starts_of(older), "the older token started something"),
        unless(equal.handle != report.handle, "a fresh request got an old handle"),
    )


def lease_required(bench: Bench) -> RuleObservation:
    """A request without a token for each of the card's resources is refused."""
    bare = replace(bench.request(long=True), fencing={})
    wrong = refusal(lambda: bench.provider.start(bare))
    return judged(
        f"refused without a token for {', '.join(bench.card.resources)}",
        unless(not wrong, f"a request without a lease: {wrong}"),
        unless(not bench.starts_of(bare), "it was started without a lease"),
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
        f"{', '.join(answers)} refuse it",
        *(f"{name} of an unknown handle: {wrong}" for name, wrong in answers.items() if wrong),
    )


def _others(bench: Bench, request: StartRequest) -> Iterator[StartRequest]:
    for parameters in map(bench.filled, (*bench.declaration.done, *bench.declaration.long)):
        if parameters != request.parameters:
            yield replace(request, parameters=parameters)


def _unfit(bench: Bench) -> Iterator[tuple[str, StartRequest]]:
    """(what is wrong with it, the request), each under a request id of its own."""
    for parameter in bench.card.parameters:
        fit = bench.request(long=True)
        if parameter.required:
            left = {name: value for name, value in fit.parameters.items() if name != parameter.name}
            yield f"without {parameter.name}", replace(fit, parameters=left)
        wrong_type = "text" if parameter.type in ("number", "boolean", "point", "points") else True
        yield f"{parameter.name} of another type", _with(bench, parameter.name, wrong_type)
        if parameter.type == "number":
            yield f"{parameter.name} is no number", _with(bench, parameter.name, math.nan)
            if parameter.maximum is not None:
                yield f"{parameter.name} over its maximum", _with(bench, parameter.name, parameter.maximum + 1.0)
            if parameter.minimum is not None:
                yield f"{parameter.name} under its minimum", _with(bench, parameter.name, parameter.minimum - 1.0)
    yield "a parameter that is not on the card", _with(bench, "not_on_the_card", 1.0)
    yield "another capability", replace(bench.request(long=True), capability="no_such_capability")
    request = bench.request(long=True)
    stranger = replace(request.identity, provider_id=ProviderId("no-such-provider"))
    yield "another provider's name", replace(request, identity=stranger)


def _with(bench: Bench, name: str, value: float | str | bool) -> StartRequest:
    request = bench.request(long=True)
    return replace(request, parameters={**request.parameters, name: value})
