#!/usr/bin/env python3
"""examples/height_segmenter in Python: the same classes from heights alone, in columns of half a metre."""

import numpy as np

import replica
from replica import Setting

SIDE_M, RISE_M = np.float32(0.5), np.float32(0.15) * np.float32(0.5)
CLASSES = ("unlabeled", "building", "vegetation", "vehicles", "ground")
UNLABELED, BUILDING, VEGETATION, VEHICLES, GROUND = map(replica.CLASS_NAMES.index, CLASSES)
# 0.7, as in Rust.
SCORE = 179


class HeightSegmenter(replica.Stage):
    name, inputs, outputs = "infer", ["submap"], ["class"]
    settings = {
        "ground_m": Setting(0.3, "Height up to which a point is ground, m.", within=(0.05, 1.0)),
        "vehicle_m": Setting(2.6, "Height of the highest vehicle, m.", within=(1.0, 5.0)),
        "street_m": Setting(15.0, "Largest distance of vehicles from the path of the sensor, m.", within=(1.0, 200.0)),
    }

    def step(self, inputs, outputs):
        for submap in inputs["submap"]:
            out = outputs.loan("class", like=submap)
            out.header["model_digest"] = replica.fingerprint(b"height_segmenter 1")
            self.label(submap, out)
            outputs.publish(out)

    def label(self, submap, out):
        valid = (abs(submap["x"]) <= 1e6) & (abs(submap["y"]) <= 1e6) & np.isfinite(submap["z"])
        x, y, z = (submap[axis][valid] for axis in "xyz")
        keys = np.stack([np.floor(x / SIDE_M), np.floor(y / SIDE_M)]).astype(np.int64)
        columns, of_point = np.unique(keys[0] << 32 | keys[1] + 2**31, return_inverse=True)
        # Another element for the neighbor that does not exist.
        lowest, highest = np.full(len(columns) + 1, np.inf, "f4"), np.full(len(columns) + 1, -np.inf, "f4")
        np.minimum.at(lowest, of_point, z)
        np.maximum.at(highest, of_point, z)
        ground = np.min([lowest[i] + RISE_M * np.float32(d) for d, i in around(columns, 4)], axis=0, initial=np.inf)
        above, top = z - ground[of_point], highest[:-1] - ground
        middle = np.zeros(len(columns), bool)
        middle[of_point[(above >= np.float32(0.6)) & (above < np.float32(2.0))]] = True
        ground_m, vehicle_m, street_m = (np.float32(self.settings[key]) for key in ("ground_m", "vehicle_m", "street_m"))
        vehicle = self.vehicles(columns, (top > ground_m) & (top <= vehicle_m), submap.header, street_m)
        of_column = np.select([vehicle, top <= vehicle_m, middle], [VEHICLES, UNLABELED, BUILDING], VEGETATION)
        classes = np.where(above <= ground_m, GROUND, of_column[of_point])
        out["class_id"][valid] = classes
        out["score"][valid] = np.where(classes == UNLABELED, 0, SCORE)

    def vehicles(self, columns, heap, header, street_m):
        """Columns of compact groups of touching columns that are `heap`, near the path of the sensor."""
        rows, cols = columns >> 32, (columns & 2**32 - 1) - 2**31
        neighbors = [np.where(np.append(heap, False)[i], i, len(columns)) for _, i in around(columns, 1)]
        group, before = np.where(heap, np.arange(len(columns)), len(columns)), None
        while not np.array_equal(group, before):
            before = group
            group = np.where(heap, np.min([np.append(group, len(columns))[i] for i in neighbors], axis=0), len(columns))
        vehicle = np.zeros(len(columns), bool)
        sensor = header["sweeps"]["submap_from_lidar_begin"][: header["n_sweeps"], :2]
        for first in np.unique(group[heap]):
            members = group == first
            center = (np.array([rows[first], cols[first]], "f4") + np.float32(0.5)) * SIDE_M
            near = np.hypot(*(sensor - center).T) <= street_m
            compact = np.ptp(rows[members]) < 14 and np.ptp(cols[members]) < 14
            vehicle[members] = members.sum() >= 6 and compact and (len(sensor) == 0 or near.any())
        return vehicle


def around(columns, reach):
    """Distance and index of each neighbor of the columns; the index of one that does not exist is len(columns)."""
    for row in range(-reach, reach + 1):
        for col in range(-reach, reach + 1):
            wanted = columns + (row << 32) + col
            found = np.searchsorted(columns, wanted).clip(max=max(len(columns) - 1, 0))
            exists = columns[found] == wanted if len(columns) else np.zeros(0, bool)
            yield max(abs(row), abs(col)), np.where(exists, found, len(columns))


if __name__ == "__main__":
    replica.run(HeightSegmenter)
