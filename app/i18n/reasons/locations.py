"""Holds the sentences that say where an error is, by reason code."""

from collections.abc import Mapping

from app.i18n.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "at_argument": N_("argument {argument}"),
    "at_context": N_("context of {subject}: {kinds:words}"),
    "at_identity": N_("issuer “{issuer}”, subject “{subject}”"),
    "at_memory_index": N_("memory index"),
    "at_position": N_("position {position}"),
    "at_record": N_("record {digest}"),
    "at_site": N_("site {site}"),
    "the_goal": N_("the goal"),
}
