//! Square tiles of the scene and the lattice of ground vertices.

/// Side of a tile, m.
pub const TILE_M: f64 = 50.0;
/// Spaces between vertices along the side of a tile. A power of two, as the triangulation requires.
pub const STEPS: usize = 512;
/// Distance of neighboring vertices, m: 9.8 cm.
pub const STEP_M: f64 = TILE_M / STEPS as f64;

/// Column and row of a tile: its south-west corner is at `column * TILE_M`, `row * TILE_M` in the frame of the clouds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Tile {
    /// Counted to the east.
    pub column: i64,
    /// Counted to the north.
    pub row: i64,
}

/// A vertex of the lattice, counted from the origin of the frame of the clouds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Vertex {
    /// Counted to the east.
    pub x: i64,
    /// Counted to the north.
    pub y: i64,
}

impl Tile {
    /// The tile with this place, m.
    pub fn at(x: f64, y: f64) -> Self {
        Self { column: (x / TILE_M).floor() as i64, row: (y / TILE_M).floor() as i64 }
    }

    /// South-west corner, m.
    pub fn corner(self) -> [f64; 2] {
        [self.column as f64 * TILE_M, self.row as f64 * TILE_M]
    }

    /// Its first vertex: the south-west corner.
    pub fn first_vertex(self) -> Vertex {
        Vertex { x: self.column * STEPS as i64, y: self.row * STEPS as i64 }
    }

    /// The tile and its eight neighbors.
    pub fn block(self) -> impl Iterator<Item = Self> {
        let offsets = (-1..=1).flat_map(|row| (-1..=1).map(move |column| (column, row)));
        offsets.map(move |(column, row)| Self { column: self.column + column, row: self.row + row })
    }

    /// The tiles between two corners, m, and those around them within `margin_m`.
    pub fn between(low: [f64; 2], high: [f64; 2], margin_m: f64) -> impl Iterator<Item = Self> {
        let first = Self::at(low[0] - margin_m, low[1] - margin_m);
        let last = Self::at(high[0] + margin_m, high[1] + margin_m);
        (first.row..=last.row).flat_map(move |row| (first.column..=last.column).map(move |column| Self { column, row }))
    }

    /// Name without extension, sorted by column, then row. Negative numbers have `m` instead of a minus, which shells read as an option.
    pub fn name(self) -> String {
        let text = |number: i64| format!("{}{:04}", if number < 0 { "m" } else { "p" }, number.abs());
        format!("{}_{}", text(self.column), text(self.row))
    }
}

impl Vertex {
    /// The vertex nearest to a place, m.
    pub fn nearest(x: f64, y: f64) -> Self {
        Self { x: (x / STEP_M).round() as i64, y: (y / STEP_M).round() as i64 }
    }

    /// Its place, m.
    pub fn place(self) -> [f64; 2] {
        [self.x as f64 * STEP_M, self.y as f64 * STEP_M]
    }

    /// The tile that stores it.
    pub fn tile(self) -> Tile {
        let steps = STEPS as i64;
        Tile { column: self.x.div_euclid(steps), row: self.y.div_euclid(steps) }
    }

    /// Its index in its tile: row by row from the south-west corner.
    pub fn idx_in_tile(self) -> usize {
        let steps = STEPS as i64;
        self.y.rem_euclid(steps) as usize * STEPS + self.x.rem_euclid(steps) as usize
    }

    /// A vertex this many steps to the east and to the north.
    #[must_use]
    pub fn plus(self, x: i64, y: i64) -> Self {
        Self { x: self.x + x, y: self.y + y }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn vertices_and_tiles_agree_on_both_sides_of_the_origin() {
        for (x, y) in [(0.0, 0.0), (49.99, -0.02), (-50.01, 120.0), (-0.049, 50.0)] {
            let vertex = Vertex::nearest(x, y);
            let [vx, vy] = vertex.place();
            assert!((vx - x).abs() <= 0.5 * STEP_M && (vy - y).abs() <= 0.5 * STEP_M);
            assert_eq!(vertex.tile(), Tile::at(vx + 1e-6, vy + 1e-6));
            let first = vertex.tile().first_vertex();
            let idx = (vertex.y - first.y) as usize * STEPS + (vertex.x - first.x) as usize;
            assert_eq!(vertex.idx_in_tile(), idx);
        }
        assert_eq!(Tile { column: -3, row: 12 }.name(), "m0003_p0012");
        assert_eq!(Tile::between([-1.0, 1.0], [51.0, 2.0], 0.0).count(), 3);
    }
}
