//! Sources of the auxiliary sensors, checked against the rig.

use super::frames::Frames;
use super::logs::{FixLog, SampleLog};
use super::references::References;
use crate::error::LiveError;
use crate::live::images::{CameraKind, ImageWatch, WatchedCamera};
use crate::live::line_address::LineAddress;
use crate::live::lines::LineLog;
use crate::live::now;
use crate::live::record_file::record_file;
use crate::live::recorded_entries::RecordedEntries;
use crate::recorded::Trigger;
use drive::imu::ImuParser;
use drive::manifest::{GnssEntry, ImuEntry, Manifest};
use drive::{CameraRig, LiveRig};
use files::atomic_file::write_atomic;
use files::regular_file;
use geometry::Stamp;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::{fs, io};

/// Names of the logs in the recording.
const GNSS_FILE: &str = "gnss.nmea";
const IMU_FILE: &str = "imu.csv";
/// File with the start of the recording, ns: a restarted process takes images from then on.
const BEGIN_FILE: &str = "begin.txt";

/// Sources of the auxiliary sensors.
#[derive(Clone, Debug, Default)]
pub struct AuxiliarySources {
    /// Folder with the folders of the cameras.
    cameras: Option<PathBuf>,
    gnss: Option<LineAddress>,
    imu: Option<LineAddress>,
    /// The rig and its folder.
    rig: Option<(PathBuf, Manifest)>,
}

impl AuxiliarySources {
    /// Finds the sources from the settings of the same names, where an empty text means no source; a folder of cameras
    /// is absolute. `rig` is a drive folder or a manifest. All problems are reported.
    pub fn find(cameras: Option<PathBuf>, gnss: &str, imu: &str, rig: &Path) -> Result<Self, Vec<LiveError>> {
        let mut problems = Vec::new();
        let found = match LiveRig::find(rig) {
            Ok(found) => found,
            Err(error) => return Err(vec![error.into()]),
        };
        let manifest = found.manifest();
        let has_cameras = manifest.is_some_and(|manifest| !manifest.cameras.is_empty() || !manifest.mosaics.is_empty());
        let wanted = [
            ("cameras", cameras.is_some(), has_cameras, "[[camera]] and no [[mosaic]]"),
            ("gnss", !gnss.is_empty(), manifest.is_some_and(|manifest| manifest.gnss.is_some()), "[gnss]"),
            ("imu", !imu.is_empty(), manifest.is_some_and(|manifest| manifest.imu.is_some()), "[imu]"),
        ];
        for (key, _, _, what) in wanted.into_iter().filter(|(_, is_set, is_in_rig, _)| *is_set && !is_in_rig) {
            problems.push(LiveError::NotInRig { key, what, rig: rig_name(&found) });
        }
        if let Some(folder) = cameras.as_ref().filter(|folder| !folder.is_dir()) {
            problems.push(LiveError::NoFolder(folder.clone()));
        }
        if cameras.is_some() && has_cameras {
            problems.extend(CameraRig::from_live(rig).err().map(LiveError::from));
        }
        let mut address = |key: &'static str, text: &str| {
            let parsed = (!text.is_empty()).then(|| text.parse::<LineAddress>())?;
            parsed.map_err(|source| problems.push(LiveError::Line { key, source })).ok()
        };
        let gnss = address("gnss", gnss);
        let imu = address("imu", imu);
        let rig = match found {
            LiveRig::File(path, manifest) => Some((path.parent().unwrap_or(Path::new("")).to_owned(), *manifest)),
            LiveRig::Simulated(_) | LiveRig::Default => None,
        };
        if problems.is_empty() { Ok(Self { cameras, gnss, imu, rig }) } else { Err(problems) }
    }

    /// Addresses that cannot be opened now, with the reasons.
    pub fn check(&self) -> Vec<LiveError> {
        let addresses = [("gnss", &self.gnss), ("imu", &self.imu)];
        let fault = |(key, address): (&'static str, &Option<LineAddress>)| {
            let address = address.as_ref()?;
            let source = address.check().err()?;
            Some(LiveError::Open { key, address: address.clone(), source })
        };
        addresses.into_iter().filter_map(fault).collect()
    }

    /// Entries of the recording's manifest for the received sensors.
    pub(super) fn entries(&self) -> RecordedEntries {
        let Some((_, manifest)) = &self.rig else { return RecordedEntries::default() };
        let with_cameras = self.cameras.is_some();
        let gnss = manifest.gnss.as_ref().filter(|_| self.gnss.is_some());
        let imu = manifest.imu.as_ref().filter(|_| self.imu.is_some());
        RecordedEntries {
            cameras: if with_cameras { manifest.cameras.clone() } else { Vec::new() },
            mosaics: if with_cameras { manifest.mosaics.clone() } else { Vec::new() },
            gnss: gnss.map(|entry| GnssEntry { file: GNSS_FILE.to_owned(), ..entry.clone() }),
            imu: imu.map(|entry| ImuEntry { file: IMU_FILE.to_owned(), ..entry.clone() }),
        }
    }

    /// Creates the folders of the cameras, records their `references` and starts to watch.
    pub(super) fn start_frames(
        &self,
        recording: &Path,
        entries: &RecordedEntries,
        trigger: Trigger,
        references: &mut References,
    ) -> Result<Option<Frames>, LiveError> {
        let Some(root) = &self.cameras else { return Ok(None) };
        let Some((rig, _)) = &self.rig else { return Ok(None) };
        let fault = |path: &Path, source: io::Error| LiveError::File { path: path.to_owned(), source };
        let mut watched = Vec::new();
        let mut names = BTreeMap::new();
        let color = entries
            .cameras
            .iter()
            .enumerate()
            .map(|(index, entry)| ((CameraKind::Color, index, entry.delay_nanos), &entry.folder, &entry.name));
        let mosaic = entries
            .mosaics
            .iter()
            .enumerate()
            .map(|(index, entry)| ((CameraKind::Mosaic, index, entry.delay_nanos), &entry.folder, &entry.name));
        for ((kind, index, delay_nanos), folder, name) in color.chain(mosaic) {
            let source = root.join(folder);
            let recorded = recording.join(folder);
            for path in [&source, &recorded] {
                fs::create_dir_all(path).map_err(|error| fault(path, error))?;
            }
            let kind_name = match kind {
                CameraKind::Color => "camera",
                CameraKind::Mosaic => {
                    let of_rig = rig.join(folder);
                    references.record(name, &source, &of_rig, &recorded).map_err(|error| fault(&recorded, error))?;
                    "mosaic"
                }
            };
            names.insert((kind, index), format!("{kind_name} {name}"));
            watched.push(WatchedCamera { kind, index, delay_nanos, source, recorded });
        }
        for name in entries.mosaics.iter().filter_map(|entry| entry.sensor.as_ref()) {
            let target = recording.join(name);
            let recorded = target.parent().map_or(Ok(()), fs::create_dir_all);
            recorded.and_then(|()| record_file(&rig.join(name), &target)).map_err(|error| fault(&target, error))?;
        }
        let watch = ImageWatch::start(watched, begin_of(recording).map_err(|error| fault(recording, error))?)?;
        Ok(Some(Frames::new(watch, names, trigger)))
    }

    pub(super) fn start_fixes(&self, recording: &Path, entry: Option<&GnssEntry>) -> Result<Option<FixLog>, LiveError> {
        let Some(address) = &self.gnss else { return Ok(None) };
        let path = recording.join(GNSS_FILE);
        let log = start_log("gnss", address, &path)?;
        Ok(Some(FixLog::new(path, log, entry)))
    }

    pub(super) fn start_samples(
        &self,
        recording: &Path,
        entry: Option<&ImuEntry>,
    ) -> Result<Option<SampleLog>, LiveError> {
        let Some(address) = &self.imu else { return Ok(None) };
        let path = recording.join(IMU_FILE);
        let log = start_log("imu", address, &path)?;
        let mounting = entry.filter(|entry| entry.body_from_imu.is_some()).map(|entry| entry.mounting().rotation);
        let parser = ImuParser::default().delayed(entry.map_or(0, |entry| entry.delay_nanos));
        let parser = match mounting {
            Some(rotation) => parser.rotated(rotation),
            None => parser,
        };
        Ok(Some(SampleLog::new(path, log, parser)))
    }
}

fn rig_name(rig: &LiveRig) -> String {
    match rig {
        LiveRig::File(path, _) => path.display().to_string(),
        LiveRig::Simulated(path) => {
            format!("the rig of the simulated drive {} is not used, and the default rig", path.display())
        }
        LiveRig::Default => "without run.rig the rig".to_owned(),
    }
}

fn start_log(key: &'static str, address: &LineAddress, path: &Path) -> Result<LineLog, LiveError> {
    let open = |source: io::Error| LiveError::Open { key, address: address.clone(), source };
    let link = address.open().map_err(open)?;
    LineLog::start(address, link, path).map_err(|source| LiveError::File { path: path.to_owned(), source })
}

/// Start of the recording: now, or the time noted by an earlier process of the run.
fn begin_of(recording: &Path) -> io::Result<Stamp> {
    let path = recording.join(BEGIN_FILE);
    if let Some(begin) = regular_file::read_to_string(&path).ok().and_then(|text| text.trim().parse().ok()) {
        return Ok(Stamp(begin));
    }
    let begin = now();
    write_atomic(&path, format!("{}\n", begin.0).as_bytes())?;
    Ok(begin)
}
