"""What other methods reached on the same recordings: ATE RMSE in m, final / online, unless a cell says otherwise.

GMapping has 30 particles; Karto is the core of slam_toolbox; Cartographer is the 2D one. None of them can use WiFi. Of
simulated drives they had one seed of their own.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from figures import median_title


@dataclass(frozen=True, slots=True)
class Peers:
    """The figures of other methods on one recording, as the cells of a table; empty where there is none."""

    gmapping: str = ""
    karto: str = ""
    cartographer: str = ""
    others: str = ""


COLUMNS = ["recording", "wayfi", "wheels alone", "GMapping", "Karto", "Cartographer", "others"]
BATCH = "batch study"  # wheels and WiFi, one set of defaults for all; it may use the whole drive at once
SIMULATED = "(other simulator)"
PEERS = {
    "b14test1": Peers(others=f"{BATCH} .25; Ismail et al. as written 7.2"),
    "b24test2": Peers(others=f"{BATCH} .38; Ismail et al. as written 9.4"),
    "b3test2": Peers(others=f"{BATCH} .75; Ismail et al. as written 9.3"),
    "ilc_site1F1": Peers(),
    "flat_calib3": Peers(gmapping=".65", karto="1.0", others="causal study 1.7"),
    "intel": Peers(gmapping=".13 (it made the reference)", karto=".16", cartographer="15.1"),
    "intel_wifi (its WiFi is simulated)": Peers(others="causal study .09 / .25; Ismail et al. as written 10.6"),
    "killian_part (its wheels and WiFi are simulated)": Peers(karto="2.8 / 3.5 (all 1.9 km)"),
    "fr079_raw": Peers(others="relations .045 to .061"),
    "fr101": Peers(),
    "belgioioso": Peers(),
    "seattle": Peers(),
    median_title(f"garage --rough {SIMULATED}"): Peers(gmapping=".18 / 1.12"),
    median_title(f"office --rough {SIMULATED}"): Peers(cartographer=".98 / 1.6"),
    median_title(f"warehouse --rough {SIMULATED}"): Peers(gmapping=".16 / .27"),
    median_title(f"garage, ideal laser {SIMULATED}"): Peers(gmapping=".34 / .41"),
    median_title(f"garage without laser {SIMULATED}"): Peers(others=f"{BATCH} .6 to 1.5"),
    median_title(f"office without laser {SIMULATED}"): Peers(others=f"{BATCH} .6 to 1.5"),
}


def beside(newest: Mapping[str, Mapping[str, str]]) -> list[list[str]]:
    """The rows of the table: `newest` figures of ours, by recording and column, and those of the others."""
    rows = []
    for name, peers in PEERS.items():
        ours = newest.get(name)
        if ours is None:
            continue
        ate = f"{ours['final ATE, m']} / {ours['online ATE, m']}" if ours["final ATE, m"] else ""
        relations = ours["relations, all / on scans, m"].split(" / ")[0]
        figure = "; ".join(part for part in (ate, f"relations {relations}" if relations else "") if part)
        rows.append(
            [name, figure, ours["wheels ATE, m"], peers.gmapping, peers.karto, peers.cartographer, peers.others]
        )
    return rows
