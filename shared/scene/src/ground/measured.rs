//! Heights of the ground where it was measured.

use crate::tile::{STEPS, Tile, Vertex};
use messages::{ClassId, GROUND_CLASSES};
use std::collections::BTreeMap;
use surveying::CloudPoint;

/// Most common surface at a vertex.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum GroundKind {
    /// Road without paint.
    #[default]
    Road,
    /// Paint on a road.
    Marking,
    /// Sidewalk.
    Sidewalk,
    /// Terrain, rails, other ground.
    Other,
}

/// Number of kinds.
const N_KINDS: usize = 4;

impl GroundKind {
    /// The kind of a class. `None` unless it is a class of the ground.
    pub fn from_class(class: ClassId) -> Option<Self> {
        match class {
            ClassId::Road => Some(Self::Road),
            ClassId::RoadLine => Some(Self::Marking),
            ClassId::Sidewalk => Some(Self::Sidewalk),
            class => GROUND_CLASSES.contains(&class).then_some(Self::Other),
        }
    }
}

/// The ground at a vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundVertex {
    /// Height in the frame of the clouds, m. NaN where it is unknown.
    pub height_m: f32,
    /// sRGB; black without color.
    pub rgb: [u8; 3],
    /// Its surface.
    pub kind: GroundKind,
    /// 1 where the ground was measured; otherwise how sure the completion is, above 0.
    pub score: f32,
    /// Whether a wall stands here: the completion ends at it.
    pub is_wall: bool,
}

impl GroundVertex {
    /// A vertex without height.
    pub const UNKNOWN: Self =
        Self { height_m: f32::NAN, rgb: [0; 3], kind: GroundKind::Road, score: 0.0, is_wall: false };

    /// Whether it has a height.
    pub fn is_known(&self) -> bool {
        !self.height_m.is_nan()
    }
}

/// Sums over the points nearest to a vertex.
#[derive(Clone, Copy, Default)]
struct Sums {
    height_m: f64,
    n: u32,
    rgb: [u32; 3],
    n_colored: u32,
    kinds: [u32; N_KINDS],
    is_wall: bool,
}

/// The measured ground of the tiles that are not yet complete.
#[derive(Default)]
pub struct MeasuredGround {
    tiles: BTreeMap<Tile, Vec<Sums>>,
}

impl MeasuredGround {
    /// Adds a point of the static world.
    pub fn add(&mut self, point: &CloudPoint) {
        let Some(class) = ClassId::from_id(point.class) else { return };
        let kind = GroundKind::from_class(class);
        let is_wall = matches!(class, ClassId::Building | ClassId::Wall | ClassId::Fence | ClassId::GuardRail);
        if kind.is_none() && !is_wall {
            return;
        }
        let vertex = Vertex::nearest(point.xyz[0], point.xyz[1]);
        let sums = self.tiles.entry(vertex.tile()).or_insert_with(|| vec![Sums::default(); STEPS * STEPS]);
        let sums = &mut sums[vertex.idx_in_tile()];
        sums.is_wall |= is_wall;
        let Some(kind) = kind else { return };
        sums.height_m += point.xyz[2];
        sums.n += 1;
        sums.kinds[kind as usize] += 1;
        if point.rgb != [0; 3] {
            sums.n_colored += 1;
            sums.rgb.iter_mut().zip(point.rgb).for_each(|(sum, channel)| *sum += u32::from(channel));
        }
    }

    /// Takes the vertices of a tile, row by row from its south-west corner. `None` without points.
    pub fn take(&mut self, tile: Tile) -> Option<Vec<GroundVertex>> {
        let sums = self.tiles.remove(&tile)?;
        let mut vertices: Vec<GroundVertex> = sums.iter().map(Sums::vertex).collect();
        let heights: Vec<f32> = vertices.iter().map(|vertex| vertex.height_m).collect();
        for (idx, vertex) in vertices.iter_mut().enumerate().filter(|(_, vertex)| vertex.is_known()) {
            vertex.height_m = smoothed(idx, &heights, &sums);
        }
        Some(vertices)
    }

    /// The tiles with points.
    pub fn tiles(&self) -> impl Iterator<Item = Tile> {
        self.tiles.keys().copied()
    }
}

impl Sums {
    fn vertex(&self) -> GroundVertex {
        let is_wall = self.is_wall;
        if self.n == 0 {
            return GroundVertex { is_wall, ..GroundVertex::UNKNOWN };
        }
        let kinds = [GroundKind::Road, GroundKind::Marking, GroundKind::Sidewalk, GroundKind::Other];
        let kind = kinds.into_iter().max_by_key(|kind| (self.kinds[*kind as usize], std::cmp::Reverse(*kind)));
        let rgb = self.rgb.map(|sum| sum.checked_div(self.n_colored).unwrap_or(0) as u8);
        let height_m = (self.height_m / f64::from(self.n)) as f32;
        GroundVertex { height_m, rgb, kind: kind.unwrap_or_default(), score: 1.0, is_wall }
    }
}

/// Neighbors whose heights differ by less are on the same surface, m: half of a low kerb, and three deviations of the ranges.
const SAME_SURFACE_M: f32 = 0.05;
/// Neighbors on each side that take part.
const REACH: usize = 2;

/// Mean of the points of a vertex and its neighbors on the same surface. At the border of a tile, only neighbors in the tile take part.
fn smoothed(idx: usize, heights: &[f32], sums: &[Sums]) -> f32 {
    let [x, y] = [idx % STEPS, idx / STEPS];
    let around = |at: usize| at.saturating_sub(REACH)..(at + REACH + 1).min(STEPS);
    let mut sum = 0.0;
    let mut n = 0;
    for near in around(y).flat_map(|y| around(x).map(move |x| y * STEPS + x)) {
        if (heights[near] - heights[idx]).abs() < SAME_SURFACE_M {
            sum += sums[near].height_m;
            n += sums[near].n;
        }
    }
    (sum / f64::from(n.max(1))) as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::removal::tests::point;

    #[test]
    fn vertex_has_mean_height_color_and_most_common_kind() {
        let mut ground = MeasuredGround::default();
        for (class, z) in [(ClassId::Road, 1.0), (ClassId::RoadLine, 1.2), (ClassId::RoadLine, 1.4)] {
            ground.add(&point(class, [-0.01, 0.02, z]));
        }
        ground.add(&point(ClassId::Sidewalk, [-0.01, 2.0 * crate::tile::STEP_M, 1.24]));
        ground.add(&point(ClassId::Sidewalk, [-0.01, 2.0 * crate::tile::STEP_M + 1.0, 1.4]));
        ground.add(&point(ClassId::Vegetation, [-0.01, 0.02, 9.0]));
        ground.add(&point(ClassId::Wall, [1.0, 0.0, 2.0]));
        let vertices = ground.take(Tile { column: 0, row: 0 }).expect("has points");
        let found = vertices[0];
        // The mean of four points: a neighbor is on the same surface.
        assert!((found.height_m - 1.21).abs() < 1e-6);
        assert_eq!((found.rgb, found.kind, found.is_wall), ([90, 91, 92], GroundKind::Marking, false));
        assert!(vertices[10].is_wall && !vertices[10].is_known());
        assert!(ground.tiles().next().is_none());
    }
}
