"""Holds the sentences of answers of a robot that are wrong, by reason code."""

from collections.abc import Mapping

from app.i18n.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "another_robot_answers": N_("{found} answers at the address of {expected}"),
    "answer_breaks_protocol": N_("The robot's answer breaks the protocol ({error})"),
    "answer_nested_too_deep": N_("The robot's answer is nested too deep"),
    "answer_not_json": N_("The robot's answer is no JSON but {content_type}"),
    "answer_too_large": N_("The robot's answer is larger than {limit_mib} MiB"),
    "figure_out_of_range": N_("The robot's answer holds the figure {figure}, which no sensor and no clock can give"),
    "fuzz_needs_one_robot": N_("The kit needs either --builtin or --url"),
    "no_simulation_there": N_("No simulation in lockstep answers at {url}; nothing is forwarded to a physical robot"),
    "observations_endless": N_("The robot's samples do not end: {batches} full batches in a row"),
    "observations_unusable": N_("The robot's samples cannot be used: {reason}"),
    "outcome_not_known": N_("Nobody knows what became of the request: {reason}"),
    "request_forgotten": N_("{provider_id} no longer knows the request that it accepted"),
    "robot_address_invalid": N_("{url} is no address of a robot"),
    "robot_answered_status": N_("The robot answered {status}"),
    "robot_blob_differs": N_("The robot gives out other bytes than those of the digest {blob}"),
    "robot_gave_no_answer": N_("The robot did not answer {request} ({error})"),
    "robot_not_looked_at": N_("{robot_id} does not answer, so that nobody knows whether it is at rest"),
    "started_but_not_found": N_("{provider_id} does not find the request, and the robot's journal holds its start"),
    "body_moves_unaccounted": N_("The body is not shown at rest, so that the request is not sent again"),
    "stopped_as_unclear": N_("the robot's answers cannot be used: {reason}"),
    "unknown_lie": N_("The kit knows no lie {name}"),
    "too_many_of": N_("The robot's answer lists more than {limit} {what}"),
}
REMEDIES: Mapping[str, str] = {
    "another_robot_answers": N_("see which robot the address leads to; nothing is sent to another one"),
    "answer_breaks_protocol": N_("run the conformance kit against it"),
    "answer_nested_too_deep": N_("run the conformance kit against it"),
    "answer_not_json": N_("see what answers at this address: a gateway's page is no answer of a robot"),
    "answer_too_large": N_("see what the robot sends; samples are asked for in batches, pictures one by one"),
    "figure_out_of_range": N_("see what the robot sends"),
    "fuzz_needs_one_robot": N_("give one of them"),
    "no_simulation_there": N_("start the simulator with --speed 0"),
    "unknown_lie": N_("there are {known}"),
    "observations_endless": N_("see what the robot sends: a batch that is not full ends a reading"),
    "outcome_not_known": N_("look at the robot; the request may or may not have had an effect"),
    "robot_address_invalid": N_("write it as http://HOST:PORT"),
    "robot_answered_status": N_("see what answers at this address"),
    "robot_blob_differs": N_("see what the robot stores"),
    "robot_gave_no_answer": N_("see whether the robot is running; the request may or may not have arrived"),
    "robot_not_looked_at": N_("see whether the robot is running"),
    "too_many_of": N_("see what the robot sends"),
}
"""What to do about it."""
