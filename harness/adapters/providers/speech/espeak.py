"""Synthesises speech with espeak-ng: text in, samples out. The same text gives the same samples."""

import subprocess
import sys
from functools import lru_cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from harness.contracts.errors import ProviderFailed
from harness.contracts.reasons import Reason, because, recorded

Samples = npt.NDArray[np.int16]

_CHILD = Path(__file__).with_name("espeak_child.py")
_LONGEST_S = 30.0
VOICE = "en-us"
"""American English, as the recogniser of the report was trained on."""


@lru_cache(maxsize=32)
def synthesise(text: str, *, voice: str = VOICE) -> tuple[Samples, int]:
    """Mono samples (N,) int16, read-only, and their rate in Hz. Raises ProviderFailed if the library fails."""
    command = [sys.executable, "-P", str(_CHILD), voice]
    try:
        child = subprocess.run(command, input=text.encode(), capture_output=True, timeout=_LONGEST_S, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise _failure(recorded(str(error))) from error
    if child.returncode != 0:
        lines = child.stderr.decode(errors="replace").strip().splitlines()
        raise _failure(recorded(lines[-1]) if lines else because("process_ended_with", status=child.returncode))
    rate, _, body = child.stdout.partition(b"\n")
    return np.frombuffer(body, dtype="<i2"), int(rate)


def _failure(reason: Reason) -> ProviderFailed:
    return ProviderFailed(because("speech_not_synthesised", reason=reason))
