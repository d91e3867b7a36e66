//! Checks a manifest against the rules and against the files of its folder.

mod cameras;

use super::lidar_file::lidar_of;
use super::listing::{Frame, files_with_extension, frames};
use super::read::Read;
use super::{Drive, TIMES_FILE};
use crate::lidar::Lidar;
use crate::manifest::{GnssEntry, ImuEntry, LidarEntry, MANIFEST_VERSION, Manifest, TruthEntry, rules};
use crate::problems::FileError;
use crate::sensor_calibration::SensorCalibration;
use crate::text_file::read_text;
use crate::toml_file::TomlFile;
use geometry::Stamp;
use messages::Message;
use std::path::{Component, Path, PathBuf};

/// Time between cloud files without `times.txt`: 10 Hz.
const SWEEP_NANOS: i64 = 100_000_000;
/// Extensions of color images.
pub(super) const IMAGES: &[&str] = &["jpg", "jpeg", "png"];
/// Extensions of mosaics.
pub(super) const MOSAICS: &[&str] = &["pgm"];

/// The drive, or all problems of its manifest and files.
pub(super) fn drive(folder: &Path, read: Read, is_inferred: bool) -> Result<Drive, FileError> {
    let manifest = read.manifest();
    let mut check = Check { folder, file: read.file, unnamed: Vec::new() };
    check.general(read.version);
    let lidar = read.lidar.as_ref().and_then(|entry| check.lidar(entry));
    let (sweep_files, sweep_stamps) = read.lidar.as_ref().map(|entry| check.sweeps(entry)).unwrap_or_default();
    let mut camera_frames = Vec::new();
    for (index, entry) in numbered(&read.cameras) {
        check.camera(index, entry);
        let mut frames = check.frames(&format!("camera[{index}].folder"), &entry.folder, index, IMAGES);
        for frame in &mut frames {
            frame.stamp = frame.stamp.plus_nanos(entry.delay_nanos.saturating_neg());
        }
        camera_frames.extend(frames);
    }
    let (mut mosaic_frames, mut sensors) = (Vec::new(), Vec::new());
    for (index, entry) in numbered(&read.mosaics) {
        sensors.push(check.mosaic(index, entry));
        mosaic_frames.extend(check.frames(&format!("mosaic[{index}].folder"), &entry.folder, index, MOSAICS));
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
    if let Some(entry) = &read.truth {
        check.truth(entry);
    }
    let Check { file, unnamed, .. } = check;
    let rig = manifest.as_ref().and_then(|manifest| manifest.rig().ok());
    match (manifest, rig, lidar) {
        (Some(manifest), Some(rig), Some(lidar)) if file.is_sound() => Ok(Drive {
            folder: folder.to_owned(),
            manifest,
            rig,
            lidar,
            is_inferred,
            sweep_files,
            sweep_stamps,
            camera_frames,
            mosaic_frames,
            sensors,
            unnamed_files: unnamed,
        }),
        _ => Err(file.into_error()),
    }
}

/// Checks the LiDAR and the poses of a manifest without its other files.
pub(super) fn manifest(folder: &Path, read: Read) -> Result<Manifest, FileError> {
    let manifest = read.manifest();
    let mut check = Check { folder, file: read.file, unnamed: Vec::new() };
    check.general(read.version);
    read.lidar.as_ref().and_then(|entry| check.lidar(entry));
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
fn numbered<T>(entries: &[Option<T>]) -> impl Iterator<Item = (usize, &T)> {
    entries.iter().enumerate().filter_map(|(index, entry)| Some((index, entry.as_ref()?)))
}

struct Check<'a> {
    folder: &'a Path,
    file: TomlFile,
    /// Files in camera folders whose names are not stamps.
    unnamed: Vec<PathBuf>,
}

impl Check<'_> {
    fn general(&mut self, version: Option<u32>) {
        let Some(version) = version else { return };
        self.file
            .rule("version", version == MANIFEST_VERSION, || format!("value {version} must be {MANIFEST_VERSION}"));
    }

    /// A message has room for this many values.
    fn fits<T: Message>(&mut self, key: &str, n_values: u64, what: &str) {
        let limit = T::MAX_ROWS as u64;
        self.file.rule(key, n_values <= limit, || {
            format!("{what}: {n_values} values, a message of topic {} has at most {limit}", T::TOPIC)
        });
    }

    fn lidar(&mut self, entry: &LidarEntry) -> Option<Lidar> {
        rules::pose(&mut self.file, "lidar.body_from_lidar", &entry.body_from_lidar);
        if let Some(name) = &entry.calibration {
            self.inside("lidar.calibration", name)?;
        }
        let lidar = match lidar_of(self.folder, entry) {
            Ok(lidar) => lidar,
            Err(problem) => {
                self.file.fault(&problem.key, problem.rule);
                return None;
            }
        };
        let missing = lidar.missing_file().filter(|_| entry.format == "pcap");
        self.file.rule("lidar.calibration", missing.is_none(), || {
            format!("is absent; packets of {:?} need {}", entry.model, missing.unwrap_or_default())
        });
        Some(lidar)
    }

    /// Files of the sweeps and, for clouds, their stamps.
    fn sweeps(&mut self, entry: &LidarEntry) -> (Vec<PathBuf>, Vec<Stamp>) {
        let none = (Vec::new(), Vec::new());
        let extensions: &[&str] = match entry.format.as_str() {
            "pcap" => &["pcap", "pcapng"],
            "pcd" => &["pcd"],
            "bin" | "nuscenes" => &["bin"],
            other => {
                self.file.fault("lidar.format", format!("value {other:?} must be one of pcap, pcd, bin, nuscenes"));
                return none;
            }
        };
        let Some(folder) = self.folder("lidar.folder", &entry.folder) else { return none };
        let files = self.listed("lidar.folder", files_with_extension(&folder, extensions)).unwrap_or_default();
        self.file.rule("lidar.folder", !files.is_empty(), || {
            format!("{} contains no *.{}", folder.display(), extensions.join(", *."))
        });
        let is_nuscenes = |path: &PathBuf| path.to_string_lossy().ends_with(".pcd.bin");
        self.file.rule("lidar.format", entry.format != "bin" || !files.iter().any(is_nuscenes), || {
            "value \"bin\" is for sweeps of KITTI; *.pcd.bin are sweeps of nuScenes: set \"nuscenes\"".into()
        });
        let stamps = if entry.format == "pcap" { Vec::new() } else { self.times(&folder, files.len()) };
        (files, stamps)
    }

    fn times(&mut self, folder: &Path, n_sweeps: usize) -> Vec<Stamp> {
        let path = folder.join(TIMES_FILE);
        // A stamp in ns has up to 20 characters.
        let limit = 64 * (n_sweeps as u64 + 16);
        let text = match read_text(&path, limit) {
            Err(error) if !error.is_absent() => {
                self.file.fault("lidar.folder", format!("{}: {error}", path.display()));
                return Vec::new();
            }
            read => read.ok(),
        };
        let Some(text) = text else {
            return (0..n_sweeps as i64).map(|k| Stamp(k * SWEEP_NANOS)).collect();
        };
        let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
        let stamps: Option<Vec<Stamp>> = lines.map(|line| line.parse().ok().map(Stamp)).collect();
        let rising = |stamps: &Vec<Stamp>| stamps.windows(2).all(|pair| pair[0] < pair[1]);
        let stamps = stamps.filter(|stamps| stamps.len() == n_sweeps && rising(stamps));
        self.file.rule("lidar.folder", stamps.is_some(), || {
            format!("{} must have {n_sweeps} increasing stamps in ns, one per line for each sweep", path.display())
        });
        stamps.unwrap_or_default()
    }

    fn gnss(&mut self, entry: &GnssEntry) {
        let [latitude, longitude, height] = entry.origin;
        let on_earth = latitude.abs() <= 90.0 && longitude.abs() <= 180.0 && height.abs() < 100_000.0;
        self.file.rule("gnss.origin", on_earth, || {
            format!("value {:?} must be latitude -90 to 90, longitude -180 to 180 and height in m", entry.origin)
        });
        rules::position(&mut self.file, "gnss.antenna_in_body", &entry.antenna_in_body);
        rules::delay(&mut self.file, "gnss.delay_nanos", entry.delay_nanos);
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
                "states the position, too; remove imu.position_in_body".into()
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
        let (frames, unnamed) = self.listed(key, frames(&folder, camera, extensions)).unwrap_or_default();
        self.unnamed.extend(unnamed);
        frames
    }

    fn listed<T>(&mut self, key: &str, listed: std::io::Result<T>) -> Option<T> {
        listed.map_err(|error| self.file.fault(key, format!("cannot list the folder: {error}"))).ok()
    }

    fn folder(&mut self, key: &str, name: &str) -> Option<PathBuf> {
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
    fn inside(&mut self, key: &str, name: &str) -> Option<PathBuf> {
        let stays = |part| matches!(part, Component::Normal(_) | Component::CurDir);
        let inside = !name.is_empty() && Path::new(name).components().all(stays);
        self.file.rule(key, inside, || format!("value {name:?} must be a path inside the drive folder"));
        inside.then(|| self.folder.join(name))
    }
}
