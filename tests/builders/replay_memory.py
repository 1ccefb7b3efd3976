"""Replays recordings one after the other and prints the peak memory of each in bytes.

python -m tests.builders.replay_memory FILE ...   in a process without any other thread, whose memory would count too
"""

import gc
import sys
import tracemalloc
from pathlib import Path

from harness.adapters.providers.recording.reader import open_recording
from harness.adapters.providers.recording.robot import RecordedRobot

STEP_S = 5.0
REMEMBERED = 500


def replayed(file: Path) -> tuple[int, int]:
    """The number of samples that passed, of which only the newest are stored, and the peak in bytes meanwhile."""
    gc.collect()
    tracemalloc.start()
    with open_recording(file) as recording:
        replay = RecordedRobot(recording, remembered=REMEMBERED)
        after = 0
        while replay.now().mission_s < recording.ends_s:
            replay.advance_to(replay.now().mission_s + STEP_S)
            after = replay.observations(after).next_seq
        replay.close()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return after, peak


if __name__ == "__main__":
    for name in sys.argv[1:]:
        print(*replayed(Path(name)), flush=True)
