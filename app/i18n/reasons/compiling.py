"""Holds the sentences of goals, templates and arguments that give no contract, by reason code."""

from collections.abc import Mapping

from app.i18n.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "object_not_known": N_("The condition {condition_id} asks for {name}, which the object detector does not know"),
    "pictures_not_read": N_("The condition {condition_id} asks what a picture shows, and nothing here reads pictures"),
    "argument_contradicts": N_("The goal is about {place}, and {parameter} says {said}"),
    "argument_missing": N_("{title:word} is not given"),
    "argument_no_number": N_("“{value}” is not a number"),
    "argument_no_text": N_("“{value}” is not a {kind:word}"),
    "argument_too_long": N_("The argument has {characters} characters"),
    "clause_cited_unknown": N_("A completion condition cites {clause}, which is no clause of the reading"),
    "clause_untested": N_("Clause {number} of the goal ({act:word}) has no completion condition"),
    "clause_without_words": N_("A clause rests on no word of the text"),
    "declared_unknown": N_("Stage {node_id} declares {declared}, which is no condition of it"),
    "evidence_unmade": N_("No stage can make the evidence that {condition_id} needs: {capabilities}"),
    "explores_nothing": N_("The contract explores nothing"),
    "facts_no_better": N_("it rests on accepted facts of other stages, which are no better"),
    "goal_empty": N_("The goal is empty"),
    "goal_heard_in_two_ways": N_("The recording was heard in two ways"),
    "goal_not_of_recording": N_("The goal is not what the recording says, which is “{heard}”"),
    "goal_not_doable_as_read": N_("The goal cannot be done as it was read"),
    "goal_not_understood": N_("The goal was not understood"),
    "goal_not_unicode": N_("The goal is not valid Unicode"),
    "goal_not_wholly_understood": N_("The goal was not understood as a whole"),
    "goal_only_forbids": N_("The goal only says what not to do"),
    "goal_read_otherwise": N_("The goal is not read as {digest} now"),
    "goal_too_long": N_("The goal has {characters} characters, at most {limit} are read"),
    "goal_words_unread": N_("The goal has words that were not read"),
    "level_out_of_reach": N_(
        "{condition_id} needs evidence of independence {required}; "
        "what this robot has for it ({sources}) reaches {level}"
    ),
    "name_misspelt": N_("There is no {kind:word} called “{name}”"),
    "name_of_two": N_("“{name}” names two things: {kind:word} {id} and {other_kind:word} {other_id}"),
    "name_unknown": N_("There is no {kind:word} called “{name}”"),
    "no_common_resource": N_("No resource is allowed by both"),
    "no_passage_within": N_("No passage lies within {place_id}"),
    "no_route_between": N_("No route leads from {start} to {end}"),
    "no_route_to": N_("No route leads to {place_id}"),
    "no_spanning_condition": N_("No completion condition spans several stages"),
    "no_template_leads": N_("No template leads to {place_id}"),
    "no_zone_around": N_("No zone holds {place_id}"),
    "no_transcriber": N_("Nothing here can write a recording down"),
    "nothing_understood": N_("Nothing was understood"),
    "nothing_verified": N_(
        "Every completion condition rests on a declared effect: nothing of the goal would be verified"
    ),
    "number_not_finite": N_("{value} is not a finite number"),
    "object_not_of_site": N_("The site has no {name}"),
    "parameter_missing": N_("A required parameter is not given"),
    "parameter_mistyped": N_("It is no {kind:word}: {error}"),
    "parameter_not_taken": N_("This goal takes no parameter “{name}”"),
    "parameter_outside_bounds": N_("{value} is outside {low} to {high}"),
    "place_ambiguous": N_("{count} places are called “{name}”"),
    "place_disputed": N_("The position of place {place_id} is disputed"),
    "provider_names_no_sources": N_("{provider_id} does not say which sensors it uses"),
    "predicate_retired": N_("Condition {condition_id} names {predicate}, which only its provider's word can show"),
    "recording_before_microphone": N_("The recording is said to begin before its microphone gave a sample"),
    "recording_unusable": N_("The recording cannot be used: {reason}"),
    "recording_unknown": N_("No recording {digest}… is stored here"),
    "reading_of_other_text": N_("The reading is of another text or site"),
    "route_between": N_("{name} ({start} to {end})"),
    "source_of_same_origin": N_(
        "{source} comes from the same process or address as {provider_id}, and the site file does not vouch for it"
    ),
    "source_of_provider": N_("{provider_id} uses {source} itself"),
    "source_missing": N_("Nothing at this robot except the provider itself can show {condition_id} ({predicate})"),
    "span_outside_text": N_("Characters {start} to {end} are not in the text"),
    "spot_inside_text": N_("{spot} is no text or number, so it cannot stand inside a text"),
    "spot_unbound": N_("{spot} is bound to nothing"),
    "spot_unreadable": N_("“{text}” has an open spot that cannot be read"),
    "spot_without_field": N_("{spot} names a field that {name} lacks"),
    "stage_without_provider": N_("nobody is connected who can do {node_id}"),
    "template_invalid": "{error}",
    "template_read_otherwise": N_("The template is read otherwise now"),
    "template_without_words": N_("{title:word} takes no goal in words"),
    "text_in_no_clause": N_("{count} parts of the text are in no clause"),
    "vouched_unknown": N_("The site vouches for {name}, which is no source of evidence here"),
    "verifier_missing": N_("No verifier is installed for {predicate}, which {condition_id} needs"),
    "way_through_forbidden": N_("The way of {node_id} leads through {region}, which the goal forbids"),
    "word_alone": N_("Only the provider's own word could show {condition_id} ({predicate}), and that is never enough"),
}
REMEDIES: Mapping[str, str] = {
    "object_not_known": N_("ask for a sign by its text, or for one of the classes that `regen vision describe` knows"),
    "pictures_not_read": N_(
        'install the extra, pip install "regenharness[{extra}]" and `regen vision install FOLDER`, and set '
        "REGEN_VISION_FOLDER"
    ),
    "argument_contradicts": N_("say the place in the goal, or leave the argument out"),
    "argument_missing": N_("give a {kind:word}"),
    "argument_no_number": N_("give a finite number"),
    "argument_no_text": N_("give its name as text"),
    "argument_too_long": N_("use at most {limit}"),
    "clause_cited_unknown": N_("cite a clause by its number, or a default of the mission profile"),
    "clause_untested": N_("test every clause, or refuse the goal"),
    "clause_without_words": N_("read the goal again"),
    "declared_unknown": N_("name one of {names}"),
    "evidence_unmade": N_("add such a stage, or drop the condition"),
    "explores_nothing": N_("start it from a template that explores"),
    "goal_empty": N_("say what the robot shall do"),
    "goal_heard_in_two_ways": N_("confirm the reading if it is what you said, else record it again or type it"),
    "goal_not_of_recording": N_("leave the recording out to type the goal"),
    "goal_not_doable_as_read": N_("start a new mission with the same goal"),
    "goal_not_understood": N_("reword the goal"),
    "goal_not_unicode": N_("send it as UTF-8"),
    "goal_not_wholly_understood": N_("reword the goal, or confirm the reading by its digest"),
    "goal_only_forbids": N_("say what the robot shall do"),
    "goal_read_otherwise": N_("read the goal again and confirm what it says now"),
    "goal_too_long": N_("say it shorter"),
    "goal_words_unread": N_("confirm the reading, or say it otherwise"),
    "level_out_of_reach": N_(
        "what is missing: {missing}; connect a source that the provider does not use and that runs elsewhere, vouch "
        "for such a source in the site file (vouched), let a person attest it in the stage's evidence policy, or ask "
        "for independence {level}"
    ),
    "name_misspelt": N_("did you mean “{nearest}”? Known: {names}"),
    "name_of_two": N_("take the name from one of them"),
    "name_unknown": N_("known: {names}"),
    "no_common_resource": N_("raise a veto if nothing may be used at all"),
    "no_passage_within": N_(
        "choose a place whose region holds a passage, or add the floor polygon that an inspection looks at"
    ),
    "no_route_between": N_("survey one, or choose places that a route connects: {routes}"),
    "no_route_to": N_("survey one that ends there"),
    "no_spanning_condition": N_("add one that no stage tests by itself, such as in_order or linked"),
    "no_template_leads": N_("add a template that serves `go`, or ask for one thing at a time"),
    "no_zone_around": N_("add the outline of the walls around it as a zone: a turn is checked against them"),
    "no_transcriber": N_("type the goal"),
    "nothing_understood": N_("say what the robot shall do"),
    "nothing_verified": N_("add a condition that does not name {nodes}"),
    "number_not_finite": N_("give a number with a bound"),
    "object_not_of_site": N_("name what the site has"),
    "parameter_missing": N_("state it in the task template"),
    "parameter_mistyped": N_("correct the template"),
    "parameter_not_taken": N_("it takes: {names}"),
    "parameter_outside_bounds": N_("correct the template, or choose another provider"),
    "place_ambiguous": N_("use an id: {ids}"),
    "place_disputed": N_("verify the place again before a mission goes there"),
    "predicate_retired": N_(
        "name the predicate that replaces it, or declare the condition in the stage's evidence policy"
    ),
    "recording_unknown": N_("upload it first"),
    "recording_before_microphone": N_("send both instants by the clock of one machine"),
    "recording_unusable": N_("give a WAV of 16-bit mono samples, {low_s} to {high_s} s long, or type the goal"),
    "reading_of_other_text": N_("read the goal again"),
    "source_missing": N_(
        "connect a source of {predicate} to this robot, or name the condition under declared in the stage's evidence "
        "policy: the mission is then verified in part"
    ),
    "span_outside_text": N_("read the goal again"),
    "spot_inside_text": N_("let the spot be the whole value"),
    "spot_unbound": N_("bound: {names}"),
    "spot_unreadable": N_("write {spot} or {spot_of_field} in lower case"),
    "spot_without_field": N_("it has: {fields}"),
    "template_invalid": N_("correct the template"),
    "template_read_otherwise": N_("start it by name alone"),
    "template_without_words": N_("start it by its name, or leave the name out"),
    "text_in_no_clause": N_("mark them unread"),
    "vouched_unknown": N_("name one of {names}"),
    "verifier_missing": N_("install one, or test the condition by a predicate that is"),
    "way_through_forbidden": N_("allow the region, or ask for a place that can be reached without it"),
    "word_alone": N_(
        "name the condition under declared in the stage's evidence policy, let a person attest it there, or test it by "
        "a predicate that measures"
    ),
}
"""What to do about it."""
