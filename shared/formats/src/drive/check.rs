//! Checks a manifest against the rules and against the files of its folder.

use super::Drive;
use super::listing::{Frame, frames};
use super::read::Read;
use crate::manifest::{
    CameraEntry, GnssEntry, ImuEntry, MANIFEST_VERSION, Manifest, MosaicEntry, TruthEntry, WhitePanelEntry, rules,
};
use crate::problems::FileError;
use crate::sensor_calibration::SensorCalibration;
use crate::text_file::{MAX_CALIBRATION_BYTES, read_text};
use crate::toml_file::TomlFile;
use messages::{CubeTopic, ImageTopic, Message, MosaicTopic};
use std::path::{Component, Path, PathBuf};

/// Values of a pixel of a color image.
const COLORS: u64 = 3;

/// The drive, or all problems of its manifest and files.
pub(super) fn drive(folder: &Path, read: Read, is_inferred: bool) -> Result<Drive, FileError> {
    let manifest = read.manifest();
    let mut check = Check { folder, file: read.file, unnamed: Vec::new() };
    check.general(read.version);
    let lidars = check.lidars(&read.lidars);
    let mut camera_frames = Vec::new();
    for (index, entry) in numbered(&read.cameras) {
        camera_frames.extend(check.camera(index, entry));
    }
    let (mut mosaic_frames, mut sensors) = (Vec::new(), Vec::new());
    for (index, entry) in numbered(&read.mosaics) {
        mosaic_frames.extend(check.mosaic(index, entry));
        sensors.push(entry.sensor.as_ref().and_then(|name| check.sensor(index, entry, name)));
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
    match (manifest, rig, lidars) {
        (Some(manifest), Some(rig), Some((first_lidar, other_lidars))) if file.is_sound() => Ok(Drive {
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
        }),
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

    /// A message has room for this many values.
    fn fits<T: Message>(&mut self, key: &str, n_values: u64, what: &str) {
        let limit = T::MAX_ROWS as u64;
        self.file.rule(key, n_values <= limit, || {
            format!("{what}: {n_values} values, a message of topic {} has at most {limit}", T::TOPIC)
        });
    }

    fn camera(&mut self, index: usize, entry: &CameraEntry) -> Vec<Frame> {
        let key = |name: &str| format!("camera[{index}].{name}");
        rules::pose(&mut self.file, &key("body_from_camera"), &entry.body_from_camera);
        rules::lens(&mut self.file, &key("model"), &entry.model);
        rules::exposure(&mut self.file, &key("exposure_nanos"), entry.exposure_nanos);
        let (width, height) = entry.model.size();
        let n_values = u64::from(width) * u64::from(height) * COLORS;
        self.fits::<ImageTopic>(&key("model"), n_values, &format!("{width} x {height} pixels of {COLORS} colors"));
        self.frames(&key("folder"), &entry.folder, index, &["jpg", "jpeg", "png"])
    }

    fn mosaic(&mut self, index: usize, entry: &MosaicEntry) -> Vec<Frame> {
        let key = |name: &str| format!("mosaic[{index}].{name}");
        rules::pose(&mut self.file, &key("body_from_camera"), &entry.body_from_camera);
        rules::lens(&mut self.file, &key("model"), &entry.model);
        rules::exposure(&mut self.file, &key("exposure_nanos"), entry.exposure_nanos);
        rules::exposure(&mut self.file, &key("dark_exposure_nanos"), entry.dark_exposure_nanos);
        rules::exposure(&mut self.file, &key("white_exposure_nanos"), entry.white_exposure_nanos);
        let white = entry.white_reflectance;
        self.file.rule(&key("white_reflectance"), white > 0.0 && white <= 1.0, || {
            format!("value {white} must be above 0, up to 1")
        });
        let bits = entry.bit_depth;
        self.file.rule(&key("bit_depth"), (1..=16).contains(&bits), || format!("value {bits} must be 1 to 16"));
        let (side, n_bands) = (entry.pattern, entry.wavelengths_nm.len());
        self.file.rule(&key("pattern"), (1..=5).contains(&side), || format!("value {side} must be 1 to 5"));
        self.file.rule(&key("wavelengths_nm"), n_bands == (side as usize).saturating_pow(2), || {
            format!("{n_bands} values; expected one for each of the {side} x {side} cells of the pattern")
        });
        let are_positive = entry.wavelengths_nm.iter().all(|nm| *nm > 0.0 && nm.is_finite());
        self.file.rule(&key("wavelengths_nm"), are_positive, || "must be positive".into());
        let ([x, y, w, h], (width, height)) = (entry.active_area, entry.model.size());
        let n_values = u64::from(width) * u64::from(height);
        self.fits::<MosaicTopic>(&key("model"), n_values, &format!("{width} x {height} pixels"));
        // Each pixel of the cube has its bands and a mask.
        let n_values = u64::from(w) * u64::from(h) * (n_bands as u64 + 1);
        self.fits::<CubeTopic>(
            &key("active_area"),
            n_values,
            &format!("a cube of {w} x {h} pixels and {n_bands} bands"),
        );
        let inside =
            u64::from(x) + u64::from(w) <= u64::from(width) && u64::from(y) + u64::from(h) <= u64::from(height);
        self.file.rule(&key("active_area"), inside && w >= side && h >= side, || {
            format!(
                "{:?} must lie in the {width} x {height} image and be at least as large as the pattern, {side}",
                entry.active_area
            )
        });
        if let Some(panel) = &entry.white_panel {
            self.white_panel(&key("white_panel"), panel, entry);
        }
        self.frames(&key("folder"), &entry.folder, index, &["pgm"])
    }

    fn white_panel(&mut self, key: &str, panel: &WhitePanelEntry, entry: &MosaicEntry) {
        if let Some(reflectances) = &panel.reflectances {
            let n_bands = entry.wavelengths_nm.len();
            let is_valid =
                reflectances.len() == n_bands && reflectances.iter().all(|white| *white > 0.0 && *white <= 1.0);
            self.file.rule(key, is_valid, || {
                format!("reflectances {reflectances:?} must be {n_bands} values above 0, up to 1, one for each band")
            });
        }
        if let Some(region) = panel.region {
            let ([x, y, w, h], [x0, y0, width, height]) = (region.map(u64::from), entry.active_area.map(u64::from));
            let inside = x >= x0 && y >= y0 && x + w <= x0 + width && y + h <= y0 + height;
            self.file.rule(key, inside && w.min(h) >= u64::from(entry.pattern), || {
                format!(
                    "region {region:?} must lie in the active area and be at least as large as the pattern, {}",
                    entry.pattern
                )
            });
        }
    }

    /// Reads the calibration file of the manufacturer and checks that the manifest agrees with it.
    fn sensor(&mut self, index: usize, entry: &MosaicEntry, name: &str) -> Option<SensorCalibration> {
        let key = |name: &str| format!("mosaic[{index}].{name}");
        let path = self.inside(&key("sensor"), name)?;
        let text = read_text(&path, MAX_CALIBRATION_BYTES);
        let text =
            text.map_err(|error| self.file.fault(&key("sensor"), format!("{}: {error}", path.display()))).ok()?;
        let sensor = SensorCalibration::from_xml(&text);
        let sensor =
            sensor.map_err(|error| self.file.fault(&key("sensor"), format!("{}: {error}", path.display()))).ok()?;
        let same_area = entry.active_area == sensor.active_area;
        self.file.rule(&key("active_area"), same_area, || {
            format!("{:?} must be {:?}, as in {}", entry.active_area, sensor.active_area, path.display())
        });
        self.file.rule(&key("pattern"), entry.pattern == sensor.pattern, || {
            format!("value {} must be {}, as in {}", entry.pattern, sensor.pattern, path.display())
        });
        let (width, height) = entry.model.size();
        self.file.rule(&key("model"), [width, height] == sensor.size, || {
            let [w, h] = sensor.size;
            format!("size {width} x {height} must be {w} x {h}, as in {}", path.display())
        });
        let bits = sensor.bit_depth.unwrap_or(entry.bit_depth);
        self.file.rule(&key("bit_depth"), entry.bit_depth == bits, || {
            format!("value {} must be {bits}, as in {}", entry.bit_depth, path.display())
        });
        Some(sensor)
    }

    fn gnss(&mut self, entry: &GnssEntry) {
        let [latitude, longitude, height] = entry.origin;
        let on_earth = latitude.abs() <= 90.0 && longitude.abs() <= 180.0 && height.abs() < 100_000.0;
        self.file.rule("gnss.origin", on_earth, || {
            format!("value {:?} must be latitude -90 to 90, longitude -180 to 180 and height in m", entry.origin)
        });
        rules::position(&mut self.file, "gnss.antenna_in_body", &entry.antenna_in_body);
        self.file("gnss.file", &entry.file);
    }

    fn imu(&mut self, entry: &ImuEntry) {
        self.imu_mounting(entry);
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
