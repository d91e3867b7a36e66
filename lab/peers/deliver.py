#!/usr/bin/env python3
"""Reads the files of `replica deliver` with third-party programs, and compares them with the clouds of the run by value.

  python3 -m venv venv && venv/bin/pip install 'laspy[lazrs]' numpy pyproj plyfile geopandas pyogrio evo==1.38.1 rasterio rio-cogeo open3d 'pystac[validation]'
  replica deliver RUN --out OUT --copc --rasters --lines --cloudcompare --semantic-kitti --bands
  venv/bin/python lab/peers/deliver.py RUN OUT

laspy with lazrs (LAZ, COPC), pyproj (systems, coordinates), plyfile (PLY), GDAL by pyogrio
(GeoJSON) and by rasterio with rio-cogeo (GeoTIFF), evo (TUM, KITTI), Open3D (PLY), CloudCompare
(PLY; Debian's package, if it is installed). SBET and SemanticKITTI are read as their readers do,
by numpy. Exit code 1 if a value differs.
"""
import argparse, json, os, pathlib, re, shutil, subprocess, sys, tempfile, time

import geopandas
import laspy
import numpy as np
import open3d
import plyfile
import pyproj
import pystac
import rasterio
import rio_cogeo
from evo.tools import file_interface
from laspy.copc import Bounds, CopcReader

FAILED = []
# docs/reference/deliverables.md
ASPRS = {0: 1, 1: 6, 3: 1, 6: 11, 7: 11, 8: 2, 9: 5, 13: 18, 14: 2, 15: 17, 16: 10, 21: 9, 22: 2}


def row(reader, what, is_right, note=""):
    print(f"| {reader} | {what} | {'equal' if is_right else 'DIFFERS'} | {note} |")
    if not is_right:
        FAILED.append(what)


class Run:
    """Clouds and path as the run wrote them."""

    def __init__(self, folder):
        index = json.loads((folder / "clouds/index.json").read_text())
        self.clouds = [plyfile.PlyData.read(folder / cloud["file"])["vertex"].data for cloud in index["clouds"]]
        self.points = np.concatenate(self.clouds)
        self.spectra = []
        first = 0
        for cloud, rows in zip(index["clouds"], self.clouds):
            if cloud["spectra"]:
                spectra = plyfile.PlyData.read(folder / cloud["spectra"]["file"])["vertex"].data
                self.spectra.append((first + spectra["point_idx"], spectra))
            first += len(rows)
        self.georeference = json.loads((folder / "georeference.json").read_text())
        self.path = file_interface.read_tum_trajectory_file(folder / "trajectory.txt")

    def geodetic(self, xyz):
        """Longitude, latitude, height of local coordinates, by PROJ."""
        origin = self.georeference["origin"]
        lon, lat, h = origin["longitude_deg"], origin["latitude_deg"], origin["altitude_m"]
        pipeline = pyproj.Transformer.from_pipeline(
            f"+proj=pipeline +step +inv +proj=topocentric +lon_0={lon} +lat_0={lat} +h_0={h} +ellps=WGS84 "
            "+step +inv +proj=cart +ellps=WGS84 +step +proj=unitconvert +xy_in=rad +xy_out=deg")
        return np.stack(pipeline.transform(*np.asarray(xyz, float).T), axis=1)

    def xyz(self, rows):
        return np.stack([rows[name].astype(float) for name in "xyz"], axis=1)


def gps_time(unix_s):
    """Adjusted standard GPS time; 18 leap seconds since 2017."""
    return unix_s - 315964800 + 18 - 1e9


def projected(run, xyz, epsg):
    lon_lat_h = run.geodetic(xyz)
    transformer = pyproj.Transformer.from_crs(4979, epsg, always_xy=True)
    return np.stack(transformer.transform(*lon_lat_h.T), axis=1)


def points(run, out, facts):
    """All LAZ tiles against the clouds."""
    tiles = sorted(out.glob("[0-9c]*_*.laz"))
    read = [laspy.read(tile) for tile in tiles]
    header = read[0].header
    crs = header.parse_crs()
    horizontal = crs.sub_crs_list[0] if crs.is_compound else crs.to_2d()
    row("laspy, pyproj", "system of the tiles", horizontal.to_epsg(min_confidence=20) == facts["epsg"], crs.name)
    row("laspy", "adjusted GPS time, WKT", header.global_encoding.gps_time_type == laspy.header.GpsTimeType.STANDARD
        and header.global_encoding.wkt, f"LAS {header.version}, format {header.point_format.id}")
    inside = all((np.floor(np.asarray(tile.xyz[:, :2]) / 50 + 1e-9) == np.array(re.findall(r"-?\d+", path.stem), float) / 50).all()
                 for tile, path in zip(read, tiles))
    row("laspy", "points lie in their tiles", inside, f"{len(tiles)} tiles")
    columns = {name: np.concatenate([np.asarray(tile[name]) for tile in read]) for name in
               ["x", "y", "z", "gps_time", "intensity", "classification", "class_id", "score", "laser", "moving", "camera", "instance", "frame",
                "red", "green", "blue", "return_number", "number_of_returns"]}
    expected = run.points
    row("laspy", "number of points", len(columns["x"]) == len(expected), f"{len(expected)}")
    # Laser and time identify a point of one LiDAR.
    order = np.lexsort([columns["laser"], columns["gps_time"]])
    expected, columns = expected[np.lexsort([expected["ring"], gps_time(expected["timestamp"])])], {k: v[order] for k, v in columns.items()}
    where = projected(run, run.xyz(expected), facts["epsg"])
    off = np.abs(where - np.stack([columns[name] for name in "xyz"], axis=1)).max()
    row("laspy, pyproj", "coordinates", off < 0.00062, f"largest difference {1e3 * off:.2f} mm")
    row("laspy", "GPS time", np.abs(columns["gps_time"] - gps_time(expected["timestamp"])).max() < 1e-6)
    row("laspy", "colors of 16 bits", all((columns[name] == expected[name].astype(int) * 256).all() for name in ["red", "green", "blue"]))
    row("laspy", "intensity of 16 bits", (columns["intensity"] == expected["intensity"].astype(int) * 257).all())
    table = np.array([ASPRS.get(i, 64 + i) for i in range(23)])
    row("laspy", "classes of the ASPRS", (columns["classification"] == table[expected["semantic"]]).all(),
        f"{len(np.unique(columns['classification']))} classes")
    names = dict([("class_id", "semantic"), ("laser", "ring"), ("moving", "dynamic"), ("camera", "camera"), ("instance", "instance"),
                  ("frame", "index_frame")])
    row("laspy", "extra bytes", all((columns[a] == expected[b]).all() for a, b in names.items())
        and np.abs(columns["score"] - expected["score"]).max() < 1e-6, ", ".join([*names, "score"]))
    row("laspy", "return 1 of 1", (columns["return_number"] == 1).all() and (columns["number_of_returns"] == 1).all())
    bands = [name for name in read[0].point_format.dimension_names if name.startswith("band_")]
    if bands and run.spectra:
        band = bands[len(bands) // 2]
        found = np.concatenate([np.asarray(tile[band]) for tile in read])[order]
        wanted = np.full(len(run.points), np.nan)
        for index, spectra in run.spectra:
            wanted[index] = spectra[band]
        wanted = wanted[np.lexsort([run.points["ring"], gps_time(run.points["timestamp"])])]
        seen = ~np.isnan(wanted)
        no_data = np.isnan(found)
        row("laspy", f"{len(bands)} bands, {band}", (no_data == ~seen).all() and np.abs(found - wanted)[seen].max() < 5.1e-5,
            f"{seen.sum()} points measured")
    return read


def copc(out, tiles):
    began = time.process_time()
    with CopcReader.open(out / "points.copc.laz") as reader:
        everything = reader.query()
        seconds = time.process_time() - began
        info, header = reader.copc_info, reader.header
        levels = [len(reader.query(level=level)) for level in range(20)]
        low = np.asarray(info.center) - info.halfsize
        inside = (np.stack([everything.x, everything.y, everything.z], 1) - low >= -1e-6).all()
        middle = np.round((np.asarray(header.mins) + np.asarray(header.maxs)) / 2, 2)
        box = reader.query(bounds=Bounds(mins=middle[:2] - 15, maxs=middle[:2] + 15))
    same = np.sort(np.concatenate([tile.points.array for tile in tiles]))
    row("laspy CopcReader", "all records equal the records of the tiles", (np.sort(everything.array) == same).all() and inside,
        f"{len([n for n in levels if n])} levels, read in {seconds:.1f} s of CPU")
    xy = np.stack([everything.x, everything.y], 1)
    n_box = (np.abs(xy - middle[:2]) <= 15 + 1e-6).all(axis=1).sum()
    row("laspy CopcReader", "query of a box", len(box) == n_box and sum(levels) == len(everything), f"{len(box)} points, {n_box} expected")


def path(run, out, facts):
    expected = projected(run, run.path.positions_xyz, facts["epsg"])
    tum = file_interface.read_tum_trajectory_file(out / "trajectory.txt")
    kitti = file_interface.read_kitti_poses_file(out / "trajectory_kitti.txt")
    off = np.abs(tum.positions_xyz - expected).max()
    row("evo, pyproj", "TUM", off < 1e-3 and np.abs(tum.timestamps - run.path.timestamps).max() < 1e-6, f"{1e3 * off:.2f} mm")
    row("evo", "KITTI", np.abs(np.array(kitti.poses_se3) - np.array(tum.poses_se3)).max() < 1e-6, f"{kitti.num_poses} poses")
    # Rotations against grid north and against true north differ by the convergence, clockwise positive.
    turned = [np.arctan2(b[1, 0], b[0, 0]) - np.arctan2(a[1, 0], a[0, 0]) for a, b in zip(run.path.poses_se3, tum.poses_se3)]
    turn = np.degrees(np.mean(np.angle(np.exp(1j * np.array(turned)))))
    # The north of the path is the north at the origin.
    origin = run.georeference["origin"]
    convergence = pyproj.Proj(facts["epsg"]).get_factors(origin["longitude_deg"], origin["latitude_deg"]).meridian_convergence
    row("evo, pyproj", "heading against grid north", abs(turn - convergence) < 1e-3, f"{turn:.4f}, PROJ {convergence:.4f} degrees")
    sbet = np.fromfile(out / "trajectory.sbet", "<f8").reshape(-1, 17)
    lon_lat_h = run.geodetic(run.path.positions_xyz)
    week = (run.path.timestamps - 315964800 + 18) % 604800
    headings = np.array([np.arctan2(pose[0, 0], pose[1, 0]) for pose in run.path.poses_se3])
    row("numpy, pyproj", "SBET", np.abs(np.degrees(sbet[:, 2]) - lon_lat_h[:, 0]).max() < 1e-8
        and np.abs(np.degrees(sbet[:, 1]) - lon_lat_h[:, 1]).max() < 1e-8 and np.abs(sbet[:, 3] - lon_lat_h[:, 2]).max() < 1e-3
        and np.abs(sbet[:, 0] - week).max() < 1e-5
        and np.degrees(np.abs(np.angle(np.exp(1j * (sbet[:, 9] - headings)))).max()) < 0.01, "time, position, heading")
    line = geopandas.read_file(out / "trajectory.geojson", engine="pyogrio")
    found = np.array(line.geometry[0].coords)
    row("GDAL", "path as GeoJSON", line.crs.to_epsg() in (4326, 4979) and np.abs(found[:, :2] - lon_lat_h[:, :2]).max() < 1e-8)


def objects(out, facts):
    boxes = geopandas.read_file(out / "objects.geojson", engine="pyogrio")
    table = geopandas.pd.read_csv(out / "objects.csv")
    centers = boxes.to_crs(facts["epsg"]).geometry.centroid
    off = np.hypot(centers.x - table["x_m"], centers.y - table["y_m"]).max()
    row("GDAL, pandas", "objects", (boxes["id"] == table["id"]).all() and (boxes["class"] == table["class"]).all() and off < 0.01,
        f"{len(boxes)} boxes, centers within {1e3 * off:.0f} mm")


def rasters(run, out, facts, tiles):
    points = np.concatenate([np.stack([np.asarray(tile[name]) for name in ["x", "y", "z", "class_id", "moving", "camera"]], 1) for tile in tiles])
    rgb = np.concatenate([np.stack([np.asarray(tile[name]) // 256 for name in ["red", "green", "blue"]], 1) for tile in tiles])
    still = points[:, 4] == 0
    points, rgb = points[still], rgb[still]
    images = {}
    names = ["height", "terrain", "class", "color", "terrain_source", "density", "orthophoto", "orthophoto_source"]
    for name in names:
        path = out / f"{name}.tif"
        is_valid, errors, _ = rio_cogeo.cog_validate(path)
        with rasterio.open(path) as image:
            images[name], transform = image.read(), image.transform
            row("rio-cogeo, GDAL", path.name, is_valid and image.crs.to_epsg() == facts["epsg"] and len(image.overviews(1)) > 0,
                f"{image.width} x {image.height}, overviews {image.overviews(1)} {' '.join(errors)}")
    # Stored coordinates are mm; a cell has a whole number of them.
    mm = np.round(points[:, :2] * 1000).astype(int)
    cell, left, top = round(transform.a * 1000), round(transform.c * 1000), round(transform.f * 1000)
    column, line = (mm[:, 0] - left) // cell, (top - mm[:, 1] - 1) // cell
    shape = images["height"].shape[1:]
    at = line * shape[1] + column
    height = np.full(shape, -9999.0).ravel()
    np.maximum.at(height, at, points[:, 2])
    row("rasterio", "heights by cell", np.abs(height.reshape(shape) - images["height"][0]).max() < 1e-3, f"{(height > -9999).sum()} cells")
    ground = np.isin(points[:, 3], [6, 7, 8, 14, 16, 22])
    n = np.bincount(at[ground], minlength=height.size)
    mean = np.where(n > 0, np.bincount(at[ground], points[ground, 2], height.size) / np.maximum(n, 1), -9999)
    source, terrain = images["terrain_source"][0], images["terrain"][0]
    row("rasterio", "terrain by cell", np.abs(mean.reshape(shape) - np.where(source == 2, -9999, terrain)).max() < 1e-3, f"{(n > 0).sum()} cells")
    row("rasterio", "sources of the terrain", ((source == 1) == (n > 0).reshape(shape)).all() and ((source == 255) == (terrain == -9999)).all(),
        f"{(source == 2).sum()} completed cells")
    density = np.bincount(at, minlength=height.size) / (cell / 1000) ** 2
    row("rasterio", "density by cell", np.abs(density.reshape(shape) - np.maximum(images["density"][0], 0)).max() < 1e-3)
    ortho, ortho_source = images["orthophoto"], images["orthophoto_source"][0]
    row("rasterio", "sources of the orthophoto", ((ortho[3] == 255) == (ortho_source != 255)).all(),
        f"{100 * (ortho_source == 2).sum() / (ortho_source != 255).sum():.1f} % completed")
    described(out)
    # Of points of equal height the first counts; tiles do not contain that order.
    highest = np.round(points[:, 2] * 1000) == np.round(height[at] * 1000)
    alone = np.bincount(at[highest], minlength=height.size)[at] == 1
    row("rasterio", "classes by cell", (images["class"][0].ravel()[at] == points[:, 3])[highest & alone].all())
    seen = highest & alone & (points[:, 5] != 255)
    row("rasterio", "colors by cell", (images["color"].reshape(4, -1).T[at][seen] == np.c_[rgb[seen], np.full(seen.sum(), 255)]).all())


def described(out):
    """Units, descriptions and names of values, as GDAL reads them."""
    with rasterio.open(out / "terrain.tif") as image:
        row("GDAL", "unit and description", image.units == ("metre",) and image.descriptions == ("height of the ground",) and image.nodata == -9999)
    with rasterio.open(out / "orthophoto.tif") as image:
        row("GDAL", "bands of the orthophoto", image.descriptions == ("red", "green", "blue", "opacity")
            and [color.name for color in image.colorinterp] == ["red", "green", "blue", "alpha"])
    names = re.findall(r"<Category>(.*?)</Category>", (out / "terrain_source.tif.aux.xml").read_text())
    row("XML", "names of the sources", names == ["", "measured", "completed"])


def lines(out, facts, tiles):
    """Contour lines, breaklines, markings and the index of tiles."""
    index = geopandas.read_file(out / "tiles.geojson", engine="pyogrio")
    points = sum(len(tile.points) for tile in tiles)
    row("GDAL", "index of tiles", index.crs.to_epsg() == facts["epsg"] and index["points"].sum() == points
        and all((out / name).exists() for name in index["file"]) and (index.area == 2500).all(), f"{len(index)} tiles")
    with rasterio.open(out / "terrain.tif") as image:
        terrain, transform = image.read(1), image.transform
    for name, kinds in [("contours", None), ("breaklines", {"kerb", "road_edge"}), ("markings", {"marking"})]:
        found = geopandas.read_file(out / f"{name}.geojson", engine="pyogrio")
        vertices = np.concatenate([np.array(line.coords) for line in found.geometry])
        column, line = ((vertices[:, 0] - transform.c) / transform.a).astype(int), ((vertices[:, 1] - transform.f) / transform.e).astype(int)
        below = terrain[line, column]
        off = np.abs(vertices[:, 2] - below)[below != -9999]
        row("GDAL", name, found.crs.to_epsg() == facts["epsg"] and (kinds is None or set(found["kind"]) <= kinds)
            and found.geometry.is_valid.all() and np.median(off) < 0.05,
            f"{len(found)} lines, {found.length.sum():.0f} m, median {np.median(off):.3f} m from the terrain")


def catalog(out, facts):
    item = pystac.Item.from_file(out / "stac_item.json")
    hrefs = [asset.href.removeprefix("./") for asset in item.assets.values()]
    crs = item.properties["proj:code"]
    # The schema of the extension is only on the network.
    item.stac_extensions = []
    row("pystac", "catalog item", bool(item.validate()) and crs == f"EPSG:{facts['epsg']}" and all((out / href).exists() for href in hrefs),
        f"{len(hrefs)} files")


def smallest_ply(run, out):
    """The smallest cloud for CloudCompare, and the points of the run in it."""
    paths = sorted((out / "cloudcompare").glob("*.ply"))
    number = min(range(len(paths)), key=lambda k: paths[k].stat().st_size)
    return paths[number], run.clouds[number]


def open3d_reader(run, out, facts):
    path, expected = smallest_ply(run, out)
    cloud = open3d.t.io.read_point_cloud(str(path)).point
    off = np.abs(cloud.positions.numpy() - projected(run, run.xyz(expected), facts["epsg"])).max()
    names = {"scalar_class": "semantic", "scalar_instance": "instance", "scalar_laser": "ring", "scalar_frame": "index_frame"}
    equal = all((cloud[a].numpy()[:, 0] == expected[b]).all() for a, b in names.items())
    colors = all((cloud.colors.numpy()[:, k] == expected[name]).all() for k, name in enumerate(["red", "green", "blue"]))
    row("Open3D", "PLY for CloudCompare", equal and colors and off < 1e-4, f"{len(cloud.positions)} points, double coordinates")


def cloudcompare_program(run, out, facts):
    """The smallest cloud as CloudCompare (Debian) loads it: coordinates, colors and all scalar fields."""
    program = shutil.which("CloudCompare")
    if program is None:
        print("| CloudCompare | PLY | not installed | |")
        return
    path, expected = smallest_ply(run, out)
    with tempfile.TemporaryDirectory() as folder:
        text = pathlib.Path(folder) / "cloud.txt"
        options = ["-SILENT", "-C_EXPORT_FMT", "ASC", "-ADD_HEADER", "-PREC", "6", "-NO_TIMESTAMP", "-O", "-GLOBAL_SHIFT", "AUTO"]
        subprocess.run([program, *options, path, "-SAVE_CLOUDS", "FILE", text], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                       env={**os.environ, "QT_QPA_PLATFORM": "offscreen"})
        found = geopandas.pd.read_csv(text, sep=" ")
    found.columns = [name.strip("/") for name in found.columns]
    off = np.abs(found[["X", "Y", "Z"]].to_numpy() - projected(run, run.xyz(expected), facts["epsg"])).max()
    names = {"R": "red", "G": "green", "B": "blue", "class": "semantic", "instance": "instance", "laser": "ring", "moving": "dynamic",
             "frame": "index_frame", "intensity": "intensity", "camera": "camera"}
    equal = all((found[a].to_numpy() == expected[b]).all() for a, b in names.items())
    row("CloudCompare", "PLY", equal and off < 2e-3, f"{len(found)} points, {len(found.columns)} columns, coordinates within {1e3 * off:.1f} mm")


def cloudcompare(run, out, facts):
    path = sorted((out / "cloudcompare").glob("*.ply"))[0]
    ply = plyfile.PlyData.read(path)
    found, expected = ply["vertex"].data, run.clouds[0]
    begin = float(re.search(r"scalar_time s since (\S+) s after", " ".join(ply.obj_info))[1])
    scalars = [p for p in ply["vertex"].properties if p.name.startswith("scalar_")]
    off = np.abs(run.xyz(found)[::97] - projected(run, run.xyz(expected)[::97], facts["epsg"])).max()
    row("plyfile", "PLY for CloudCompare", all(p.val_dtype == "f4" for p in scalars) and off < 1e-4
        and (found["scalar_class"] == expected["semantic"]).all() and (found["red"] == expected["red"]).all()
        and (found["scalar_instance"] == expected["instance"]).all()
        and np.abs(found["scalar_time"].astype(float) + begin - expected["timestamp"]).max() < 1e-4, f"{len(scalars)} scalar fields")


def semantic_kitti(run, out):
    folder = out / "sequences/00"
    poses = file_interface.read_kitti_poses_file(folder / "poses.txt").poses_se3
    bins, labels = sorted((folder / "velodyne").glob("*.bin")), sorted((folder / "labels").glob("*.label"))
    frames = np.unique(run.points["index_frame"])
    counts = [len(np.fromfile(path, "<f4")) // 4 == len(np.fromfile(label, "<u4")) for path, label in zip(bins, labels)]
    k = len(frames) // 2
    rows = run.points[run.points["index_frame"] == frames[k]]
    scan = np.fromfile(bins[k], "<f4").reshape(-1, 4).astype(float)
    moved = scan[:, :3] @ poses[k][:3, :3].T + poses[k][:3, 3]
    first = np.fromfile(bins[0], "<f4").reshape(-1, 4).astype(float)[:, :3]
    # Poses are relative to the first sweep, whose place is found from its points.
    wanted = run.points[run.points["index_frame"] == frames[0]]
    a, b = first - first.mean(0), run.xyz(wanted) - run.xyz(wanted).mean(0)
    u, _, v = np.linalg.svd(a.T @ b)
    turn = (u @ v).T
    place = run.xyz(wanted).mean(0) - turn @ first.mean(0)
    off = np.abs(moved @ turn.T + place - run.xyz(rows)).max()
    label = np.fromfile(labels[k], "<u4")
    row("evo, numpy", "SemanticKITTI", len(bins) == len(poses) == len(frames) and all(counts) and off < 2e-3
        and ((label >> 16) == rows["instance"]).all() and (((label & 0xffff) == 40) == (rows["semantic"] == 7)).all(),
        f"{len(bins)} sweeps, points within {1e3 * off:.1f} mm")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("run", type=pathlib.Path)
    parser.add_argument("out", type=pathlib.Path)
    args = parser.parse_args()
    run, facts = Run(args.run), json.loads((args.out / "delivery.json").read_text())
    print("| reader | what | result | |\n|---|---|---|---|")
    tiles = points(run, args.out, facts)
    copc(args.out, tiles)
    path(run, args.out, facts)
    objects(args.out, facts)
    rasters(run, args.out, facts, tiles)
    lines(args.out, facts, tiles)
    catalog(args.out, facts)
    cloudcompare(run, args.out, facts)
    open3d_reader(run, args.out, facts)
    cloudcompare_program(run, args.out, facts)
    semantic_kitti(run, args.out)
    sys.exit(f"differ: {', '.join(FAILED)}" if FAILED else 0)


if __name__ == "__main__":
    main()
