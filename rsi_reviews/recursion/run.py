"""Distributes the fleets of one experiment over the sites, blind ones too, and runs them on local processes.

Each outcome is stored at once, so that a run can be resumed.
"""

import multiprocessing
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from pathlib import Path

import msgspec

from harness.contracts.errors import ContractInvalid, StoreUnavailable
from harness.contracts.ids import sha256
from harness.contracts.reasons import because
from harness.contracts.simulation import Simulator
from harness.contracts.values import digest, encode
from rsi_reviews.hidden_sites import FOLDER, site_file, site_names
from rsi_reviews.recursion.experiment import FleetOutcome, Task, Terms, run_fleet

FOLDER_PATH = Path(__file__).resolve().parents[1]
BLIND = "blind"
CALM, DRIFTING = "calm", "moving-boxes"
FleetReport = Callable[[FleetOutcome, int, int], None]


def tasks(terms: Terms, fleets: int) -> tuple[Task, ...]:
    """Fleets distributed over the sites: of ten, seven on regular ones, two on sites without regularities, one on a
    site that drifts.
    """
    regular = [name for name in site_names() if site_file(name).kind == "regular"]
    ring = [*regular, CALM, CALM, DRIFTING]
    return tuple(Task(terms=terms, fleet=number + 1, site=ring[number % len(ring)]) for number in range(fleets))


def blind_tasks(terms: Terms, *, each: int) -> tuple[Task, ...]:
    """The final fleets, on the sites written blind. Raises ContractInvalid if one is not what was hashed."""
    check_blind()
    names = [name for name in site_names(f"sites/{BLIND}") for _ in range(each)]
    return tuple(Task(terms=terms, fleet=1001 + number, site=f"{BLIND}/{name}") for number, name in enumerate(names))


def blind_digest() -> str:
    """One digest over the names and bytes of all blind sites."""
    folder = Path(FOLDER_PATH, "sites", BLIND)
    return digest({name: sha256((folder / f"{name}.yaml").read_bytes()) for name in site_names(f"sites/{BLIND}")})


def check_blind() -> None:
    """Raise ContractInvalid if the blind sites are not those whose digest was committed first."""
    committed = Path(FOLDER_PATH, "sites", f"{BLIND}.sha256").read_text(encoding="utf-8").split()
    found = blind_digest()
    if committed[:1] != [found]:
        raise ContractInvalid(
            because("blind_sites_changed", digest=found),
            where=f"{FOLDER}/sites/{BLIND}",
        )


def outcomes(
    jobs: Sequence[Task], *, simulator: Simulator, folder: Path, processes: int, report: FleetReport
) -> tuple[FleetOutcome, ...]:
    """Every fleet's outcome, in order; what lies in `folder` from an earlier run on the same terms is taken from it.

    Raises StoreUnavailable if the folder cannot be written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise StoreUnavailable(because("results_folder_unmakeable", error=str(error)), where=str(folder)) from error
    found = {one.task: one for one in read_outcomes(jobs, folder=folder)}
    for outcome in _run([task for task in jobs if task not in found], simulator, processes=processes):
        _keep(folder, outcome)
        found[outcome.task] = outcome
        report(outcome, len(found), len(jobs))
    return tuple(found[task] for task in jobs)


def read_outcomes(jobs: Sequence[Task], *, folder: Path) -> tuple[FleetOutcome, ...]:
    """The outcomes stored there so far, in order."""
    return tuple(outcome for task in jobs if (outcome := _read_outcome(folder, task)) is not None)


def _run(left: Sequence[Task], simulator: Simulator, *, processes: int) -> Iterator[FleetOutcome]:
    if processes < 2 or len(left) < 2:
        yield from (run_fleet(task, simulator) for task in left)
        return
    with multiprocessing.get_context("spawn").Pool(processes, maxtasksperchild=4) as pool:
        yield from pool.imap_unordered(partial(run_fleet, simulator=simulator), left)


def _file(folder: Path, task: Task) -> Path:
    return folder / f"fleet-{task.fleet}-{digest(task)[:12]}.json"


def _read_outcome(folder: Path, task: Task) -> FleetOutcome | None:
    file = _file(folder, task)
    if not file.exists():
        return None
    try:
        outcome = msgspec.json.decode(file.read_bytes(), type=FleetOutcome)
    except msgspec.MsgspecError:
        return None
    return outcome if outcome.task == task else None


def _keep(folder: Path, outcome: FleetOutcome) -> None:
    """One that a crash cuts off cannot be read, and its fleet runs again."""
    _file(folder, outcome.task).write_bytes(encode(outcome))
