"""Recognises what a recording says, with PocketSphinx and the model in its wheel: no part in making the sound (D47)."""

import io
import json
import subprocess
import sys
import wave
from collections import defaultdict
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path

import numpy as np
from pocketsphinx import get_model_path

from harness.adapters.providers.speech.language_model import bigrams, pronunciations, sentences, spoken
from harness.contracts.errors import ProviderFailed
from harness.contracts.ids import sha256
from harness.contracts.measurements import Recognition
from harness.contracts.reasons import Reason, because, recorded

RATE_HZ = 16_000
_CHILD = Path(__file__).with_name("sphinx_child.py")
_LONGEST_S = 60.0


@lru_cache(maxsize=256)
def recognised(recording: bytes, *, text: str, names: tuple[str, ...]) -> Recognition:
    """What a WAV says. `text` is what was to be said, `names` are the places of the site: both and their contraries
    are expected alike. Equal recordings are recognised once. Raises ProviderFailed if the recogniser fails.
    """
    expected = tuple(sentences(text, names))
    known = _dictionary()
    words = sorted({word for sentence, _ in expected for word in sentence})
    sounds = pronunciations(words, known)
    understood = [(tuple(word for word in sentence if word in sounds), weight) for sentence, weight in expected]
    recognised_text = _decode(_samples(recording), model=bigrams(understood), dictionary=_lines(sounds))
    return Recognition(
        sound=sha256(recording),
        recogniser=f"pocketsphinx {version('pocketsphinx')} en-us",
        asked=tuple(" ".join(spoken(text, names)).replace("_", " ").split()),
        heard=tuple(recognised_text.replace("_", " ").split()),
        unknown=tuple(word.replace("_", " ") for word in words if word not in sounds),
    )


def _decode(samples: bytes, *, model: str, dictionary: str) -> str:
    job = json.dumps({"model": model, "dictionary": dictionary}).encode() + b"\n" + samples
    try:
        child = subprocess.run(
            [sys.executable, "-P", str(_CHILD)], input=job, capture_output=True, timeout=_LONGEST_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise _failure(recorded(str(error))) from error
    if child.returncode != 0:
        lines = child.stderr.decode(errors="replace").strip().splitlines()
        raise _failure(recorded(lines[-1]) if lines else because("process_ended_with", status=child.returncode))
    return child.stdout.decode(errors="replace").strip()


def _samples(recording: bytes) -> bytes:
    """16-bit mono samples at the recogniser's rate. Raises ProviderFailed for what is no such WAV."""
    try:
        with wave.open(io.BytesIO(recording)) as file:
            if (file.getnchannels(), file.getsampwidth()) != (1, 2):
                raise _failure(because("sound_not_16_bit_mono"))
            rate_hz = file.getframerate()
            body: bytes = file.readframes(file.getnframes())
    except (wave.Error, EOFError) as error:
        raise _failure(because("sound_no_wav", error=str(error))) from error
    if rate_hz == RATE_HZ:
        return body
    samples = np.frombuffer(body, dtype="<i2").astype(np.float64)
    at = np.arange(0.0, len(samples), rate_hz / RATE_HZ)
    return np.interp(at, np.arange(len(samples)), samples).astype("<i2").tobytes()


@lru_cache(maxsize=1)
def _dictionary() -> dict[str, list[str]]:
    """Pronunciations of the model's own dictionary, by word."""
    found: dict[str, list[str]] = defaultdict(list)
    with Path(get_model_path("en-us/cmudict-en-us.dict")).open(encoding="utf-8") as file:
        for line in file:
            word, _, sounds = line.strip().partition(" ")
            found[word.partition("(")[0]].append(sounds)
    return dict(found)


def _lines(sounds: dict[str, tuple[str, ...]]) -> str:
    lines = [
        f"{word}{'' if index == 0 else f'({index + 1})'} {one}"
        for word, ways in sounds.items()
        for index, one in enumerate(ways)
    ]
    return "\n".join(lines) + "\n"


def _failure(reason: Reason) -> ProviderFailed:
    return ProviderFailed(because("speech_recogniser_failed", reason=reason))
