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

/// What a point is on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Surface {
    /// Ground.
    Ground(GroundKind),
    /// A wall, at which the completion ends.
    Wall,
}

/// A point of the ground or of a wall, at its vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GroundPoint {
    /// The nearest vertex.
    pub vertex: Vertex,
    /// Height, m.
    pub height_m: f64,
    /// sRGB; black without color.
    pub rgb: [u8; 3],
    /// What it is on.
    pub surface: Surface,
}

/// Number of a wall in the bytes of a point; kinds of ground have the numbers below.
const WALL: u8 = N_KINDS as u8;

impl GroundPoint {
    /// Bytes of a point: index of its vertex in the tile, height, color, surface.
    pub(crate) const N_BYTES: usize = 16;

    /// A point of a cloud. `None` if it is on something else.
    pub fn new(point: &CloudPoint) -> Option<Self> {
        let class = ClassId::from_id(point.class)?;
        let is_wall = matches!(class, ClassId::Building | ClassId::Wall | ClassId::Fence | ClassId::GuardRail);
        let surface = GroundKind::from_class(class).map(Surface::Ground).or(is_wall.then_some(Surface::Wall))?;
        let [x, y, height_m] = point.xyz;
        Some(Self { vertex: Vertex::nearest(x, y), height_m, rgb: point.rgb, surface })
    }

    /// The bytes of the point in its tile.
    pub(crate) fn to_bytes(self) -> [u8; Self::N_BYTES] {
        let mut bytes = [0; Self::N_BYTES];
        bytes[..4].copy_from_slice(&(self.vertex.idx_in_tile() as u32).to_le_bytes());
        bytes[4..12].copy_from_slice(&self.height_m.to_le_bytes());
        bytes[12..15].copy_from_slice(&self.rgb);
        bytes[15] = match self.surface {
            Surface::Ground(kind) => kind as u8,
            Surface::Wall => WALL,
        };
        bytes
    }

    /// The point of a tile with these bytes.
    pub(crate) fn from_bytes(tile: Tile, bytes: &[u8; Self::N_BYTES]) -> Self {
        let [a, b, c, d, height @ .., r, g, blue, surface] = *bytes;
        let idx = i64::from(u32::from_le_bytes([a, b, c, d]));
        let steps = STEPS as i64;
        let surface = match surface {
            0 => Surface::Ground(GroundKind::Road),
            1 => Surface::Ground(GroundKind::Marking),
            2 => Surface::Ground(GroundKind::Sidewalk),
            WALL => Surface::Wall,
            _ => Surface::Ground(GroundKind::Other),
        };
        Self {
            vertex: tile.first_vertex().plus(idx % steps, idx / steps),
            height_m: f64::from_le_bytes(height),
            rgb: [r, g, blue],
            surface,
        }
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
        if let Some(ground) = GroundPoint::new(point) {
            self.add_ground(&ground);
        }
    }

    /// Adds a point of the ground or of a wall.
    pub fn add_ground(&mut self, point: &GroundPoint) {
        let GroundPoint { vertex, height_m, rgb, surface } = *point;
        let sums = self.tiles.entry(vertex.tile()).or_insert_with(|| vec![Sums::default(); STEPS * STEPS]);
        let sums = &mut sums[vertex.idx_in_tile()];
        let Surface::Ground(kind) = surface else {
            sums.is_wall = true;
            return;
        };
        sums.height_m += height_m;
        sums.n += 1;
        sums.kinds[kind as usize] += 1;
        if rgb != [0; 3] {
            sums.n_colored += 1;
            sums.rgb.iter_mut().zip(rgb).for_each(|(sum, channel)| *sum += u32::from(channel));
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
    fn point_survives_its_bytes() {
        for (class, surface) in [
            (ClassId::Road, Some(Surface::Ground(GroundKind::Road))),
            (ClassId::RoadLine, Some(Surface::Ground(GroundKind::Marking))),
            (ClassId::Sidewalk, Some(Surface::Ground(GroundKind::Sidewalk))),
            (ClassId::Terrain, Some(Surface::Ground(GroundKind::Other))),
            (ClassId::Fence, Some(Surface::Wall)),
            (ClassId::Pole, None),
        ] {
            let ground = GroundPoint::new(&point(class, [-73.21, 112.34, -5.678_901]));
            assert_eq!(ground.map(|ground| ground.surface), surface);
            if let Some(ground) = ground {
                assert_eq!(GroundPoint::from_bytes(ground.vertex.tile(), &ground.to_bytes()), ground);
            }
        }
    }

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
