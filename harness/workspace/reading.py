"""Reads a site's own folder; every problem is typed and names its file, its line and what can be done about it.

site.yaml        frames, map version, places, routes, passages, zones, mission profile; optionally a floor map
robots.yaml      robots by name: the simulator's, or one at an address
channels.yaml    where messages are sent, and who writes down what people say; the file may be missing
models.yaml      language and vision models by name, and which role each has; the file may be missing
missions/*.yaml  task templates of this site, one a file; the folder may be missing
capabilities.yaml  capability types of this site, beside those that ship; the file may be missing
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeVar

import msgspec

from harness.adapters.bounded_yaml import LONGEST_TEXT
from harness.adapters.installed_predicates import INSTALLED
from harness.adapters.map_rasters import read_map
from harness.adapters.plain_files import plain_text
from harness.adapters.secret_values import secret
from harness.contracts import ports
from harness.contracts.capabilities import CapabilityType, Vocabulary
from harness.contracts.channels import ChannelsFile, is_readable
from harness.contracts.errors import ContractInvalid, HarnessError
from harness.contracts.exploration import GridMap
from harness.contracts.places import Site, SiteChannel
from harness.contracts.reasons import because
from harness.contracts.tasks import TaskTemplate
from harness.workspace import checks
from harness.workspace.capability_types import CAPABILITIES, CapabilitiesFile, has_capabilities, with_own
from harness.workspace.contract_yaml import Lines, read_yaml
from harness.workspace.files import (
    EvidencePath,
    HttpRobotEntry,
    ModelsFile,
    RobotEntry,
    RobotsFile,
    SecretReference,
    SiteDescription,
    VehicleEntry,
)

T = TypeVar("T")
SITE, ROBOTS, CHANNELS, MODELS = "site.yaml", "robots.yaml", "channels.yaml", "models.yaml"
MISSIONS, CONFORMANCE = "missions", "conformance"


@dataclass(frozen=True)
class SiteFiles:
    """What people's changes to a site are checked against and written beside: its floor map, its missions' YAML, its
    robots and the YAML of robots.yaml.
    """

    floor: GridMap | None = None
    missions: Mapping[str, str] = field(default_factory=dict)
    robots: tuple[RobotEntry, ...] = ()
    robots_text: str = ""


NO_FILES = SiteFiles()


@dataclass(frozen=True)
class Workspace:
    """A site's folder as it was read. `notes` say what is allowed and will be in the way.

    `mission_files`: where each of its missions stands.
    """

    folder: Path
    site: Site
    robots: tuple[RobotEntry, ...]
    missions: tuple[TaskTemplate, ...]
    capabilities: tuple[CapabilityType, ...] = ()
    floor: GridMap | None = None
    channels: ChannelsFile = field(default_factory=ChannelsFile)
    models: ModelsFile = field(default_factory=ModelsFile)
    notes: tuple[ContractInvalid, ...] = ()
    files: SiteFiles = NO_FILES
    mission_files: Mapping[str, Path] = field(default_factory=dict)

    @property
    def vocabulary(self) -> Vocabulary:
        """The capability types that missions and cards may name here."""
        return with_own(self.capabilities)

    def robot(self, name: str) -> RobotEntry:
        """Raises ContractInvalid."""
        for one in self.robots:
            if one.name == name:
                return one
        known = tuple(one.name for one in self.robots)
        raise ContractInvalid(because("unknown_robot", robot_id=name[:40], known=known), where=str(self.folder))

    def conformance_files(self) -> tuple[Path, ...]:
        """What the conformance kit may ask of the providers at this site."""
        return tuple(sorted((self.folder / CONFORMANCE).glob("*.yaml")))


@dataclass
class Reader:
    """One pass over a folder; collects problems instead of ending at the first.

    `foreign`: anybody may have written its files, so that a process with limits reads them.
    """

    folder: Path
    reserved: frozenset[str]
    foreign: bool
    predicates: ports.Predicates = INSTALLED
    problems: list[HarnessError] = field(default_factory=list)
    notes: list[ContractInvalid] = field(default_factory=list)

    def read(self) -> Workspace | None:
        """None where there are problems."""
        if not self.folder.is_dir():
            self.problems.append(ContractInvalid(because("workspace_missing"), where=str(self.folder)))
            return None
        self._strangers()
        site_file = self._file(self.folder / SITE, SiteDescription)
        robots = self._file(self.folder / ROBOTS, RobotsFile)
        channels = self._channels()
        site = _site(site_file[0], channels) if site_file else None
        floor = self._floor(site_file) if site_file else None
        if site_file and site_file[0].channels:
            where = checks.at(self.folder / SITE, site_file[1].of("channels"))
            self.problems.append(ContractInvalid(because("channels_in_site_file"), where=where))
        if site_file and site:
            self._take(checks.site_problems(site, self.folder / SITE, site_file[1], floor, predicates=self.predicates))
        if robots:
            self._take(checks.robot_problems(robots[0], self.folder / ROBOTS, robots[1]))
            self.notes += checks.robot_notes(robots[0], self.folder, robots[1], has_secret=self._has_secret)
        models = self._models()
        capabilities = self._capabilities()
        missions = self._missions(site, with_own(capabilities))
        if site and robots and floor:
            self._take(checks.clearance_problems(site, robots[0], self.folder / SITE, site_file[1], floor))  # type: ignore[index]
        if self.problems or site is None or robots is None:
            return None
        self.notes += checks.speed_notes(missions, robots[0], self.folder / MISSIONS)
        return Workspace(
            folder=self.folder,
            site=site,
            robots=robots[0].robots,
            missions=tuple(one for one, _, _ in missions),
            capabilities=capabilities,
            floor=floor,
            channels=channels,
            models=models,
            notes=tuple(self.notes),
            files=SiteFiles(
                floor=floor,
                missions={one.name: lines.text for one, _, lines in missions},
                robots=robots[0].robots,
                robots_text=robots[1].text,
            ),
            mission_files={one.name: file for one, file, _ in missions},
        )

    def _strangers(self) -> None:
        """A YAML file that nobody reads is a misspelt one."""
        known = {SITE, ROBOTS, CHANNELS, MODELS, CAPABILITIES}
        for file in sorted(self.folder.glob("*.y*ml")):
            if file.name not in known:
                self.problems.append(
                    ContractInvalid(because("workspace_file_unknown", known=tuple(sorted(known))), where=str(file))
                )

    def _channels(self) -> ChannelsFile:
        """What channels.yaml says; nothing where there is none, or where it cannot be used."""
        file = self.folder / CHANNELS
        read = self._file(file, ChannelsFile) if file.exists() else None
        if read is None:
            return ChannelsFile()
        self._take(checks.channel_problems(read[0], file, read[1]))
        self.notes += checks.channel_notes(read[0], file, read[1], has_secret=self._has_secret)
        return read[0]

    def _models(self) -> ModelsFile:
        """No models where there is no such file, and where it has problems."""
        file = self.folder / MODELS
        if not file.exists():
            return ModelsFile()
        read = self._file(file, ModelsFile)
        if read is None:
            return ModelsFile()
        self._take(checks.model_problems(read[0], file, read[1]))
        self.notes += checks.model_notes(read[0], file, read[1], has_secret=self._has_secret)
        return read[0]

    def _capabilities(self) -> tuple[CapabilityType, ...]:
        file = self.folder / CAPABILITIES
        read = self._file(file, CapabilitiesFile) if has_capabilities(self.folder) else None
        if read is None:
            return ()
        self._take(checks.capability_problems(read[0].capabilities, file, read[1], predicates=self.predicates))
        return read[0].capabilities

    def _missions(self, site: Site | None, vocabulary: Vocabulary) -> list[tuple[TaskTemplate, Path, Lines]]:
        found: list[tuple[TaskTemplate, Path, Lines]] = []
        for file in sorted((self.folder / MISSIONS).glob("*.yaml")):
            read = self._file(file, TaskTemplate)
            if read is None:
                continue
            twin = next((one for one, _, _ in found if one.name == read[0].name), None)
            if twin is not None or read[0].name in self.reserved:
                known = because("mission_name_taken", name=read[0].name)
                self.problems.append(ContractInvalid(known, where=checks.at(file, read[1].of("name"))))
                continue
            found.append((read[0], file, read[1]))
        for template, file, lines in found:
            if site is not None:
                self._take(
                    checks.mission_problems(
                        template, site, file, lines, vocabulary=vocabulary, predicates=self.predicates
                    )
                )
        return found

    def _floor(self, read: tuple[SiteDescription, Lines]) -> GridMap | None:
        site, lines = read
        if isinstance(site.map, msgspec.UnsetType):
            return None
        file = self.folder / site.map
        try:
            if not file.resolve().is_relative_to(self.folder.resolve()):
                raise ContractInvalid(because("workspace_path_outside", path=site.map), where=str(file))
            return read_map(file, frame=site.frame, map_version=site.map_version)
        except HarnessError as error:
            self.problems.append(checks.relocated(error, self.folder / SITE, lines.of("map")))
            return None

    def _file(self, file: Path, kind: type[T]) -> tuple[T, Lines] | None:
        try:
            text = plain_text(file, most_bytes=4 * LONGEST_TEXT)
        except (OSError, UnicodeError) as error:
            missing = because("workspace_file_unreadable", error=getattr(error, "strerror", None) or str(error))
            self.problems.append(ContractInvalid(missing, where=str(file)))
            return None
        try:
            return read_yaml(text, kind, where=str(file), foreign=self.foreign), Lines(text)
        except ContractInvalid as error:
            self.problems.append(error)
            return None

    def _take(self, problems: Iterator[HarnessError]) -> None:
        self.problems.extend(problems)

    def _has_secret(self, reference: SecretReference) -> bool:
        try:
            secret(variable=reference.environment, file=reference.file, folder=self.folder)
        except HarnessError:
            return False
        return True


def examined(
    folder: Path, *, reserved: Sequence[str] = (), foreign: bool = True
) -> tuple[Workspace | None, tuple[HarnessError, ...]]:
    """The folder, or everything that is wrong with it. `reserved`: names of missions that ship with the harness."""
    reader = Reader(folder, frozenset(reserved), foreign)
    found = reader.read()
    return found, tuple(reader.problems)


def open_workspace(folder: Path, *, reserved: Sequence[str] = (), foreign: bool = True) -> Workspace:
    """Raises the first problem: ContractInvalid, UnknownName."""
    found, problems = examined(folder, reserved=reserved, foreign=foreign)
    if found is None:
        raise problems[0]
    return found


def token_of(entry: HttpRobotEntry | EvidencePath, folder: Path) -> str:
    """The bearer token of a robot, or of its evidence path, at an address; empty where the path names none.

    Raises ContractInvalid.
    """
    if entry.token is None:
        return ""
    return secret(variable=entry.token.environment, file=entry.token.file, folder=folder)


def password_of(entry: VehicleEntry, folder: Path) -> str:
    """The password for a vehicle's broker; empty where none is asked for. Raises ContractInvalid."""
    if entry.password is None:
        return ""
    return secret(variable=entry.password.environment, file=entry.password.file, folder=folder)


def _site(file: SiteDescription, channels: ChannelsFile) -> Site:
    """The site with the names of its channels; those of two channels, and unknown ones, are problems of their own."""
    named = tuple(
        SiteChannel(name=one.name, aliases=one.aliases, readable=is_readable(one), default=one.name == channels.default)
        for one in channels.channels
    )
    fields = {name: getattr(file, name) for name in Site.__struct_fields__}
    return Site(**fields | {"channels": named, "wake_phrases": channels.voice.wake_phrases})
