"""The readings of a WiFi scan: what is usable of them, and their mean over scans."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from wayfi.frontends.events import DropReason
from wayfi.frontends.measurements import WifiScan
from wayfi.frontends.wifi.readings import BSSID, bssid_of, mean_readings, usable_readings


def bssid(number: int) -> str:
    return f"02:00:00:00:00:{number:02x}"


def scan(bssids: list[str], rssi: list[float], age_s: list[float] | None = None) -> WifiScan:
    ages = np.array(age_s or [0.0] * len(rssi), np.float32)
    return WifiScan(0, "phone", tuple(bssids), np.array(rssi, np.float32), ages)


@pytest.mark.parametrize(
    "bad", ["", "aa:bb:cc:dd:ee", "AA:BB:CC:DD:EE:FF", "aa-bb-cc-dd-ee-ff", "aa:bb:cc:dd:ee:ff:00", "the office"]
)
def test_what_is_no_bssid_is_dropped(bad: str) -> None:
    usable, dropped = usable_readings(scan([bad, bssid(1)], [-50.0, -60.0]))
    assert usable.bssids == (bssid(1),)
    assert dropped == [DropReason.MALFORMED_BSSID]


@pytest.mark.parametrize(
    "form",
    [
        *("0a:1b:2c:3d:4e:5f", "0A-1B-2C-3D-4E-5F", "0a1b.2c3d.4e5f", "0A1B2C3D4E5F", "a:1b:2c:3d:4e:5f"),
        *("  0a:1b:2c:3d:4e:5f ", "0A:1B:2C:3D:4E:5F\t", "0a1b2c-3d4e5f", "0a:1b:2c:3d:4e:5f\0"),
    ],
)
def test_a_bssid_is_known_in_the_forms_that_systems_print(form: str) -> None:
    assert bssid_of(form) == "0a:1b:2c:3d:4e:5f"


@given(st.integers(0, 2**48 - 1))
def test_every_form_of_an_address_is_the_same_bssid(address: int) -> None:
    digits = f"{address:012x}"
    octets = [digits[i : i + 2] for i in range(0, 12, 2)]
    quads = [digits[i : i + 4] for i in range(0, 12, 4)]
    short = [octet.lstrip("0") or "0" for octet in octets]
    forms = [digits, ".".join(quads), *(mark.join(o) for mark in ":-" for o in (octets, short))]
    assert {bssid_of(case) for form in forms for case in (form, form.upper())} == {":".join(octets)}


@given(st.text(st.sampled_from("0123456789abcdefg:-. "), max_size=20))
def test_what_is_made_of_any_text_is_made_once(text: str) -> None:
    assert bssid_of(bssid_of(text)) == bssid_of(text)


@pytest.mark.parametrize("other", ["", "aa:bb:cc:dd:ee", "the office", "aa:bb-cc:dd-ee:ff", "::::: ", "0a1b2c3d4e5"])
def test_another_form_stays_and_is_no_bssid(other: str) -> None:
    assert bssid_of(other) == other.strip()
    assert not BSSID.fullmatch(bssid_of(other))


@pytest.mark.parametrize("absurd", [0.1, 7.0, -120.1, math.nan, math.inf, -math.inf])
def test_an_absurd_rssi_is_dropped(absurd: float) -> None:
    usable, dropped = usable_readings(scan([bssid(0), bssid(1)], [absurd, -60.0]))
    assert usable.bssids == (bssid(1),)
    assert dropped == [DropReason.ABSURD_RSSI]


def test_the_ends_of_the_range_are_in_it() -> None:
    _, dropped = usable_readings(scan([bssid(0), bssid(1)], [0.0, -120.0]))
    assert dropped == []


def test_of_a_repeated_bssid_the_strongest_reading_stays_with_its_age() -> None:
    usable, dropped = usable_readings(scan([bssid(0)] * 3, [-70.0, -50.0, -60.0], [1.0, 2.0, 3.0]))
    assert usable.bssids == (bssid(0),)
    assert usable.rssi.tolist() == [-50.0]
    assert usable.age_s.tolist() == [2.0]
    assert dropped == []


def test_an_age_that_cannot_be_is_one_that_is_not_known() -> None:
    usable, _ = usable_readings(scan([bssid(n) for n in range(5)], [-50.0] * 5, [-1.0, math.nan, math.inf, 5.0, 1e6]))
    assert usable.age_s.tolist() == [0.0, 0.0, 0.0, 5.0, 1e6]


def test_a_scan_without_readings_is_empty() -> None:
    usable, _ = usable_readings(scan([], []))
    assert usable.bssids == ()
    assert usable.rssi.shape == usable.age_s.shape == (0,)


def test_the_mean_of_scans_leaves_out_what_few_of_them_heard() -> None:
    scans = [scan([bssid(0), bssid(1)], [-50.0, -70.0]), scan([bssid(0)], [-60.0])]
    readings = [usable_readings(one)[0] for one in scans]
    assert mean_readings(readings, 2).bssids == (bssid(0),)
    both = mean_readings(readings, 1)
    assert dict(zip(both.bssids, both.rssi.tolist(), strict=True)) == {bssid(0): -55.0, bssid(1): -70.0}
