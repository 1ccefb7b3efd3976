"""Pure: the one pointer to what new missions run under: where it stands, how it came there, what runs under what."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from app.messages import N_, lazy_gettext
from app.views.canary import CanaryPanel, canary_panel
from app.views.candidates import title_of
from app.views.review_rows import UptakeRow, policy_sentence, uptake_rows
from app.views.shell import Shell
from harness.contracts.actors import Actor
from harness.contracts.ids import Digest, RobotId
from rsi_reviews.events import PointerMoved
from rsi_reviews.pointers import Pointer, current_at
from rsi_reviews.projections import Review

CAUSES = {
    "shipped": N_("shipped with the program"), "canary": N_("canary began"), "released": N_("released to every robot"),
    "rolled_back": N_("rolled back"), "withdrawn": N_("canary withdrawn"),
}  # fmt: skip
TONES = {"rolled_back": "bad", "canary": "warn", "released": "good"}
WIDTH, HEIGHT = 920.0, 64.0


@dataclass(frozen=True)
class MoveRow:
    """One move of the pointer. `configuration` holds for every robot but `robot_id`, where `canary` runs."""

    revision: int
    cause: str
    tone: str
    configuration: str
    canary: str
    robot_id: str
    candidate: str
    who: str
    reason: str
    at_s: float


@dataclass(frozen=True)
class Span:
    """A stretch of the timeline: from one move to the next, or to now."""

    revision: int
    tone: str
    title: str
    x: float
    width: float


@dataclass(frozen=True)
class VersionRow:
    """One version and the unfinished missions pinned to it. `candidate` proposed it; empty for what was shipped."""

    configuration: str
    title: str
    candidate: str
    state: str
    quarantined: str
    missions: tuple[str, ...]


@dataclass(frozen=True)
class LookRow:
    """One look at the held-out suite, whatever it answered."""

    candidate: str
    look: int
    alpha: float
    at_s: float


@dataclass(frozen=True)
class At:
    """What was current at an instant; `found` is empty before the pointer was first written."""

    asked: str
    instant_s: float
    found: str
    robots: tuple[tuple[str, str], ...]
    wrong: str


@dataclass(frozen=True)
class PolicyForm:
    """Who must agree before a release, as it stands or as somebody left it."""

    kind: str
    quorum: str
    cooling_off_h: str
    sentence: str
    may: bool
    reviewers: tuple[str, ...]
    releasers: tuple[str, ...]
    typed: str
    refused: str


@dataclass(frozen=True)
class Around:
    """What the console found beside the pointer: candidates, pins, states of versions, who holds which role."""

    reviews: Sequence[Review]
    pins: Mapping[Digest, Sequence[str]]
    versions: Mapping[Digest, str]
    robots: Sequence[str]
    reviewers: Sequence[str]
    releasers: Sequence[str]


@dataclass(frozen=True)
class ReleasesPage:
    """`released` is the candidate whose configuration is current and can be rolled back; empty for what was shipped."""

    shell: Shell
    revision: int
    current: str
    title: str
    released: str
    rollback: str
    canary: CanaryPanel | None
    moves: tuple[MoveRow, ...]
    spans: tuple[Span, ...]
    width: float
    height: float
    at: At | None
    versions: tuple[VersionRow, ...]
    uptakes: tuple[UptakeRow, ...]
    looks: tuple[LookRow, ...]
    policy: PolicyForm
    key: str


def releases_page(
    shell: Shell, pointer: Pointer, around: Around, actor: Actor, *, key: str, at: At | None, policy: PolicyForm
) -> ReleasesPage:
    by_configuration: dict[str, Review] = {one.configuration: one for one in reversed(around.reviews)}
    trial = next((one for one in around.reviews if one.candidate == pointer.trial), None)
    current = by_configuration.get(pointer.configuration)
    return ReleasesPage(
        shell=shell,
        revision=pointer.revision,
        current=pointer.configuration,
        title=title_of(current) if current and pointer.released else N_("what the program ships"),
        released=pointer.released or "",
        rollback=pointer.rollback,
        canary=canary_panel(trial, pointer, actor) if trial else None,
        moves=tuple(_move(one) for one in reversed(pointer.history)),
        spans=_spans(pointer, now_s=shell.now_s),
        width=WIDTH,
        height=HEIGHT,
        at=at,
        versions=tuple(_version(name, state, by_configuration.get(name), pointer, around)
                       for name, state in around.versions.items() if name),
        uptakes=uptake_rows(pointer),
        looks=tuple(LookRow(one.candidate, one.look, one.alpha, one.at_s) for one in reversed(pointer.looks)),
        policy=policy,
        key=key,
    )  # fmt: skip


def policy_form(
    pointer: Pointer, around: Around, *, may: bool, typed: Mapping[str, str] | None = None, refused: str = ""
) -> PolicyForm:
    """As it stands, or as it was left."""
    left = typed or {}
    return PolicyForm(
        kind=left.get("kind", pointer.policy.kind),
        quorum=left.get("quorum", str(pointer.policy.quorum)),
        cooling_off_h=left.get("cooling_off_h", f"{pointer.policy.cooling_off_s / 3600.0:g}"),
        sentence=policy_sentence(pointer),
        may=may,
        reviewers=tuple(around.reviewers),
        releasers=tuple(around.releasers),
        typed=left.get("reason", ""),
        refused=refused,
    )


def at_instant(pointer: Pointer, asked: str, instant_s: float | None, robots: Sequence[str]) -> At:
    """What a mission begun then was pinned to, on every robot. Without an instant it says how to write one."""
    if instant_s is None:
        wrong = N_("Write an instant as 2026-11-20T09:30:00Z.")
        return At(asked=asked, instant_s=0.0, found="", robots=(), wrong=wrong)
    by_robot = [(robot, current_at(pointer, instant_s, robot_id=RobotId(robot)) or "") for robot in robots]
    found = current_at(pointer, instant_s) or ""
    others = tuple((robot, name) for robot, name in by_robot if name != found)
    return At(asked=asked, instant_s=instant_s, found=found, robots=others, wrong="")


def _move(move: PointerMoved) -> MoveRow:
    return MoveRow(
        revision=move.revision,
        cause=CAUSES[move.cause],
        tone=TONES.get(move.cause, "plain"),
        configuration=move.configuration,
        canary=move.canary or "",
        robot_id=str(move.robot_id or ""),
        candidate=move.trial or move.released or "",
        who=move.actor.name,
        reason=move.reason,
        at_s=move.at_s,
    )


def _spans(pointer: Pointer, *, now_s: float) -> tuple[Span, ...]:
    """Equal stretches would hide time, true ones would hide short canaries: each gets at least a visible width."""
    moves = pointer.history
    if not moves:
        return ()
    ends = [*(one.at_s for one in moves[1:]), max(now_s, moves[-1].at_s)]
    lasted = [max(end - one.at_s, 0.0) for one, end in zip(moves, ends, strict=True)]
    least = WIDTH / (4.0 * len(moves))
    free, total = WIDTH - least * len(moves), sum(lasted) or 1.0
    spans, x = [], 0.0
    for move, seconds in zip(moves, lasted, strict=True):
        width = least + free * seconds / total
        title = lazy_gettext(
            "revision {revision}, {cause}: {configuration}",
            revision=move.revision,
            cause=CAUSES[move.cause],
            configuration=(move.canary or move.configuration)[:8],
        )
        spans.append(Span(move.revision, TONES.get(move.cause, "plain"), title, round(x, 1), round(width - 2.0, 1)))
        x += width
    return tuple(spans)


def _version(name: Digest, state: str, review: Review | None, pointer: Pointer, around: Around) -> VersionRow:
    bad = pointer.quarantined.get(name)
    return VersionRow(
        configuration=name,
        title=title_of(review) if review else N_("what the program ships"),
        candidate=review.candidate if review else "",
        state=state,
        quarantined=bad.reason if bad else "",
        missions=tuple(around.pins.get(name, ())),
    )
