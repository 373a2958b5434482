"""The budget for recordings."""

from pathlib import Path

from wayfi.service.blackbox.disk import MIB, keep_budget


def test_the_newest_part_of_each_kind_stays(tmp_path: Path) -> None:
    names = [f"blackbox_{n:04d}.mcap" for n in (1, 2, 3)] + [f"session_{n:04d}.rrd" for n in (1, 2)]
    for name in names:
        (tmp_path / "now").mkdir(exist_ok=True)
        (tmp_path / "now" / name).write_bytes(bytes(MIB))
    keep_budget(tmp_path, tmp_path / "now", 4.0)
    assert sorted(path.name for path in (tmp_path / "now").iterdir()) == names[1:]
    keep_budget(tmp_path, tmp_path / "now", 0.1)
    assert sorted(path.name for path in (tmp_path / "now").iterdir()) == [names[2], names[4]]
