"""The score and the candidate set: inspectable, deterministic, comparable scales."""

from itertools import permutations
from typing import Any

import msgspec
import pytest
from msgspec.structs import replace

from harness.contracts.capabilities import CapabilityCard, Estimates, Latency
from harness.contracts.configuration import RoutingPreferences
from harness.contracts.ids import Digest, NodeId, ProviderId
from harness.contracts.memory import OutcomeSums
from harness.contracts.values import decode, encode
from harness.contracts.verdicts import Verdict
from harness.routing.candidates import candidates
from harness.routing.history import ExecutionOutcome, ExecutionResult, OutcomeSeries, RoutingHistory, SettingHistory
from harness.routing.requirements import ProviderRequirements
from harness.routing.score import latency, route_length_m, terms, total
from tests.unit.planning.building import CONFIGURATION, card, contract
from tests.unit.routing.building import need

WEIGHTS = RoutingPreferences(
    success=1.0, risk=0.5, uncertainty=0.3, latency=0.2, cost=0.1, history=0.4, history_half_life=4.0
)
FOLLOWER = card("route-follower", latency=Latency(base_s=6.0, per_metre_s=2.1))
CAREFUL = card(
    "careful-local-planner",
    latency=Latency(base_s=8.0, per_metre_s=3.6),
    estimates=Estimates(success=0.88, risk=0.15, uncertainty=0.2, cost=2.0),
)


def outcome(verdict: Verdict, *, provider: str = "route-follower", **changes: Any) -> ExecutionOutcome:
    return replace(
        ExecutionOutcome(
            provider_id=ProviderId(provider),
            capability="navigate",
            place="office_storage",
            configuration=CONFIGURATION.configuration_id,
            verdict=verdict,
        ),
        **changes,
    )


def penalty(*outcomes: ExecutionOutcome, half_life: float = 4.0) -> float:
    return RoutingHistory(outcomes=outcomes).penalty(
        ProviderId("route-follower"),
        capability="navigate",
        place="office_storage",
        configuration=CONFIGURATION.configuration_id,
        half_life=half_life,
    )


@pytest.mark.ledger("R59", symbol="harness.routing.score:terms")
def test_the_score_is_success_less_risk_uncertainty_latency_cost_and_history() -> None:
    asked = need(place="office_storage", history=RoutingHistory(outcomes=(outcome("violated"),)))
    length_m = route_length_m(asked.parameters)
    assert length_m == pytest.approx(17.62, abs=0.005)
    weighted = terms(FOLLOWER, asked, preferences=WEIGHTS, dearest=2.0)
    assert weighted == {
        "success": pytest.approx(1.0 * 0.9),
        "risk": pytest.approx(-0.5 * 0.1),
        "uncertainty": pytest.approx(-0.3 * 0.1),
        "latency": pytest.approx(-0.2 * (6.0 + 2.1 * length_m) / 180.0),
        "cost": pytest.approx(-0.1 * 1.0 / 2.0),
        "history": pytest.approx(-0.4 * 2.0 / 3.0),
    }
    assert total(weighted) == pytest.approx(sum(weighted.values()))


@pytest.mark.ledger("R59", symbol="harness.routing.score:terms")
def test_candidates_that_cost_nothing_lose_nothing_for_it() -> None:
    free = Estimates(success=0.9, risk=0.1, uncertainty=0.1, cost=0.0)
    ranked = candidates(need(), cards=(card("a", estimates=free), card("b", estimates=free)), preferences=WEIGHTS)
    assert [one.terms["cost"] for one in ranked.candidates] == [0.0, 0.0]


@pytest.mark.ledger("R61", symbol="harness.routing.score:latency")
def test_latency_is_a_share_of_the_timeout_and_never_more_than_one() -> None:
    asked = need()
    assert 0.0 < latency(FOLLOWER, asked) < latency(CAREFUL, asked) < 1.0
    hasty = replace(asked, node=replace(asked.node, timeout_s=1.0))
    assert latency(CAREFUL, hasty) == 1.0
    assert latency(card(latency=Latency(base_s=18.0)), replace(asked, parameters={})) == pytest.approx(0.1)


def test_a_negative_weight_is_no_preference() -> None:
    with pytest.raises(msgspec.ValidationError, match=r">= 0.*history"):
        msgspec.convert({**msgspec.to_builtins(WEIGHTS), "history": -0.1}, RoutingPreferences)


@pytest.mark.ledger("R60", symbol="harness.routing.history:RoutingHistory.penalty")
def test_history_counts_verified_failures_and_residuals_only() -> None:
    assert penalty() == 0.5
    assert penalty(outcome("violated")) == pytest.approx(2 / 3)
    assert penalty(outcome("unsafe")) == pytest.approx(2 / 3)
    assert penalty(outcome("satisfied")) == pytest.approx(1 / 3)
    assert penalty(outcome("satisfied", residual=0.5)) == pytest.approx(1.5 / 3)
    assert penalty(outcome("ambiguous"), outcome("stale")) == 0.5


def test_history_belongs_to_provider_capability_place_and_configuration() -> None:
    foreign = [
        outcome("violated", provider="careful-local-planner"),
        outcome("violated", capability="speak"),
        outcome("violated", place="anchor_a"),
        outcome("violated", configuration=Digest("0" * 64)),
    ]
    assert penalty(*foreign) == 0.5


def test_an_old_failure_fades_as_newer_outcomes_come() -> None:
    fresh = penalty(outcome("satisfied"), outcome("violated"), half_life=1.0)
    faded = penalty(outcome("violated"), outcome("satisfied"), half_life=1.0)
    assert fresh == pytest.approx((1 + 1) / (2 + 1.5))
    assert faded == pytest.approx((1 + 0.5) / (2 + 1.5))


def test_the_best_score_is_chosen_and_its_terms_add_up() -> None:
    ranked = candidates(need(), cards=(CAREFUL, FOLLOWER), preferences=WEIGHTS)
    assert [one.provider_id for one in ranked.candidates] == ["route-follower", "careful-local-planner"]
    assert ranked.chosen == "route-follower"
    for one in ranked.candidates:
        assert one.score == pytest.approx(sum(one.terms.values()))
        assert set(one.terms) == {"success", "risk", "uncertainty", "latency", "cost", "history"}


@pytest.mark.ledger("R62", symbol="harness.routing.candidates:candidates")
def test_other_weights_and_a_bad_history_change_the_choice() -> None:
    failed = RoutingHistory(outcomes=tuple(outcome("violated") for _ in range(6)))
    wary = replace(WEIGHTS, history=2.0)
    asked = need(place="office_storage", history=failed)
    assert candidates(asked, cards=(FOLLOWER, CAREFUL), preferences=wary).chosen == "careful-local-planner"
    unmoved = replace(WEIGHTS, history=0.0)
    assert candidates(asked, cards=(FOLLOWER, CAREFUL), preferences=unmoved).chosen == "route-follower"


def test_a_tie_goes_to_the_lower_risk_and_then_to_the_name() -> None:
    level = replace(WEIGHTS, risk=0.0, success=0.0)
    a, b = card("a"), card("b")
    safer = card("z", estimates=replace(a.estimates, risk=0.05))
    for order in permutations((a, b, safer)):
        ranked = candidates(need(), cards=order, preferences=level)
        assert [one.provider_id for one in ranked.candidates] == ["z", "a", "b"]


def test_every_provider_looked_at_is_kept_with_the_reason_for_its_refusal() -> None:
    speaker = card("voice", capability="speak")
    cards: tuple[CapabilityCard, ...] = (speaker, FOLLOWER, card("arm", embodiments=("arm",)))
    ranked = candidates(need(excluded=(ProviderId("route-follower"),)), cards=cards, preferences=WEIGHTS)
    assert ranked.chosen is None
    assert {one.provider_id: one.refused_by for one in ranked.candidates} == {
        "arm": "embodiment", "route-follower": "excluded", "voice": "capability",
    }  # fmt: skip
    assert all(one.score is None and one.reason for one in ranked.candidates)
    assert (ranked.node_id, ranked.k) == ("go", 3)


def test_a_refused_provider_cannot_buy_its_way_in_with_a_score() -> None:
    perfect = Estimates(success=1.0, risk=0.0, uncertainty=0.0, cost=0.0)
    unfit = card("perfect", estimates=perfect, risk="high")
    assert candidates(need(), cards=(unfit, CAREFUL), preferences=WEIGHTS).chosen == "careful-local-planner"


def test_the_dearest_candidate_sets_the_scale_of_cost_among_those_that_passed() -> None:
    refused = card("gold", estimates=Estimates(success=0.9, risk=0.1, uncertainty=0.1, cost=1000.0), capability="speak")
    ranked = candidates(need(), cards=(FOLLOWER, CAREFUL, refused), preferences=WEIGHTS)
    costs = {one.provider_id: one.terms.get("cost") for one in ranked.candidates}
    assert costs == {"route-follower": pytest.approx(-0.05), "careful-local-planner": pytest.approx(-0.1), "gold": None}


def test_nodes_that_no_route_leads_to_have_no_length() -> None:
    asked: ProviderRequirements = need(parameters={"text": "hello"})
    assert route_length_m(asked.parameters) == 0.0
    assert route_length_m(contract().node(NodeId("panorama")).parameters) == 0.0


@pytest.mark.ledger("R60", symbol="harness.routing.history:RoutingHistory.penalty")
def test_a_series_weighs_what_its_outcomes_weigh_one_by_one_and_another_setting_counts_nothing() -> None:
    told: tuple[tuple[Verdict, float], ...] = (
        ("violated", 0.0), ("satisfied", 0.25), ("ambiguous", 1.0), ("unsafe", 0.0), ("stale", 1.0), ("satisfied", 0.0),
    )  # fmt: skip
    one_by_one = penalty(*(outcome(verdict, residual=residual) for verdict, residual in told))
    first = outcome("satisfied")
    setting = {
        "provider_id": first.provider_id,
        "capability": first.capability,
        "place": first.place,
        "configuration": first.configuration,
    }
    executions = tuple(ExecutionResult(verdict=verdict, residual=residual) for verdict, residual in told)
    refuted = (ExecutionResult(verdict="unsafe"),) * 9
    mine = OutcomeSeries(**setting, judged=executions)  # type: ignore[arg-type]
    elsewhere = OutcomeSeries(**{**setting, "place": "hall"}, judged=refuted)  # type: ignore[arg-type]
    asked = {**setting, "half_life": 4.0}
    fading = 0.5 ** (1 / 4)
    failed, total = 1 + fading + 0.25 * fading**2 + fading**3, 2 + 1 + fading + fading**2 + fading**3
    assert one_by_one == pytest.approx(failed / total)
    assert RoutingHistory(series=(mine, elsewhere)).penalty(**asked) == one_by_one  # type: ignore[arg-type]
    assert RoutingHistory(series=(elsewhere,)).penalty(**asked) == 0.5  # type: ignore[arg-type]
    sums = OutcomeSums()
    for verdict, residual in told:
        sums = sums.after(verdict, residual, half_life=4.0)
    summed = SettingHistory(**setting, sums=sums, position=9)  # type: ignore[arg-type]
    aside = SettingHistory(**{**setting, "place": "hall"}, sums=sums, position=9)  # type: ignore[arg-type]
    assert RoutingHistory(settings=(aside, summed)).penalty(**asked) == pytest.approx(one_by_one)  # type: ignore[arg-type]
    assert RoutingHistory(settings=(aside,)).penalty(**asked) == 0.5  # type: ignore[arg-type]


def test_a_history_from_an_older_log_is_read_as_it_was_written() -> None:
    old = msgspec.json.encode({"outcomes": [outcome("violated"), outcome("satisfied")]})
    assert decode(old, RoutingHistory).outcomes[0].verdict == "violated"
    series = OutcomeSeries(
        provider_id=ProviderId("route-follower"),
        capability="navigate",
        place="office_storage",
        configuration=CONFIGURATION.configuration_id,
        judged=(ExecutionResult(verdict="satisfied"),) * 200,
    )
    assert decode(encode(RoutingHistory(series=(series,))), RoutingHistory).series == (series,)
