//! Checks a manifest against the rules and against the files of its folder.

mod cameras;
mod trajectory;

use super::Drive;
use super::lidars::CheckedLidars;
use super::listing::{Frame, IMAGES, ListedFrames, MOSAICS, frames};
use super::read::Read;
use crate::manifest::{GnssEntry, ImuEntry, MANIFEST_VERSION, Manifest, TruthEntry, rules};
use files::problems::FileError;
use files::toml_file::TomlFile;
use formats::sensor_calibration::SensorCalibration;
use lidar::nmea;
use messages::Message;
use std::path::{Component, Path, PathBuf};

/// The drive, or all problems of its manifest and files.
pub(super) fn drive(folder: &Path, read: Read, is_inferred: bool) -> Result<Drive, FileError> {
    let manifest = read.manifest();
    let mut check = Check { folder, file: read.file, unnamed: Vec::new() };
    check.general(read.version);
    let lidars = check.lidars(&read.lidars);
    let mut camera_frames = Vec::new();
    for (index, entry) in numbered(&read.cameras) {
        check.camera(index, entry);
        let frames = check.frames(&format!("camera[{index}].folder"), &entry.folder, index, IMAGES);
        camera_frames.extend(frames.into_iter().map(|frame| frame.without_delay(entry.delay_nanos)));
    }
    let mut mosaic_frames = Vec::new();
    let mut sensors = Vec::new();
    for (index, entry) in numbered(&read.mosaics) {
        sensors.push(check.mosaic(index, entry));
        let frames = check.frames(&format!("mosaic[{index}].folder"), &entry.folder, index, MOSAICS);
        mosaic_frames.extend(frames.into_iter().map(|frame| frame.without_delay(entry.delay_nanos)));
    }
    for frames in [&mut camera_frames, &mut mosaic_frames] {
        frames.sort_by_key(|frame: &Frame| (frame.stamp, frame.camera));
    }
    if let Some(entry) = &read.gnss {
        check.gnss(entry);
    }
    if let Some(entry) = &read.imu {
        check.imu(entry);
    }
    if let Some(entry) = &read.trajectory {
        check.trajectory(entry);
    }
    if let Some(entry) = &read.truth {
        check.truth(entry);
    }
    let Check { file, unnamed, .. } = check;
    let rig = manifest.as_ref().and_then(|manifest| manifest.rig().ok());
    match (manifest, rig, lidars) {
        (Some(manifest), Some(rig), Some(CheckedLidars { first: first_lidar, others: other_lidars }))
            if file.is_sound() =>
        {
            Ok(Drive {
                folder: folder.to_owned(),
                manifest,
                rig,
                first_lidar,
                other_lidars,
                is_inferred,
                camera_frames,
                mosaic_frames,
                sensors,
                unnamed_files: unnamed,
            })
        }
        _ => Err(file.into_error()),
    }
}

/// Checks the LiDAR and the poses of a manifest without its other files.
pub(super) fn manifest(folder: &Path, read: Read) -> Result<Manifest, FileError> {
    let manifest = read.manifest();
    let mut check = Check { folder, file: read.file, unnamed: Vec::new() };
    check.general(read.version);
    check.models_of_lidars(&read.lidars);
    for (index, entry) in numbered(&read.cameras) {
        rules::pose(&mut check.file, &format!("camera[{index}].body_from_camera"), &entry.body_from_camera);
    }
    for (index, entry) in numbered(&read.mosaics) {
        rules::pose(&mut check.file, &format!("mosaic[{index}].body_from_camera"), &entry.body_from_camera);
    }
    match manifest {
        Some(manifest) if check.file.is_sound() => Ok(manifest),
        _ => Err(check.file.into_error()),
    }
}

/// Checks the cameras of a manifest without their images. Returns the manufacturer's calibration of each mosaic camera.
pub(super) fn cameras(
    folder: &Path,
    file: TomlFile,
    manifest: &Manifest,
) -> Result<Vec<Option<SensorCalibration>>, FileError> {
    let mut check = Check { folder, file, unnamed: Vec::new() };
    for (index, entry) in manifest.cameras.iter().enumerate() {
        check.camera(index, entry);
        check.inside(&format!("camera[{index}].folder"), &entry.folder);
    }
    let mut sensors = Vec::new();
    for (index, entry) in manifest.mosaics.iter().enumerate() {
        check.inside(&format!("mosaic[{index}].folder"), &entry.folder);
        sensors.push(check.mosaic(index, entry));
    }
    if check.file.is_sound() { Ok(sensors) } else { Err(check.file.into_error()) }
}

/// The entries that could be read, with their index among all.
pub(super) fn numbered<T>(entries: &[Option<T>]) -> impl Iterator<Item = (usize, &T)> {
    entries.iter().enumerate().filter_map(|(index, entry)| Some((index, entry.as_ref()?)))
}

/// The manifest, and the problems found so far.
pub(super) struct Check<'a> {
    pub(super) folder: &'a Path,
    pub(super) file: TomlFile,
    /// Files in camera folders whose names are not stamps.
    unnamed: Vec<PathBuf>,
}

impl Check<'_> {
    fn general(&mut self, version: Option<u32>) {
        let Some(version) = version else { return };
        self.file
            .rule("version", version == MANIFEST_VERSION, || format!("value {version} must be {MANIFEST_VERSION}"));
    }

    /// Checks that this many values fit into a message.
    fn fits<T: Message>(&mut self, key: &str, n_values: u64, what: &str) {
        let limit = T::MAX_ROWS as u64;
        self.file.rule(key, n_values <= limit, || {
            format!("{what}: {n_values} values, a message of topic {} has at most {limit}", T::TOPIC)
        });
    }

    fn gnss(&mut self, entry: &GnssEntry) {
        let [latitude, longitude, height] = entry.origin;
        let on_earth = latitude.abs() <= 90.0 && longitude.abs() <= 180.0 && height.abs() < 100_000.0;
        self.file.rule("gnss.origin", on_earth, || {
            format!("value {:?} must be latitude -90 to 90, longitude -180 to 180 and height in m", entry.origin)
        });
        rules::position(&mut self.file, "gnss.antenna_in_body", &entry.antenna_in_body);
        rules::delay(&mut self.file, "gnss.delay_nanos", entry.delay_nanos);
        let is_height = entry.geoid_m.is_none_or(|geoid_m| geoid_m.abs() <= nmea::MAX_GEOID_M);
        self.file.rule("gnss.geoid_m", is_height, || {
            format!("value {:?} must be a height of the geoid above the ellipsoid, -200 to 200 m", entry.geoid_m)
        });
        self.file("gnss.file", &entry.file);
    }

    fn imu(&mut self, entry: &ImuEntry) {
        self.imu_mounting(entry);
        rules::delay(&mut self.file, "imu.delay_nanos", entry.delay_nanos);
        self.file("imu.file", &entry.file);
    }

    fn imu_mounting(&mut self, entry: &ImuEntry) {
        rules::position(&mut self.file, "imu.position_in_body", &entry.position_in_body);
        if let Some(mounting) = &entry.body_from_imu {
            rules::pose(&mut self.file, "imu.body_from_imu", mounting);
            rules::position(&mut self.file, "imu.body_from_imu", &mounting.translation);
            self.file.rule("imu.body_from_imu", entry.position_in_body == [0.0; 3], || {
                "also states the position; remove imu.position_in_body".into()
            });
        }
    }

    fn truth(&mut self, entry: &TruthEntry) {
        self.file("truth.trajectory", &entry.trajectory);
        if let Some(name) = &entry.labels {
            self.folder("truth.labels", name);
        }
        if let Some(name) = &entry.calibration {
            self.file("truth.calibration", name);
        }
        if let Some(name) = &entry.gnss {
            self.file("truth.gnss", name);
        }
    }

    fn frames(&mut self, key: &str, name: &str, camera: usize, extensions: &[&str]) -> Vec<Frame> {
        let Some(folder) = self.folder(key, name) else { return Vec::new() };
        let ListedFrames { frames, unnamed } =
            self.listed(key, frames(&folder, camera, extensions)).unwrap_or_default();
        self.unnamed.extend(unnamed);
        frames
    }

    pub(super) fn listed<T>(&mut self, key: &str, listed: std::io::Result<T>) -> Option<T> {
        listed.map_err(|error| self.file.fault(key, format!("cannot list the folder: {error}"))).ok()
    }

    pub(super) fn folder(&mut self, key: &str, name: &str) -> Option<PathBuf> {
        let path = self.inside(key, name)?;
        let is_there = path.is_dir();
        self.file.rule(key, is_there, || format!("{} is not a folder", path.display()));
        is_there.then_some(path)
    }

    fn file(&mut self, key: &str, name: &str) {
        if let Some(path) = self.inside(key, name) {
            self.file.rule(key, path.is_file(), || format!("{} is not a file", path.display()));
        }
    }

    /// Paths must stay inside the drive folder, so that a drive can be moved. Files elsewhere can be linked.
    pub(super) fn inside(&mut self, key: &str, name: &str) -> Option<PathBuf> {
        let stays = |part| matches!(part, Component::Normal(_) | Component::CurDir);
        let inside = !name.is_empty() && Path::new(name).components().all(stays);
        self.file.rule(key, inside, || format!("value {name:?} must be a path inside the drive folder"));
        inside.then(|| self.folder.join(name))
    }
}
