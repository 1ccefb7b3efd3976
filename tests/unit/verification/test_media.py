"""Sizes are read from headers of whole files; anything else is undecidable, whatever bytes come."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from harness.verification.finding import Undecidable
from harness.verification.media import image_size, wav_samples
from tests.unit.verification.stages import png, sound


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
def test_sizes_of_real_files_are_read_without_decoding(suffix: str) -> None:
    body = cv2.imencode(suffix, np.zeros((72, 128, 3), np.uint8))[1].tobytes()
    assert image_size(body) == (128, 72)
    with pytest.raises(Undecidable):
        image_size(body[: len(body) // 2])


def test_a_sound_says_how_many_samples_it_has() -> None:
    assert wav_samples(sound(1000, 16000)) == (1000, 16000)
    with pytest.raises(Undecidable):
        wav_samples(sound()[:-1])


@settings(deadline=None)
@given(st.binary(max_size=200), st.sampled_from([b"", b"\xff\xd8\xff", png(2, 2)[:30], sound(4)[:40]]))
def test_no_bytes_break_the_readers(noise: bytes, start: bytes) -> None:
    for reader in (image_size, wav_samples):
        try:
            width, height = reader(start + noise)
        except Undecidable:
            continue
        assert width >= 0
        assert height >= 0
