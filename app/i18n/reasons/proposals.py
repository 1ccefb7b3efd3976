"""Holds the sentences with which planners and explorers explain a proposal, by reason code."""

from collections.abc import Mapping

from app.i18n.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "first_eligible": N_("{node_id:word} is the first eligible stage in the graph; others: {others:words}."),
    "first_waiting": N_(
        "{node_id:word} is the first eligible stage in the graph, although it waits for {waiting_for}; others:"
        " {others:words}."
    ),
    "nearest_unknown_edge": N_(
        "{length_m:.1f} m of unknown edge near ({x_m:.1f}, {y_m:.1f}), {way_m:.1f} m away; {open} of {edges} "
        "edges are open."
    ),
    "no_node_eligible": N_("No stage is eligible: each one is done, failed or waits for another."),
    "proposed_nothing_usable": N_("{planner} proposed nothing usable: {kind}: {error}"),
    "skill_proposed": N_("Attempt {attempt} of {node_id:word}. Facts of: {facts}. Dropped: {dropped}."),
    "target_refused": N_("{rule:word}: {why}"),
}
