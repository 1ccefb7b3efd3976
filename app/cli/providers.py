"""regen provider: list providers, check their conformance, and print the description of the protocol."""

import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NoReturn

import msgspec
import typer

from app.acts.admissions import RecordCheckAct
from app.cli import output
from app.cli.api import api_without_robots
from app.cli.output import Json, data_of, settings, show, table
from app.cli.owner_api import OwnerApi, owner_api
from app.i18n.reasons import rendering as reasons
from app.i18n.visible_text import visible_at_terminal
from harness.addressed_robots import met_vehicle, observed_robot
from harness.baseline.load import workspace_in
from harness.bootstrap import read_harness
from harness.conformance.address import AddressedStands, addressed, by_broker
from harness.conformance.conformance_file import ConformanceFile, read, shipped
from harness.conformance.findings import ConformanceFinding, ConformanceResult
from harness.conformance.hostile.kit import LieReport, chosen, fuzzed
from harness.conformance.hostile.lies import Mode
from harness.conformance.hostile.missions import MissionUnderLie, met, met_at
from harness.conformance.kit import FIRST_TOKEN, check
from harness.conformance.provider_setup import fresh_name, installed, installed_cards, protocol
from harness.conformance.stack import check_stack
from harness.conformance.subject import Stand
from harness.contracts.capabilities import CapabilityCard, Vocabulary
from harness.contracts.errors import (
    ContractInvalid,
    HarnessError,
    OnlyObserved,
    ProviderFailed,
    StoreUnavailable,
    UnknownName,
)
from harness.contracts.ids import ProviderId, RobotId
from harness.contracts.reasons import because
from harness.workspace.files import AddressedEntry, SimulatedRobotEntry, VehicleEntry
from harness.workspace.reading import Workspace, token_of
from simulator.in_process import SIMULATOR

app = typer.Typer(no_args_is_help=True, help="See and check what can act.")
Stands = dict[ProviderId, Stand]


@app.command("list")
def list_providers(as_json: Json = False) -> None:
    """Installed providers, what they can do, and which rows of the conformance kit their files speak of."""
    with tempfile.TemporaryDirectory(prefix="regen-kit-") as folder:
        cards = installed_cards(Path(folder), SIMULATOR)
    rows = [_listed(card) for card in cards]
    lines = table(
        [["provider", "version", "capability", "moves", "reattach", "resources", "preconditions", "meets", "exempt"]]
        + [
            [
                row["provider_id"],
                row["version"],
                row["capability"],
                "yes" if row["moves"] else "no",
                row["reattach"],
                ",".join(row["resources"]) or "-",
                ",".join(row["preconditions"]) or "-",
                str(len(row["meets"])),
                str(len(row["exempt"])),
            ]
            for row in rows
        ]
    )
    show({"providers": rows}, as_json=as_json, lines=lines)


def _listed(card: CapabilityCard) -> dict[str, Any]:
    declared = shipped(card.provider_id)
    return {
        "provider_id": card.provider_id,
        "version": card.version,
        "capability": card.capability,
        "moves": card.moves,
        "reattach": card.reattach,
        "resumable": card.resumable,
        "resources": list(card.resources),
        "preconditions": list(card.preconditions),
        "meets": list(declared.meets),
        "exempt": declared.exempt,
    }


@app.command("check")
def check_provider(
    target: Annotated[str, typer.Argument(help="Name of an installed provider, `all`, or a robot's http(s) address.")],
    as_json: Json = False,
    token: Annotated[str, typer.Option(help="The robot's bearer token.", envvar="REGEN_ROBOT_TOKEN")] = "",
    file: Annotated[list[Path] | None, typer.Option(help="A conformance file; may be given again.")] = None,
    provider: Annotated[list[str] | None, typer.Option(help="Only this one of a robot's providers.")] = None,
    still: Annotated[bool, typer.Option("--still", help="Leave out providers that move the robot.")] = False,
    allow_motion: Annotated[
        bool, typer.Option("--allow-motion", help="At an address: try providers that move the robot too.")
    ] = False,
    stands_clear: Annotated[
        str, typer.Option(help="The robot's name, instead of typing it: nobody is near it, and it may move.")
    ] = "",
    site: output.Site = None,
    data: output.Data = output.DEFAULT_DATA,
    fencing: Annotated[int, typer.Option(help="Fencing token to use: the newest given out.", min=1)] = FIRST_TOKEN,
    recording: Annotated[Path | None, typer.Option(help="What the recording navigator replays.")] = None,
    fidelity: Annotated[str, typer.Option(help="mujoco, kinematic or walking, for the simulated robot.")] = "kinematic",
) -> None:
    """Try every row of the lifecycle contract. Exit 0: all rows met or exempt; 1: a row is not met.

    At an address, providers that move do move the robot: they are tried with --allow-motion and after somebody said
    that it stands clear, and left out with --still. With --site, the name is that of a robot of the site; the result is
    recorded, and decides which of its providers missions may use. A robot in shadow mode is only read.
    """
    found = _of_site(target, site, data) if site else None
    if found and found.entry.authority == "observe":
        _check_observed(found, as_json=as_json, moving=allow_motion)
    files = [*(found.files if found else ()), *(file or [])]
    declared = {one.provider_id: one for one in map(read, files)}
    address = found.entry.identity if found else target
    standing = _of_robot(found) if found else _stands(target, token=token, fidelity=fidelity, recording=recording)
    with standing as (robot_id, stands, cards):
        if found:
            if robot_id != found.entry.name:
                raise ProviderFailed(because("another_robot_answers", found=robot_id[:80], expected=found.entry.name))
            _check_declared(cards, found)
        names = _selected_providers(address, stands, cards, only=provider or [], still=still, allow_motion=allow_motion)
        moving = tuple(card.provider_id for card in cards if card.moves and card.provider_id in names)
        if "://" in address and moving:
            _confirm_clear(robot_id, moving, typed=stands_clear)
        used = max(fencing, found.fencing) if found else fencing
        results = [_checked(name, stands[name], declared, fencing=used) for name in names]
    ok = bool(results) and all(result.ok for result in results)
    answer: dict[str, Any] = {"ok": ok, "providers": [_row(result) for result in results]}
    lines = _lines(results)
    if found and results:
        answer["recorded"] = _recorded(found, results, stands_clear=bool(moving))
        lines.append(f"Recorded for {found.entry.name}; it is connected with this at the next start.")
    show(answer, as_json=as_json, lines=lines)
    raise typer.Exit(0 if ok else 1)


@dataclass(frozen=True)
class SiteRobot:
    """A robot of a site: its entry, the newest fencing token given out for it, its conformance files."""

    entry: AddressedEntry
    workspace: Workspace
    fencing: int
    files: tuple[Path, ...]
    data: Path
    vocabulary: Vocabulary


def _check_observed(found: SiteRobot, *, as_json: bool, moving: bool) -> NoReturn:
    """A robot in shadow mode is asked for nothing but what it says. Raises OnlyObserved where it is to move."""
    name = found.entry.name
    if moving:
        raise OnlyObserved(because("robot_only_observed", robot_id=name), where="--allow-motion")
    with observed_robot(found.entry, found.workspace) as robot:
        findings = check_stack(robot, name)
    for one in findings:
        _tell(one)
    ok = all(one.outcome != "not met" for one in findings)
    answer = {
        "ok": ok,
        "robot_id": name,
        "authority": "observe",
        "rows": reasons.stating(findings),
    }
    lines = table([[one.outcome, one.row, reasons.sentence(one.text)] for one in findings])
    show(answer, as_json=as_json, lines=[*lines, f"{name} is in shadow mode: nothing was sent, nothing is admitted."])
    raise typer.Exit(0 if ok else 1)


def _of_site(name: str, site: Path, data: Path) -> SiteRobot:
    """Raises ContractInvalid for a robot that is not of this site or has no address, HarnessError while it works."""
    workspace = workspace_in(site)
    entry = workspace.robot(name)
    if isinstance(entry, SimulatedRobotEntry):
        raise ContractInvalid(because("robot_without_address", name=name), where=str(site))
    folder = data_of(data, site)
    commanded = entry.authority == "command"
    owner = owner_api(folder) if commanded else None
    if owner is not None and _at_work(owner, name):
        raise HarnessError(because("robot_at_work", robot_id=name))
    return SiteRobot(
        entry=entry,
        workspace=workspace,
        fencing=_newest_token(folder, name) if commanded else FIRST_TOKEN,
        files=workspace.conformance_files(),
        data=folder,
        vocabulary=workspace.vocabulary,
    )


def _check_declared(cards: Sequence[CapabilityCard], robot: SiteRobot) -> None:
    """Raise ContractInvalid for a card whose capability the site does not declare, or declares otherwise."""
    for card in cards:
        reason = robot.vocabulary.refusal(card)
        if reason is not None:
            raise ContractInvalid(reason, where=robot.entry.address)


def _at_work(owner: OwnerApi, name: str) -> bool:
    try:
        return bool(owner.get(f"/robots/{name}")["mission_id"])
    except UnknownName:
        return False


def _newest_token(data: Path, name: str) -> int:
    """The newest fencing token that this data folder gave out for the robot: an older one would be refused."""
    try:
        with read_harness(settings(data_folder=data)) as runtime:
            leases = runtime.leases(RobotId(name))
    except StoreUnavailable:
        return FIRST_TOKEN
    return max((one.token for one in leases), default=FIRST_TOKEN) or FIRST_TOKEN


def _confirm_clear(robot_id: str, moving: tuple[str, ...], *, typed: str) -> None:
    """A person says that nobody is near the robot, by its name. Raises ContractInvalid where nobody does."""
    sys.stderr.write(visible_at_terminal(f"These move the robot, stand clear: {', '.join(moving)}\n"))
    if not typed and sys.stdin.isatty():
        typed = typer.prompt(f"Type {visible_at_terminal(robot_id)} once nobody is near it", err=True)
    if typed.strip() != robot_id:
        raise ContractInvalid(because("not_confirmed_clear", robot_id=robot_id[:80]))


def _recorded(found: SiteRobot, results: list[ConformanceResult], *, stands_clear: bool) -> dict[str, Any]:
    act = RecordCheckAct.of(
        address=found.entry.identity,
        findings=[msgspec.to_builtins(one) for one in results],
        stands_clear=stands_clear,
        reason="regen provider check",
    )
    with api_without_robots(found.data) as api:
        answer: dict[str, Any] = api.post(f"/robots/{found.entry.name}/checks", act.body())
    return answer


@app.command("fuzz")
def fuzz_harness(
    mode: Annotated[list[str] | None, typer.Argument(help="Lies or groups of lies; all of them without any.")] = None,
    as_json: Json = False,
    builtin: Annotated[bool, typer.Option("--builtin", help="Against a simulated robot in this process.")] = False,
    url: Annotated[str, typer.Option(help="Against the simulator at this address, which runs in lockstep.")] = "",
    token: Annotated[str, typer.Option(help="The simulator's bearer token.", envvar="REGEN_ROBOT_TOKEN")] = "",
    truth: Annotated[
        Path | None, typer.Option(help="That simulator's own folder: what is accepted is compared with its truth.")
    ] = None,
    seed: Annotated[int, typer.Option(help="Seed of every mission.", min=0)] = 3,
) -> None:
    """Run missions against a robot that lies, floods, hangs and breaks the protocol. It tests the harness.

    Nothing is ever forwarded to a physical robot: an address without a simulation is refused. Exit 0: no false
    completion, second motion, hang, traceback or held lease, and at most 400 MiB; 1 otherwise.
    """
    if builtin == bool(url):
        raise ContractInvalid(because("fuzz_needs_one_robot"))

    def meet(one: Mode) -> MissionUnderLie:
        if builtin:
            return met(one, SIMULATOR, seed=seed)
        return met_at(one, url, token, seed=seed, folder=truth)

    result = fuzzed(chosen(mode or []), meet, watch=_tell_met)
    show(msgspec.to_builtins(result), as_json=as_json, lines=_met_lines(result))
    raise typer.Exit(0 if result.ok else 1)


def _tell_met(one: MissionUnderLie) -> None:
    sys.stderr.write(f"{'ok' if one.harmless else 'WRONG':<6} {one.mode:<40} {one.ended} ({one.wall_s:.1f} s)\n")
    sys.stderr.flush()


def _met_lines(result: LieReport) -> list[str]:
    rows = [["lie", "ended", "stages accepted", "motions", "wrong"]] + [
        [one.mode, one.ended, str(len(one.committed)), str(one.motions), "" if one.harmless else "yes"]
        for one in result.met
    ]
    counts = (
        f"{result.missions} missions, {result.against_truth} of them compared with the simulated truth: "
        f"{result.false_completions} false completions, "
        f"{result.second_motions} second motions, {result.hangs} hangs, {result.tracebacks} tracebacks, "
        f"{result.held} leases left held, {result.peak_mib} MiB at the peak; "
        f"{result.epistemic} epistemic (every source forged)"
    )
    return [*table(rows), counts]


@app.command()
def openapi() -> None:
    """The HTTP provider protocol as an OpenAPI document."""
    sys.stdout.write(msgspec.json.format(msgspec.json.encode(protocol(SIMULATOR)), indent=2).decode() + "\n")


@contextmanager
def _of_robot(found: SiteRobot) -> Iterator[tuple[str, Stands, tuple[CapabilityCard, ...]]]:
    """What answers for a robot of a site."""
    with _connected(found) as stands:
        yield stands.robot_id, stands.stands, stands.cards


def _connected(found: SiteRobot) -> AbstractContextManager[AddressedStands]:
    entry = found.entry
    if isinstance(entry, VehicleEntry):
        return by_broker(partial(met_vehicle, entry, found.workspace, found.data), name=entry.name)
    return addressed(entry.address, token_of(entry, found.workspace.folder))


@contextmanager
def _stands(
    target: str, *, token: str, fidelity: str, recording: Path | None
) -> Iterator[tuple[str, Stands, tuple[CapabilityCard, ...]]]:
    if target.startswith(("http://", "https://")):
        with addressed(target, token) as found:
            yield found.robot_id, found.stands, found.cards
        return
    with tempfile.TemporaryDirectory(prefix="regen-kit-") as folder:
        chosen = settings(speed=0.0, fidelity=fidelity)
        with installed(Path(folder), chosen, SIMULATOR, recording=recording) as stands:
            yield chosen.robot_id, stands, installed_cards(Path(folder), SIMULATOR)


def _selected_providers(
    target: str,
    stands: Stands,
    cards: tuple[CapabilityCard, ...],
    *,
    only: list[str],
    still: bool,
    allow_motion: bool,
) -> list[ProviderId]:
    named = only or ([target] if "://" not in target and target != "all" else list(stands))
    unknown = [name for name in named if ProviderId(name) not in stands]
    if unknown:
        raise UnknownName(because("unknown_provider", provider_id=tuple(unknown), known=tuple(stands)))
    moving = {card.provider_id for card in cards if card.moves}
    if moving & set(named) and "://" in target and still == allow_motion:
        raise ContractInvalid(because("motion_not_allowed", providers=tuple(sorted(moving & set(named)))))
    return [ProviderId(name) for name in named if not (still and name in moving)]


def _checked(
    name: ProviderId, stand: Stand, declared: dict[ProviderId, ConformanceFile], *, fencing: int
) -> ConformanceResult:
    declaration = declared[name] if name in declared else shipped(name)
    sys.stderr.write(f"{visible_at_terminal(name)}\n")
    return check(stand, declaration, mission_id=fresh_name(), fencing=fencing, watch=_tell)


def _tell(finding: ConformanceFinding) -> None:
    sys.stderr.write(visible_at_terminal(f"  {finding.outcome:<8} {finding.row}\n"))
    sys.stderr.flush()


def _row(result: ConformanceResult) -> dict[str, Any]:
    return {
        "provider_id": result.provider_id,
        "version": result.version,
        "capability": result.card.capability,
        "ok": result.ok,
        "rows": reasons.stating(result.findings),
    }


def _lines(results: list[ConformanceResult]) -> list[str]:
    lines: list[str] = []
    for result in results:
        counts = ", ".join(f"{len(result.rows(word))} {word}" for word in ("met", "not met", "exempt"))
        lines += [f"{result.provider_id} {result.version} ({result.card.capability}): {counts}"]
        lines += table([[f"  {one.row}", one.outcome, reasons.sentence(one.text)] for one in result.findings])
    return lines or ["Nothing was tried."]
