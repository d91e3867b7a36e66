//! Where a cloud lies is known at the end of the drive. What is written before that is in the odometry's frame; then its
//! coordinates are moved, in a copy that takes its name when it is whole. A cloud that says in its header where it lies is not
//! moved again, so a run that dies on the way may begin anew with any of its clouds.

use crate::coordinates::{Bounds, Coordinates, SharedBounds};
use crate::folder::Folder;
use crate::index::CloudEntry;
use crate::world::{PlacedSubmap, World};
use formats::ply::{Header, PlyError, PlyRows, PlyWriter, Row};
use geometry::{Point3, Pose};
use stage::StepError;
use std::path::Path;

/// How the header of a cloud begins the line about its frame.
const FRAME: &str = "frame ";
/// And the one about its place, once it has one.
const PLACED: &str = "world_from_submap ";

/// The line about the frame, for clouds under way.
pub(crate) fn odometry_frame() -> String {
    format!("{FRAME}odometry, m")
}

/// Whether a file is a cloud of so many points that is in its place.
pub(crate) fn is_placed(path: &Path, n_points: u64) -> bool {
    let is_moved = |cloud: &PlyRows| cloud.header().infos.iter().any(|info| info.starts_with(PLACED));
    PlyRows::open(path).is_ok_and(|cloud| cloud.len() as u64 == n_points && is_moved(&cloud))
}

/// Where the clouds of a submap belong.
pub(crate) struct Place<'a> {
    world: &'a World,
    submap: &'a PlacedSubmap,
    world_from_odom: Pose,
}

impl<'a> Place<'a> {
    /// `None` if the world does not know the submap.
    pub(crate) fn of(seq: u64, world: &'a World) -> Option<Self> {
        let submap = world.submap(seq)?;
        Some(Self { world, submap, world_from_odom: submap.world_from_odom() })
    }

    /// What the header says about frame and place.
    fn lines(&self) -> [String; 2] {
        let place = self.submap.world_from_submap;
        let (t, q) = (place.translation.vector, place.rotation.coords);
        let line = format!("{PLACED}{} {} {} {} {} {} {}", t.x, t.y, t.z, q.x, q.y, q.z, q.w);
        [format!("{FRAME}{}", self.world.frame()), line]
    }

    /// The header of a cloud here, from that in the odometry's frame.
    fn header(&self, Header { comments, infos, properties }: Header) -> Header {
        let others = infos.into_iter().filter(|info| *info != odometry_frame());
        Header { comments, infos: self.lines().into_iter().chain(self.world.crs()).chain(others).collect(), properties }
    }

    /// Moves rows of the odometry's frame here; the first of them is point `first` of the file.
    fn take(&self, coordinates: &Coordinates, first: usize, rows: &mut [u8], path: &Path) -> Result<(), PlyError> {
        let rotation = self.world_from_odom.rotation.to_rotation_matrix();
        let translation = self.world_from_odom.translation.vector;
        let moved = |xyz: [f64; 3]| self.world.coordinates(&(rotation * Point3::from(xyz) + translation));
        coordinates.replace(rows, moved).map_err(|(i, cause)| PlyError::Row {
            path: path.to_owned(),
            point: first + i,
            rule: cause.to_string(),
        })
    }

    /// Enters the place into the index.
    pub(crate) fn enter(&self, entry: &mut CloudEntry) {
        let pose = self.submap.world_from_submap;
        (entry.translation, entry.rotation) = (pose.translation.vector.into(), pose.rotation.coords.into());
        (entry.sigma_m, entry.sigma_rad) = (Some(self.submap.sigma_m), Some(self.submap.sigma_rad));
    }
}

/// Writes a cloud, header and rows of which are in the odometry's frame: there, or in its place if that is known. Size and
/// bounds of the file. Bringing it to the disk is left to others.
pub(crate) fn write(
    path: &Path,
    header: Header,
    n_points: usize,
    encode: impl Fn(usize, &mut Row<'_>) + Sync,
    place: Option<&Place<'_>>,
) -> Result<(u64, Bounds), StepError> {
    let coordinates = coordinates(&header, path)?;
    let header = if let Some(place) = place { place.header(header) } else { header };
    let mut writer = PlyWriter::create(path, &header, n_points).map_err(StepError::io)?;
    let bounds = SharedBounds::default();
    let moved = |first: usize, rows: &mut [u8]| {
        place.map_or(Ok(()), |place| place.take(&coordinates, first, rows, path))?;
        bounds.add(coordinates.bounds(rows));
        Ok(())
    };
    writer.write_amended(n_points, encode, moved).map_err(StepError::io)?;
    Ok((writer.finish_unsynced().map_err(StepError::io)?, bounds.all()))
}

/// Moves the files of a submap to their place, if it has one. `done` brings them to the disk and gives them their names.
pub(crate) fn place(
    entry: &mut CloudEntry,
    folder: &Folder,
    world: &World,
    done: impl Fn(PlyWriter) -> Result<(), StepError>,
) -> Result<(), StepError> {
    // Written there at once.
    if entry.is_placed() {
        return Ok(());
    }
    let Some(place) = Place::of(entry.seq, world) else { return Ok(()) };
    (entry.bytes, entry.bounds) = place_file(&folder.path(&entry.file), &place, &done)?;
    if let Some(spectra) = &mut entry.spectra {
        (spectra.bytes, _) = place_file(&folder.path(&spectra.file), &place, &done)?;
    }
    place.enter(entry);
    Ok(())
}

/// Size and bounds of the file in its place, as they stand there.
fn place_file(
    path: &Path,
    place: &Place<'_>,
    done: impl Fn(PlyWriter) -> Result<(), StepError>,
) -> Result<(u64, Bounds), StepError> {
    let cloud = PlyRows::open(path).map_err(StepError::io)?;
    let header = cloud.header();
    let coordinates = coordinates(header, path)?;
    if place.lines().iter().all(|line| header.infos.contains(line)) {
        return Ok((cloud.n_bytes(), coordinates.bounds_of_all(&cloud).map_err(StepError::io)?));
    }
    if !header.infos.contains(&odometry_frame()) {
        return Err(fault(path, "is neither in the odometry's frame nor where it belongs"));
    }
    let mut writer = PlyWriter::create(path, &place.header(header.clone()), cloud.len()).map_err(StepError::io)?;
    let bounds = SharedBounds::default();
    let moved = writer.write_blocks(cloud.len(), |first, rows| {
        cloud.read_into(first, rows)?;
        place.take(&coordinates, first, rows, path)?;
        bounds.add(coordinates.bounds(rows));
        Ok(())
    });
    moved.map_err(StepError::io)?;
    let n_bytes = writer.n_bytes();
    done(writer)?;
    Ok((n_bytes, bounds.all()))
}

fn coordinates(header: &Header, path: &Path) -> Result<Coordinates, StepError> {
    Coordinates::of(header).ok_or_else(|| fault(path, "has no coordinates x y z of one type"))
}

fn fault(path: &Path, rule: &str) -> StepError {
    StepError::data(format!("{}: {rule}", path.display()))
}
