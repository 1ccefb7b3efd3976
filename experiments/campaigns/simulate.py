"""Runs seeded missions on several processes and adds up the adjudicator's findings. A seed always gives the
same result.
"""

import gc
import multiprocessing
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool

from experiments.campaigns.adjudicate import judged
from experiments.campaigns.chance import uniform
from experiments.campaigns.mission import played
from experiments.campaigns.plan import mission_plan
from experiments.campaigns.tally import Tally
from harness.contracts.errors import HarnessError

CHUNK = 20
TELL_S = 10.0
SILENT_S = 300.0
Chunk = Callable[[list[int]], Tally]


class CampaignWorkersLost(HarnessError):
    """Worker processes that died or sent nothing for a long time; missions after that are not counted."""

    code = "workers_lost"


def mission_seed(campaign_seed: int, number: int) -> int:
    """The seed of mission `number` of a campaign; two campaigns share one only by chance, 1 in 2**48."""
    return int(uniform(campaign_seed, "mission", number) * 2**48)


def seeds_of(campaign_seed: int, missions: int) -> list[int]:
    """The seeds of a campaign's missions, in order."""
    return [mission_seed(campaign_seed, number) for number in range(missions)]


def one_mission(seed: int) -> Tally:
    """Run and judge the mission of one seed."""
    tally = Tally()
    with played(mission_plan(seed)) as mission:
        tally.add(seed, judged(mission), struck=mission.struck, end=mission.mission.status)
    return tally


def simulated_campaign(seeds: list[int], *, processes: int, minutes: float | None = None) -> Tally:
    """All missions, or as many as `minutes` allow; progress goes to stderr. The tally holds their number."""
    begun_s, told_s = time.monotonic(), 0.0
    whole = Tally()
    for tally in _chunks(seeds, processes=processes):
        whole.join(tally)
        passed_s = time.monotonic() - begun_s
        if passed_s - told_s > TELL_S:
            told_s = passed_s
            print(_progress(whole, len(seeds), passed_s), file=sys.stderr, flush=True)
        if minutes is not None and passed_s > 60.0 * minutes:
            break
    print(_progress(whole, len(seeds), time.monotonic() - begun_s), file=sys.stderr, flush=True)
    return whole


def _chunks(seeds: list[int], *, processes: int) -> Iterator[Tally]:
    chunks = [seeds[start : start + CHUNK] for start in range(0, len(seeds), CHUNK)]
    if processes < 2 or len(chunks) < 2:
        yield from map(played_and_judged, chunks)
        return
    yield from spread(chunks, processes=processes)


def spread(
    chunks: list[list[int]], *, processes: int, silent_s: float = SILENT_S, work: Chunk | None = None
) -> Iterator[Tally]:
    """The chunks' tallies as they come from worker processes, which end with this generator.

    Raises WorkersLost where a worker dies (it cannot import the code, or memory is short), or after `silent_s` without
    any result.
    """
    others = set(multiprocessing.active_children())
    pool = ProcessPoolExecutor(processes, mp_context=multiprocessing.get_context("spawn"))
    try:
        open_: set[Future[Tally]] = {pool.submit(work or played_and_judged, chunk) for chunk in chunks}
        while open_:
            done, open_ = wait(open_, timeout=silent_s, return_when=FIRST_COMPLETED)
            if not done:
                raise CampaignWorkersLost(
                    f"No worker answered for {silent_s:.0f} s",
                    where=f"{processes} processes, {len(open_)} chunks left",
                    do="run with --processes 1 to see where it stands",
                )
            yield from (one.result() for one in done)
    except BrokenProcessPool as error:
        raise CampaignWorkersLost(
            f"A worker process died ({error})",
            where=f"{processes} processes",
            do="run with --processes 1 to see why: code that cannot be imported, or too little memory",
        ) from error
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        for child in set(multiprocessing.active_children()) - others:
            child.terminate()
            child.join()


def played_and_judged(seeds: list[int]) -> Tally:
    """One chunk. Garbage is collected after it and not during it: a mission leaves few cycles and much that stays.

    What was there before is not searched: modules, and pictures and maps that missions share.
    """
    whole = Tally()
    gc.disable()
    gc.freeze()
    try:
        for seed in seeds:
            whole.join(one_mission(seed))
    finally:
        gc.enable()
        gc.collect()
    return whole


def _progress(tally: Tally, of: int, passed_s: float) -> str:
    rate = tally.missions / max(passed_s, 1e-6)
    wrong = f"{len(tally.offences)} offences" if tally.offences else "nothing wrong"
    return f"{tally.missions} of {of} missions, {rate:.1f} per second, {wrong}"
