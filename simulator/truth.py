"""Records ground truth for an adjudicator: written by the robot's process, never offered on any interface."""

from pathlib import Path
from typing import IO, Literal

from harness.contracts.values import Value, encode

TruthKind = Literal["pose", "start", "terminal", "struck", "mission", "fell"]


class Truth(Value):
    """One line. Poses are the body's true planar pose in the map frame: metres, radians, m/s."""

    kind: TruthKind
    at_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    v_mps: float
    request_id: str = ""
    text: str = ""


class TruthLog:
    """One JSON-lines file per mission under `folder`; kept in `records` where there is no folder."""

    def __init__(self, folder: Path | None) -> None:
        self._folder = folder
        self._file: IO[bytes] | None = None
        self.records: list[Truth] = []
        if folder is not None:
            folder.mkdir(parents=True, exist_ok=True)

    def begin(self, mission_id: str) -> None:
        """Write to this mission's file from now on."""
        self.records = []
        if self._folder is not None:
            self.close()
            safe = "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in mission_id)
            self._file = (self._folder / f"{safe}.jsonl").open("ab")

    def add(self, truth: Truth) -> None:
        if self._folder is None:
            self.records.append(truth)
        elif self._file is not None:
            self._file.write(encode(truth) + b"\n")
            self._file.flush()

    def close(self) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None
