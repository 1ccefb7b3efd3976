"""Binds a recording's positions to a frame, a map version and one clock, or gives the reason why it cannot."""

from harness.adapters.providers.recording.roles import TopicRoles
from harness.adapters.providers.recording.samples import Binding, Clocks, RecordingClock
from harness.adapters.providers.recording.survey import Positions, Survey
from harness.adapters.providers.recording.topics import TopicSettings
from harness.adapters.providers.recording.transforms import Frames
from harness.contracts.errors import RecordingInvalid
from harness.contracts.ids import Digest
from harness.contracts.reasons import because

METADATA = "regen.mission"


def bind_frame(
    positions: Positions,
    *,
    settings: TopicSettings,
    frames: Frames,
    digest: Digest,
    recorded: dict[str, str],
    where: str,
) -> Binding:
    """The map frame if static transforms lead there, else the positions' own frame; D38 for the map version.

    `recorded` is the record that the harness's own writer leaves: it names the map version of its mission.
    """
    if len(positions.frames) > 1:
        raise RecordingInvalid(because("positions_change_frame", frames=tuple(sorted(positions.frames))), where=where)
    frame = next(iter(positions.frames), "") or settings.map_frame
    matrix = None
    if frame != settings.map_frame:
        matrix = frames.between(settings.map_frame, frame)
        frame = frame if matrix is None else settings.map_frame
    known = recorded.get("map_version") if frame == settings.map_frame else None
    return Binding(frame, settings.map_version or known or f"recording:{digest}", matrix)


def choose_clock(
    survey: Survey, *, roles: TopicRoles, settings: TopicSettings, where: str
) -> tuple[Clocks, RecordingClock]:
    """Mission time on the clock of the settings, or on log time if header stamps are missing."""
    positions = survey.positions[roles.position]
    if not positions.count:
        raise RecordingInvalid(
            because("positions_not_finite", count=positions.unusable, topic=roles.position), where=where
        )
    clock, reason = settings.clock, None
    if clock == "header" and positions.unstamped:
        clock = "log"
        reason = because("header_stamps_missing", count=positions.unstamped, topic=roles.position)
    clocks = Clocks(
        clock=clock,
        reason=reason,
        least_delay_s=positions.least_delay_ns / 1e9,
        most_delay_s=positions.most_delay_ns / 1e9,
        first_log_s=survey.first_log_ns / 1e9,
        last_log_s=survey.last_log_ns / 1e9,
    )
    return clocks, RecordingClock(clocks, shift_ns=positions.least_delay_ns)
