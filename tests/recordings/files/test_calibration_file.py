"""calibration.toml: what one drive has learnt, the next one takes up to the bit."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from wayfi.backend.graph.wheel_calibration import NAMES, WheelCalibration
from wayfi.frontends.calibration import Calibration
from wayfi.frontends.wifi.receivers import ReceiverOffset
from wayfi.recordings.files.calibration_file import (
    CalibrationError,
    calibration_toml,
    parse_calibration,
    read_calibration,
    write_calibration,
)

VALUES = st.lists(st.floats(-0.99, 1e3), min_size=4, max_size=4)
SIGMAS = st.lists(st.floats(1e-12, 1e3), min_size=4, max_size=4)
GOOD = calibration_toml(
    Calibration(
        WheelCalibration(np.array([0.01, -0.02, 0.026, 0.0]), np.array([0.1, 0.2, 0.3, 0.4])),
        {"phone": ReceiverOffset(-1.5, 0.5)},
    )
)


RECEIVERS = st.dictionaries(
    st.text(st.characters(codec="utf-8", exclude_categories=["Cs"])),
    st.builds(ReceiverOffset, st.floats(-20, 20), st.floats(0, 10)),
)


@settings(deadline=None)
@given(VALUES, SIGMAS, RECEIVERS)
def test_a_calibration_comes_back_to_the_bit(
    values: list[float], sigmas: list[float], receivers: dict[str, ReceiverOffset]
) -> None:
    wheels = WheelCalibration(np.array(values), np.array(sigmas))
    found = parse_calibration(calibration_toml(Calibration(wheels, receivers)), "here")
    np.testing.assert_array_equal(found.wheels.values, wheels.values)
    np.testing.assert_array_equal(found.wheels.sigmas, wheels.sigmas)
    assert list(found.receivers.items()) == list(receivers.items()), "in their order: the first is the reference"


def test_the_file_holds_each_name_with_value_and_sigma(tmp_path: Path) -> None:
    path = tmp_path / "calibration.toml"
    path.write_text(GOOD)
    content = tomllib.loads(path.read_text())
    assert tuple(content["wheels"]) == NAMES
    assert content["wheels"]["turn_bias_rad_per_m"] == {"value": 0.026, "sigma": 0.3}
    assert content["receivers"] == {"phone": {"offset_db": -1.5, "sigma_db": 0.5}}
    again = tmp_path / "again.toml"
    write_calibration(again, read_calibration(path))
    assert again.read_text() == GOOD


def test_a_file_without_receivers_is_a_calibration_of_the_wheels() -> None:
    assert parse_calibration(GOOD[: GOOD.index("[receivers]")], "here").receivers == {}


@pytest.mark.parametrize(
    "text",
    [
        "",
        "wheels = 3",
        "[wheels]",
        "[wheels",
        GOOD.replace("turn_scale", "turning"),
        GOOD.replace("0.026", "nan"),
        GOOD.replace("value = 0.01", "value = -1.0"),
        GOOD.replace("0.026", "'much'"),
        GOOD.replace("sigma = 0.2", "sigma = 0.0"),
        GOOD.replace("sigma = 0.2", "sigma = -1.0"),
        GOOD.replace("sigma = 0.2", "spread = 0.2"),
        GOOD.replace("-1.5", "inf"),
        GOOD.replace("sigma_db = 0.5", "sigma_db = -0.5"),
        GOOD.replace("sigma_db", "spread"),
        "receivers = 3\n" + GOOD[: GOOD.index("[receivers]")],
    ],
)
def test_what_is_no_calibration_is_refused_in_one_line_that_names_the_file(tmp_path: Path, text: str) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(CalibrationError, match=r"mine\.toml") as refused:
        read_calibration(path)
    assert "\n" not in str(refused.value)


def test_a_file_that_is_no_text_is_refused(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_bytes(b"\xff\xfe[wheels]")
    with pytest.raises(CalibrationError, match=r"mine\.toml"):
        read_calibration(tmp_path / "mine.toml")


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    with pytest.raises(CalibrationError, match=r"none\.toml: cannot be read"):
        read_calibration(tmp_path / "none.toml")
