"""WiFi: access points in and around the building, and the receivers on the robot.

RSSI (dBm) = power at 1 m - 10 n log10(distance) - a distance + shadowing(position) + fast fading + receiver's offset,
with the building's attenuation a in dB/m (Devasirvatham et al. 1990). Shadowing is a smooth random field for each site,
evaluated by random Fourier features (Rahimi and Recht 2007).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from wayfi.frontends.measurements import WifiScan

Floats = NDArray[np.float64]

DETECTION_LIMIT_DBM = -92.0
HEARD_FRACTION = 0.93
SHADOWING_DB = (4.0, 6.0)
SHADOWING_LENGTH_M = (4.0, 8.0)
FADING_DB = (2.0, 4.0)
FEATURES = 32
POWER_DBM = (-34.0, -26.0)
EXPONENT = (2.8, 3.6)
WALLS_DB = (2.0, 26.0)
BUILDING_DB_PER_M = (1.15, 1.85)
HALL_DB_PER_M = 0.1
CORRIDOR_DB_PER_M = (0.4, 0.7)
HOTSPOT_WALLS_DB = 8.0
HOTSPOT_STEP_M = 12.0
AGE_MEDIAN_S = 1.8
AGE_LOG_SIGMA = 0.9
AGE_MAX_S = 20.0
OFFSET_DIFFERENCE_DB = (2.0, 4.0)
PHONES = ("phone_a", "phone_b")
KNOT_S = 60.0
FREQUENCIES_MHZ = (2412, 2437, 2462, 5180, 5220, 5260, 5500, 5580)


@dataclass(frozen=True, slots=True)
class RadioPlan:
    """The number and places of sites; a site has one or more access points.

    `inside` is the building's x_min, y_min, x_max, y_max (m). Outside sites are up to `margin_m` around it and above
    it; `hotspots` are carried by people who walk inside; `corridor_xy` (m) are at the ceiling of a corridor.
    """

    inside: tuple[float, float, float, float]
    inside_sites: int
    margin_m: float
    outside_sites: int
    hotspots: int
    corridor_xy: tuple[tuple[float, float], ...] = ()

    @property
    def fixed(self) -> int:
        """The number of sites that do not move."""
        return self.inside_sites + self.outside_sites + len(self.corridor_xy)


@dataclass(frozen=True, slots=True, eq=False)
class Sites:
    """(s,) sites: `knots_xyz` (s, k, 3) m are their positions every `KNOT_S` seconds.

    `power_dbm` at 1 m, less the walls' attenuation; `exponent` n; `attenuation_db_per_m` a; shadowing of `shadow_db`
    from `waves` (s, f, 2) and `phases` (s, f).
    """

    knots_xyz: Floats
    power_dbm: Floats
    exponent: Floats
    attenuation_db_per_m: Floats
    shadow_db: Floats
    waves: Floats
    phases: Floats


@dataclass(frozen=True, slots=True, eq=False)
class RadioEnvironment:
    """All access points: (b,) BSSIDs, each with the index of its `site`, `fading_db`, SSID and frequency."""

    sites: Sites
    site: NDArray[np.int64]
    bssids: tuple[str, ...]
    ssids: tuple[str, ...]
    frequency_mhz: tuple[int, ...]
    fading_db: Floats


def draw_radio(plan: RadioPlan, duration_s: float, rng: np.random.Generator) -> RadioEnvironment:
    """Random sites according to `plan`, with their BSSIDs, for a drive of `duration_s`."""
    sites = _draw_sites(plan, duration_s, rng)
    networks = np.r_[rng.integers(1, 5, plan.fixed), np.ones(plan.hotspots, int)]
    site = np.repeat(np.arange(len(networks)), networks)
    bssids = _addresses(networks, rng)
    names = np.r_[np.repeat("net", plan.fixed), np.repeat("phone", plan.hotspots)]
    return RadioEnvironment(
        sites,
        site,
        bssids,
        tuple(f"{names[s]}-{s}" for s in site),
        tuple(int(f) for f in rng.choice(FREQUENCIES_MHZ, len(site))),
        rng.uniform(*FADING_DB, len(site)),
    )


def _draw_sites(plan: RadioPlan, duration_s: float, rng: np.random.Generator) -> Sites:
    count = plan.fixed + plan.hotspots
    length = rng.uniform(*SHADOWING_LENGTH_M, count)
    walls_db = np.r_[
        np.zeros(plan.inside_sites),
        rng.uniform(*WALLS_DB, plan.outside_sites),
        np.zeros(len(plan.corridor_xy)),
        np.full(plan.hotspots, HOTSPOT_WALLS_DB),
    ]
    return Sites(
        _knots(plan, duration_s, rng),
        rng.uniform(*POWER_DBM, count) - walls_db,
        rng.uniform(*EXPONENT, count),
        _attenuation_db_per_m(plan, rng),
        rng.uniform(*SHADOWING_DB, count),
        rng.standard_normal((count, FEATURES, 2)) / length[:, None, None],
        rng.uniform(0.0, 2 * np.pi, (count, FEATURES)),
    )


def _attenuation_db_per_m(plan: RadioPlan, rng: np.random.Generator) -> Floats:
    """(s,) attenuation in dB/m, in addition to the path loss."""
    inside, hotspots = (np.full(count, HALL_DB_PER_M) for count in (plan.inside_sites, plan.hotspots))
    outside = rng.uniform(*BUILDING_DB_PER_M, plan.outside_sites)
    return np.concatenate([inside, outside, rng.uniform(*CORRIDOR_DB_PER_M, len(plan.corridor_xy)), hotspots])


def _knots(plan: RadioPlan, duration_s: float, rng: np.random.Generator) -> Floats:
    """(s, k, 3) positions: sites inside, outside, in corridors, then hotspots, which walk from knot to knot."""
    count = int(duration_s // KNOT_S) + 2
    low, high = np.array(plan.inside[:2]), np.array(plan.inside[2:])
    inside = rng.uniform(low, high, (plan.inside_sites, 2))
    outside = rng.uniform(low - plan.margin_m, high + plan.margin_m, (plan.outside_sites, 2))
    corridor = np.reshape(plan.corridor_xy, (-1, 2))
    xy = np.vstack([inside, outside, corridor])
    height = np.r_[np.full(len(inside), 2.5), rng.uniform(3.0, 12.0, len(outside)), np.full(len(corridor), 2.5)]
    fixed = np.repeat(np.column_stack([xy, height])[:, None], count, axis=1)
    steps = rng.normal(0.0, HOTSPOT_STEP_M, (plan.hotspots, count, 2))
    walks = rng.uniform(low, high, (plan.hotspots, 1, 2)) + steps.cumsum(axis=1)
    return np.vstack([fixed, np.dstack([walks, np.ones(walks.shape[:2])])])


def _addresses(networks: NDArray[np.int64], rng: np.random.Generator) -> tuple[str, ...]:
    """A BSSID for each network. Those of a site differ in the last octet and, for about half, in the local bit."""
    addresses = []
    for index, count in enumerate(networks):
        vendor = rng.integers(0, 256, 3) & [0xFC, 0xFF, 0xFF]
        for k in range(count):
            first = int(vendor[0]) | (0x02 if rng.random() < 0.5 else 0x00)
            octets = (first, int(vendor[1]), int(vendor[2]), index >> 8, index & 0xFF, k)
            addresses.append(":".join(f"{octet:02x}" for octet in octets))
    return tuple(addresses)


@dataclass(frozen=True, slots=True)
class SimulatedReceiver:
    """A WiFi receiver: its name, and the offset (dB) of its readings."""

    name: str
    offset_db: float


def draw_receivers(rng: np.random.Generator) -> tuple[SimulatedReceiver, ...]:
    """The receivers on the robot, two phones with opposite offsets."""
    apart_db = rng.choice([-1.0, 1.0]) * rng.uniform(*OFFSET_DIFFERENCE_DB)
    offsets = np.array([-0.5, 0.5]) * apart_db
    return tuple(SimulatedReceiver(name, float(offset)) for name, offset in zip(PHONES, offsets, strict=True))


def wifi_scan(
    environment: RadioEnvironment,
    receiver: SimulatedReceiver,
    stamp_ns: int,
    time_s: float,
    poses: Callable[[Floats], Floats],
    rng: np.random.Generator,
) -> WifiScan:
    """The scan that `receiver` completes at `stamp_ns`, `time_s` from the start of the drive.

    `poses` gives the true poses (m, 3) at times (m,) s from the start.
    """
    count = len(environment.bssids)
    age_s = np.minimum(AGE_MEDIAN_S * np.exp(AGE_LOG_SIGMA * rng.standard_normal(count)), AGE_MAX_S)
    age_s = np.asarray(np.round(np.minimum(age_s, time_s), 3), np.float64)
    detected = rng.random(count) < HEARD_FRACTION
    fading = rng.standard_normal(count) * environment.fading_db
    measured_s = time_s - age_s
    xy = poses(measured_s)[:, :2]
    rssi = _mean_rssi(environment, xy, measured_s) + fading + receiver.offset_db
    rssi = np.round(rssi + shadowing(environment, xy, rssi))
    heard = np.flatnonzero(detected & (rssi >= DETECTION_LIMIT_DBM))
    return WifiScan(
        stamp_ns,
        receiver.name,
        tuple(environment.bssids[i] for i in heard),
        rssi[heard].astype(np.float32),
        age_s[heard].astype(np.float32),
        tuple(environment.ssids[i] for i in heard),
        tuple(environment.frequency_mhz[i] for i in heard),
    )


def _mean_rssi(environment: RadioEnvironment, xy: Floats, time_s: Floats) -> Floats:
    """(b,) RSSI (dBm) of each BSSID at `xy` (b, 2) and `time_s` (b,), without shadowing and fading."""
    sites, knots = environment.sites, environment.sites.knots_xyz
    knot, fraction = np.divmod(time_s / KNOT_S, 1.0)
    before, after = (knots[environment.site, np.minimum(knot.astype(int) + k, knots.shape[1] - 1)] for k in range(2))
    place = before + fraction[:, None] * (after - before)
    distance = np.hypot(np.hypot(*(place[:, :2] - xy).T), place[:, 2])
    loss = 10 * sites.exponent[environment.site] * np.log10(np.maximum(distance, 1.0))
    loss += sites.attenuation_db_per_m[environment.site] * distance
    mean: Floats = sites.power_dbm[environment.site] - loss
    return mean


def shadowing(environment: RadioEnvironment, xy: Floats, rssi: Floats) -> Floats:
    """(b,) shadowing (dB) of each BSSID at `xy` (b, 2); 0 if `rssi` is too low to be detected with any shadowing."""
    near = np.flatnonzero(rssi > DETECTION_LIMIT_DBM - 3 * SHADOWING_DB[1])
    site = environment.site[near]
    angles = np.einsum("bfk,bk->bf", environment.sites.waves[site], xy[near]) + environment.sites.phases[site]
    shadow = np.zeros(len(rssi))
    shadow[near] = environment.sites.shadow_db[site] * np.sqrt(2.0 / FEATURES) * np.cos(angles).sum(axis=1)
    return shadow
