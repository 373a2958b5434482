"""GeoTIFF of levels in the map frame, metres, without a place on the globe: QGIS lays them over one another.

The tags are those of OGC GeoTIFF 1.1 (19-008r4): a raster in a coordinate system of the user.
"""

import io
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, TiffImagePlugin, TiffTags

from wayfi.frontends.radio.cells import Cells
from wayfi.recordings.files.atomic_files import write_bytes

PIXEL_SCALE, TIE_POINT, GEO_KEYS, GEO_TEXT, NO_DATA = 33550, 33922, 34735, 34737, 42113
DESCRIPTION = 270
CITATION = "wayfi map frame, metres|"
KEYS = (
    *(1, 1, 1, 4),  # version 1.1.1, four keys
    *(1024, 0, 1, 32767),  # GTModelType: of the user
    *(1025, 0, 1, 1),  # GTRasterType: a pixel is an area
    *(1026, GEO_TEXT, len(CITATION), 0),  # GTCitation
    *(3076, 0, 1, 9001),  # ProjLinearUnits: metres
)


def write_geotiff(path: Path, cells: Cells, values: NDArray[np.float32], description: str) -> None:
    """Write one band of float32, the (n,) `values` at `cells`, NaN where nothing is told. Raises OSError."""
    write_bytes(path, _geotiff(cells, values, description))


def _geotiff(cells: Cells, values: NDArray[np.float32], description: str) -> bytes:
    """A TIFF whose first row has the highest y."""
    x, y = cells.origin_xy_m
    top = y + cells.shape[0] * cells.cell_m
    tags = TiffImagePlugin.ImageFileDirectory_v2()
    for tag, kind, value in (
        (PIXEL_SCALE, TiffTags.DOUBLE, (cells.cell_m, cells.cell_m, 0.0)),
        (TIE_POINT, TiffTags.DOUBLE, (0.0, 0.0, 0.0, x, top, 0.0)),
        (GEO_KEYS, TiffTags.SHORT, KEYS),
        (GEO_TEXT, TiffTags.ASCII, CITATION),
        (NO_DATA, TiffTags.ASCII, "nan"),
        (DESCRIPTION, TiffTags.ASCII, description),
    ):
        tags.tagtype[tag] = kind
        tags[tag] = value
    packed = io.BytesIO()
    image = Image.fromarray(np.ascontiguousarray(cells.image(values)[::-1]))
    image.save(packed, "TIFF", tiffinfo=tags, compression="tiff_adobe_deflate")
    return packed.getvalue()
