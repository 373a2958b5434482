"""The evaluation of a folder: its files, and what is refused."""

import json
import struct
from pathlib import Path

import pytest
from laps import START_NS, loops, noisy, replay_folder

from wayfi.recordings.files.tables import TableError
from wayfi.recordings.files.tum import TrajectoryError, write_tum
from wayfi.service.evaluation.evaluate import evaluate, read_relations, write_evaluation
from wayfi.service.evaluation.plots import write_plots
from wayfi.service.evaluation.trajectory_scores import (
    ScoringError,
)


def test_an_evaluation_is_written_as_figures_and_pictures(tmp_path: Path) -> None:
    truth = loops()
    folder = replay_folder(tmp_path / "replay", truth, noisy(truth, 0.1), noisy(truth, 0.5, 1))
    (tmp_path / "relations.txt").write_text(f"{START_NS // 10**9} {START_NS // 10**9 + 20}.5 1 2 0.1\n")
    evaluation = evaluate(folder, folder / "truth.tum", tmp_path / "relations.txt")
    write_evaluation(folder, evaluation)
    write_plots(folder, evaluation)
    figures = json.loads((folder / "evaluation.json").read_text())
    assert figures == evaluation.to_dict()
    assert figures["final"]["ate_rmse_m"] < figures["online"]["ate_rmse_m"]
    assert figures["final"]["relations"]["scored"] == 1
    assert [error["distance_m"] for error in figures["final"]["rpe"]] == [1.0, 10.0, 50.0]
    assert figures["closures"]["wifi"]["nees"] is None
    for name in ("evaluation_trajectory.png", "evaluation_error.png"):
        picture = (folder / name).read_bytes()
        assert picture.startswith(b"\x89PNG")
        assert len(picture) < 300_000
        assert min(struct.unpack(">II", picture[16:24])) > 300


def test_what_is_missing_or_broken_is_named(tmp_path: Path) -> None:
    truth = loops(100)
    with pytest.raises(TrajectoryError, match=r"nowhere\.tum"):
        evaluate(tmp_path, tmp_path / "nowhere.tum")
    write_tum(tmp_path / "truth.tum", truth.stamps_ns, truth.poses)
    with pytest.raises(TableError, match=r"closures\.csv"):
        evaluate(tmp_path, tmp_path / "truth.tum")
    write_tum(tmp_path / "one.tum", truth.stamps_ns[:1], truth.poses[:1])
    with pytest.raises(ScoringError, match=r"one\.tum"):
        evaluate(tmp_path, tmp_path / "one.tum")
    (tmp_path / "relations.txt").write_text("1 2 3\n")
    for name in ("relations.txt", "none.txt"):
        with pytest.raises(ScoringError, match=name):
            read_relations(tmp_path / name)
