"""Holds the sentences with which the console itself refuses, by reason code."""

from collections.abc import Mapping

from app.i18n.catalogues import N_

SENTENCES: Mapping[str, str] = {
    "no_permission_declared": N_("Nobody has declared who may give {command}."),
    "robot_elsewhere": N_("{robot_id} is driven by {worker}: do it at that process's own console"),
    "no_supervisor_here": N_("No supervisor runs here, so no robot can be reached."),
    "role_revoked": N_("{actor} may no longer decide this: their role was taken back."),
    "unseen": N_("What was on your screen has changed since. Read it again, then decide."),
    "viewer_not_private": N_("The 3D view would listen where others reach it, so it was stopped."),
    "wheel_not_taken": N_("Nobody has control of {robot_id}: take control first."),
}
