"""Runs seeded missions on several processes and adds up what an adjudicator found. A seed's result is its own."""

import gc
import multiprocessing
import sys
import time
from collections.abc import Iterator

from campaigns.adjudicate import judged
from campaigns.chance import uniform
from campaigns.mission import played
from campaigns.plan import mission_plan
from campaigns.tally import Tally

CHUNK = 20
TELL_S = 10.0


def mission_seed(campaign_seed: int, number: int) -> int:
    """The seed of mission `number` of a campaign; two campaigns share none but by chance in 2**48."""
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
    """All missions, or as many as `minutes` allow; progress goes to stderr. The tally says how many there were."""
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
        yield from map(_chunk, chunks)
        return
    with multiprocessing.get_context("spawn").Pool(processes) as pool:
        yield from pool.imap_unordered(_chunk, chunks)


def _chunk(seeds: list[int]) -> Tally:
    whole = Tally()
    for seed in seeds:
        whole.join(one_mission(seed))
    gc.collect()
    return whole


def _progress(tally: Tally, of: int, passed_s: float) -> str:
    rate = tally.missions / max(passed_s, 1e-6)
    wrong = f"{len(tally.offences)} offences" if tally.offences else "nothing wrong"
    return f"{tally.missions} of {of} missions, {rate:.1f} per second, {wrong}"
