#!/usr/bin/env python3
"""Opens the output of `replica instances --geojson` with GDAL, and checks the values that it reads.

  pip install geopandas pyogrio
  replica instances OUT --geojson > instances.geojson && lab/peers/geojson.py instances.geojson
"""
import sys

import geopandas
import pyogrio

path = sys.argv[1]
info = pyogrio.read_info(path)
boxes = geopandas.read_file(path, engine="pyogrio")
in_metres = boxes.to_crs(boxes.estimate_utm_crs())
# UTM shrinks lengths by up to 0.04 %; corners are written to 1e-8 degrees, about 1 mm.
sides = boxes[["length_m", "width_m"]]
off = (in_metres.area - sides.prod(axis=1)).abs() / sides.sum(axis=1)
print(f"GDAL {'.'.join(map(str, pyogrio.__gdal_version__))}: {len(boxes)} features of type {info['geometry_type']} in {info['crs']}; "
      f"areas agree with their boxes to {1e3 * off.max():.1f} mm of an edge")
assert len(boxes) == info["features"] > 0
assert info["driver"] == "GeoJSON" and info["geometry_type"] == "Polygon Z"
assert boxes.crs.to_epsg() in (4326, 4979), "WGS84"
assert boxes.is_valid.all() and boxes.geometry.has_z.all()
assert boxes.geometry.exterior.is_ccw.all(), "RFC 7946, section 3.1.6"
assert boxes.id.is_unique and {"class", "points", "height_m"} <= set(boxes.columns)
assert off.max() < 0.01
