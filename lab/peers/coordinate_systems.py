#!/usr/bin/env python3
"""Delivers one run at places around the Earth in national systems, and reads the files with laspy, rasterio and pyproj.

  python3 -m venv venv && venv/bin/pip install 'laspy[lazrs]' numpy pyproj==3.7.2 rasterio
  apt-get download proj-data && dpkg-deb -x proj-data_*.deb proj-data        # grids of datums, a geoid
  venv/bin/python lab/peers/coordinate_systems.py RUN proj-data/usr/share/proj

For each place, the origin of a copy of the run is moved there. The number of the system must be found in LAZ and GeoTIFF, and the path must
be where PROJ computes it from the positions in the SBET. Exit code 1 if a value differs by more than 1 mm.
"""
import argparse
import json
import pathlib
import subprocess
import sys
import tempfile
import warnings

import laspy
import numpy as np
import pyproj
import rasterio

# Latitude, longitude, system, geoid, grid of the datum.
CASES = [
    (46.951083, 7.438633, "EPSG:2056", None, None),
    (52.2297, 21.0122, "EPSG:2180", None, None),
    (50.85, 4.35, "EPSG:3812", None, None),
    (-36.85, 174.76, "EPSG:2193", None, None),
    (59.33, 18.06, "EPSG:3006", None, None),
    (35.68, 139.77, "EPSG:6677", None, None),
    (-33.86, 151.2, "EPSG:7856", None, None),
    (-22.9, -43.2, "EPSG:31983", None, None),
    (47.6, -122.33, "EPSG:26910", None, None),
    (85.0, 10.0, "EPSG:5041", None, None),
    (52.52, 13.4, "EPSG:25833+5773", "egm96_15.gtx", None),
    (48.78, 9.18, "EPSG:31467", None, "BETA2007.gsb"),
    (46.951083, 7.438633, "EPSG:21781", None, "CHENYX06_etrs.gsb"),
    (-41.29, 174.78, "EPSG:27213", None, "nzgd2kgrid0005.gsb"),
]


def moved(run, copy, latitude, longitude):
    """A copy of the run with its origin at a place; clouds are links."""
    for path in run.iterdir():
        (copy / path.name).symlink_to(path.resolve())
    georeference = json.loads((run / "georeference.json").read_text())
    georeference["origin"] = {"latitude_deg": latitude, "longitude_deg": longitude, "altitude_m": 400.0}
    (copy / "georeference.json").unlink()
    (copy / "georeference.json").write_text(json.dumps(georeference))


def expected(code, sbet, grids, grid):
    """Easting, northing and height by PROJ of latitude, longitude (rad) and height."""
    longitude, latitude, height = np.degrees(sbet[:, 2]), np.degrees(sbet[:, 1]), sbet[:, 3]
    number = int(code.removeprefix("EPSG:").split("+")[0])
    if grid is None:
        east, north = pyproj.Transformer.from_crs(4979, number, always_xy=True).transform(longitude, latitude, height)[:2]
    else:
        with warnings.catch_warnings():
            # The string lacks the datum, which the grid replaces.
            warnings.simplefilter("ignore")
            projection = pyproj.CRS.from_epsg(number).to_proj4().replace("+type=crs", "")
        pipeline = f"+proj=pipeline +step +proj=unitconvert +xy_in=deg +xy_out=rad +step +inv +proj=hgridshift +grids={grids / grid} +step {projection}"
        east, north = pyproj.Transformer.from_pipeline(pipeline).transform(longitude, latitude)
    return np.stack([east, north], 1)


def check(program, run, grids, case, folder):
    latitude, longitude, code, geoid, grid = case
    copy, out = folder / "run", folder / "out"
    copy.mkdir()
    moved(run, copy, latitude, longitude)
    options = [*(["--geoid", grids / geoid] if geoid else []), *(["--grid", grids / grid] if grid else [])]
    command = [program, "deliver", copy, "--out", out, "--crs", code, "--rasters", "--tile-m", "0", *options]
    said = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if said.returncode != 0:
        return None, said.stderr.strip().splitlines()[0]
    numbers = code.removeprefix("EPSG:").split("+")
    with laspy.open(out / "points.laz") as tile:
        crs = tile.header.parse_crs()
        points = tile.read()
    parts = crs.sub_crs_list if crs.is_compound else [crs.to_2d()]
    found = [str(part.to_epsg()) for part in parts]
    with rasterio.open(out / "terrain.tif") as image:
        raster = image.crs.to_epsg() or (pyproj.CRS.from_wkt(image.crs.to_wkt()).sub_crs_list or [None])[0]
        raster = raster if isinstance(raster, int) or raster is None else raster.to_epsg()
        inside = image.bounds.left <= points.x.min() and points.x.max() <= image.bounds.right
    sbet = np.fromfile(out / "trajectory.sbet", "<f8").reshape(-1, 17)
    path = np.loadtxt(out / "trajectory.txt")
    off = np.abs(path[:, 1:3] - expected(code, sbet, grids, grid)).max()
    is_right = found == numbers and raster == int(numbers[0]) and inside and off < 1e-3
    return is_right, f"{crs.name}: LAZ EPSG:{'+'.join(found)}, GeoTIFF EPSG:{raster}, path within {1e3 * off:.3f} mm of PROJ"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=pathlib.Path)
    parser.add_argument("grids", type=pathlib.Path)
    parser.add_argument("--program", default="target/release/replica")
    arguments = parser.parse_args()
    failed = 0
    for case in CASES:
        with tempfile.TemporaryDirectory() as folder:
            is_right, note = check(arguments.program, arguments.run, arguments.grids.resolve(), case, pathlib.Path(folder))
        failed += not is_right
        print(f"| {case[2]} | {'equal' if is_right else 'DIFFERS'} | {note} |")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
