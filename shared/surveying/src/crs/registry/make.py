"""Writes the tables of coordinate reference systems from the EPSG registry, as pyproj contains it.

    python3 -m venv /tmp/venv && /tmp/venv/bin/pip install pyproj==3.7.2
    /tmp/venv/bin/python make.py                   # systems.tsv, datums.tsv, grids.tsv, heights.tsv, compounds.tsv, refused.tsv
    /tmp/venv/bin/python make.py --points          # proj_points.csv, the reference coordinates of the tests

Each accepted projection is computed once with the parameters of the table and once from the registry's own definition, both by PROJ; they
must agree within 1 um. The columns of the tables: README.md.
"""

import argparse
import math
import pathlib
import re
import sqlite3
import warnings

import pyproj
from pyproj.database import query_crs_info
from pyproj.enums import PJType
from pyproj.transformer import TransformerGroup

HERE = pathlib.Path(__file__).parent
POINTS = HERE / "proj_points.csv"
DATABASE = sqlite3.connect(pathlib.Path(pyproj.datadir.get_data_dir()) / "proj.db")

# Method of the tables: projection of WKT 1, its parameters, and the projection of PROJ.
TAIL = ["false_easting", "false_northing"]
METHODS = {
    "tmerc": ("Transverse_Mercator", ["latitude_of_origin", "central_meridian", "scale_factor", *TAIL],
              "+proj=tmerc +lat_0={} +lon_0={} +k={} +x_0={} +y_0={}"),
    "lcc2": ("Lambert_Conformal_Conic_2SP", ["latitude_of_origin", "central_meridian", "standard_parallel_1", "standard_parallel_2", *TAIL],
             "+proj=lcc +lat_0={} +lon_0={} +lat_1={} +lat_2={} +x_0={} +y_0={}"),
    "lcc1": ("Lambert_Conformal_Conic_1SP", ["latitude_of_origin", "central_meridian", "scale_factor", *TAIL],
             "+proj=lcc +lat_1={0} +lat_0={0} +lon_0={1} +k_0={2} +x_0={3} +y_0={4}"),
    "aea": ("Albers_Conic_Equal_Area", ["latitude_of_center", "longitude_of_center", "standard_parallel_1", "standard_parallel_2", *TAIL],
            "+proj=aea +lat_0={} +lon_0={} +lat_1={} +lat_2={} +x_0={} +y_0={}"),
    "laea": ("Lambert_Azimuthal_Equal_Area", ["latitude_of_center", "longitude_of_center", *TAIL],
             "+proj=laea +lat_0={} +lon_0={} +x_0={} +y_0={}"),
    "sterea": ("Oblique_Stereographic", ["latitude_of_origin", "central_meridian", "scale_factor", *TAIL],
               "+proj=sterea +lat_0={} +lon_0={} +k={} +x_0={} +y_0={}"),
    "ups": ("Polar_Stereographic", ["latitude_of_origin", "central_meridian", "scale_factor", *TAIL],
            "+proj=stere +lat_0={} +lon_0={} +k={} +x_0={} +y_0={}"),
    "polar_north": ("Polar_Stereographic", ["latitude_of_origin", "central_meridian", *TAIL],
                    "+proj=stere +lat_0=90 +lat_ts={} +lon_0={} +x_0={} +y_0={}"),
    "polar_south": ("Polar_Stereographic", ["latitude_of_origin", "central_meridian", *TAIL],
                    "+proj=stere +lat_0=-90 +lat_ts={} +lon_0={} +x_0={} +y_0={}"),
    "somerc": ("Hotine_Oblique_Mercator_Azimuth_Center",
               ["latitude_of_center", "longitude_of_center", "azimuth", "rectified_grid_angle", "scale_factor", *TAIL],
               "+proj=somerc +lat_0={0} +lon_0={1} +k_0={4} +x_0={5} +y_0={6}"),
    "omerc": ("Hotine_Oblique_Mercator_Azimuth_Center",
              ["latitude_of_center", "longitude_of_center", "azimuth", "rectified_grid_angle", "scale_factor", *TAIL],
              "+proj=omerc +lat_0={} +lonc={} +alpha={} +gamma={} +k={} +x_0={} +y_0={}"),
    "omerc_no_uoff": ("Hotine_Oblique_Mercator",
                      ["latitude_of_center", "longitude_of_center", "azimuth", "rectified_grid_angle", "scale_factor", *TAIL],
                      "+proj=omerc +no_uoff +lat_0={} +lonc={} +alpha={} +gamma={} +k={} +x_0={} +y_0={}"),
    "cass": ("Cassini_Soldner", ["latitude_of_origin", "central_meridian", *TAIL],
             "+proj=cass +lat_0={} +lon_0={} +x_0={} +y_0={}"),
    "merc1": ("Mercator_1SP", ["central_meridian", "scale_factor", *TAIL], "+proj=merc +lon_0={} +k={} +x_0={} +y_0={}"),
    "poly": ("Polyconic", ["latitude_of_origin", "central_meridian", *TAIL], "+proj=poly +lat_0={} +lon_0={} +x_0={} +y_0={}"),
    "krovak": ("Krovak", ["latitude_of_center", "longitude_of_center", "azimuth", "pseudo_standard_parallel_1", "scale_factor", *TAIL],
               "+proj=krovak +lat_0={0} +lon_0={1} +alpha={2} +k={4} +x_0={5} +y_0={6}"),
}
# Methods of the projection library of the project that differ from PROJ by more than 0.1 mm in the area of use of a system.
WRONG_METHODS = {}
# Datums that satellite receivers with corrections realize, without a zero transformation to WGS 84 in the registry.
SATELLITE = [4490, 6783, 6322, 6325, 8237, 8240, 8246, 9696, 10284, 10305]
# Old datums that the registry equates with WGS 84 for want of anything better.
NOT_SATELLITE = [4600]
# Datums that their surveys define by these operations to ETRS89, and on which PROJ agrees. LUREF has three operations that differ by 15 mm,
# S-JTSK [JTSK03] one for each direction, 6 mm apart: both are refused.
DEFINED = {4150: 1647, 5681: 5826}
# Grids with a worse accuracy by the registry are not offered, m.
GRID_ACCURACY_M = 1.0
# Systems that are compared at more than one place, and at how many: the systems that surveys use most, every method and kind of datum.
N_PLACES = 25
AT_MANY_PLACES = {2056, 2154, 2169, 2180, 2193, 2327, 3006, 3034, 3035, 3057, 3059, 3067, 3301, 3346, 3347, 3413, 3577, 3763, 3765, 3794, 3812, 3873,
                  3949, 4647, 5041, 5042, 5243, 5650, 5682, 5684, 5880, 6372, 6677, 6870, 7855, 8353, 9377, 25832, 26910, 27700, 28355, 28992, 31370, 31467,
                  31983, 32118, 32198, 32632, 32756}


def field(text):
    assert "\t" not in text and "\n" not in text, text
    return text


def shortest(value):
    text = repr(float(value))
    return text.removesuffix(".0")


def parsed(wkt):
    """Datum, projection, parameters, axes of a PROJCS of WKT 1."""
    geogcs = re.search(r'^PROJCS\["[^"]*",(GEOGCS\[.*?AUTHORITY\["EPSG","\d+"\]\]),PROJECTION\["([^"]*)"\],', wkt)
    if not geogcs:
        return None
    parameters = re.findall(r'PARAMETER\["([^"]*)",([^\]]*)\]', wkt)
    rest = wkt[geogcs.end():]
    axes = re.findall(r'AXIS\["([^"]*)",(\w+)\]', rest)
    return geogcs[1], geogcs[2], parameters, axes


def rebuilt(row):
    wkt_method, names, _ = METHODS[row["method"]]
    parameters = "".join(f'PARAMETER["{name}",{value}],' for name, value in zip(names, row["values"]))
    axes = 'AXIS["Easting",EAST],AXIS["Northing",NORTH],' if row["axes"] == "EN" else ""
    return (f'PROJCS["{row["name"]}",{row["geogcs"]},PROJECTION["{wkt_method}"],{parameters}UNIT["metre",1,AUTHORITY["EPSG","9001"]],{axes}'
            f'AUTHORITY["EPSG","{row["code"]}"]]')


def definition(row, ellipsoid):
    return METHODS[row["method"]][2].format(*row["values"]) + f" +a={ellipsoid[0]} +rf={ellipsoid[1]} +units=m +no_defs"


def is_null(transformer):
    words = ["helmert", "molodensky", "grid", "cart", "affine", "geoc", "deform"]
    return not any(word in transformer.definition for word in words)


class Datums:
    """How each geographic system follows from positions of a satellite receiver."""

    def __init__(self):
        self.kinds = {}
        self.names = {}
        # The targets of transformations that count as satellite positions.
        codes = [int(i.code) for i in query_crs_info(auth_name="EPSG", pj_types=[PJType.GEOGRAPHIC_2D_CRS])]
        self.satellite = {code for code in codes if self.kind_of_satellite(code)}

    def kind_of_satellite(self, code):
        if code in NOT_SATELLITE:
            return False
        if code in SATELLITE:
            return True
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                group = TransformerGroup("EPSG:4326", f"EPSG:{code}", always_xy=True, allow_ballpark=False)
            except IndexError:  # No operation at all.
                return False
        return any(is_null(one) for one in group.transformers)

    def helmert(self, code):
        if code not in DEFINED:
            return None
        row = DATABASE.execute("select method_code, tx, ty, tz, rx, ry, rz, scale_difference from helmert_transformation_table where auth_name = "
                               "'EPSG' and code = ? and source_crs_code = ? and target_crs_code = 4258", (DEFINED[code], code)).fetchone()
        method, *values = row
        values = [value or 0.0 for value in values]
        if method == 9607:
            # Coordinate frame rotation: other sign than the position vector transformation of PROJ 4.
            values[3:6] = [-value + 0.0 for value in values[3:6]]
        else:
            assert method in (9603, 9606), method
        return values

    def grids(self, code):
        rows = DATABASE.execute(
            "select g.source_crs_code, g.target_crs_code, g.accuracy, g.grid_name, a.url, e.description from grid_transformation g "
            "left join grid_alternatives a on a.original_grid_name = g.grid_name "
            "left join usage u on u.object_auth_name = 'EPSG' and u.object_table_name = 'grid_transformation' and u.object_code = g.code "
            "left join extent e on e.auth_name = u.extent_auth_name and e.code = u.extent_code "
            "where g.auth_name = 'EPSG' and g.method_name = 'NTv2' and g.deprecated = 0 and (g.source_crs_code = ? or g.target_crs_code = ?)",
            (code, code)).fetchall()
        found = {}
        for source, target, accuracy, name, url, extent in rows:
            other = int(target if int(source) == code else source)
            if other not in self.satellite or accuracy > GRID_ACCURACY_M:
                continue
            direction = "to_satellite" if int(source) == code else "from_satellite"
            old = found.get(name)
            if old is None or accuracy < old[1]:
                found[name] = (direction, accuracy, name, url or "", extent.split(" - ", 1)[-1])
        superseded = {"OSTN02_NTv2.gsb", "rdtrans2008.gsb", "AT_GIS_GRID.gsb", "hu_sgo_hd72corr.gsb"}
        return sorted((grid for grid in found.values() if grid[2] not in superseded), key=lambda grid: (grid[1], grid[2]))


def projected():
    """Rows of systems, and the reasons why the others are refused."""
    datums = Datums()
    rows, refused = [], []
    # A system with two areas of use is listed twice.
    infos = {int(info.code): info for info in query_crs_info(auth_name="EPSG", pj_types=[PJType.PROJECTED_CRS], allow_deprecated=True)}
    for code, info in sorted(infos.items()):
        crs = pyproj.CRS.from_epsg(code)
        refuse = lambda reason: refused.append((code, field(crs.name), field(reason)))
        if info.deprecated:
            new = DATABASE.execute("select replacement_code from deprecation where table_name = 'projected_crs' and deprecated_code = ?", (str(code),)).fetchall()
            refuse("deprecated " + " ".join(str(row[0]) for row in sorted(new)))
            continue
        unit = crs.axis_info[0].unit_name
        if unit != "metre":
            refuse(f"unit {unit}")
            continue
        base = crs.geodetic_crs
        if base.prime_meridian.longitude != 0.0:
            refuse(f"meridian {base.prime_meridian.name}")
            continue
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            try:
                proj4 = crs.to_proj4()
            except pyproj.exceptions.CRSError:  # A method that PROJ lacks.
                proj4 = ""
        if "+axis=" in proj4 or "+south" in proj4 and "+proj=utm" not in proj4:
            refuse("axes")
            continue
        try:
            wkt = crs.to_wkt("WKT1_GDAL")
        except pyproj.exceptions.CRSError:
            wkt = ""
        # A WKT with an extension refers to a definition of PROJ 4: not the method that it names.
        method_name = crs.coordinate_operation.method_name
        found = parsed(wkt) if "EXTENSION" not in wkt and "Spherical" not in method_name else None
        method = None
        if found:
            geogcs, projection, parameters, axes = found
            for name, (wkt_method, expected, _) in METHODS.items():
                # Three methods have the same projection and parameters as another one.
                fits = {"somerc": "+proj=somerc", "polar_north": "+lat_0=90", "polar_south": "+lat_0=-90"}.get(name, "") in proj4
                if wkt_method == projection and expected == [p for p, _ in parameters] and fits:
                    method = name
                    break
        if method is None or method in WRONG_METHODS:
            refuse(f"method {method_name}")
            continue
        axes = {(): "", (("Easting", "EAST"), ("Northing", "NORTH")): "EN"}[tuple(axes)]
        # WKT 1 of PROJ leaves out other axes than east and north, and then does not find the number of the system again.
        if not axes and [axis.direction for axis in crs.axis_info[:2]] == ["north", "east"]:
            axes = "NE"
        area = crs.area_of_use
        row = {"code": code, "name": field(crs.name), "datum": base.to_epsg(), "method": method, "values": [v for _, v in parameters],
               "axes": axes, "area": area.bounds, "geogcs": geogcs, "crs": crs}
        assert rebuilt(row) == wkt, f"{rebuilt(row)}\n{wkt}"
        kind = datums.kinds.get(row["datum"])
        if kind is None:
            if row["datum"] in datums.satellite:
                kind = ("satellite",)
            elif helmert := datums.helmert(row["datum"]):
                kind = ("helmert", helmert)
            elif grids := datums.grids(row["datum"]):
                kind = ("grid", grids)
            else:
                kind = ("unknown",)
            datums.kinds[row["datum"]] = kind
        if kind[0] == "unknown":
            refuse(f"datum {base.name}")
            continue
        row["kind"] = kind
        row["ellipsoid"] = (shortest(base.ellipsoid.semi_major_metre), shortest(base.ellipsoid.inverse_flattening))
        check(row)
        rows.append(row)
    return rows, refused


def places(row, n):
    """Places in the area of use, on a Kronecker sequence; heights from 0 to 1000 m."""
    west, south, east, north = row["area"]
    if east < west:
        east += 360.0
    # The whole of a very wide area is of no use to a survey.
    middle = (west + east) / 2
    half = min((east - west) / 2, 15.0)
    for k in range(n):
        lon = middle - half + 2 * half * math.modf(0.5 + k * 0.7548776662466927)[0]
        lat = south + (north - south) * math.modf(0.5 + k * 0.5698402909980532)[0]
        yield round(lat, 6), round((lon + 180.0) % 360.0 - 180.0, 6), round(1000.0 * math.modf(0.25 + k * 0.38196601125)[0], 1)


def check(row):
    ours = pyproj.Proj(definition(row, row["ellipsoid"]))
    theirs = pyproj.Transformer.from_crs(row["crs"].geodetic_crs, row["crs"], always_xy=True)
    for lat, lon, _ in places(row, 3):
        a, b = ours(lon, lat), theirs.transform(lon, lat)
        assert math.dist(a, b) < 1e-6, (row["code"], row["name"], lat, lon, a, b)


def write(name, lines):
    (HERE / name).write_text("".join(line + "\n" for line in lines))
    print(f"{name}: {len(lines)} lines")


def heights():
    """Vertical systems in m, upwards, with their grids."""
    found, lines = {}, []
    infos = {int(info.code): info for info in query_crs_info(auth_name="EPSG", pj_types=[PJType.VERTICAL_CRS])}
    for _, info in sorted(infos.items()):
        crs = pyproj.CRS.from_epsg(int(info.code))
        axis = crs.axis_info[0]
        if axis.unit_name != "metre" or axis.direction != "up":
            continue
        wkt = crs.to_wkt("WKT1_GDAL")
        match = re.fullmatch(r'VERT_CS\["([^"]*)",VERT_DATUM\["([^"]*)",2005,AUTHORITY\["EPSG","(\d+)"\]\],UNIT\["metre",1,AUTHORITY\["EPSG","9001"\]\],'
                             r'AXIS\["Gravity-related height",UP\],AUTHORITY\["EPSG","(\d+)"\]\]', wkt)
        if not match:
            continue
        name, datum, datum_code, code = match.groups()
        grids = DATABASE.execute(
            "select distinct coalesce(a.proj_grid_name, g.grid_name) from grid_transformation g "
            "left join grid_alternatives a on a.original_grid_name = g.grid_name where g.deprecated = 0 and g.target_crs_code = ? "
            "and g.source_crs_auth_name = 'EPSG' and g.target_crs_auth_name = 'EPSG' and g.method_name like '%Geog%' order by g.accuracy", (code,)).fetchall()
        west, south, east, north = crs.area_of_use.bounds
        found[int(code)] = name
        names = list(dict.fromkeys(row[0] for row in grids if row[0]))
        lines.append("\t".join([code, field(name), field(datum), datum_code, " ".join(names[:6]), f"{west:g} {south:g} {east:g} {north:g}"]))
    return found, lines


def compounds(systems, heights):
    infos = {int(info.code): info for info in query_crs_info(auth_name="EPSG", pj_types=[PJType.COMPOUND_CRS])}
    for _, info in sorted(infos.items()):
        crs = pyproj.CRS.from_epsg(int(info.code))
        horizontal, vertical = (part.to_epsg() for part in crs.sub_crs_list[:2])
        if horizontal in systems and vertical in heights:
            yield f"{info.code}\t{horizontal}\t{vertical}"


def write_tables():
    rows, refused = projected()
    write("systems.tsv", ["\t".join([str(row["code"]), row["name"], str(row["datum"]), row["method"], " ".join(row["values"]), row["axes"],
                                     "{:g} {:g} {:g} {:g}".format(*row["area"])]) for row in sorted(rows, key=lambda row: row["code"])])
    datums = {row["datum"]: row for row in rows}
    lines, grids = [], []
    for code, row in sorted(datums.items()):
        kind = row["kind"]
        shift = " ".join(shortest(value) for value in kind[1]) if kind[0] == "helmert" else ""
        lines.append("\t".join([str(code), kind[0], shift, *row["ellipsoid"], row["geogcs"]]))
        if kind[0] == "grid":
            grids += ["\t".join([str(code), direction, f"{accuracy:g}", field(name), url, field(extent)]) for direction, accuracy, name, url, extent in kind[1]]
    write("datums.tsv", lines)
    write("grids.tsv", grids)
    write("refused.tsv", ["\t".join(map(str, row)) for row in sorted(refused)])
    names, lines = heights()
    write("heights.tsv", lines)
    write("compounds.tsv", list(compounds({row["code"] for row in rows}, names)))


def from_satellite(row):
    """PROJ's own transformation from satellite positions, with its choice of operation."""
    crs = row["crs"]
    source = "EPSG:4979" if row["kind"][0] == "helmert" else crs.geodetic_crs.to_3d() if row["kind"][0] == "satellite" else crs.geodetic_crs
    return pyproj.Transformer.from_crs(source, crs, always_xy=True)


def write_points():
    rows, _ = projected()
    lines = ["epsg,latitude_deg,longitude_deg,height_m,east_m,north_m"]
    tested = 0
    for row in sorted(rows, key=lambda row: row["code"]):
        n = N_PLACES if row["code"] in AT_MANY_PLACES else 1
        tested += n > 1
        transformer = from_satellite(row)
        for lat, lon, height in places(row, n):
            east, north = transformer.transform(lon, lat, height)[:2]
            lines.append(f"{row['code']},{lat},{lon},{height},{east:.5f},{north:.5f}")
    POINTS.write_text("\n".join(lines) + "\n")
    print(f"{POINTS}: {len(lines) - 1} points in {len(rows)} systems, {tested} with {N_PLACES}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--points", action="store_true")
    if parser.parse_args().points:
        write_points()
    else:
        write_tables()
