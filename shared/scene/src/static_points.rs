//! The points of the static world, thinned to one point for each cube.

use crate::tile::Tile;
use formats::ply::{Header, Kind, PlyError, PlyWriter, Row};
use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use surveying::CloudPoint;

/// Side of the cubes, m: finer than the surfaces that simulators show, and the distance of the LiDAR's points at 15 m.
const CUBE_M: f64 = 0.05;

/// The mean of the points of a cube.
#[derive(Clone, Copy)]
struct Thinned {
    sum: [f64; 3],
    rgb: [u32; 3],
    n: u32,
    /// Class of the first point.
    class: u8,
}

/// Points of the tiles that are not yet complete.
#[derive(Default)]
pub struct StaticPoints {
    tiles: BTreeMap<Tile, TilePoints>,
}

/// The points of a tile in the order in which their cubes were first seen.
#[derive(Default)]
struct TilePoints {
    points: Vec<Thinned>,
    by_cube: HashMap<[i32; 3], u32>,
}

/// A point of the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ScenePoint {
    /// Place in the frame of the clouds, m.
    pub xyz: [f64; 3],
    /// sRGB.
    pub rgb: [u8; 3],
    /// Class id.
    pub class: u8,
    /// 1 for points that were measured, less for completed ones.
    pub score: f32,
}

impl StaticPoints {
    /// Adds a point of the static world.
    pub fn add(&mut self, point: &CloudPoint) {
        let tile = Tile::at(point.xyz[0], point.xyz[1]);
        let points = self.tiles.entry(tile).or_default();
        let cube = point.xyz.map(|value| (value / CUBE_M).floor() as i32);
        let idx = *points.by_cube.entry(cube).or_insert(points.points.len() as u32) as usize;
        if idx == points.points.len() {
            points.points.push(Thinned { sum: [0.0; 3], rgb: [0; 3], n: 0, class: point.class });
        }
        let thinned = &mut points.points[idx];
        thinned.n += 1;
        thinned.sum.iter_mut().zip(point.xyz).for_each(|(sum, value)| *sum += value);
        thinned.rgb.iter_mut().zip(point.rgb).for_each(|(sum, value)| *sum += u32::from(value));
    }

    /// Takes the points of a tile.
    pub fn take(&mut self, tile: Tile) -> Vec<ScenePoint> {
        let points = self.tiles.remove(&tile).unwrap_or_default().points;
        let point = |thinned: &Thinned| ScenePoint {
            xyz: thinned.sum.map(|sum| sum / f64::from(thinned.n)),
            rgb: thinned.rgb.map(|sum| (sum / thinned.n) as u8),
            class: thinned.class,
            score: 1.0,
        };
        points.iter().map(point).collect()
    }

    /// The tiles with points.
    pub fn tiles(&self) -> impl Iterator<Item = Tile> {
        self.tiles.keys().copied()
    }
}

/// Writes points as PLY. `frame` names the frame of the coordinates.
pub fn write_points(path: &Path, points: &[ScenePoint], frame: &str) -> Result<(), PlyError> {
    let header = Header::new([
        ("x", Kind::Double),
        ("y", Kind::Double),
        ("z", Kind::Double),
        ("red", Kind::UChar),
        ("green", Kind::UChar),
        ("blue", Kind::UChar),
        ("semantic", Kind::UChar),
        ("completed", Kind::UChar),
        ("score", Kind::Float),
    ]);
    let mut writer = PlyWriter::create(path, &header.info(format!("frame {frame}, m")), points.len())?;
    let encode = |i: usize, row: &mut Row<'_>| {
        let ScenePoint { xyz: [x, y, z], rgb: [red, green, blue], class, score } = points[i];
        row.f64(x).f64(y).f64(z).u8(red).u8(green).u8(blue).u8(class).u8(u8::from(score < 1.0)).f32(score);
    };
    writer.write_each(points.len(), encode)?;
    writer.finish()?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::removal::tests::point;
    use formats::ply::Vertices;
    use messages::ClassId;

    #[test]
    fn cube_has_one_point_at_the_mean() {
        let mut points = StaticPoints::default();
        for x in [0.01, 0.03, 0.07] {
            points.add(&point(ClassId::Building, [x, -0.02, 3.0]));
        }
        let tile = Tile { column: 0, row: -1 };
        assert_eq!(points.tiles().collect::<Vec<_>>(), [tile]);
        let taken = points.take(tile);
        assert_eq!(taken.len(), 2);
        assert!((taken[0].xyz[0] - 0.02).abs() < 1e-9);
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("points.ply");
        write_points(&path, &taken, "odometry").expect("writes");
        let read = Vertices::load(&path).expect("reads");
        assert_eq!(read.u8s("semantic").expect("a field"), [ClassId::Building as u8; 2]);
        assert_eq!(read.u8s("completed").expect("a field"), [0, 0]);
    }
}
