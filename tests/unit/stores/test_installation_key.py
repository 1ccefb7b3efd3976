"""The installation's key: made once, for its owner alone, and never taken from the data folder."""

from pathlib import Path

import pytest

from harness.adapters.stores.installation_key import installation_key, standard_place


def missing(given: Path | None, data: Path, *, make: bool = False) -> str:
    found = installation_key(given, data=data, make=make)
    assert found.missing is not None and found.secret == b""
    return found.missing.code


def test_it_is_made_once_and_readable_by_its_owner_alone(tmp_path: Path) -> None:
    place, data = tmp_path / "state" / "key", tmp_path / "data"
    assert missing(place, data) == "installation_key_absent"
    made = installation_key(place, data=data, make=True)
    assert len(made.secret) == 32 and place.stat().st_mode & 0o077 == 0
    assert installation_key(place, data=data, make=True).secret == made.secret
    assert "secret" not in repr(made)


def test_it_does_not_lie_in_the_data_folder_not_even_by_a_link(tmp_path: Path) -> None:
    data = tmp_path / "data"
    data.mkdir()
    (tmp_path / "elsewhere").symlink_to(data)
    for place in (data / "key", tmp_path / "elsewhere" / "key"):
        assert missing(place, data, make=True) == "installation_key_in_data_folder"
        assert not place.exists()


def test_one_that_others_can_read_or_that_is_short_is_not_used(tmp_path: Path) -> None:
    place = tmp_path / "key"
    place.write_bytes(bytes(32))
    place.chmod(0o644)
    assert missing(place, tmp_path / "data") == "installation_key_exposed"
    place.chmod(0o600)
    assert installation_key(place, data=tmp_path / "data", make=False).secret == bytes(32)
    place.write_bytes(b"short")
    assert missing(place, tmp_path / "data") == "installation_key_length"


def test_its_standard_place_is_the_users_state_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert standard_place() == tmp_path / "regenharness" / "installation.key"
