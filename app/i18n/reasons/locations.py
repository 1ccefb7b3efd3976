"""Holds the sentences that say where an error is, by reason code."""

from collections.abc import Mapping

from app.i18n.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "at_algorithm": N_("algorithm {algorithm}"),
    "at_aliases": N_("site {site}, aliases of {first} and {second}"),
    "at_argument": N_("argument {argument}"),
    "at_claim": N_("claim {claim}"),
    "at_conformance_file": N_("conformance file of {provider_id}"),
    "at_context": N_("context of {subject}: {kinds:words}"),
    "at_groups_of": N_("{name}, {groups} groups"),
    "at_identity": N_("issuer “{issuer}”, subject “{subject}”"),
    "at_invocation": N_("invocation {invocation_id}"),
    "at_memory_index": N_("memory index"),
    "at_name": N_("name “{name}”"),
    "at_new_password": N_("the new password"),
    "at_position": N_("position {position}"),
    "at_present_password": N_("the present password"),
    "at_principal": N_("{name}, {roles}"),
    "at_record": N_("record {digest}"),
    "at_resources": N_("resources {first} and {second}"),
    "at_role_context": N_("{role} of {node_id}"),
    "at_roles": N_("roles {roles}"),
    "at_site": N_("site {site}"),
    "at_stream_position": N_("position {position}, stream {stream}"),
    "at_template": N_("template {template}"),
    "at_template_field": N_("template {template}, {field}"),
    "at_token": N_("token {name}"),
    "at_token_scopes": N_("token {name}, scopes {scopes}"),
    "the_goal": N_("the goal"),
}
