"""What the system refuses has one text, whichever library was told."""

import errno
import pwd

import pytest

from cvt_hpc.storage.files import StorageError, naming_refusals, written_aside

FULL = OSError(errno.ENOSPC, "No space left on device")
# As h5py and the netCDF library tell it.
LONG = OSError(errno.ENOSPC, "Unable to write\n, errno = 28, error message = 'No space left on device'")
MUTE = RuntimeError("NetCDF: HDF error")


def refuse(error):
    raise error


@pytest.mark.parametrize("error", [FULL, LONG], ids=["plain", "long"])
def test_a_full_disk_has_one_text(tmp_path, error):
    path = tmp_path / "x.nc"
    expected = f"{path}: expected to be able to write, found: No space left on device"
    with pytest.raises(StorageError) as aside, written_aside(path):
        refuse(error)
    with pytest.raises(StorageError) as named, naming_refusals(path, "a folder that can be read"):
        refuse(error)
    assert [str(aside.value), str(named.value)] == [expected, expected]


def test_other_refusals_are_named_by_what_was_expected(tmp_path):
    with pytest.raises(StorageError, match="x: expected a folder, found: Permission denied"):
        with naming_refusals("x", "a folder"):
            refuse(OSError(errno.EACCES, "Permission denied"))


def test_who_can_grant_a_right_is_told(tmp_path):
    owner = pwd.getpwuid(tmp_path.stat().st_uid).pw_name
    told = f" ({tmp_path} belongs to {owner}, who can grant the right; or choose another --out, or copy it)"
    path = tmp_path / "new" / "x.nc"
    for errno_, reason, then in ((errno.EACCES, "Permission denied", told), (errno.EROFS, "Read-only", "")):
        with pytest.raises(StorageError) as caught, naming_refusals(path, "a folder"):
            refuse(OSError(errno_, reason))
        assert str(caught.value) == f"{path}: expected a folder, found: {reason}{then}"
    with pytest.raises(StorageError) as caught, written_aside(tmp_path / "x.nc", advice="Kept"):
        refuse(OSError(errno.EPERM, "Operation not permitted"))
    assert str(caught.value).endswith(f"found: Operation not permitted{told}. Kept")


def test_the_system_is_asked_where_a_library_does_not_say(tmp_path, monkeypatch):
    monkeypatch.setattr("cvt_hpc.storage.files.os.fsync", lambda _: refuse(FULL))
    with pytest.raises(StorageError, match="expected to be able to write, found: No space left on device$"):
        with written_aside(tmp_path / "x.nc"):
            refuse(MUTE)
    monkeypatch.undo()
    with pytest.raises(StorageError, match="expected to be able to write, found: NetCDF: HDF error$"):
        with written_aside(tmp_path / "x.nc"):  # which has room
            refuse(MUTE)
    assert list(tmp_path.iterdir()) == []
