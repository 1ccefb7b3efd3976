"""Finds objects in a picture with NanoDet-g, in a child of Node.js that may read its own folder and nothing else."""

import resource
import subprocess
from contextlib import suppress
from threading import Lock, Timer
from weakref import finalize

import numpy as np
from numpy.typing import NDArray

from harness.adapters.process_priority import give_way
from harness.adapters.vision.installation import WORKER, DetectorFiles
from harness.adapters.vision.nanodet import ANSWER_BYTES, objects_of, prepared
from harness.contracts.errors import ProviderFailed
from harness.contracts.pictures import DetectedObject
from harness.contracts.reasons import because

STARTING_S = 60.0
LONGEST_S = 30.0
HEAP_MIB = 256
PERMISSION_MAJOR = 23
"""From this version of Node.js on, the permission model has no `experimental` in its name."""
BOUNDS = {resource.RLIMIT_NOFILE: 64, resource.RLIMIT_FSIZE: 0, resource.RLIMIT_CORE: 0}
"""No file is written. V8 reserves more address space than it uses: memory is bounded by its own option instead."""
Pixels = NDArray[np.uint8]


class ObjectDetector:
    """One child for many pictures, one at a time; it starts with the first, and is replaced after a failure."""

    def __init__(self, files: DetectorFiles) -> None:
        self.model = files.model
        self._files = files
        self._children: list[subprocess.Popen[bytes]] = []
        self._lock = Lock()
        finalize(self, _end_all, self._children)

    def detect(self, pixels: Pixels) -> tuple[DetectedObject, ...]:
        """The objects in an RGB picture (H, W, 3), best first. Raises ProviderFailed."""
        request = prepared(pixels).tobytes()
        with self._lock:
            try:
                answer = self._exchanged(request)
            except BaseException:
                _end_all(self._children)
                raise
        height, width = pixels.shape[:2]
        return objects_of(answer, width_px=width, height_px=height)

    def close(self) -> None:
        """End the child. A later picture starts another one."""
        with self._lock:
            _end_all(self._children)

    def _exchanged(self, request: bytes) -> bytes:
        child = self._child()
        assert child.stdin is not None and child.stdout is not None
        timer = _killing(child, LONGEST_S)
        try:
            child.stdin.write(request)
            child.stdin.flush()
            answer = child.stdout.read(ANSWER_BYTES)
        except OSError as error:
            raise ProviderFailed(because("detector_failed", error=str(error)[:120]), where=self.model.name) from error
        finally:
            timer.cancel()
        if len(answer) < ANSWER_BYTES:
            raise ProviderFailed(because("detector_failed", error="no whole answer"), where=self.model.name)
        return answer

    def _child(self) -> subprocess.Popen[bytes]:
        if self._children and self._children[0].poll() is not None:
            _end_all(self._children)
        if self._children:
            return self._children[0]
        files = self._files
        permission = "--permission" if files.node_major >= PERMISSION_MAJOR else "--experimental-permission"
        reads = [f"--allow-fs-read={place}" for place in (files.folder, WORKER)]
        worker = str(WORKER / "detector.mjs")
        child = subprocess.Popen(
            [files.node, permission, *reads, f"--max-old-space-size={HEAP_MIB}", worker, str(files.folder)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            env={},
            start_new_session=True,
        )
        self._children.append(child)
        give_way(child.pid)
        for bound, value in BOUNDS.items():
            with suppress(ProcessLookupError):
                resource.prlimit(child.pid, bound, (value, value))
        assert child.stdout is not None
        timer = _killing(child, STARTING_S)
        ready = child.stdout.read(1)
        timer.cancel()
        if ready != b"R":
            raise ProviderFailed(because("detector_failed", error="it did not start"), where=self.model.name)
        return child


def _killing(child: subprocess.Popen[bytes], seconds: float) -> Timer:
    """Kills the child after so long unless it is cancelled: reading from it then ends."""
    timer = Timer(seconds, child.kill)
    timer.daemon = True
    timer.start()
    return timer


def _end_all(children: list[subprocess.Popen[bytes]]) -> None:
    while children:
        child = children.pop()
        child.kill()
        child.wait()
        for pipe in (child.stdin, child.stdout):
            with suppress(OSError):
                if pipe is not None:
                    pipe.close()
