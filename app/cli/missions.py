"""regen mission: run, replay, list, show, events, stop."""

import math
from pathlib import Path
from typing import Annotated, Any, TypeVar

import msgspec
import typer

from app.acts.missions import DisputeCompletionAct, StartMissionAct, StopMissionAct, WithdrawMissionAct
from app.acts.uploads import ReplayUploadAct
from app.background.mission_history import Histories
from app.cli import output
from app.cli.api import api_with_robots
from app.cli.api_client import Api
from app.cli.junit import junit
from app.cli.owner_api import owner_api
from app.cli.person import me
from app.cli.uploads import replayed_there
from app.i18n.messages import reasoned
from app.i18n.reasons import rendering as reasons
from app.i18n.reasons.rendering import sentence
from app.i18n.visible_text import visible_at_terminal
from app.views.contexts import ranked
from app.views.mission_json import mission_outcome
from app.views.unverified import UNVERIFIED
from harness.bootstrap import read_harness
from harness.contracts.errors import UnknownName
from harness.contracts.ids import Digest, MissionId
from harness.contracts.observations import SINGLE_SOURCE
from harness.contracts.proposals import CandidateSet, RoutingExplanation
from harness.contracts.reasons import because
from harness.contracts.upcasting import name_of
from harness.contracts.values import decode
from harness.projections.exploration import ExplorationDecision, decisions
from harness.recordings import replayed, write_recording
from harness.routing.explanation import explained
from harness.routing.question import RoutingQuestion
from harness.runtime import Runtime

T = TypeVar("T")
MOST_SOUND_BYTES = 2 * 2**20
"""Twice what is taken: a longer recording is refused by its length, and not read on."""
app = typer.Typer(no_args_is_help=True, help="Run and read missions.")


@app.command()
def run(
    template: Annotated[str, typer.Argument(help="Name of a task template, or a goal in words.")] = "",
    data: output.Data = output.DEFAULT_DATA,
    site: output.Site = None,
    robot: Annotated[str, typer.Option(help="Which robot; the site's first without one.")] = "",
    as_json: output.Json = False,
    speed: Annotated[float | None, typer.Option(help="Mission seconds per second; 0 is as fast as possible.")] = None,
    seed: Annotated[int, typer.Option(help="Seed of the simulated world.", min=0)] = 1,
    fault: Annotated[list[str] | None, typer.Option(help="NAME or NAME:persistent; may be given again.")] = None,
    argument: Annotated[list[str] | None, typer.Option("--set", help="NAME=VALUE of a template parameter.")] = None,
    fidelity: Annotated[str | None, typer.Option(help="mujoco, kinematic or walking.")] = None,
    record_to: Annotated[Path | None, typer.Option("--record", help="Write the mission as MCAP.")] = None,
    goal: Annotated[str, typer.Option(help="The goal in words, where the first argument names a template.")] = "",
    confirm_reading: Annotated[str, typer.Option(help="Digest of the reading to start, as the refusal shows it.")] = "",
    wait: Annotated[bool, typer.Option("--wait", help="Also wait while an earlier mission asks a person.")] = False,
    recording: Annotated[
        Path | None, typer.Option(help="A WAV in which the goal is spoken in English: 16-bit mono, at most 30 s.")
    ] = None,
) -> None:
    """Run one mission and wait for its end. At speed 0 nothing waits for people: exit 3 at once."""
    if fault:
        from simulator.in_process import SIMULATOR  # noqa: PLC0415  the simulated world loads its physics

        SIMULATOR.check_faults(fault)
    if not template and recording is None:
        raise typer.BadParameter("name a template, say a goal, or give --recording", param_hint="TEMPLATE")
    spoken = _sound(recording) if recording is not None else b""
    act = StartMissionAct.of(
        robot_id=robot,
        template="" if _in_words(template) else template,
        goal=template if _in_words(template) else goal,
        arguments=_arguments(argument),
        seed=seed,
        labels={"faults": ",".join(fault)} if fault else {},
        confirm_reading=confirm_reading,
    )
    data = output.data_of(data, site)
    chosen = output.settings(data_folder=data, site_folder=site, speed=speed, seed=seed, fidelity=fidelity)
    with api_with_robots(data, chosen) as api:
        transcript = _transcript(api, spoken) if spoken else ""
        mission_id = api.post("/missions", act.model_copy(update=_recorded(transcript)).body())["mission_id"]
        api.finish_earlier(mission_id)
        outcome = api.follow(mission_id, wait=wait)
    if record_to is not None:
        with read_harness(chosen) as runtime:
            write_recording(runtime, MissionId(mission_id), record_to)
    output.show(outcome, as_json=as_json, lines=_summary(outcome))
    raise typer.Exit(output.exit_code(outcome["status"]))


def _sound(file: Path) -> bytes:
    """The bytes of a recording, no more than is refused as too long. Raises UnknownName if it cannot be read."""
    try:
        with file.open("rb") as opened:
            return opened.read(MOST_SOUND_BYTES)
    except OSError as error:
        raise UnknownName(because("file_unreadable", error=error.strerror or ""), where=str(file)) from error


def _transcript(api: Api, recording: bytes) -> str:
    """Has a recording stored and written down; says what was heard, and gives its digest."""
    found = api.upload("/recordings", recording, kind="audio/wav")
    wake = f" after “{found['wake']}”" if found["wake"] else ""
    freely = "" if found["agreed"] else f"; freely: {found['free'] or '-'}"
    typer.echo(visible_at_terminal(f"Heard: {found['text']}{wake}{freely}"), err=True)
    return str(found["recording"])


def _recorded(digest: str) -> dict[str, str]:
    """What a start says of the recording it is of; nothing for a goal that was typed."""
    return {"recording": digest, "captured_by": "file"} if digest else {}


def _in_words(text: str) -> bool:
    """Whether the first argument is a goal in words: it has spaces, or is not written in Latin letters."""
    return " " in text or not text.isascii()


@app.command()
def resume(
    mission_id: str,
    data: output.Data = output.DEFAULT_DATA,
    site: output.Site = None,
    as_json: output.Json = False,
    speed: Annotated[float | None, typer.Option(help="Mission seconds per second; 0 is as fast as possible.")] = None,
    fidelity: Annotated[str | None, typer.Option(help="mujoco, kinematic or walking.")] = None,
) -> None:
    """Go on with a mission that a crash or an exit left open."""
    data = output.data_of(data, site)
    chosen = output.settings(data_folder=data, site_folder=site, speed=speed, fidelity=fidelity)
    with api_with_robots(data, chosen) as api:
        outcome = api.follow(mission_id)
    output.show(outcome, as_json=as_json, lines=_summary(outcome))
    raise typer.Exit(output.exit_code(outcome["status"]))


def _arguments(given: list[str] | None) -> dict[str, str | float]:
    arguments: dict[str, str | float] = {}
    for text in given or []:
        name, found, value = text.partition("=")
        if not found or not name:
            raise typer.BadParameter(f"{text!r} is not NAME=VALUE", param_hint="--set")
        arguments[name] = value
    return arguments


def _summary(outcome: dict[str, Any]) -> list[str]:
    lines = [f"{outcome['mission_id']}  {_status(outcome)}  goal {outcome['goal_verdict'] or 'not judged'}"]
    lines += output.table(
        [["segment", "L_ref m", "declared m", "measured m", "last pose m"]]
        + [
            [
                segment["name"],
                *(
                    f"{value:.2f}" if (value := segment[name]) is not None else "-"
                    for name in (
                        "reference_length_m",
                        "declared_distance_m",
                        "measured_distance_m",
                        "last_pose_distance_m",
                    )
                ),
            ]
            for segment in outcome["segments"]
        ]
    )
    clauses = [[one["clause"], one["told"], one["verdict"] or "-"] for one in outcome["clauses"]]
    lines += output.table([["", "clause", "verdict"], *clauses]) if clauses else []
    if outcome.get("reason"):
        lines.append(str(outcome["reason"]))
    if spoken := outcome["spoken"]:
        lines.append(f"spoken: recording {spoken['recording']}, transcript {spoken['transcript']}")
    if outcome.get("report"):
        lines += [str(outcome["report"]), f"asked as: {outcome['goal']}"]
    lines += [f"unverified: {one['text']} ({UNVERIFIED[one['why']]})" for one in outcome["unverified_parts"]]
    return lines


@app.command()
def replay(
    recording: Annotated[Path, typer.Argument(help="MCAP, rosbag2 folder or ROS 1 bag.")],
    target: Annotated[str | None, typer.Option(help="X,Y in metres; default: the recording's goals or routes.")] = None,
    place: Annotated[str, typer.Option(help="A place of the site as the target; the recording is on its map.")] = "",
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
    topic: Annotated[list[str] | None, typer.Option(help="ROLE=TOPIC, such as odometry=/odom.")] = None,
    recover: Annotated[
        bool, typer.Option("--recover", help="Replay what is whole of a recording that was cut off.")
    ] = False,
) -> None:
    """Run a navigation mission on a recording; the harness measures arrival and progress itself.

    Beside a running console the recording is uploaded, and the console replays it.
    """
    if target and place:
        raise typer.BadParameter("give --target or --place", param_hint="--place")
    topics, point = topic or [], target_point(target)
    if (owner := owner_api(data)) is not None:
        x_m, y_m = point or (None, None)
        act = ReplayUploadAct.of(target_x_m=x_m, target_y_m=y_m, place=place, topics=tuple(topics), recover=recover)
        there = replayed_there(owner, recording, act)
        output.show(there, as_json=as_json, lines=_summary(there))
        raise typer.Exit(output.exit_code(there["status"]))
    settings = output.settings(data_folder=data, speed=0.0)
    with replayed(settings, recording, target=point, place=place, topics=topics, recover=recover) as replayer:
        mission, facts = replayer.run(me(), watch=output.ProgressPrinter())
        outcome = mission_outcome(mission, Histories(replayer.runtime).of(mission.mission_id), ())
    outcome |= reasons.stating(facts)
    lines = [f"{name}: {reasons.stating(value)}" for name, value in facts.items() if value != ""]
    if topic_alone := facts[SINGLE_SOURCE]:
        lines.append(f"Single source: position and motion come from {topic_alone}; nothing else confirms them.")
    output.show(outcome, as_json=as_json, lines=[*_summary(outcome), *lines])
    raise typer.Exit(output.exit_code(outcome["status"]))


def target_point(text: str | None) -> tuple[float, float] | None:
    """A target as X,Y in metres; None where none was given."""
    if text is None:
        return None
    try:
        x, y = (float(part) for part in text.split(","))
    except ValueError:
        raise typer.BadParameter(f"{text!r} is not X,Y", param_hint="--target") from None
    if not (math.isfinite(x) and math.isfinite(y)):
        raise typer.BadParameter(f"{text!r} is no finite point", param_hint="--target")
    return x, y


@app.command("list")
def list_missions(data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False) -> None:
    """All missions, newest first."""
    with read_harness(output.settings(data_folder=data)) as runtime:
        rows: list[dict[str, Any]] = [
            {
                "mission_id": mission.mission_id,
                "status": mission.status,
                "disputed": bool(mission.disputed),
                "template": mission.template,
                "goal": mission.goal,
                "robot_id": mission.robot_id,
                "state_version": mission.k,
                **reasons.stated("reason", mission.reason),
            }
            for mission in runtime.missions()
        ]
    lines = output.table([[m["mission_id"], _status(m), m["template"], m["goal"][:60]] for m in rows])
    output.show(
        {"missions": rows},
        as_json=as_json,
        lines=lines or ["No mission yet: `regen mission run warehouse-inspection`."],
    )


def _status(row: dict[str, Any]) -> str:
    """The status, never without what is disputed of it."""
    return f"{row['status']}, disputed" if row.get("disputed") else str(row["status"])


@app.command("show")
def show_mission(
    mission_id: str,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
    junit_file: Annotated[Path | None, typer.Option("--junit", help="Write its verdicts as JUnit XML.")] = None,
) -> None:
    """One mission as the log has it."""
    with read_harness(output.settings(data_folder=data)) as runtime:
        mission = runtime.mission(MissionId(mission_id))
        if junit_file is not None:
            junit_file.write_bytes(junit(mission))
        outcome = mission_outcome(mission, Histories(runtime).of(mission.mission_id), ())
    explored = decisions(mission) if mission.contract else ()
    outcome |= {"exploration": reasons.stating(explored)} if explored else {}
    nodes = [[n.node_id, n.status, str(n.provider_id or "-"), f"attempt {n.attempt}"] for n in mission.nodes.values()]
    output.show(
        outcome, as_json=as_json, lines=[*_summary(outcome), *output.table(nodes), *output.table(_targets(explored))]
    )


def _targets(explored: tuple[ExplorationDecision, ...]) -> list[list[str]]:
    """Each choice of an exploration: what it was made from, where it led, what came of it."""
    if not explored:
        return []
    head = ["target", "x m", "y m", "picture", "map", "answer", "next map", "why"]
    return [head] + [
        [
            one.leg,
            *(f"{part:.2f}" for part in one.target_m),
            one.image[:12],
            one.map_before[:12],
            f"{one.response.terminal} {one.response.failure}".strip() if one.response else "-",
            (one.map_after or "-")[:12],
            reasoned(one.reason),
        ]
        for one in explored
    ]


class RoutingRecords:
    """Reads the records that routing stored with its decisions; None for one that the log does not hold."""

    def __init__(self, runtime: Runtime) -> None:
        self._runtime = runtime

    def candidates(self, digest: Digest) -> CandidateSet | None:
        return self._read(digest, CandidateSet)

    def explained(self, question: Digest, found: CandidateSet) -> RoutingExplanation | None:
        routing_question = self._read(question, RoutingQuestion)
        return explained(routing_question, found) if routing_question else None

    def _read(self, digest: Digest, kind: type[T]) -> T | None:
        try:
            return decode(self._runtime.record(digest).body, kind)
        except (UnknownName, msgspec.DecodeError):
            return None


@app.command()
def routing(
    mission_id: str,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
    stage: Annotated[str, typer.Option(help="One stage only.")] = "",
) -> None:
    """Why each provider was chosen or not: its score term by term, and what history held of it."""
    with read_harness(output.settings(data_folder=data)) as runtime:
        mission = runtime.mission(MissionId(mission_id))
        if stage and stage not in mission.nodes:
            raise UnknownName(
                because("unknown_stage_of_mission", node_id=stage, known=tuple(mission.nodes)), where=mission_id
            )
        entries = Histories(runtime).of(mission.mission_id)
        records = RoutingRecords(runtime)
        found = [
            (choice.position, choice.why)
            for node_id in mission.nodes
            if stage in ("", node_id)
            for choice in ranked(entries, node_id=node_id, candidates=records.candidates, explain=records.explained)
            if choice.why is not None
        ]
    rows = [{"position": position, **reasons.stating(why)} for position, why in found]
    lines = [line for position, why in found for line in _routed(position, why)]
    output.show(
        {"mission_id": mission_id, "decisions": rows},
        as_json=as_json,
        lines=lines or ["No provider was chosen yet."],
    )


def _routed(position: int, why: RoutingExplanation) -> list[str]:
    """One decision: the reason, the scores by term, and the history of each candidate."""
    ranking = [one for one in why.candidates if one.score is not None]
    names = list(ranking[0].terms) if ranking else []
    rows = [["provider", "score", *names, ""]] + [
        [
            one.provider_id,
            f"{one.score:.3f}",
            *(f"{one.terms[name]:+.3f}" for name in names),
            "chosen" if one.provider_id == why.chosen else "",
        ]
        for one in ranking
    ]
    past = [
        f"  history of {one.provider_id} at {one.place or 'no place'}: {one.judged} verified executions, "
        f"{one.failed} failed; input {one.penalty:.2f} of 1"
        for one in why.history
    ]
    refused = [
        f"  {one.provider_id} refused by {one.refused_by}: {sentence(one.reason)}"
        for one in why.candidates
        if one.score is None and one.refused_by != "capability"
    ]
    return [f"e-{position}  {why.node_id}: {sentence(why.reason)}", *output.table(rows), *past, *refused]


@app.command()
def events(mission_id: str, data: output.Data = output.DEFAULT_DATA, as_json: output.Json = False) -> None:
    """The mission's events in order, each with its position in the log."""
    with read_harness(output.settings(data_folder=data)) as runtime:
        runtime.mission(MissionId(mission_id))
        stored = runtime.events(MissionId(mission_id))
    rows = [
        {
            "position": event.position,
            "version": event.version,
            "kind": name_of(event.kind),
            "mission_s": event.mission_s,
            "recorded_s": event.recorded_s,
            "body": msgspec.json.decode(event.body),
        }
        for event in stored
    ]
    first_s = stored[0].mission_s
    lines = [f"{e.position:>6}  {e.mission_s - first_s:>8.2f} s  {name_of(e.kind)}" for e in stored]
    output.show({"mission_id": mission_id, "events": rows}, as_json=as_json, lines=lines)


@app.command()
def stop(
    mission_id: str,
    reason: output.Why,
    data: output.Data = output.DEFAULT_DATA,
    site: output.Site = None,
    as_json: output.Json = False,
) -> None:
    """Stop a mission: stopping until acknowledged, then static."""
    data = output.data_of(data, site)
    with api_with_robots(data, output.settings(data_folder=data, site_folder=site, speed=0.0)) as api:
        api.post(f"/missions/{mission_id}/stop", StopMissionAct.of(reason=reason).body())
        outcome = api.follow(mission_id)
    output.show(outcome, as_json=as_json, lines=_summary(outcome))


@app.command()
def withdraw(
    mission_id: str,
    reason: output.Why,
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Take back a mission that waits for its robot and has not begun."""
    with api_with_robots(data) as api:
        outcome = api.post(f"/missions/{mission_id}/withdraw", WithdrawMissionAct.of(reason=reason).body())
    output.show(outcome, as_json=as_json, lines=_summary(outcome))


@app.command()
def dispute(
    mission_id: str,
    condition: Annotated[str, typer.Option(help="The accepted condition, as `regen mission events` shows it.")],
    reason: Annotated[str, typer.Option(help="Why it is wrong; it is stored in the log.")],
    data: output.Data = output.DEFAULT_DATA,
    as_json: output.Json = False,
) -> None:
    """Say that an accepted completion is wrong. It counts as false; nothing is deleted."""
    act = DisputeCompletionAct.of(reason=reason)
    with api_with_robots(data) as api:
        outcome = api.post(f"/missions/{mission_id}/facts/{condition}/dispute", act.body())
    line = f"{condition} of {mission_id} is disputed: {reason}"
    output.show(outcome, as_json=as_json, lines=[line])
