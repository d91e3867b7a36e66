"""The table of columns, and clouds with a column that is not in the table of the pipeline."""

import json

import numpy as np
import pytest
from conftest import call

import replica
from replica import _native
from replica._columns import columns_from_json
from replica._layouts import dtypes

NONE = -1.0


def test_fields_of_the_table_are_in_the_rows_of_their_topics():
    by_name = {column.name: column for column in replica.COLUMNS}
    assert {"points", "color", "spectra", "class", "instance", "material", "region"} <= set(by_name)
    for column in by_name.values():
        _, row = dtypes(column.topic)
        for field in column.fields if column.topic != "submap" else ():
            assert field.row_field in (row.names or ("",)), field
    [instance] = by_name["instance"].fields
    assert (instance.property, instance.none, instance.kind) == ("instance", 0.0, "u32")


@pytest.fixture
def moist(tmp_path):
    """A cloud with the field ``moisture``, and a table that has it."""
    names = ["x", "y", "z", "x_lidar_position", "y_lidar_position", "z_lidar_position", "moisture"]
    points = np.zeros(300, [(name, "<f4") for name in names] + [("semantic", "u1")])
    points["x"] = np.arange(300) % 20
    points["y"] = np.arange(300) // 20
    points["moisture"] = np.where(points["x"] < 5, NONE, points["x"] * 2)
    points["semantic"] = np.arange(300) % 3
    properties = "".join(f"property float {name}\n" for name in names) + "property uchar semantic\n"
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n{properties}end_header\n"
    path = tmp_path / "cloud.ply"
    path.write_bytes(header.encode() + points.tobytes())
    field = {"name": "moisture", "property": "moisture", "row_field": "", "kind": "f32", "unit": "%", "none": NONE, "description": "water"}
    added = {"name": "moisture", "topic": "moisture", "description": "water", "fields": [field]}
    return path, points, columns_from_json(json.dumps([*json.loads(_native.columns()), added]))


def test_values_of_an_added_column_are_read_and_points_without_one_are_masked(moist, tmp_path):
    path, points, table = moist
    cloud = replica.read_ply(path)
    values = cloud.values("moisture", table)
    assert np.array_equal(values.mask, points["x"] < 5) and np.array_equal(values.data, points["moisture"])
    assert not np.ma.is_masked(cloud.values("moisture")), "the table of the pipeline does not have the column"
    classes = cloud.values("class")
    assert np.array_equal(classes.data, points["semantic"]) and np.array_equal(classes.mask, points["semantic"] == 0)
    call("replica", "inspect", path, "--view", "top", "--by", "moisture", "--picture", tmp_path / "moisture.png")
    assert (tmp_path / "moisture.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(ValueError, match="no field of name dryness"):
        cloud.values("dryness")
