//! Quadratic approximation of a smooth function of coordinates in a cell.

use crate::crs::CrsError;

/// Side of a cell, m. The third derivatives of a map projection are about 1 / R², with the radius R of the Earth. Over
/// half a cell they contribute less than a micrometre.
const CELL_M: f64 = 1024.0;
/// Half a cell: the spacing of the positions where the function is evaluated, m.
const STEP_M: f64 = CELL_M / 2.0;

/// Values of a function in a cell: easting, northing, height, latitude, longitude.
pub(super) struct Quadratic {
    center: [f64; 3],
    /// Coefficients of 1, x, y, z, xx, yy, zz, xy, xz, yz for each value.
    coefficients: [[f64; 10]; 5],
}

fn cell_of(xyz: [f64; 3]) -> [f64; 3] {
    xyz.map(|value| (value / CELL_M).floor())
}

impl Quadratic {
    /// The cell of a point. Cells are aligned to multiples of their side, so results do not depend on the order of the
    /// points.
    pub(super) fn around(
        xyz: [f64; 3],
        function: impl Fn([f64; 3]) -> Result<[f64; 5], CrsError>,
    ) -> Result<Self, CrsError> {
        let center = cell_of(xyz).map(|cell| (cell + 0.5) * CELL_M);
        let at = |steps: [f64; 3]| function(std::array::from_fn(|axis| center[axis] + steps[axis] * STEP_M));
        let middle = at([0.0; 3])?;
        let unit = |axis: usize, sign: f64| std::array::from_fn(|k| if k == axis { sign } else { 0.0 });
        let mut up = [[0.0; 5]; 3];
        let mut down = [[0.0; 5]; 3];
        for axis in 0..3 {
            (up[axis], down[axis]) = (at(unit(axis, 1.0))?, at(unit(axis, -1.0))?);
        }
        let pairs = [(0, 1), (0, 2), (1, 2)];
        let mut mixed = [[0.0; 5]; 3];
        for (mixed, (a, b)) in mixed.iter_mut().zip(pairs) {
            let corner = |sign_a: f64, sign_b: f64| {
                at(std::array::from_fn(|k| {
                    if k == a {
                        sign_a
                    } else if k == b {
                        sign_b
                    } else {
                        0.0
                    }
                }))
            };
            let pp = corner(1.0, 1.0)?;
            let pm = corner(1.0, -1.0)?;
            let mp = corner(-1.0, 1.0)?;
            let mm = corner(-1.0, -1.0)?;
            *mixed = std::array::from_fn(|v| (pp[v] - pm[v] - mp[v] + mm[v]) / (4.0 * STEP_M * STEP_M));
        }
        let coefficients = std::array::from_fn(|v| {
            let slope = |axis: usize| (up[axis][v] - down[axis][v]) / (2.0 * STEP_M);
            let bend = |axis: usize| (up[axis][v] - 2.0 * middle[v] + down[axis][v]) / (2.0 * STEP_M * STEP_M);
            let [xy, xz, yz] = std::array::from_fn(|pair| mixed[pair][v]);
            [middle[v], slope(0), slope(1), slope(2), bend(0), bend(1), bend(2), xy, xz, yz]
        });
        Ok(Self { center, coefficients })
    }

    #[inline]
    pub(super) fn contains(&self, xyz: [f64; 3]) -> bool {
        (0..3).all(|axis| {
            let off = xyz[axis] - self.center[axis];
            (-STEP_M..STEP_M).contains(&off)
        })
    }

    #[inline]
    pub(super) fn at(&self, xyz: [f64; 3]) -> [f64; 5] {
        let [x, y, z] = std::array::from_fn(|axis| xyz[axis] - self.center[axis]);
        self.coefficients.map(|[one, cx, cy, cz, xx, yy, zz, xy, xz, yz]| {
            one + x * (cx + xx * x + xy * y + xz * z) + y * (cy + yy * y + yz * z) + z * (cz + zz * z)
        })
    }
}
