"""Holds the sentences of declared capabilities, of installed predicates and of estimates, by reason code."""

from collections.abc import Mapping

from app.i18n.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "best_estimate": N_(
        "{node_id:word} has the best estimate of the world model ({score:.2f}; {over:word} has {other:.2f})."
    ),
    "capability_not_namespaced": N_("{capability} is no name for a capability of a site"),
    "capability_of_card_undeclared": N_("{provider_id} offers {capability}, which is not declared at this site"),
    "capability_only_estimates": N_("{capability} only estimates: no stage can be done by it"),
    "capability_undeclared": N_("{capability} is not a declared capability"),
    "capability_without_effect": N_("{capability} may not claim {predicate}, which {condition_id} tests"),
    "capability_without_parameter": N_("{capability} has no parameter {parameter}"),
    "card_of_other_type": N_("The card of {provider_id} does not fit {capability}: {why}"),
    "condition_names_no_predicate": N_("{condition_id} names the predicate {predicate}, which is not installed"),
    "declared_source_silent": N_("{predicate} needs {sources}, which showed nothing"),
    "effect_without_predicate": N_("No predicate tests {predicate}, which {capability} may claim"),
    "goal_proposed_already": N_("This goal waits for a person already"),
    "estimate_unusable": N_("The estimate cannot be used: {error}"),
    "estimates_claim_nothing": N_("{capability} only estimates, and yet it claims effects"),
    "estimator_moves": N_("{name} moves the robot, and may only estimate"),
    "evidence_not_promised": N_("it does not promise {name}"),
    "installed_predicate_failed": N_("the predicate {predicate} gave no usable answer: {reason}"),
    "installed_predicate_says": N_("{predicate} {version}: {why}"),
    "extra_missing": N_("The extra [{extra}] is not installed"),
    "mcp_token_odd": N_("This token may {may}; for an agent it may read and suggest, no more and no less"),
    "parameter_not_declared": N_("it requires {name}, which is not declared"),
    "card_lacks_parameter": N_("it does not take {name}"),
    "parameter_of_other_type": N_("it declares {name} with another type or unit"),
    "predicate_answers_nothing": N_("it answered with a {kind} and not with a PredicateAnswer"),
    "predicate_answers_two_ways": N_("it answered the same question in two ways"),
    "predicate_changes_evidence": N_("it changed the evidence that it was shown"),
    "predicate_is_none": N_("the entry point names a {kind} and not an EvidencePredicate"),
    "predicate_misnamed": N_("it calls itself {name}, which is another name than its entry point's, or taken"),
    "predicate_needs_vouching": N_("{condition_id} rests on {predicate}, which the site does not vouch for"),
    "predicate_not_installed": N_("the predicate {name} is not installed"),
    "predicate_not_pinned": N_("the mission is not pinned to the predicate {predicate}"),
    "predicate_not_vouched": N_("the site does not vouch for {predicate}, so it decides nothing: {reason}"),
    "predicate_of_another_version": N_(
        "the mission is judged by {predicate} {version} ({code}); installed is {now} ({now_code})"
    ),
    "predicate_of_other_effect": N_("{condition_id} names {predicate}, which tests {effect} effects"),
    "predicate_only_alone": N_("{condition_id} holds {predicate} over time, which an installed predicate cannot be"),
    "predicate_unusable": N_("The installed predicate {name} cannot be used: {reason}"),
    "predicate_without_source": N_("the file of its function cannot be found"),
    "resource_not_leased": N_("it does not lease {name}"),
    "stage_risk_understated": N_("A stage with {capability} has at least the risk {least:word}, not {risk:word}"),
    "proposed_goal_not_waiting": N_("This goal does not wait any more"),
    "too_many_goals_proposed": N_("{count} goals wait for a person already"),
}
REMEDIES: Mapping[str, str] = {
    "capability_not_namespaced": N_("call it VENDOR.NAME, in small letters"),
    "capability_of_card_undeclared": N_("declare it in capabilities.yaml; known: {known}"),
    "capability_only_estimates": N_("name a capability that does something"),
    "capability_undeclared": N_("declare it in capabilities.yaml, or name one of {known}"),
    "capability_without_effect": N_("test one of {known}, or add it to `effects` of the capability"),
    "capability_without_parameter": N_("name one of {known}, or declare it with the capability"),
    "card_of_other_type": N_("correct the card, or the declaration in capabilities.yaml"),
    "condition_names_no_predicate": N_("install the package that brings it; installed: {installed}"),
    "effect_without_predicate": N_("install the package that brings it, or name one of {known}"),
    "estimates_claim_nothing": N_("leave `effects` out, or `estimates`"),
    "extra_missing": N_("install it: `pip install 'regenharness[{extra}]'`"),
    "mcp_token_odd": N_("issue one: `regen token create NAME --scope read --scope suggest`"),
    "predicate_needs_vouching": N_("read it, try it against lies, then name it under `vouched` in site.yaml"),
    "predicate_of_other_effect": N_("give the condition an effect of that type"),
    "predicate_only_alone": N_("name it as an effect of its own"),
    "predicate_unusable": N_("correct or remove the package that brings it"),
    "stage_risk_understated": N_("raise `risk` of the stage"),
}
