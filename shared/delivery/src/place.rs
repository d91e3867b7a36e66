//! Moves clouds to the final frame. The placement of a submap is known only at the end of the drive. Clouds that were
//! written before are in the frame of the odometry. They are rewritten to a copy, which replaces the original when it is
//! complete. Clouds with their final pose in the header are not moved again, so a crashed run can be restarted at any
//! time.

use crate::coordinates::{Bounds, Coordinates, SharedBounds};
use crate::error::DeliveryError;
use crate::folder::Folder;
use crate::frame::{deviation_line, frame_line, is_in_odometry, odometry_line, pose_line};
use crate::index::CloudEntry;
use crate::world::{PlacedSubmap, World};
use formats::ply::{Header, PlyError, PlyRows, PlyWriter, Row};
use geometry::{Point3, Pose};
use std::path::Path;

/// Final pose and frame of the clouds of a submap.
pub(crate) struct Place<'a> {
    world: &'a World,
    submap: &'a PlacedSubmap,
    world_from_odom: Pose,
}

impl<'a> Place<'a> {
    /// Place of a submap; `None` if the placement does not contain the submap.
    pub(crate) fn find(seq: u64, world: &'a World) -> Option<Self> {
        let submap = world.submap(seq)?;
        Some(Self { world, submap, world_from_odom: submap.world_from_odom() })
    }

    /// Header lines about frame and pose.
    fn lines(&self) -> [String; 3] {
        let PlacedSubmap { world_from_submap, deviation, .. } = self.submap;
        [frame_line(self.world.frame()), pose_line(world_from_submap), deviation_line(deviation)]
    }

    /// The header of a cloud in its final frame, from its header in the frame of the odometry.
    fn header(&self, Header { comments, infos, properties }: Header) -> Header {
        let others = infos.into_iter().filter(|info| *info != odometry_line());
        Header { comments, infos: self.lines().into_iter().chain(self.world.crs()).chain(others).collect(), properties }
    }

    /// Transforms rows from the frame of the odometry. The first row is point `first` of the file.
    fn transform(&self, coordinates: &Coordinates, first: usize, rows: &mut [u8], path: &Path) -> Result<(), PlyError> {
        let rotation = self.world_from_odom.rotation.to_rotation_matrix();
        let translation = self.world_from_odom.translation.vector;
        let moved = |xyz: [f64; 3]| self.world.coordinates(&(rotation * Point3::from(xyz) + translation));
        coordinates.replace(rows, moved).map_err(|(i, cause)| PlyError::Transform {
            path: path.to_owned(),
            point: first + i,
            cause: Box::new(cause),
        })
    }

    /// Sets pose and standard deviations in the index.
    pub(crate) fn enter(&self, entry: &mut CloudEntry) {
        let pose = self.submap.world_from_submap;
        entry.translation = pose.translation.vector.into();
        entry.rotation = pose.rotation.coords.into();
        entry.sigma_m = Some(self.submap.sigma_m);
        entry.sigma_rad = Some(self.submap.sigma_rad);
    }
}

/// A file with points.
pub(crate) struct WrittenCloud {
    /// Size of the file.
    pub bytes: u64,
    /// Bounds of its points.
    pub bounds: Bounds,
}

/// Writes a cloud whose header and rows are given in the frame of the odometry. It is written in the final frame if its
/// place is known. The file is not synced.
pub(crate) fn write_cloud(
    path: &Path,
    header: Header,
    n_points: usize,
    encode: impl Fn(usize, &mut Row<'_>) + Sync,
    place: Option<&Place<'_>>,
) -> Result<WrittenCloud, DeliveryError> {
    let coordinates = coordinates(&header, path)?;
    let header = if let Some(place) = place { place.header(header) } else { header };
    let mut writer = PlyWriter::create(path, &header, n_points)?;
    let bounds = SharedBounds::default();
    let moved = |first: usize, rows: &mut [u8]| {
        place.map_or(Ok(()), |place| place.transform(&coordinates, first, rows, path))?;
        bounds.add(coordinates.bounds(rows));
        Ok(())
    };
    writer.write_amended(n_points, encode, moved)?;
    Ok(WrittenCloud { bytes: writer.finish_unsynced()?, bounds: bounds.all() })
}

/// Moves the files of a submap to the final frame, if its place is known. `finish` syncs them and gives them their final
/// names.
pub fn move_clouds(
    entry: &mut CloudEntry,
    folder: &Folder,
    world: &World,
    finish: impl Fn(PlyWriter) -> Result<(), DeliveryError>,
) -> Result<(), DeliveryError> {
    // The files were written in the final frame.
    if entry.is_placed() {
        return Ok(());
    }
    let Some(place) = Place::find(entry.seq, world) else { return Ok(()) };
    let moved = move_file(&folder.path(&entry.file), &place, &finish)?;
    entry.bytes = moved.bytes;
    entry.bounds = moved.bounds;
    if let Some(spectra) = &mut entry.spectra {
        spectra.bytes = move_file(&folder.path(&spectra.file), &place, &finish)?.bytes;
    }
    place.enter(entry);
    Ok(())
}

/// Moves a file to the final frame.
fn move_file(
    path: &Path,
    place: &Place<'_>,
    finish: impl Fn(PlyWriter) -> Result<(), DeliveryError>,
) -> Result<WrittenCloud, DeliveryError> {
    let cloud = PlyRows::open(path)?;
    let header = cloud.header();
    let coordinates = coordinates(header, path)?;
    if place.lines().iter().all(|line| header.infos.contains(line)) {
        return Ok(WrittenCloud { bytes: cloud.n_bytes(), bounds: coordinates.bounds_of_all(&cloud)? });
    }
    if !is_in_odometry(header) {
        return Err(DeliveryError::UnknownFrame { path: path.to_owned() });
    }
    let mut writer = PlyWriter::create(path, &place.header(header.clone()), cloud.len())?;
    let bounds = SharedBounds::default();
    let moved = writer.write_blocks(cloud.len(), |first, rows| {
        cloud.read_into(first, rows)?;
        place.transform(&coordinates, first, rows, path)?;
        bounds.add(coordinates.bounds(rows));
        Ok(())
    });
    moved?;
    let n_bytes = writer.n_bytes();
    finish(writer)?;
    Ok(WrittenCloud { bytes: n_bytes, bounds: bounds.all() })
}

fn coordinates(header: &Header, path: &Path) -> Result<Coordinates, DeliveryError> {
    Coordinates::from_header(header).ok_or_else(|| DeliveryError::Coordinates { path: path.to_owned() })
}
