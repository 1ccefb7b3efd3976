"""Holds the sentences about records that a role was not given, by reason code."""

from collections.abc import Mapping

from app.i18n.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "about_other_stages": N_("about {stages}"),
    "attestation_not_in_policy": N_("the stage's evidence policy names no attestation by a person"),
    "beyond_budget": N_("oldest beyond {budget} items"),
    "beyond_limit_of_kind": N_("at most {limit} of its kind"),
    "confidence_too_low": N_("{confidence:.2f} < {least:.2f}"),
    "contradicted_by": N_("{name}: {stated} against {against} by {source}"),
    "observed_again": N_("{source} observed again at {at_s:.2f}"),
    "observed_too_late": N_("observed {late_s:.2f} s after the instant it should speak for"),
    "of_another_map": N_("map version {map_version}, the contract's is {contract_map}"),
    "origin_no_evidence": N_("origin {origin:word} is no evidence"),
    "packet_executed_again": N_("packet {packet} executed again later"),
    "record_too_old": N_("{age_s:.2f} s old, limit {limit_s:.2f} s"),
    "settled_by": N_("settled by {source} at {at_s:.2f}"),
}
