"""The files of a radio map: tables, GeoTIFF, and a picture over the grid map."""
