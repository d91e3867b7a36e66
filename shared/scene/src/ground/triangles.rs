//! Triangles of a tile: a right-triangulated irregular network (Evans, Kirkpatrick and Townsend, Algorithmica 2001).
//!
//! A triangle is halved until the lattice deviates from it by less than the tolerance. Vertices on the border of a tile are all kept, so that
//! neighboring tiles meet without gaps, and so are vertices at the edge of the known ground.

use super::measured::GroundVertex;
use crate::tile::STEPS;

/// Vertices along the side of a tile, with both borders.
const SIDE: usize = STEPS + 1;

/// A corner of a triangle on the lattice of a tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Corner {
    x: usize,
    y: usize,
}

impl Corner {
    fn idx(self) -> usize {
        self.y * SIDE + self.x
    }

    fn middle(self, other: Self) -> Self {
        Self { x: usize::midpoint(self.x, other.x), y: usize::midpoint(self.y, other.y) }
    }

    fn is_on_border(self) -> bool {
        [self.x, self.y].iter().any(|value| *value == 0 || *value == STEPS)
    }
}

/// Half of a square: `a` and `b` are the ends of its hypotenuse.
#[derive(Clone, Copy)]
struct Half {
    a: Corner,
    b: Corner,
    c: Corner,
}

impl Half {
    /// Both halves of a tile.
    fn both() -> [Self; 2] {
        let corner = |x, y| Corner { x: x * STEPS, y: y * STEPS };
        let [sw, se, nw, ne] = [corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1)];
        [Self { a: sw, b: ne, c: nw }, Self { a: ne, b: sw, c: se }]
    }

    /// Its halves; `None` if it has no vertex between its corners.
    fn halves(self) -> Option<[Self; 2]> {
        let Self { a, b, c } = self;
        let is_smallest = a.x.abs_diff(c.x) + a.y.abs_diff(c.y) <= 1;
        let middle = a.middle(b);
        (!is_smallest).then_some([Self { a: c, b: a, c: middle }, Self { a: b, b: c, c: middle }])
    }
}

/// Halvings from half a tile to the smallest triangle.
const LEVELS: u32 = 2 * STEPS.ilog2();

/// Indices of the triangles of a tile, counter-clockwise seen from above. `vertices` has `STEPS + 1` vertices in a row, from the south-west
/// corner. Each triangle deviates from the heights at its inner vertices by at most `tolerance_m`, m.
pub fn triangles(vertices: &[GroundVertex], tolerance_m: f32) -> Vec<[u32; 3]> {
    assert_eq!(vertices.len(), SIDE * SIDE, "vertices of a tile");
    let mut errors = vec![0.0_f32; vertices.len()];
    // Two triangles share a hypotenuse: its error is complete before larger triangles use it.
    for level in (0..LEVELS).rev() {
        for half in Half::both() {
            measure(half, level, vertices, &mut errors);
        }
    }
    let mut found = Vec::new();
    for half in Half::both() {
        collect(half, vertices, &errors, tolerance_m, &mut found);
    }
    found
}

/// Stores the largest error within each triangle, `level` halvings below this one, at the middle of its hypotenuse.
fn measure(half: Half, level: u32, vertices: &[GroundVertex], errors: &mut [f32]) {
    let Some(halves) = half.halves() else { return };
    if level > 0 {
        return halves.into_iter().for_each(|half| measure(half, level - 1, vertices, errors));
    }
    let Half { a, b, .. } = half;
    let middle = a.middle(b);
    let height = |corner: Corner| vertices[corner.idx()].height_m;
    let off_m = (0.5 * (height(a) + height(b)) - height(middle)).abs();
    let own = if off_m.is_nan() || middle.is_on_border() { f32::INFINITY } else { off_m };
    let below = |half: Half| match half.halves() {
        Some(_) => errors[half.a.middle(half.b).idx()],
        // Corners at the edge of the known ground keep all triangles around them.
        None if [half.a, half.b, half.c].iter().all(|corner| vertices[corner.idx()].is_known()) => 0.0,
        None => f32::INFINITY,
    };
    let largest = halves.map(below).into_iter().fold(own, f32::max);
    errors[middle.idx()] = errors[middle.idx()].max(largest);
}

fn collect(half: Half, vertices: &[GroundVertex], errors: &[f32], tolerance_m: f32, found: &mut Vec<[u32; 3]>) {
    let Half { a, b, c } = half;
    match half.halves().filter(|_| errors[a.middle(b).idx()] > tolerance_m) {
        Some(halves) => halves.into_iter().for_each(|half| collect(half, vertices, errors, tolerance_m, found)),
        None if [a, b, c].iter().all(|corner| vertices[corner.idx()].is_known()) => {
            let area = (b.x as i64 - a.x as i64) * (c.y as i64 - a.y as i64)
                - (b.y as i64 - a.y as i64) * (c.x as i64 - a.x as i64);
            let corners = if area > 0 { [a, b, c] } else { [a, c, b] };
            found.push(corners.map(|corner| corner.idx() as u32));
        }
        None => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn surface(height: impl Fn(usize, usize) -> f32) -> Vec<GroundVertex> {
        let vertex = |x, y| GroundVertex { height_m: height(x, y), score: 1.0, ..GroundVertex::UNKNOWN };
        (0..SIDE).flat_map(|y| (0..SIDE).map(move |x| (x, y))).map(|(x, y)| vertex(x, y)).collect()
    }

    /// Numbers of directed edges; each inner edge occurs once in each direction if the surface has no cracks.
    fn open_edges(triangles: &[[u32; 3]]) -> Vec<(u32, u32)> {
        let mut edges: BTreeMap<(u32, u32), i32> = BTreeMap::new();
        for [a, b, c] in triangles {
            for (from, to) in [(*a, *b), (*b, *c), (*c, *a)] {
                *edges.entry((from.min(to), from.max(to))).or_default() += if from < to { 1 } else { -1 };
            }
        }
        edges.into_iter().filter(|(_, n)| *n != 0).map(|(edge, _)| edge).collect()
    }

    #[test]
    fn kerb_is_kept_within_the_tolerance_and_the_surface_has_no_cracks() {
        let side = STEPS as f32;
        let kerb = |x: usize, y: usize| (x as f32 * 0.002).sin() + if x + y / 8 > 300 { 0.14 } else { 0.0 };
        let vertices = surface(kerb);
        let found = triangles(&vertices, 0.01);
        assert!(found.len() < 60_000, "{} triangles of 524 288", found.len());
        let is_border = |idx: u32| Corner { x: idx as usize % SIDE, y: idx as usize / SIDE }.is_on_border();
        assert!(open_edges(&found).iter().all(|(a, b)| is_border(*a) && is_border(*b)));
        let area: f64 = found
            .iter()
            .map(|corners| {
                let [a, b, c] = corners.map(|idx| [f64::from(idx % SIDE as u32), f64::from(idx / SIDE as u32)]);
                0.5 * ((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
            })
            .sum();
        assert!((area - f64::from(side * side)).abs() < 1e-3, "{area}");
        let largest = found.iter().map(|corners| deviation(corners, &vertices)).fold(0.0, f32::max);
        assert!(largest <= 0.0101, "{largest}");
    }

    /// Largest distance of the lattice from a triangle.
    fn deviation(corners: &[u32; 3], vertices: &[GroundVertex]) -> f32 {
        let place = corners.map(|idx| [(idx as usize % SIDE) as f32, (idx as usize / SIDE) as f32]);
        let heights = corners.map(|idx| vertices[idx as usize].height_m);
        let [a, b, c] = place;
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        let range = |axis: usize| {
            let values = place.map(|p| p[axis]);
            values.iter().copied().fold(f32::MAX, f32::min) as usize..=values.into_iter().fold(0.0, f32::max) as usize
        };
        let mut largest = 0.0_f32;
        for (x, y) in range(0).flat_map(|x| range(1).map(move |y| (x, y))) {
            let p = [x as f32, y as f32];
            let share =
                |u: [f32; 2], v: [f32; 2]| ((u[0] - p[0]) * (v[1] - p[1]) - (u[1] - p[1]) * (v[0] - p[0])) / area;
            let weights = [share(b, c), share(c, a), share(a, b)];
            if weights.iter().all(|weight| *weight >= 0.0) {
                let height: f32 = weights.iter().zip(heights).map(|(weight, height)| weight * height).sum();
                largest = largest.max((height - vertices[y * SIDE + x].height_m).abs());
            }
        }
        largest
    }

    #[test]
    fn triangles_end_at_the_edge_of_the_known_ground() {
        let hole = |x: usize, y: usize| (200..230).contains(&x) && (100..117).contains(&y);
        let vertices = surface(|x, y| if hole(x, y) { f32::NAN } else { 2.0 });
        let found = triangles(&vertices, 0.01);
        assert!(found.iter().flatten().all(|idx| vertices[*idx as usize].is_known()));
        let near = open_edges(&found).into_iter().filter(|(a, _)| {
            let corner = Corner { x: *a as usize % SIDE, y: *a as usize / SIDE };
            !corner.is_on_border()
        });
        // The edges around the hole run from vertex to vertex, perhaps across corners of cells.
        let [width, height] = [31, 18];
        assert!((2 * (width + height) - 4..=2 * (width + height) + 8).contains(&near.count()));
        assert!(triangles(&surface(|_, _| f32::NAN), 0.01).is_empty());
    }
}
