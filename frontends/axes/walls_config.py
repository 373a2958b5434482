"""The settings of the headings that walls tell."""

from dataclasses import dataclass

from wayfi.backend.options import option


@dataclass(frozen=True)
class WallsConfig:
    """When the walls that scans see tell the axes of the building, and how well."""

    enabled: bool = option(True, "", "off in a building that is neither straight nor at right angles")
    sample_m: float = option(3.0, "m", "of path to one sample: over it a laser sees other walls, and turns by 2 mrad")
    min_share: float = option(0.35, "", "of a scan's normals within 0.05 rad of the axes: furniture has 0.1")
    min_points: int = option(30, "", "that these are at least: fewer were off by 16 mrad in a castle, others by 7")
    sigma_rad: float = option(
        0.008, "rad", "of a sample at first, then learnt: .5 to 2.4 mrad in simulation, 3 to 9 in real buildings"
    )
    sigma_samples: int = option(3, "samples", "of that sigma which are imagined")
    least_sigma_rad: float = option(0.002, "rad", "that is learnt at best")
    together: float = option(2.25, "samples", "that err alike, for they see some of the same walls: 1.4 to 3.6")
    samples_alike: int = option(4, "samples", "that begin a wing: 12 m of path, over which a round wall turns")
