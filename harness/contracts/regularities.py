"""What a simulated site does to robots again and again. The simulated world knows it; no role of the harness does."""

from typing import Literal

from harness.contracts.values import Name, Point, Positive, Share, Value

RegularityKind = Literal[
    "obstructed", "closed", "unlocalised", "lagging", "unready", "giving_up", "stalling", "claiming"
]  # fmt: skip


class Regularity(Value):
    """One habit of a place: in `share` of the missions, drawn from the mission's own seed, it strikes near `at_m`.

    obstructed: boxes across the way with a gap for the careful; closed: from wall to wall. Both are gone `lasts_s`
    after the robot first came within `radius_m`.
    unlocalised: the localiser is silent within `radius_m`; lagging: it repeats an old pose. Both for `lasts_s` from
    each arrival there. unready: it is silent for `lasts_s` from the mission's begin.
    giving_up: `provider_id` ends as interrupted there; stalling: it stands there without a word; claiming: it says
    that it arrived. Without `lasts_s` a habit lasts as long as the mission. Metres in the map frame, seconds.
    """

    name: Name
    kind: RegularityKind
    share: Share
    at_m: Point = (0.0, 0.0)
    radius_m: Positive = 1.0
    lasts_s: Positive | None = None
    provider_id: str = ""


class HiddenSite(Value):
    """The regularities of one site. Before each mission a person carries the robot back to where it starts."""

    name: Name
    regularities: tuple[Regularity, ...] = ()
