"""Holds the sentences of candidates that cannot be read, by reason code."""

from collections.abc import Mapping

from app.i18n.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "candidate_key_twice": N_("The key “{name}” stands twice in one object"),
    "candidate_not_json": N_("It is not JSON: {error}"),
    "candidate_of_other_baseline": N_("The candidate was made against {baseline}, not {current}"),
    "candidate_outside": N_("A candidate cannot name “{name}”: it lies outside every configuration"),
    "candidate_prefix_ambiguous": N_("{count} candidates begin with {prefix}"),
    "candidate_too_deep": N_("It is nested over {limit} deep"),
    "candidate_too_large": N_("The text has {size_bytes} bytes, at most {limit_bytes} are read"),
    "unknown_candidate": N_("There is no candidate {candidate}"),
    "value_not_listed": N_("“{value}” is none of {values}"),
}
REMEDIES: Mapping[str, str] = {
    "candidate_key_twice": N_("write each key once"),
    "candidate_not_json": N_("send one JSON object"),
    "candidate_of_other_baseline": N_("propose it again on the current baseline"),
    "candidate_outside": N_("state {sections} and nothing else"),
    "candidate_prefix_ambiguous": N_("list them with `regen rsi list`"),
    "candidate_too_deep": N_("write it flatter"),
    "candidate_too_large": N_("state the four sections and nothing else"),
    "unknown_candidate": N_("list them with `regen rsi list`"),
}
"""What to do about it."""
