"""Numbered parts."""

from pathlib import Path

from wayfi.recordings.mcap.parts import BLACKBOX, SESSION, next_part, parts_of


def test_parts_are_numbered_on_even_where_the_oldest_are_gone(tmp_path: Path) -> None:
    made = []
    for _ in range(4):
        made.append(next_part(tmp_path, BLACKBOX))
        made[-1].touch()
    made[0].unlink()
    assert next_part(tmp_path, BLACKBOX).name == "blackbox_0005.mcap"
    assert next_part(tmp_path, SESSION).name == "session_0001.rrd"
    assert parts_of(tmp_path, BLACKBOX) == made[1:]


def test_the_ten_thousandth_part_comes_last(tmp_path: Path) -> None:
    for number in (9999, 10000, 1):
        (tmp_path / f"session_{number:04d}.rrd").touch()
    assert [path.stem for path in parts_of(tmp_path, SESSION)] == ["session_0001", "session_9999", "session_10000"]
    assert next_part(tmp_path, SESSION).name == "session_10001.rrd"
