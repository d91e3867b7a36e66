//! Positions and the arithmetic of their distances.

/// Largest coordinate of an indexed point or a query, m. Squared distances between such points are finite in `f32`.
pub const LIMIT_M: f32 = 1e18;

/// Squared distance, m²: `(dx * dx + dy * dy) + dz * dz` in `f32`. All results of this crate compare this number.
#[inline(always)]
pub fn squared_distance(a: [f32; 3], b: [f32; 3]) -> f32 {
    let [dx, dy, dz] = [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
    (dx * dx + dy * dy) + dz * dz
}

/// Positions relative to an origin, for clouds in UTM or other large coordinates. `f64` differences are rounded to `f32`: by at most
/// 0.031 mm within 1 km of the origin, 0.25 mm within 8 km.
pub fn around(origin: [f64; 3], positions: impl IntoIterator<Item = [f64; 3]>) -> impl Iterator<Item = [f32; 3]> {
    positions.into_iter().map(move |p| std::array::from_fn(|axis| (p[axis] - origin[axis]) as f32))
}

/// Whether a point can be indexed or queried.
#[inline(always)]
pub(crate) fn is_valid(p: [f32; 3]) -> bool {
    // False for NaN.
    p.iter().all(|v| v.abs() <= LIMIT_M)
}

/// Axis-aligned box around positions.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    pub low: [f32; 3],
    pub high: [f32; 3],
}

impl Bounds {
    /// An empty box, infinitely far from every position.
    pub const EMPTY: Self = Self { low: [f32::INFINITY; 3], high: [f32::NEG_INFINITY; 3] };

    /// The smallest box around both.
    #[inline(always)]
    pub fn union(self, other: Self) -> Self {
        Self {
            low: std::array::from_fn(|axis| self.low[axis].min(other.low[axis])),
            high: std::array::from_fn(|axis| self.high[axis].max(other.high[axis])),
        }
    }
    /// The smallest box around positions.
    pub fn around(positions: impl Iterator<Item = [f32; 3]>) -> Self {
        positions.fold(Self::EMPTY, |bounds, p| bounds.union(Self { low: p, high: p }))
    }
    /// Length of the longest side, m.
    pub fn extent(self) -> f64 {
        (0..3).map(|axis| f64::from(self.high[axis]) - f64::from(self.low[axis])).fold(0.0, f64::max)
    }
}
