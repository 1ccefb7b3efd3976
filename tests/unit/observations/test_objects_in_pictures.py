"""Objects and text in pictures: the detector's raw answer read, its folder checked, and what is told of a picture."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from harness.adapters.picture_boxes import with_boxes
from harness.adapters.pictures import PICTURES
from harness.adapters.providers.models.vision import described_content
from harness.adapters.vision import nanodet
from harness.adapters.vision.installation import WEIGHTS, detector_files
from harness.adapters.vision.text_reader import distinct
from harness.contracts.errors import ConfigurationMissing
from harness.contracts.ids import Digest, sha256
from harness.contracts.pictures import DetectedObject, PictureInventory, ReadText, VisionModel

CHAIR = nanodet.LABELS.index("chair")


class ScriptedObserver:
    """A PictureObserver that finds the same in every picture."""

    labels = frozenset(nanodet.LABELS)

    def __init__(self, *found: DetectedObject, texts: tuple[ReadText, ...] = ()) -> None:
        self._found, self._texts = found, texts

    def observe(self, image: Digest, body: bytes) -> PictureInventory:
        width_px, height_px = PICTURES.size(body)
        model = VisionModel(task="objects", name="scripted", version="1", digest=Digest("d" * 64))
        return PictureInventory(
            image=image, width_px=width_px, height_px=height_px, objects=self._found, texts=self._texts, models=(model,)
        )


def picture(width: int = 640, height: int = 480) -> bytes:
    rows = np.tile(np.linspace(40, 200, width, dtype=np.uint8), (height, 1))
    return bytes(cv2.imencode(".png", cv2.merge([rows, rows, rows]))[1])


def raw_answer(*cells: tuple[int, int, int, float, tuple[float, float, float, float]]) -> bytes:
    """An answer with a score for a class at (stride number, row, column), whose sides are so many bins away."""
    parts = []
    for number, stride in enumerate(nanodet.STRIDES_PX):
        across = nanodet.SIDE_PX // stride
        scores = np.zeros((across, across, len(nanodet.LABELS)), np.float32)
        spread = np.zeros((across, across, 4, nanodet.BINS), np.float32)
        for stride_number, row, column, score, sides in cells:
            if stride_number == number:
                scores[row, column, CHAIR] = score
                for side, bins in enumerate(sides):
                    low = int(bins)
                    spread[row, column, side] = -50.0
                    spread[row, column, side, low] = 0.0
        parts += [scores.tobytes(), spread.tobytes()]
    return b"".join(parts)


def test_a_box_is_read_in_pixels_of_the_whole_picture_without_the_margin_around_it() -> None:
    """Stride 32, row 6, column 6: centre (208, 208) of 416; 640x480 is scaled by 0.65, with 52 px above and below."""
    answer = raw_answer((2, 6, 6, 0.9, (2, 1, 3, 1)))
    assert len(answer) == nanodet.ANSWER_BYTES
    (found,) = nanodet.objects_of(answer, width_px=640, height_px=480)
    assert (found.label, found.score) == ("chair", 0.9)
    left, top = (208 - 64) / 0.65, (208 - 32 - 52) / 0.65
    assert found.box_px == (round(left), round(top), round(5 * 32 / 0.65), round(2 * 32 / 0.65))


def test_what_is_below_the_threshold_or_covers_a_surer_box_is_left_out() -> None:
    surest, same, doubtful = (2, 6, 6, 0.8, (2, 2, 2, 2)), (1, 12, 12, 0.6, (4, 4, 4, 4)), (2, 1, 1, 0.34, (1, 1, 1, 1))
    found = nanodet.objects_of(raw_answer(surest, same, doubtful), width_px=416, height_px=416)
    assert [one.score for one in found] == [0.8]


def test_a_picture_keeps_its_aspect_ratio_in_the_middle_of_a_black_square() -> None:
    prepared = nanodet.prepared(np.full((480, 640, 3), (200, 10, 30), np.uint8))
    assert prepared.shape == (416, 416, 3)
    assert not prepared[:50].any() and not prepared[-50:].any()
    assert prepared[208, 208].tolist() == [30, 10, 200], "blue first"


def test_of_readings_that_cover_one_another_the_fullest_is_kept() -> None:
    part = ReadText(text="12", score=0.99, box_px=(20, 0, 20, 10))
    whole = ReadText(text="B-12", score=0.9, box_px=(0, 0, 40, 10))
    other = ReadText(text="EXIT", score=0.8, box_px=(100, 0, 40, 10))
    assert distinct([part, whole, other, part]) == [whole, other]


def test_a_folder_without_the_detector_or_with_other_weights_is_refused_with_what_to_do(tmp_path: Path) -> None:
    with pytest.raises(ConfigurationMissing) as caught:
        detector_files(tmp_path)
    assert caught.value.reason.code == "detector_incomplete"
    runtime = tmp_path / "node_modules/@tensorflow/tfjs-backend-wasm/dist/tfjs-backend-wasm-simd.wasm"
    runtime.parent.mkdir(parents=True)
    runtime.write_bytes(b"")
    (tmp_path / "models").mkdir()
    for file in WEIGHTS:
        (tmp_path / "models" / file).write_bytes(b"{}")
    with pytest.raises(ConfigurationMissing) as caught:
        detector_files(tmp_path)
    assert caught.value.reason.code == "detector_changed"


def test_a_description_names_objects_and_text_with_scores_and_the_models() -> None:
    chairs = [DetectedObject(label="chair", score=score, box_px=(10, 10, 50, 60)) for score in (0.8, 0.5)]
    texts = (ReadText(text="B-12", score=0.97, box_px=(5, 5, 20, 8)),)
    body = picture()
    found = described_content(ScriptedObserver(*chairs, texts=texts), sha256(body), body)
    assert found.text.startswith("Objects: chair (2, best score 0.80). Text: “B-12” (0.97).")
    assert found.text.endswith("Found by scripted 1 sha256 dddddddddddd.")
    nothing = described_content(ScriptedObserver(), sha256(body), body)
    assert nothing.text.startswith("No object that the detector knows was found. No text was read.")


def test_boxes_are_drawn_over_a_copy_of_the_picture() -> None:
    body = picture()
    drawn = PICTURES.pixels(with_boxes(body, [((100, 100, 200, 150), "chair 0.80"), ((0, 0, 30, 10), "储物 0.5")]))
    changed = np.any(drawn != PICTURES.pixels(body), axis=2)
    assert changed[100, 150] and changed[250, 150] and not changed[175, 200], "the outline, not what is in it"
