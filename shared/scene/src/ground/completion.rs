//! Ground that objects hid, between ground that was measured.
//!
//! A street changes little along its direction, so that a gap is closed between its measured ends along the path of the vehicle: kerbs go on
//! under parked cars. Without such ends, the nearest measured vertices in eight directions decide, weighted by the inverse square of their
//! distance. Nothing is completed beyond walls, or where fewer than three of the four sides are measured.

use super::measured::GroundVertex;
use crate::tile::{STEP_M, STEPS, Tile, Vertex};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Longest distance to measured ground, m: the length of a lorry's half. Farther away, a surface would be invented.
const REACH_M: f64 = 8.0;
/// The longest distance in steps of the lattice.
const REACH: i64 = (REACH_M / STEP_M) as i64;
/// Difference in height of the two ends of a gap along the street, m, and for each meter of gap: kerbs that begin, and slopes of streets.
const MAX_STEP_M: f64 = 0.05;
const MAX_SLOPE: f64 = 0.12;
/// Distance at which the score of a completed vertex is one half, m. Chosen on simulated towns (`lab/notebook/scenes.md`).
const HALF_SCORE_M: f64 = 3.0;
/// Longest distance of a color, steps of the lattice: 3 m, the width of the strip that a parked lorry hides from a camera.
const COLOR_REACH: i64 = (3.0 / STEP_M) as i64;
/// Directions in which a color must be found.
const MIN_COLORS: usize = 3;
/// Sides that must be measured.
const MIN_SIDES: usize = 3;

/// East, north, west, south, then the diagonals.
const DIRECTIONS: [[i64; 2]; 8] = [[1, 0], [0, 1], [-1, 0], [0, -1], [1, 1], [-1, 1], [-1, -1], [1, -1]];
/// The first directions are the four sides.
const N_SIDES: usize = 4;

/// Vertices along the side of a completed tile, with both borders.
const SIDE: usize = STEPS + 1;

/// A tile with its borders, row by row from the south-west corner.
pub struct CompletedTile {
    /// `STEPS + 1` rows of as many vertices.
    pub vertices: Vec<GroundVertex>,
}

impl CompletedTile {
    /// Numbers of measured and of completed vertices, without the borders that neighbors have.
    pub fn counts(&self) -> [u64; 2] {
        let own = self.vertices.chunks_exact(SIDE).take(STEPS).flat_map(|row| &row[..STEPS]);
        own.filter(|vertex| vertex.is_known()).fold([0, 0], |[measured, completed], vertex| {
            if vertex.score >= 1.0 { [measured + 1, completed] } else { [measured, completed + 1] }
        })
    }
}

/// Measured vertices of tiles and their neighbors.
#[derive(Default)]
pub struct Completion {
    /// Vertices of each tile, row by row.
    tiles: BTreeMap<Tile, Vec<GroundVertex>>,
}

/// The nearest measured vertex in a direction.
#[derive(Clone, Copy)]
struct End {
    distance_m: f64,
    vertex: GroundVertex,
}

impl Completion {
    /// Adds the measured vertices of a tile.
    pub fn insert(&mut self, tile: Tile, vertices: Vec<GroundVertex>) {
        self.tiles.insert(tile, vertices);
    }

    /// Forgets a tile.
    pub fn remove(&mut self, tile: Tile) {
        self.tiles.remove(&tile);
    }

    /// Whether the tile has measured vertices.
    pub fn contains(&self, tile: Tile) -> bool {
        self.tiles.contains_key(&tile)
    }

    /// Completes the colors of a tile: ground that the LiDAR saw and no camera, such as next to a parked car, gets the color of the nearest
    /// measured ground around.
    pub fn complete_colors(&self, tile: Tile, ground: &mut CompletedTile) {
        let window = Window::new(self, tile);
        let rows = ground.vertices.par_chunks_mut(SIDE).enumerate();
        rows.for_each(|(y, row)| {
            for (x, vertex) in
                row.iter_mut().enumerate().filter(|(_, vertex)| vertex.is_known() && vertex.rgb == [0; 3])
            {
                vertex.rgb = window.color([x as i64, y as i64]);
            }
        });
    }

    /// Completes a tile whose neighbors have been added. `direction` gives the direction of the street at a place as a unit vector, if it is
    /// known there.
    pub fn complete(&self, tile: Tile, direction: impl Fn([f64; 2]) -> Option<[f64; 2]> + Sync) -> CompletedTile {
        let window = Window::new(self, tile);
        let first = tile.first_vertex();
        let row = |y: usize| {
            let vertices = (0..SIDE).map(|x| {
                let at = [x as i64, y as i64];
                let measured = window.get(at);
                if measured.is_known() {
                    return measured;
                }
                let street = || direction(first.plus(at[0], at[1]).place());
                window.completed(at, street).unwrap_or(measured)
            });
            vertices.collect::<Vec<_>>()
        };
        CompletedTile { vertices: (0..SIDE).into_par_iter().flat_map_iter(row).collect() }
    }
}

/// The vertices of a tile and its surroundings.
struct Window<'a> {
    /// From the south-west neighbor, row by row of tiles.
    tiles: [Option<&'a [GroundVertex]>; 9],
}

impl<'a> Window<'a> {
    fn new(all: &'a Completion, tile: Tile) -> Self {
        let mut block = tile.block();
        Self { tiles: std::array::from_fn(|_| block.next().and_then(|tile| all.tiles.get(&tile)).map(Vec::as_slice)) }
    }

    /// The vertex that many steps from the south-west corner of the tile: between minus and twice the side of a tile.
    fn get(&self, [x, y]: [i64; 2]) -> GroundVertex {
        let steps = STEPS as i64;
        let tile = (y.div_euclid(steps) + 1) * 3 + x.div_euclid(steps) + 1;
        let found = usize::try_from(tile).ok().and_then(|tile| self.tiles.get(tile).copied().flatten());
        found.map_or(GroundVertex::UNKNOWN, |vertices| vertices[Vertex { x, y }.idx_in_tile()])
    }

    /// The nearest measured vertex in a direction, within reach and before a wall.
    fn end(&self, at: [i64; 2], step: [f64; 2]) -> Option<End> {
        self.nearest(at, step, REACH, GroundVertex::is_known)
    }

    /// Mean color of the nearest colored vertices around; black with fewer than [`MIN_COLORS`].
    fn color(&self, at: [i64; 2]) -> [u8; 3] {
        let is_colored = |vertex: &GroundVertex| vertex.is_known() && vertex.rgb != [0; 3];
        let around = DIRECTIONS.map(|step| self.nearest(at, step.map(|value| value as f64), COLOR_REACH, is_colored));
        let ends: Vec<End> = around.into_iter().flatten().collect();
        let weights: Vec<f64> = ends.iter().map(|end| end.distance_m.powi(-2)).collect();
        if ends.len() < MIN_COLORS { [0; 3] } else { mean_color(ends.iter().zip(&weights)) }
    }

    /// The nearest wanted vertex in a direction, within `reach` steps of the lattice and before a wall.
    fn nearest(
        &self,
        [x, y]: [i64; 2],
        step: [f64; 2],
        reach: i64,
        is_wanted: impl Fn(&GroundVertex) -> bool,
    ) -> Option<End> {
        let length = step[0].hypot(step[1]);
        for k in 1..=(reach as f64 / length) as i64 {
            let offset = step.map(|value| (value * k as f64).round() as i64);
            let vertex = self.get([x + offset[0], y + offset[1]]);
            if is_wanted(&vertex) {
                return Some(End { distance_m: k as f64 * length * STEP_M, vertex });
            }
            if vertex.is_wall {
                return None;
            }
        }
        None
    }

    fn completed(&self, at: [i64; 2], street: impl Fn() -> Option<[f64; 2]>) -> Option<GroundVertex> {
        if self.get(at).is_wall {
            return None;
        }
        let side = |number: usize| self.end(at, DIRECTIONS[number].map(|value| value as f64));
        let mut ends: Vec<Option<End>> = (0..N_SIDES).map(side).collect();
        if ends.iter().flatten().count() < MIN_SIDES {
            return None;
        }
        let along = street().and_then(|[x, y]| Some([self.end(at, [x, y])?, self.end(at, [-x, -y])?]));
        if let Some(ends) = along.filter(agree) {
            return Some(between(&ends));
        }
        ends.extend((N_SIDES..DIRECTIONS.len()).map(side));
        Some(between(&ends.into_iter().flatten().collect::<Vec<_>>()))
    }
}

/// Whether both ends of a gap along a street are on one surface.
fn agree([a, b]: &[End; 2]) -> bool {
    let gap_m = a.distance_m + b.distance_m;
    f64::from((a.vertex.height_m - b.vertex.height_m).abs()) <= MAX_STEP_M + MAX_SLOPE * gap_m
}

/// The vertex between these ends, of which there is at least one. Two opposite ends: a straight line.
fn between(ends: &[End]) -> GroundVertex {
    let power = if ends.len() == 2 { 1 } else { 2 };
    let weights: Vec<f64> = ends.iter().map(|end| end.distance_m.powi(-power)).collect();
    let sum: f64 = weights.iter().sum();
    let mean = |value: &dyn Fn(&GroundVertex) -> f64| {
        ends.iter().zip(&weights).map(|(end, weight)| weight * value(&end.vertex)).sum::<f64>() / sum
    };
    let nearest = ends.iter().min_by(|a, b| a.distance_m.total_cmp(&b.distance_m));
    let distance_m = nearest.map_or(0.0, |end| end.distance_m);
    GroundVertex {
        height_m: mean(&|vertex| f64::from(vertex.height_m)) as f32,
        rgb: mean_color(ends.iter().zip(&weights)),
        kind: nearest.map(|end| end.vertex.kind).unwrap_or_default(),
        score: (HALF_SCORE_M / (HALF_SCORE_M + distance_m)) as f32,
        is_wall: false,
    }
}

/// Mean color of the ends with a color; black if none has one.
fn mean_color<'a>(ends: impl Iterator<Item = (&'a End, &'a f64)>) -> [u8; 3] {
    let mut sum = [0.0; 3];
    let mut weights = 0.0;
    for (End { vertex, .. }, weight) in ends.filter(|(end, _)| end.vertex.rgb != [0; 3]) {
        sum.iter_mut().zip(vertex.rgb).for_each(|(sum, channel)| *sum += weight * f64::from(channel));
        weights += weight;
    }
    if weights == 0.0 { [0; 3] } else { sum.map(|sum| (sum / weights).round() as u8) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ground::GroundKind;

    const TILE: Tile = Tile { column: 0, row: 0 };

    fn tile(vertex: impl Fn([f64; 2]) -> GroundVertex) -> Vec<GroundVertex> {
        let places = (0..STEPS * STEPS).map(|idx| [idx % STEPS, idx / STEPS].map(|steps| steps as f64 * STEP_M));
        places.map(vertex).collect()
    }

    /// A street to the north-north-east with a kerb of 12 cm on its right and a slope of 3 %.
    fn street([x, y]: [f64; 2]) -> GroundVertex {
        let right = across([x, y]);
        let height_m = (0.03 * y + if right > 0.0 { 0.12 } else { 0.0 }) as f32;
        let kind = if right > 0.0 { GroundKind::Sidewalk } else { GroundKind::Road };
        GroundVertex { height_m, kind, score: 1.0, ..GroundVertex::UNKNOWN }
    }

    const DIRECTION: [f64; 2] = [0.447_213_595, 0.894_427_191];

    fn across([x, y]: [f64; 2]) -> f64 {
        (x - 25.0) * DIRECTION[1] - (y - 25.0) * DIRECTION[0]
    }

    fn along([x, y]: [f64; 2]) -> f64 {
        (x - 25.0) * DIRECTION[0] + (y - 25.0) * DIRECTION[1]
    }

    /// The shadow of a parked car across the kerb.
    fn is_hidden(place: [f64; 2]) -> bool {
        along(place).abs() < 2.3 && (-1.9..0.5).contains(&across(place))
    }

    #[test]
    fn kerb_goes_on_under_a_parked_car() {
        let mut completion = Completion::default();
        completion.insert(TILE, tile(|place| if is_hidden(place) { GroundVertex::UNKNOWN } else { street(place) }));
        let found = completion.complete(TILE, |_| Some(DIRECTION));
        let mut n = 0;
        for (idx, vertex) in found.vertices.iter().enumerate() {
            let place = [idx % SIDE, idx / SIDE].map(|steps| steps as f64 * STEP_M);
            // Off the kerb itself, by the error of a step of the lattice.
            if is_hidden(place) && across(place).abs() > 1.5 * STEP_M {
                let truth = street(place);
                assert!((vertex.height_m - truth.height_m).abs() < 0.02, "{place:?} {vertex:?} {truth:?}");
                assert_eq!(vertex.kind, truth.kind);
                assert!(vertex.score < 1.0 && vertex.score > 0.5);
                n += 1;
            }
        }
        assert!(n > 900);
        let [_, n_completed] = found.counts();
        assert!(n_completed >= n);
        // Without the direction of the street, the kerb is lost.
        let unknown = completion.complete(TILE, |_| None);
        let worst = unknown.vertices.iter().zip(&found.vertices).map(|(a, b)| (a.height_m - b.height_m).abs());
        assert!(worst.fold(0.0, f32::max) > 0.04);
    }

    #[test]
    fn colors_go_on_next_to_a_car_and_are_not_mixed_with_black() {
        let mut completion = Completion::default();
        // Ground of one color; a strip of 1 m that no camera saw, and a hidden place of 1 m next to it.
        let vertex = |[x, y]: [f64; 2]| match (x, y) {
            (x, y) if (20.0..21.0).contains(&x) && (10.0..11.0).contains(&y) => GroundVertex::UNKNOWN,
            (x, _) if (21.0..22.0).contains(&x) => street([x, y]),
            (x, _) if x > 40.0 => street([x, y]),
            _ => GroundVertex { rgb: [80, 90, 100], ..street([x, y]) },
        };
        completion.insert(TILE, tile(vertex));
        let mut found = completion.complete(TILE, |_| None);
        let at = |found: &CompletedTile, x: f64, y: f64| {
            found.vertices[(y / STEP_M) as usize * SIDE + (x / STEP_M) as usize].rgb
        };
        assert_eq!((at(&found, 20.5, 10.5), at(&found, 21.5, 30.0)), ([80, 90, 100], [0; 3]));
        completion.complete_colors(TILE, &mut found);
        assert_eq!(at(&found, 21.5, 30.0), [80, 90, 100]);
        assert_eq!(at(&found, 46.0, 30.0), [0; 3], "no color within reach");
    }

    #[test]
    fn nothing_is_completed_behind_walls_or_beyond_the_edge() {
        let mut completion = Completion::default();
        // A courtyard of 6 m between walls, in ground that ends 10 m before the east border.
        let is_inside = |[x, y]: [f64; 2]| (10.0..16.0).contains(&x) && (10.0..16.0).contains(&y);
        let is_wall = |[x, y]: [f64; 2]| {
            let grown = (9.7..16.3).contains(&x) && (9.7..16.3).contains(&y);
            grown && !is_inside([x, y])
        };
        let vertex = |place: [f64; 2]| match place {
            place if is_wall(place) => GroundVertex { is_wall: true, ..GroundVertex::UNKNOWN },
            [x, _] if is_inside(place) || x > 40.0 => GroundVertex::UNKNOWN,
            place => street(place),
        };
        completion.insert(TILE, tile(vertex));
        let found = completion.complete(TILE, |_| Some([1.0, 0.0]));
        let at = |x: f64, y: f64| found.vertices[(y / STEP_M) as usize * SIDE + (x / STEP_M) as usize];
        assert!(at(5.0, 5.0).is_known());
        assert!(!at(13.0, 13.0).is_known());
        assert!(!at(44.0, 13.0).is_known());
    }

    #[test]
    fn both_sides_of_a_border_agree() {
        let mut completion = Completion::default();
        let east = Tile { column: 1, row: 0 };
        let hidden = |x: f64| (48.0..52.5).contains(&x);
        let vertices = |tile: Tile| {
            let [x0, _] = tile.corner();
            self::tile(|[x, y]| {
                let place = [x + x0, y];
                if hidden(place[0]) && (20.0..22.0).contains(&y) { GroundVertex::UNKNOWN } else { street(place) }
            })
        };
        for tile in [TILE, east] {
            completion.insert(tile, vertices(tile));
        }
        let [left, right] = [TILE, east].map(|tile| completion.complete(tile, |_| Some(DIRECTION)));
        for y in 0..SIDE {
            let [a, b] = [left.vertices[y * SIDE + STEPS], right.vertices[y * SIDE]];
            assert!(a == b || !a.is_known() && !b.is_known(), "{y}: {a:?} {b:?}");
        }
    }
}
