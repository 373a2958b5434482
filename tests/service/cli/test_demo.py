"""The demo: from a simulated car park to a scored map."""

from pathlib import Path

from drives import RESULT_FILES, cli


def test_the_demo_makes_scores_and_says_where_to_look(tmp_path: Path) -> None:
    done = cli("demo", "--out", tmp_path / "demo", "--minutes", "0.5")
    assert done.returncode == 0, done.stderr
    assert "absolute trajectory error" in done.stdout
    assert f"wayfi view {tmp_path / 'demo' / 'replay'}" in done.stdout.replace("\n", "")
    assert {path.name for path in (tmp_path / "demo").iterdir()} == {"recording.mcap", "truth.tum", "replay"}
    assert {path.name for path in (tmp_path / "demo" / "replay").iterdir()} >= set(RESULT_FILES)
