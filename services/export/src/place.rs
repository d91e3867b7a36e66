//! A cloud is written while the drive goes on, in the odometry's frame. Where it lies is known at the end: then its coordinates
//! are moved, in a copy that takes its name when it is whole. A cloud that says in its header where it lies is not moved again,
//! so a run that dies on the way may begin anew with any of its clouds.

use crate::folder::Folder;
use crate::index::CloudEntry;
use crate::world::{PlacedSubmap, World};
use formats::ply::{Header, Kind, PlyError, PlyRows, PlyWriter};
use geometry::Point3;
use stage::StepError;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// How the header of a cloud begins the line about its frame.
const FRAME: &str = "frame ";
/// And the one about its place, once it has one.
const PLACED: &str = "world_from_submap ";
/// Coordinates, if they are there.
const TRIPLES: [&str; 2] = ["x", "x_lidar_position"];
/// Rows that are looked at at a time: 300 KB of 64 bytes.
const BLOCK_ROWS: usize = 1 << 12;

/// Smallest and largest x y z. None without points.
type Bounds = Option<[[f64; 3]; 2]>;

/// The line about the frame, for clouds under way.
pub(crate) fn odometry_frame() -> String {
    format!("{FRAME}odometry, m")
}

/// Whether a file is a cloud of so many points that has been moved.
pub(crate) fn is_placed(path: &Path, n_points: u64) -> bool {
    let is_moved = |cloud: &PlyRows| cloud.header().infos.iter().any(|info| info.starts_with(PLACED));
    PlyRows::open(path).is_ok_and(|cloud| cloud.len() as u64 == n_points && is_moved(&cloud))
}

/// Moves the files of a submap to their place, if it has one, and brings them to the disk.
pub(crate) fn place(entry: &mut CloudEntry, folder: &Folder, world: &World) -> Result<(), StepError> {
    let Some(submap) = world.submap(entry.seq) else { return Ok(()) };
    (entry.bytes, entry.bounds) = place_file(&folder.path(&entry.file), submap, world)?;
    if let Some(spectra) = &mut entry.spectra {
        (spectra.bytes, _) = place_file(&folder.path(&spectra.file), submap, world)?;
    }
    let pose = submap.world_from_submap;
    (entry.translation, entry.rotation) = (pose.translation.vector.into(), pose.rotation.coords.into());
    (entry.sigma_m, entry.sigma_rad) = (Some(submap.sigma_m), Some(submap.sigma_rad));
    Ok(())
}

/// Size and bounds of the file in its place, as they stand there.
fn place_file(path: &Path, submap: &PlacedSubmap, world: &World) -> Result<(u64, Bounds), StepError> {
    let cloud = PlyRows::open(path).map_err(StepError::io)?;
    let Header { comments, infos, properties } = cloud.header().clone();
    let columns = Columns::of(cloud.header()).ok_or_else(|| fault(path, "has no coordinates x y z of one type"))?;
    let place = submap.world_from_submap;
    let (t, q) = (place.translation.vector, place.rotation.coords);
    let line = format!("{PLACED}{} {} {} {} {} {} {}", t.x, t.y, t.z, q.x, q.y, q.z, q.w);
    let frame = format!("{FRAME}{}", world.frame());
    if infos.contains(&line) && infos.contains(&frame) {
        return Ok((cloud.n_bytes(), columns.bounds_of_all(&cloud).map_err(StepError::io)?));
    }
    if !infos.contains(&odometry_frame()) {
        return Err(fault(path, "is neither in the odometry's frame nor where it belongs"));
    }
    let others = infos.into_iter().filter(|info| *info != odometry_frame());
    let infos = [frame, line].into_iter().chain(world.crs()).chain(others).collect();
    let mut writer =
        PlyWriter::create(path, &Header { comments, infos, properties }, cloud.len()).map_err(StepError::io)?;
    let world_from_odom = submap.world_from_odom();
    let (rotation, translation) = (world_from_odom.rotation.to_rotation_matrix(), world_from_odom.translation.vector);
    let bounds = Mutex::new(None);
    let moved = writer.write_blocks(cloud.len(), |first, rows| {
        cloud.read_into(first, rows)?;
        for (i, row) in rows.chunks_exact_mut(columns.row_size).enumerate() {
            for at in &columns.triples {
                let p = rotation * Point3::from(columns.read(row, *at)) + translation;
                let xyz = world.coordinates(&p).map_err(|cause| PlyError::Row {
                    path: path.to_owned(),
                    point: first + i,
                    rule: cause.to_string(),
                })?;
                columns.write(row, *at, xyz);
            }
        }
        let of_block = columns.bounds(rows);
        let mut bounds = bounds.lock().unwrap_or_else(PoisonError::into_inner);
        *bounds = joined(*bounds, of_block);
        Ok(())
    });
    let n_bytes = moved.and_then(|()| writer.finish()).map_err(StepError::io)?;
    Ok((n_bytes, bounds.into_inner().unwrap_or_else(PoisonError::into_inner)))
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
    fn of(cloud: &Header) -> Option<Self> {
        let mut triples = Vec::new();
        let (mut offset, mut kind) = (0, None);
        for (k, property) in cloud.properties.iter().enumerate() {
            if TRIPLES.contains(&property.name.as_str()) {
                let three = cloud.properties.get(k..k + 3)?;
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
        match self.kind {
            Kind::Double => fields(row, at).map(f64::from_le_bytes),
            _ => fields(row, at).map(|bytes| f64::from(f32::from_le_bytes(bytes))),
        }
    }

    fn write(&self, row: &mut [u8], at: usize, xyz: [f64; 3]) {
        match self.kind {
            Kind::Double => row[at..at + 24].copy_from_slice(xyz.map(f64::to_le_bytes).as_flattened()),
            _ => row[at..at + 12].copy_from_slice(xyz.map(|value| (value as f32).to_le_bytes()).as_flattened()),
        }
    }

    /// The smallest of many numbers is the same in any order.
    fn bounds(&self, rows: &[u8]) -> Bounds {
        let of_point = |row| Some([self.read(row, self.triples[0]); 2]);
        rows.chunks_exact(self.row_size).map(of_point).fold(None, joined)
    }

    fn bounds_of_all(&self, cloud: &PlyRows) -> Result<Bounds, PlyError> {
        let (mut bounds, mut block) = (None, Vec::new());
        for first in (0..cloud.len()).step_by(BLOCK_ROWS) {
            block.resize(BLOCK_ROWS.min(cloud.len() - first) * self.row_size, 0);
            cloud.read_into(first, &mut block)?;
            bounds = joined(bounds, self.bounds(&block));
        }
        Ok(bounds)
    }
}

/// Three fields of `N` bytes. Panics beyond the end of the row, which [`Columns::of`] has seen to.
fn fields<const N: usize>(row: &[u8], at: usize) -> [[u8; N]; 3] {
    std::array::from_fn(|axis| {
        let from = at + axis * N;
        row[from..from + N].try_into().expect("N bytes")
    })
}

fn joined(a: Bounds, b: Bounds) -> Bounds {
    let (Some([a_min, a_max]), Some([b_min, b_max])) = (a, b) else { return a.or(b) };
    Some([std::array::from_fn(|k| a_min[k].min(b_min[k])), std::array::from_fn(|k| a_max[k].max(b_max[k]))])
}
