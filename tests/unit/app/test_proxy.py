"""What a viewer may say to its server: where its camera is and where it points."""

from typing import Any

import msgspec
import pytest

from app.scene.proxy import LARGEST, admitted


def message(kind: Any, **fields: Any) -> bytes:
    return msgspec.msgpack.encode({"type": kind, **fields})


@pytest.mark.parametrize("kind", ["ViewerCameraMessage", "ScenePointerMessage"])
def test_camera_and_pointer_pass(kind: str) -> None:
    assert admitted(message(kind, position=[1.0, 2.0, 3.0]))


@pytest.mark.parametrize(
    "kind",
    ["ShareUrlRequest", "ShareUrlDisconnect", "GuiUpdateMessage", "FileTransferStartUpload", "CommandTriggerMessage",
     "GetRenderResponseMessage", "TransformControlsUpdateMessage", None, 7, ""],
)  # fmt: skip
def test_everything_else_is_kept_out(kind: Any) -> None:
    assert not admitted(message(kind))


@pytest.mark.parametrize("body", [b"", b"\xc1", b"\xff" * 9, msgspec.msgpack.encode(["ViewerCameraMessage"]), b"{}"])
def test_what_is_no_message_is_kept_out(body: bytes) -> None:
    assert not admitted(body)


def test_an_oversized_message_is_kept_out() -> None:
    assert not admitted(message("ViewerCameraMessage", wxyz="x" * LARGEST))
