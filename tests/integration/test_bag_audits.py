"""An audit of recordings: every declared success is judged by its own samples, one by one, and goes on where it was."""

import os
from pathlib import Path

import pytest

from harness.adapters.providers.recording.topics import topic_settings
from harness.adapters.stores.audit_results import stored_audits
from harness.recording_audits import ARRIVAL, audited_folder
from tests.builders.declared_drives import declared_drive
from tests.integration.runs import ROOT, answer, regen

TOPICS = topic_settings((), arrival=ARRIVAL)


def fleet(folder: Path) -> Path:
    """One backed success, three that lack something, one that is contradicted, and files that cannot be read."""
    (folder / "monday").mkdir(parents=True)
    declared_drive(folder / "monday" / "backed.mcap")
    declared_drive(folder / "monday" / "elsewhere.mcap", goal_m=9.0)
    declared_drive(folder / "monday" / "moving.mcap", declared_after_s=14.3)
    declared_drive(folder / "one-source.mcap", localised=False)
    declared_drive(folder / "no-goal.mcap", goal_m=None)
    declared_drive(folder / "silent.mcap", declared_after_s=None)
    (folder / "broken.mcap").write_bytes(b"\x89MCAP0\r\nnothing of the kind")
    (folder / "packed.bag").write_bytes(b"not a bag")
    (folder / "README.txt").write_text("no recording at all\n")
    return folder


def test_regen_audit_bags_counts_successes_without_evidence_and_names_what_it_could_not_read(tmp_path: Path) -> None:
    done = regen("audit", "bags", fleet(tmp_path / "bags"), "--data", tmp_path / "data", "--json")
    found = answer(done)
    assert done.returncode == 1
    assert (found["recordings"], found["unreadable"], found["successes"]) == (8, 2, 5)
    assert found["verdicts"] == {"backed": 1, "lacking": 3, "contradicted": 1}
    assert found["lacks"] == {"target": 1, "position": 0, "arrival": 2, "standstill": 1, "second_source": 1}
    by_path = {one["path"]: one for one in found["audited"]}
    assert "README.txt" not in by_path
    assert by_path["broken.mcap"]["problem_code"] and by_path["packed.bag"]["problem_code"] == "not_a_recording"
    (wrong,) = by_path["monday/elsewhere.mcap"]["successes"]
    assert wrong["verdict"] == "contradicted" and wrong["distance_m"] == pytest.approx(3.0, abs=0.05)
    assert by_path["silent.mcap"]["successes"] == []


def test_an_audit_says_so_at_the_terminal(tmp_path: Path) -> None:
    (tmp_path / "bags").mkdir()
    declared_drive(tmp_path / "bags" / "elsewhere.mcap", goal_m=9.0)
    done = regen("audit", "bags", tmp_path / "bags", "--data", tmp_path / "data")
    assert done.returncode == 0
    assert "1 recordings, 0 not readable, 0 cut off; 1 declared successes." in done.stdout
    assert "1/1  elsewhere.mcap" in done.stderr


def test_an_audit_reads_again_only_what_changed(tmp_path: Path) -> None:
    folder, data = tmp_path / "bags", tmp_path / "data"
    folder.mkdir()
    kept, changed = declared_drive(folder / "kept.mcap"), declared_drive(folder / "changed.mcap")
    first = audited_folder(folder, data, topics=TOPICS)
    marks = kept.stat()
    kept.write_bytes(bytes(marks.st_size))
    os.utime(kept, ns=(marks.st_atime_ns, marks.st_mtime_ns))
    declared_drive(changed, goal_m=9.0)
    second = {one.path: one for one in audited_folder(folder, data, topics=TOPICS).recordings}
    assert second["kept.mcap"] == next(one for one in first.recordings if one.path == "kept.mcap")
    assert second["changed.mcap"].successes[0].verdict == "contradicted"
    third = {one.path: one for one in audited_folder(folder, data, topics=TOPICS, again=True).recordings}
    assert third["kept.mcap"].problem is not None


def test_an_audit_that_was_ended_goes_on_where_it_was(tmp_path: Path) -> None:
    folder, data = tmp_path / "bags", tmp_path / "data"
    folder.mkdir()
    for name in ("a", "b", "c"):
        declared_drive(folder / f"{name}.mcap")

    def ended(one: object, number: int, total: int) -> None:
        if number == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        audited_folder(folder, data, topics=TOPICS, watch=ended)
    (partly,) = stored_audits(data)
    assert [one.path for one in partly.recordings] == ["a.mcap", "b.mcap"]
    (folder / "a.mcap").unlink()
    declared_drive(folder / "a.mcap", goal_m=9.0)
    assert [one.path for one in audited_folder(folder, data, topics=TOPICS).recordings] == [
        "a.mcap",
        "b.mcap",
        "c.mcap",
    ]
    (whole,) = stored_audits(data)
    assert len(whole.recordings) == 3 and whole.recordings[0].successes[0].verdict == "contradicted"


@pytest.mark.real_data
def test_real_recordings_are_audited_and_their_problems_named(real_data: Path, tmp_path: Path) -> None:
    audit = audited_folder(real_data / "edge_bags", tmp_path, topics=TOPICS)
    assert len(audit.recordings) == len(audit.unreadable) == 8
    assert all(one.problem is not None for one in audit.recordings)
    assert audited_folder(real_data / "bags", tmp_path, topics=TOPICS).findings == ()


def test_this_harness_s_own_mission_is_backed(tmp_path: Path) -> None:
    (tmp_path / "bags").mkdir()
    (tmp_path / "bags" / "own.mcap").symlink_to(ROOT / "tests" / "fixtures" / "warehouse-inspection.mcap")
    assert audited_folder(tmp_path / "bags", tmp_path, topics=TOPICS).recordings == ()
    (tmp_path / "bags" / "own.mcap").unlink()
    (tmp_path / "bags" / "own.mcap").write_bytes((ROOT / "tests/fixtures/warehouse-inspection.mcap").read_bytes())
    found = audited_folder(tmp_path / "bags", tmp_path, topics=TOPICS).findings
    assert [one.verdict for one in found] == ["backed", "backed"]
