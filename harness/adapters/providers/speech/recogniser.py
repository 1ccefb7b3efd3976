"""Recognises what a recording says, with PocketSphinx and the model in its wheel: no part in making the sound (D47)."""

import json
import subprocess
import sys
from collections import defaultdict
from functools import lru_cache
from importlib.metadata import version
from pathlib import Path

import msgspec
from pocketsphinx import get_model_path

from harness.adapters.providers.speech.language_model import bigrams, pronunciations, sentences, spoken
from harness.adapters.providers.speech.waves import read_wave
from harness.contracts.errors import ProviderFailed
from harness.contracts.ids import sha256
from harness.contracts.measurements import Recognition
from harness.contracts.reasons import Reason, because, recorded
from harness.contracts.values import Value

NAME = f"pocketsphinx {version('pocketsphinx')} en-us"
CHILD = Path(__file__).with_name("sphinx_child.py")
_LONGEST_S = 60.0


@lru_cache(maxsize=256)
def recognised(recording: bytes, *, text: str, names: tuple[str, ...]) -> Recognition:
    """What a WAV says. `text` is what was to be said, `names` are the places of the site: both and their contraries
    are expected alike. Equal recordings are recognised once. Raises ProviderFailed if the recogniser fails.
    """
    expected = tuple(sentences(text, names))
    known = dictionary()
    words = sorted({word for sentence, _ in expected for word in sentence})
    sounds = pronunciations(words, known)
    understood = [(tuple(word for word in sentence if word in sounds), weight) for sentence, weight in expected]
    recognised_text = decode(_samples(recording), model=bigrams(understood), dictionary=listed(sounds))
    return Recognition(
        sound=sha256(recording),
        recogniser=NAME,
        asked=tuple(" ".join(spoken(text, names)).replace("_", " ").split()),
        heard=tuple(recognised_text.replace("_", " ").split()),
        unknown=tuple(word.replace("_", " ") for word in words if word not in sounds),
    )


class Decoded(Value):
    """The words of a sound, and [word, from, until] of each, seconds; fillers such as silence stand among them."""

    text: str
    words: tuple[tuple[str, float, float], ...] = ()


def decode(samples: bytes, *, model: str = "", dictionary: str = "") -> str:
    """The words in 16-bit mono samples of RATE_HZ; without a model, by the one of general English in the wheel.

    Raises ProviderFailed if the recogniser fails.
    """
    return decoded(samples, model=model, dictionary=dictionary).text.strip()


def decoded(samples: bytes, *, model: str = "", dictionary: str = "") -> Decoded:
    """The words of `decode` with their times. Raises as it does."""
    job = json.dumps({"model": model, "dictionary": dictionary}).encode() + b"\n" + samples
    try:
        child = subprocess.run(
            [sys.executable, "-P", str(CHILD)], input=job, capture_output=True, timeout=_LONGEST_S, check=False
        )
    except (OSError, subprocess.TimeoutExpired) as error:
        raise _failure(recorded(str(error))) from error
    if child.returncode != 0:
        lines = child.stderr.decode(errors="replace").strip().splitlines()
        raise _failure(recorded(lines[-1]) if lines else because("process_ended_with", status=child.returncode))
    return read_answer(child.stdout)


def read_answer(line: bytes) -> Decoded:
    """What the child says. Raises ProviderFailed where that is nothing of the kind."""
    try:
        return msgspec.json.decode(line, type=Decoded)
    except msgspec.MsgspecError as error:
        raise _failure(recorded(str(error))) from error


def _samples(recording: bytes) -> bytes:
    sound = read_wave(recording)
    if isinstance(sound, Reason):
        raise _failure(sound)
    return sound.body


@lru_cache(maxsize=1)
def dictionary() -> dict[str, list[str]]:
    """Pronunciations of the model's own dictionary, by word."""
    found: dict[str, list[str]] = defaultdict(list)
    with Path(get_model_path("en-us/cmudict-en-us.dict")).open(encoding="utf-8") as file:
        for line in file:
            word, _, sounds = line.strip().partition(" ")
            found[word.partition("(")[0]].append(sounds)
    return dict(found)


def listed(sounds: dict[str, tuple[str, ...]]) -> str:
    """A dictionary file of these pronunciations."""
    lines = [
        f"{word}{'' if index == 0 else f'({index + 1})'} {one}"
        for word, ways in sounds.items()
        for index, one in enumerate(ways)
    ]
    return "\n".join(lines) + "\n"


def _failure(reason: Reason) -> ProviderFailed:
    return ProviderFailed(because("speech_recogniser_failed", reason=reason))
