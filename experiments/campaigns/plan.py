"""Plans what happens in one mission of a campaign from one seed: template, faults of the robot, disturbances. Pure."""

from typing import Literal, get_args

from experiments.campaigns.chance import between, one_of, uniform
from harness.contracts.configuration import SPENDING
from harness.contracts.values import Value

RobotFault = Literal[
    "stale-pose", "missing-pose", "frozen-localiser", "early-success", "duplicate-request", "interrupted",
    "blocked-passage", "lost-localisation", "biased-localiser",
]  # fmt: skip
DisturbanceName = Literal[
    "request-lost", "reply-lost", "late-reply", "reordered", "duplicated", "foreign-identity", "provider-silent",
    "robot-crash", "lease-conflict", "clock-step", "epoch-change", "veto",
]  # fmt: skip
Template = Literal["errand", "circuit", "warehouse-inspection"]
ROBOT_FAULTS: tuple[RobotFault, ...] = get_args(RobotFault)
DISTURBANCES: tuple[DisturbanceName, ...] = get_args(DisturbanceName)
SHARES: dict[Template, float] = {"warehouse-inspection": 0.03, "circuit": 0.17, "errand": 0.80}
"""Most missions are short, so that there can be a hundred thousand; every fault strikes in each kind."""
LASTS_S: dict[Template, float] = {"warehouse-inspection": 110.0, "circuit": 45.0, "errand": 12.0}
"""About how long an undisturbed one takes: disturbances begin within this."""
AT_THE_START: dict[DisturbanceName, float] = {"lease-conflict": 0.8, "provider-silent": 0.8, "veto": 0.4}
"""How many of these come in a mission's first second, where most of what they can meet is: dispatches and leases."""
PERSISTENT_SHARE = 0.25
POOR_SHARE = 0.25
LONGEST_S: dict[DisturbanceName, float] = {
    "provider-silent": 25.0,
    "robot-crash": 8.0,
    "lease-conflict": 30.0,
    "clock-step": 60.0,
    "veto": 25.0,
    "foreign-identity": 60.0,
}
SHARE_OF_CALLS: dict[DisturbanceName, tuple[float, float]] = {
    "request-lost": (0.1, 0.9),
    "reply-lost": (0.1, 0.9),
    "late-reply": (0.05, 0.5),
    "reordered": (0.1, 0.8),
    "duplicated": (0.2, 1.0),
    "foreign-identity": (0.1, 0.7),
}


class Disturbance(Value):
    """One thing that goes wrong outside the robot: from `at_s` after the mission's begin, for `for_s`.

    `share`: of the calls in that time, for disturbances of messages. `size_s`: of a clock's step, or a reply's delay.
    """

    name: DisturbanceName
    at_s: float
    for_s: float
    share: float = 1.0
    size_s: float = 0.0


class MissionPlan(Value):
    """One mission. `approvals` is how many handoffs a person approves before nobody answers any more.

    `unpaid`: recovery actions that this mission's contract gives no budget for.
    """

    seed: int
    template: Template
    faults: tuple[str, ...]
    disturbances: tuple[Disturbance, ...]
    approvals: int
    unpaid: tuple[str, ...] = ()

    @property
    def needs_folder(self) -> bool:
        """Whether the robot dies in it, so that its journal and its world must be on a disk."""
        return any(one.name == "robot-crash" for one in self.disturbances)


def mission_plan(seed: int, *, template: Template | None = None) -> MissionPlan:
    """The mission of that seed, of the template it draws or of the given one, with one to four faults or
    disturbances.
    """
    template = template or _template(seed)
    mixture = one_of(seed, ((1, 0), (0, 1), (1, 1), (2, 1), (1, 2), (2, 2)), "mixture")
    faults = tuple(dict.fromkeys(_fault(seed, index) for index in range(mixture[0])))
    disturbances = tuple(_disturbance(seed, index, lasts_s=LASTS_S[template]) for index in range(mixture[1]))
    names = [fault.partition(":")[0] for fault in faults]
    return MissionPlan(
        seed=seed,
        template=template,
        faults=tuple(fault for place, fault in enumerate(faults) if names.index(names[place]) == place),
        disturbances=disturbances,
        approvals=int(uniform(seed, "approvals") * 3),
        unpaid=(one_of(seed, SPENDING, "unpaid"),) if uniform(seed, "poor") < POOR_SHARE else (),
    )


def _template(seed: int) -> Template:
    drawn, passed = uniform(seed, "template"), 0.0
    for template, share in SHARES.items():
        passed += share
        if drawn < passed:
            return template
    return "errand"


def _fault(seed: int, index: int) -> str:
    name = one_of(seed, ROBOT_FAULTS, "fault", index)
    persistent = uniform(seed, "persistent", index) < PERSISTENT_SHARE
    return f"{name}:persistent" if persistent else name


def _disturbance(seed: int, index: int, *, lasts_s: float) -> Disturbance:
    name = one_of(seed, DISTURBANCES, "disturbance", index)
    low, high = SHARE_OF_CALLS.get(name, (1.0, 1.0))
    sign = -1.0 if uniform(seed, "sign", index) < 0.5 else 1.0
    size_s = between(seed, 0.2, 3.0, "size", index)
    early = uniform(seed, "early", index) < AT_THE_START.get(name, 0.0)
    return Disturbance(
        name=name,
        at_s=between(seed, 0.0, 1.0 if early else lasts_s, "at", index),
        for_s=between(seed, 0.5, LONGEST_S.get(name, 12.0), "for", index),
        share=between(seed, low, high, "share", index),
        size_s=sign * size_s * 5.0 if name == "clock-step" else size_s,
    )
