#!/usr/bin/env python3
"""Checks that SPy (pip install spectral) opens our ENVI images with the same numbers and wavelengths.

usage: spy_open.py IMAGE.hdr ...
"""
import sys

import numpy as np
import spectral.io.envi as envi

for path in sys.argv[1:]:
    image = envi.open(path)
    cube = np.asarray(image.load())
    plain = np.fromfile(path[: -len(".hdr")] + ".img", "<f4").reshape(image.nbands, image.nrows, image.ncols)
    assert np.array_equal(cube, plain.transpose(1, 2, 0)), path
    print(f"{path}: {image.nrows} x {image.ncols} x {image.nbands}, {image.bands.centers[0]} to {image.bands.centers[-1]} {image.bands.band_unit}")
