"""Holds the sentences of what an audit replay or the check of a dossier finds to differ, by reason code."""

from collections.abc import Mapping

from app.i18n.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "audit_difference": N_("position {position}, {stream}, {kind}: {difference}"),
    "audit_difference_of_stream": N_("{stream}: {difference}"),
    "audited_candidates_differ": N_(
        "routing chose {stored}; derived again it chooses {derived}, or scores the candidates otherwise"
    ),
    "audited_choice_not_bound": N_("the contract was bound to another choice than the one that was made"),
    "audited_command_changed": N_("command {digest} was changed: its bytes have the digest {found}"),
    "audited_command_missing": N_("no command is stored with it, though commands are stored before it"),
    "audited_command_unreadable": N_("command {digest} cannot be read: {error}"),
    "audited_event_differs": N_("derived again it is {derived}, stored is {stored}"),
    "audited_event_not_stored": N_("the gate derives {event} before it, which is not stored"),
    "audited_event_unexplained": N_("no command leads to this event here"),
    "audited_event_unreadable": N_("it cannot be read: {reason}"),
    "audited_first_map_not_empty": N_("the first map was drawn on a map that already had known cells"),
    "audited_gate_differs": N_("derived again by the gate it is {derived}, stored is {stored}"),
    "audited_gate_refuses": N_("the gate accepted it; derived again it is refused by rule {rule}: {reason}"),
    "audited_gate_undecided": N_("the gate cannot decide {command} again: {error}"),
    "audited_goal_differs": N_("the goal verdict was {stored:word}; derived again it is {derived:word}"),
    "audited_input_unreadable": N_("what the role was shown cannot be read: {reason}"),
    "audited_last_event_not_stored": N_("the gate derives {event} after it, which is not stored"),
    "audited_map_differs": N_("the map was {stored}; drawn again it is {derived}"),
    "audited_map_of_other_basis": N_("the map was drawn on another map than the mission's newest"),
    "audited_map_of_other_packets": N_("the map was drawn from other packets than the new ones"),
    "audited_map_of_other_sweeps": N_("the map was drawn from other sweeps than those that can be used"),
    "audited_outcomes_differ": N_("routing was told {stored} of {provider_id}; the log says {derived}"),
    "audited_person_differs": N_("C4 led to a person ({reason}); derived again it leads to {derived:word}"),
    "audited_plan_differs": N_("C1 led to {stored}; derived again it leads to {derived}"),
    "audited_plan_of_other_state": N_("C1 is of state version {shown}, the plan was made at {planned}"),
    "audited_plan_refused": N_("the plan was accepted; derived again it is refused: {reason}"),
    "audited_policy_differs": N_(
        "the recovery policy is not that of configuration {configuration}, which the mission is pinned to"
    ),
    "audited_provider_not_chosen": N_("routing chose {chosen}; {provider_id} was sent"),
    "audited_record_changed": N_("record {digest} was changed: its bytes have the digest {found}"),
    "audited_record_of_other_kind": N_("record {digest} is not a {kind}: {error}"),
    "audited_recovery_differs": N_("C4 led to {stored:word}; derived again it leads to {derived:word} ({reason})"),
    "audited_routing_preferences": N_(
        "routing did not use the preferences of configuration {configuration}, which the mission is pinned to"
    ),
    "audited_skill_differs": N_("C2 led to {stored}; derived again it leads to {derived}"),
    "audited_state_differs": N_("the state folded from zero is not, byte for byte, the live one"),
    "audited_target_differs": N_("the target was {stored}; derived again it is {derived}"),
    "audited_target_of_other_inputs": N_("the target was proposed from other inputs than the mission's: {inputs}"),
    "audited_verdict_differs": N_("the verdict was {stored:word}; derived again it is {derived:word}"),
    "audited_verdict_unanswered": N_("no verifier answered, yet the verdict is {stored:word}"),
    "decision_unreadable": N_("position {position}: {reason}"),
    "dossier_erasure_without_event": N_("the dossier says that blob {digest} was erased, but none of its events does"),
    "dossier_goal_of_other_transcript": N_("the goal is not the text of its transcript"),
    "dossier_judgement_differs": N_(
        "the dossier states another reading, or another verdict by clause, than its events do"
    ),
    "dossier_place_differs": N_("the contract's {parameter} is not {place_id} as of its revision {revision}"),
    "dossier_place_removed": N_("the contract's {parameter} is {place_id}, which had been removed"),
    "dossier_place_revision_skipped": N_(
        "event {position} is revision {revision} of {place_id}, which was at revision {before}"
    ),
    "dossier_speech_differs": N_("the dossier states another recording or transcript of the goal than its events do"),
    "dossier_speech_missing": N_("the recording or transcript of the goal is missing or damaged: {digests}"),
    "dossier_status_differs": N_("the dossier says {stated:word}, its events fold to {folded:word}"),
    "dossier_transcript_of_other_recording": N_("the transcript is of another recording"),
    "dossier_transcript_unreadable": N_("the transcript of the goal cannot be read"),
}
