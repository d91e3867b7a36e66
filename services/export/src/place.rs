//! A cloud is written while the drive goes on, in the odometry's frame. Where it lies is known at the end: then its coordinates
//! are moved, in a copy that takes its name when it is whole. A cloud that says in its header where it lies is not moved again,
//! so a run that dies on the way may begin anew with any of its clouds.

use crate::world::{PlacedSubmap, World};
use formats::ply::{Header, Kind, PlyWriter, Vertices};
use geometry::Point3;
use rayon::prelude::*;
use stage::StepError;
use std::path::Path;

/// How the header of a cloud begins the line about its frame.
const FRAME: &str = "frame ";
/// And the one about its place, once it has one.
const PLACED: &str = "world_from_submap ";
/// Coordinates, if they are there.
const TRIPLES: [&str; 2] = ["x", "x_lidar_position"];
/// Rows that are moved at a time: 5 MB of 80 bytes.
const CHUNK_ROWS: usize = 1 << 16;

/// What is true of a cloud in its place.
pub(crate) struct PlacedCloud {
    /// Size of the file.
    pub bytes: u64,
    /// Smallest and largest x y z as they stand in the file. None without points.
    pub bounds: Option<[[f64; 3]; 2]>,
}

/// The line about the frame, for clouds under way.
pub(crate) fn odometry_frame() -> String {
    format!("{FRAME}odometry, m")
}

/// Whether a file is a cloud of so many points that has been moved.
pub(crate) fn is_placed(path: &Path, n_points: u64) -> bool {
    let is_moved = |cloud: &Vertices| cloud.infos().iter().any(|info| info.starts_with(PLACED));
    Vertices::load(path).is_ok_and(|cloud| cloud.len() as u64 == n_points && is_moved(&cloud))
}

/// Moves the cloud of a submap.
pub(crate) fn place(path: &Path, submap: &PlacedSubmap, world: &World) -> Result<PlacedCloud, StepError> {
    let cloud = Vertices::load(path).map_err(StepError::io)?;
    let columns = Columns::of(&cloud).ok_or_else(|| fault(path, "has no coordinates x y z of one type"))?;
    let place = submap.world_from_submap;
    let (t, q) = (place.translation.vector, place.rotation.coords);
    let line = format!("{PLACED}{} {} {} {} {} {} {}", t.x, t.y, t.z, q.x, q.y, q.z, q.w);
    let frame = format!("{FRAME}{}", world.frame());
    if cloud.infos().contains(&line) && cloud.infos().contains(&frame) {
        let bytes = std::fs::metadata(path).map_err(|cause| fault(path, &cause.to_string()))?.len();
        return Ok(PlacedCloud { bytes, bounds: columns.bounds(cloud.rows()) });
    }
    if !cloud.infos().contains(&odometry_frame()) {
        return Err(fault(path, "is neither in the odometry's frame nor where it belongs"));
    }
    let infos = cloud.infos().iter().filter(|info| **info != odometry_frame()).cloned();
    let header = Header {
        comments: cloud.comments().to_vec(),
        infos: [frame, line].into_iter().chain(world.crs()).chain(infos).collect(),
        properties: cloud.properties().to_vec(),
    };
    let mut writer = PlyWriter::create(path, &header, cloud.len()).map_err(StepError::io)?;
    let world_from_odom = submap.world_from_odom();
    let mut bounds = None;
    for chunk in cloud.rows().chunks((CHUNK_ROWS * columns.row_size).max(1)) {
        let mut rows = chunk.to_vec();
        rows.par_chunks_exact_mut(columns.row_size).with_min_len(1 << 12).try_for_each(|row| {
            columns.triples.iter().try_for_each(|at| {
                let p = Point3::from(columns.read(row, *at));
                columns.write(row, *at, world.coordinates(&(world_from_odom * p))?);
                Ok::<(), StepError>(())
            })
        })?;
        writer.write_rows(&rows).map_err(StepError::io)?;
        bounds = joined(bounds, columns.bounds(&rows));
    }
    let bytes = writer.finish().map_err(StepError::io)?;
    Ok(PlacedCloud { bytes, bounds })
}

fn fault(path: &Path, rule: &str) -> StepError {
    StepError::data(format!("{}: {rule}", path.display()))
}

/// Where the coordinates stand in a row.
struct Columns {
    row_size: usize,
    /// Of the first of each three.
    triples: Vec<usize>,
    kind: Kind,
}

impl Columns {
    fn of(cloud: &Vertices) -> Option<Self> {
        let mut triples = Vec::new();
        let (mut offset, mut kind) = (0, None);
        for (k, property) in cloud.properties().iter().enumerate() {
            if TRIPLES.contains(&property.name.as_str()) {
                let three = cloud.properties().get(k..k + 3)?;
                let is_one = three.iter().all(|other| other.kind == property.kind);
                if !is_one || *kind.get_or_insert(property.kind) != property.kind {
                    return None;
                }
                triples.push(offset);
            }
            offset += property.kind.size();
        }
        let kind = kind.filter(|kind| matches!(kind, Kind::Float | Kind::Double))?;
        Some(Self { row_size: offset, triples, kind })
    }

    fn read(&self, row: &[u8], at: usize) -> [f64; 3] {
        std::array::from_fn(|axis| {
            let from = at + axis * self.kind.size();
            match self.kind {
                Kind::Double => f64::from_le_bytes(bytes(row, from)),
                _ => f64::from(f32::from_le_bytes(bytes(row, from))),
            }
        })
    }

    fn write(&self, row: &mut [u8], at: usize, xyz: [f64; 3]) {
        for (axis, value) in xyz.into_iter().enumerate() {
            let from = at + axis * self.kind.size();
            match self.kind {
                Kind::Double => row[from..from + 8].copy_from_slice(&value.to_le_bytes()),
                _ => row[from..from + 4].copy_from_slice(&(value as f32).to_le_bytes()),
            }
        }
    }

    /// Smallest and largest x y z. The smallest of many numbers is the same in any order.
    fn bounds(&self, rows: &[u8]) -> Option<[[f64; 3]; 2]> {
        let at = self.triples[0];
        let both = rows.par_chunks_exact(self.row_size).with_min_len(1 << 12).map(|row| {
            let xyz = self.read(row, at);
            Some([xyz, xyz])
        });
        both.reduce(|| None, joined)
    }
}

fn bytes<const N: usize>(row: &[u8], from: usize) -> [u8; N] {
    std::array::from_fn(|k| row[from + k])
}

fn joined(a: Option<[[f64; 3]; 2]>, b: Option<[[f64; 3]; 2]>) -> Option<[[f64; 3]; 2]> {
    let (Some([a_min, a_max]), Some([b_min, b_max])) = (a, b) else { return a.or(b) };
    Some([std::array::from_fn(|k| a_min[k].min(b_min[k])), std::array::from_fn(|k| a_max[k].max(b_max[k]))])
}
