"""Recurring disturbances of a simulated site. The simulated world knows them; no role of the harness does."""

from typing import Literal

from harness.contracts import values

RegularityKind = Literal[
    "obstructed", "closed", "unlocalised", "lagging", "unready", "giving_up", "stalling", "claiming"
]  # fmt: skip


class Regularity(values.Value):
    """One recurring disturbance: in `share` of the missions, drawn from the mission's own seed, it occurs near `at_m`.

    obstructed: boxes across the path with a gap for the careful; closed: from wall to wall. Both are gone `lasts_s`
    after the robot first came within `radius_m`. unlocalised: the localiser is silent within `radius_m`; lagging: it
    repeats an old pose. Both for `lasts_s` from each arrival there. unready: it is silent for `lasts_s` from the start
    of the mission. giving_up: `provider_id` ends as interrupted there; stalling: it stops there without a report;
    claiming: it reports that it arrived. Without `lasts_s` a disturbance lasts as long as the mission. Metres in the
    map frame, seconds.
    """

    name: values.Name
    kind: RegularityKind
    share: values.Share
    at_m: values.Point = (0.0, 0.0)
    radius_m: values.Positive = 1.0
    lasts_s: values.Positive | None = None
    provider_id: str = ""


class HiddenSite(values.Value):
    """The regularities of one site. Before each mission a person carries the robot back to its start."""

    name: values.Name
    regularities: tuple[Regularity, ...] = ()
