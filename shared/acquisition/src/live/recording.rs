//! The raw recording of a live run: a growing drive folder.

use super::mounting::Mounting;
use super::recorded_entries::RecordedEntries;
use crate::error::LiveError;
use drive::MANIFEST_FILE;
use drive::manifest::{LidarEntry, Manifest, PoseEntry};
use files::atomic_file::write_atomic;
use files::names::sort_by_name;
use lidar::Lidar;
use lidar::pcap::Recorder;
use std::path::{Component, Path, PathBuf};
use std::{fs, io};

/// Size of the header of a capture.
const CAPTURE_HEADER_BYTES: u64 = 24;

/// Folder of the captures of the first LiDAR in the recording, as in [`LidarEntry::from_captures`].
pub(crate) const LIDAR: &str = "lidar";
/// Largest number of captures. Names have three digits, so that they sort by number.
const MAX_CAPTURES: u32 = 1000;

/// The folder and its captures; the last one is being written.
#[derive(Debug)]
pub(crate) struct Recording {
    folder: PathBuf,
    captures: Vec<PathBuf>,
}

/// Folder of the captures of another LiDAR in the recording.
pub(crate) fn folder_of(name: &str) -> String {
    format!("{LIDAR}_{name}")
}

/// Captures of the first LiDAR in a recording's folder, sorted by name; empty without the folder.
pub fn captures(folder: &Path) -> io::Result<Vec<PathBuf>> {
    captures_in(&folder.join(LIDAR))
}

fn captures_in(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let entries = match fs::read_dir(folder) {
        Ok(entries) => entries,
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        Err(error) => return Err(error),
    };
    let paths = entries.map(|entry| Ok(entry?.path())).collect::<io::Result<Vec<PathBuf>>>()?;
    let is_capture = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "pcap");
    let mut captures: Vec<PathBuf> = paths.into_iter().filter(is_capture).collect();
    sort_by_name(&mut captures);
    Ok(captures)
}

/// Folder of a recording inside the output folder, so that a run writes nowhere else.
pub fn folder_inside(output: &Path, name: &str) -> Result<PathBuf, LiveError> {
    let path = Path::new(name);
    let is_inside = path.components().all(|part| matches!(part, Component::Normal(_)));
    if is_inside && !name.is_empty() {
        return Ok(output.join(path));
    }
    Err(LiveError::Outside(name.to_owned()))
}

impl Recording {
    /// Starts the next capture: `000.pcap`, or the number after the existing captures, which are never overwritten.
    pub(crate) fn begin(folder: PathBuf, lidar: &str) -> Result<(Self, Recorder), LiveError> {
        let fault = |source: io::Error| LiveError::File { path: folder.clone(), source };
        fs::create_dir_all(folder.join(lidar)).map_err(fault)?;
        let mut captures = captures_in(&folder.join(lidar)).map_err(fault)?;
        let number =
            |path: &PathBuf| path.file_stem().and_then(|stem| stem.to_str()).and_then(|stem| stem.parse().ok());
        let next = captures.iter().filter_map(number).max().map_or(0, |last: u32| last.saturating_add(1));
        if next >= MAX_CAPTURES {
            return Err(LiveError::Full { folder, max: MAX_CAPTURES });
        }
        let path = folder.join(lidar).join(format!("{next:03}.pcap"));
        let recorder = Recorder::create(&path).map_err(|source| LiveError::File { path: path.clone(), source })?;
        captures.push(path);
        Ok((Self { folder, captures }, recorder))
    }

    /// All captures; the last one is being written.
    pub(crate) fn captures(&self) -> &[PathBuf] {
        &self.captures
    }

    /// Whether an earlier process of the run started it.
    pub(crate) fn is_continued(&self) -> bool {
        self.captures.len() > 1
    }

    /// Whether earlier processes of the run received packets: their captures have more than a header.
    pub(crate) fn has_earlier_packets(&self) -> bool {
        let earlier = self.captures.iter().rev().skip(1);
        earlier.into_iter().any(|path| path.metadata().is_ok_and(|metadata| metadata.len() > CAPTURE_HEADER_BYTES))
    }

    /// Writes the manifest and the calibration of the unit if they are absent, so that the recording is a drive.
    pub(crate) fn describe(&self, lidar: &Lidar, mounting: &Mounting) -> Result<(), LiveError> {
        let path = self.folder.join(MANIFEST_FILE);
        if path.exists() {
            return Ok(());
        }
        let entry = |lidar: &Lidar, folder: &str, name: Option<String>, body_from_lidar: PoseEntry| {
            let calibration = self.write_calibration(lidar, folder)?;
            let entry = LidarEntry::new(lidar.model().name(), "pcap", folder, body_from_lidar);
            Ok::<_, LiveError>(LidarEntry { name, calibration, ..entry })
        };
        let first = entry(lidar, LIDAR, mounting.name(), mounting.body_from_lidar())?;
        let mut manifest = Manifest::with_lidar("live recording", first);
        for other in &mounting.secondary_lidars {
            let name = other.name();
            let found = entry(&other.lidar, &folder_of(name), Some(name.to_owned()), other.entry.body_from_lidar)?;
            manifest.other_lidars.push(found);
        }
        let RecordedEntries { cameras, mosaics, gnss, imu } = mounting.auxiliary.clone();
        let manifest = Manifest { cameras, mosaics, gnss, imu, ..manifest };
        let text = toml::to_string(&manifest).map_err(|source| LiveError::Manifest { path: path.clone(), source })?;
        write_atomic(&path, text.as_bytes()).map_err(|source| LiveError::File { path, source })
    }

    /// Writes the calibration of a unit, if it has one, and returns the name of the file.
    fn write_calibration(&self, lidar: &Lidar, folder: &str) -> Result<Option<String>, LiveError> {
        let Some((name, text)) = lidar.calibration_file() else { return Ok(None) };
        let extension = Path::new(name).extension().and_then(|extension| extension.to_str()).unwrap_or("txt");
        let name = format!("{folder}_calibration.{extension}");
        let path = self.folder.join(&name);
        write_atomic(&path, text.as_bytes()).map_err(|source| LiveError::File { path, source })?;
        Ok(Some(name))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn captures_get_the_next_number_and_are_never_overwritten() {
        let folder = tempfile::tempdir().expect("a folder");
        let recording = folder.path().join("recording");
        for name in ["000.pcap", "001.pcap", "002.pcap"] {
            let (begun, recorder) = Recording::begin(recording.clone(), LIDAR).expect("begins");
            assert_eq!(begun.captures().last().and_then(|path| path.file_name()), Some(name.as_ref()));
            assert_eq!(begun.is_continued(), name != "000.pcap");
            drop(recorder);
        }
        fs::write(recording.join("lidar/999.pcap"), b"").expect("writes");
        assert!(Recording::begin(recording, LIDAR).expect_err("is full").to_string().contains("1000 captures"));
    }
}
