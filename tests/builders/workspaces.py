"""The example workspaces with their robots, as a stranger runs them, and the predicates' package beside us."""

import socket
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import copyfile, copytree

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = ROOT / "docs" / "examples" / "workspaces"
TOKEN = "a secret of this test"


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def package(folder: Path, *, changed: tuple[str, str] | None = None) -> Path:
    """The package `docs/examples/workspaces/predicates` as an installer leaves it in a folder of packages.

    `changed` is a text in its module and what stands there instead.
    """
    project = tomllib.loads((EXAMPLES / "predicates" / "pyproject.toml").read_text())["project"]
    about = folder / f"acme_predicates-{project['version']}.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n")
    points = project["entry-points"]["regenharness.predicates"]
    lines = [f"{name} = {value}" for name, value in points.items()]
    (about / "entry_points.txt").write_text("\n".join(["[regenharness.predicates]", *lines, ""]))
    module = folder / "acme_predicates.py"
    copyfile(EXAMPLES / "predicates" / "acme_predicates.py", module)
    if changed:
        text = module.read_text()
        assert changed[0] in text
        module.write_text(text.replace(*changed))
    return folder


class ExampleWorkspace:
    """One of the examples in a folder of its own, at a port of its own."""

    def __init__(self, folder: Path, name: str) -> None:
        self.folder, self.name, self.port = folder, name, free_port()
        copytree(EXAMPLES / name, folder)
        robots = folder / "robots.yaml"
        text = robots.read_text()
        known = next(line.split(": ", 1)[1] for line in text.splitlines() if "address:" in line)
        robots.write_text(text.replace(known, f"http://127.0.0.1:{self.port}"))

    @contextmanager
    def robot(self, *options: str) -> Iterator[None]:
        """Its robot's process, whose time passes only when it is asked to."""
        program = str(EXAMPLES / self.name / "robot.py")
        words = [sys.executable, program, "--port", str(self.port), "--token", TOKEN, "--lockstep", *options]
        with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
            assert process.stdout is not None and process.stdout.readline()
            try:
                yield
            finally:
                process.kill()

    def edit(self, file: str, old: str, new: str) -> None:
        """Replace a text in one of its files."""
        path = self.folder / file
        text = path.read_text()
        assert old in text
        path.write_text(text.replace(old, new))


@contextmanager
def installed(folder: Path) -> Iterator[None]:
    """Packages of this folder are found, as if they were installed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(folder))
        yield
