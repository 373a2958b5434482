"""radio.rrd: a radio map in the viewer, over the grid map; one layer for each access point, to be switched on."""

import uuid
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from wayfi.backend.grid.occupancy_grid import OccupancyGrid
from wayfi.backend.pose2 import Floats
from wayfi.frontends.event_making import grid_event
from wayfi.frontends.radio.radio_map import AccessPoint, RadioMap
from wayfi.recordings.rerun.config import RerunConfig
from wayfi.recordings.rerun.stream import RerunStream, flip_y
from wayfi.recordings.rerun.style import HERE, screen_radius
from wayfi.recordings.rerun.views.grid import GridView

LEVELS_DBM = (-90.0, -40.0)  # of the colours, dark to light
KNOWN_M = 8.0  # a position with a larger sigma is not drawn
CORNERS = 49  # of an ellipse
OPAQUE = 190  # of 255: walls show through
_VIRIDIS = np.array([[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]])
COLOURS = np.column_stack([np.interp(np.linspace(0, 4, 64), np.arange(5), channel) for channel in _VIRIDIS.T])


def write_radio_log(path: Path, radio: RadioMap, grid: OccupancyGrid) -> None:
    """Write the radio map into the .rrd file at `path`. Raises LogError."""
    stream = RerunStream(str(uuid.uuid4()))
    config = RerunConfig()
    stream.open(config, path, serve=False, blueprint=_blueprint(radio))
    stream.log_static("/map", flip_y())
    view = GridView(stream, config)
    view.on_grid(grid_event(0, grid))
    view.draw_last()
    _log_levels(stream, "/map/coverage", radio, radio.best()[1])
    for ap in radio.access_points:
        _log_levels(stream, f"/map/levels/{_name(ap)}", radio, ap.level)
    _log_positions(stream, radio)
    stream.close()


def _log_levels(stream: RerunStream, path: str, radio: RadioMap, level: NDArray[np.float32]) -> None:
    """Log levels (n,) at the cells as an image; where nothing is told it is transparent."""
    image, cells = radio.cells.image(level), radio.cells
    low, high = LEVELS_DBM
    shade = np.clip((np.nan_to_num(image, nan=low) - low) / (high - low), 0.0, 1.0)
    pixels = np.empty((*image.shape, 4), np.uint8)
    pixels[..., :3] = COLOURS[np.rint(shade * (len(COLOURS) - 1)).astype(np.int64)]
    pixels[..., 3] = np.where(np.isnan(image), 0, OPAQUE)
    x, y = cells.origin_xy_m
    place = rr.Transform3D(translation=[x, y, 0.0], scale=[cells.cell_m, cells.cell_m, 1.0])
    stream.log_static(path, place, rr.Image(pixels, draw_order=-5.0))


def _log_positions(stream: RerunStream, radio: RadioMap) -> None:
    """Log the access points whose places are known, with an ellipse of one sigma."""
    known = [ap for ap in radio.access_points if ap.sigmas_m is not None and ap.sigmas_m[0] <= KNOWN_M]
    places = np.array([ap.xy for ap in known], np.float64).reshape(-1, 2)
    names = [ap.bssids[0] for ap in known]
    stream.log_static(
        "/map/access_points", rr.Points2D(places, labels=names, show_labels=False, colors=[HERE],
        radii=[screen_radius(5.0)], draw_order=10.0),
    )  # fmt: skip
    ellipses = [_ellipse(ap) for ap in known]
    style = rr.LineStrips2D(ellipses, colors=[HERE], radii=[screen_radius(1.0)], draw_order=9.0)
    stream.log_static("/map/access_points/sigma", style)


def _ellipse(ap: AccessPoint) -> Floats:
    """(k, 2) m along the ellipse of one sigma."""
    assert ap.xy is not None
    assert ap.covariance is not None
    angle = np.linspace(0.0, 2 * np.pi, CORNERS)
    circle = np.column_stack([np.cos(angle), np.sin(angle)])
    return np.asarray(ap.xy + circle @ np.linalg.cholesky(ap.covariance).T)


def _name(ap: AccessPoint) -> str:
    return ap.bssids[0].replace(":", "-")


def _blueprint(radio: RadioMap) -> rrb.Blueprint:
    hidden: dict[Any, Any] = {
        f"/map/levels/{_name(ap)}": rrb.EntityBehavior(visible=False) for ap in radio.access_points
    }
    view = rrb.Spatial2DView(origin="/", contents="/map/**", name="Coverage", overrides=hidden)
    return rrb.Blueprint(view, rrb.SelectionPanel(state="collapsed"), rrb.TimePanel(state="collapsed"))
