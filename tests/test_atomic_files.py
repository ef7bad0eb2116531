"""Files appear whole or not at all."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import pytest

from tapelayer.atomic_files import check_names, write_files
from tapelayer.errors import TargetNotWritable


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def test_files_are_written_whole(tmp_path: Path) -> None:
    write_files({tmp_path / "a.nc": b"%\n", tmp_path / "b.json": b"{}"})
    assert (tmp_path / "a.nc").read_bytes() == b"%\n"
    assert names(tmp_path) == {"a.nc", "b.json"}


def test_permissions_are_those_of_the_old_file_or_of_a_new_one(tmp_path: Path) -> None:
    old, new, plain = tmp_path / "old", tmp_path / "new", tmp_path / "plain"
    old.write_bytes(b"1")
    old.chmod(0o640)
    plain.write_bytes(b"")
    write_files({old: b"2", new: b"3"})
    assert old.stat().st_mode & 0o777 == 0o640
    assert new.stat().st_mode == plain.stat().st_mode


def test_one_bad_target_leaves_every_file_untouched(tmp_path: Path) -> None:
    good = tmp_path / "good.nc"
    good.write_bytes(b"old")
    for bad, reason in ((tmp_path / "none" / "x.nc", "no such file or directory"), (tmp_path, "is a directory")):
        with pytest.raises(TargetNotWritable) as caught:
            write_files({good: b"new", bad: b"new"})
        assert str(caught.value) == f"{bad}: cannot be written: {reason}; nothing was changed, choose another target"
        assert good.read_bytes() == b"old"
        assert names(tmp_path) == {"good.nc"}


def test_a_failing_disk_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "a.nc"
    target.write_bytes(b"old")

    def full(handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(TargetNotWritable, match="no space left on device"):
        write_files({target: b"new"})
    assert target.read_bytes() == b"old"
    assert names(tmp_path) == {"a.nc"}


def test_a_read_only_file_is_left_alone(tmp_path: Path) -> None:
    target = tmp_path / "a.nc"
    target.write_bytes(b"old")
    target.chmod(0o444)
    with pytest.raises(TargetNotWritable, match="permission denied; nothing was changed"):
        write_files({target: b"new"})
    assert target.read_bytes() == b"old"
    assert names(tmp_path) == {"a.nc"}


def test_a_link_is_followed(tmp_path: Path) -> None:
    target, link = tmp_path / "a.nc", tmp_path / "link.nc"
    target.write_bytes(b"old")
    link.symlink_to(target)
    write_files({link: b"new"})
    assert link.is_symlink()
    assert target.read_bytes() == b"new"


def test_a_full_device_is_told_and_stays_a_device(tmp_path: Path) -> None:
    device = Path("/dev/full")
    if not device.is_char_device():
        pytest.skip("there is no device that is always full")
    beside = tmp_path / "a.nc"
    with pytest.raises(TargetNotWritable, match="/dev/full: cannot be written: no space left on device"):
        write_files({beside: b"new", device: b"new"})
    assert device.is_char_device()
    assert names(tmp_path) == set()


def test_an_interrupt_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    target = tmp_path / "a.nc"
    target.write_bytes(b"old")

    def interrupted(handle: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(os, "fsync", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_files({target: b"new"})
    assert target.read_bytes() == b"old"
    assert names(tmp_path) == {"a.nc"}


def test_two_writers_do_not_mix(tmp_path: Path) -> None:
    target = tmp_path / "a.nc"
    contents = [bytes([65 + i]) * 200_000 for i in range(4)]
    threads = [threading.Thread(target=write_files, args=({target: data},)) for data in contents for _ in range(5)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert target.read_bytes() in contents
    assert names(tmp_path) == {"a.nc"}


def test_an_output_that_is_an_input_is_refused(tmp_path: Path) -> None:
    """However it is named: by another way, a symbolic link, a hard link or a link's folder."""
    source = tmp_path / "panel.txt"
    source.write_bytes(b"1")
    (tmp_path / "link").symlink_to(source)
    (tmp_path / "folder").symlink_to(tmp_path)
    os.link(source, tmp_path / "hard")
    for name in (source, tmp_path / "folder" / "panel.txt", tmp_path / "link", tmp_path / "hard"):
        with pytest.raises(TargetNotWritable, match=r"is the same file as the input .*panel\.txt; name another"):
            check_names([str(source)], [str(name)])
    check_names([str(source)], [str(tmp_path / "panel.nc")])


def test_two_outputs_with_one_name_are_refused(tmp_path: Path) -> None:
    """Also where only a file system that folds case and accents would take them for one; a device takes both."""
    (tmp_path / "folder").symlink_to(tmp_path)
    for one, other in (("a.nc", "a.nc"), ("a.nc", "folder/a.nc"), ("a.nc", "A.NC"), ("\u00e9.nc", "e\u0301.nc")):
        with pytest.raises(TargetNotWritable, match="is the same file as the output"):
            check_names([], [str(tmp_path / one), str(tmp_path / other)])
    check_names([], [str(tmp_path / "a.nc"), str(tmp_path / "b.nc"), os.devnull, os.devnull])


def test_a_circle_of_links_is_told(tmp_path: Path) -> None:
    (tmp_path / "a.nc").symlink_to(tmp_path / "b.nc")
    (tmp_path / "b.nc").symlink_to(tmp_path / "a.nc")
    with pytest.raises(TargetNotWritable, match=r"a\.nc: cannot be written: too many levels of symbolic links"):
        write_files({tmp_path / "a.nc": b"%"})
    assert (tmp_path / "a.nc").is_symlink()
