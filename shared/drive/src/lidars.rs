//! The LiDARs of a drive: their models, and the files of their sweeps.

use super::TIMES_FILE;
use super::check::{Check, numbered};
use super::lidar_file::lidar_of;
use super::listing::{captures, files_with_extension};
use super::numbering::{Missing, missing_files, positions};
use crate::manifest::{LidarEntry, rules};
use files::text_file::read_text;
use formats::cloud_fields::IntensityScale;
use geometry::Stamp;
use lidar::Lidar;
use lidar::pcap::sort_by_time;
use messages::MAX_LIDARS;
use std::path::{Path, PathBuf};

/// Time between cloud files without `times.txt`: 10 Hz.
const SWEEP_NANOS: i64 = 100_000_000;

/// Largest origin of map coordinates, m.
const MAX_ORIGIN_M: i64 = 100_000_000;

/// A LiDAR of a drive and its files.
#[derive(Clone, Debug)]
pub struct DriveLidar {
    /// The LiDAR, with the calibration of its unit.
    pub lidar: Lidar,
    /// Format of its files, as in [`LidarEntry::format`].
    pub format: String,
    /// Captures in the order of their times, or clouds in the natural order of their names.
    pub files: Vec<PathBuf>,
    /// Stamps of clouds, one per file; empty for captures.
    pub stamps: Vec<Stamp>,
    /// Factor of the intensities of clouds; `None`: determined from the files.
    pub intensity_scale: Option<f64>,
    /// Whole meters that are subtracted from map coordinates of clouds; `None`: determined from the files.
    pub map_origin: Option<[i64; 3]>,
    /// Files that are missing by the numbers in the names; none for clouds with stamps.
    pub missing: Missing,
}

/// All LiDARs of a drive.
pub(super) struct CheckedLidars {
    pub(super) first: DriveLidar,
    pub(super) others: Vec<DriveLidar>,
}

impl Check<'_> {
    /// All LiDARs; `None` if one has problems.
    pub(super) fn lidars(&mut self, entries: &[Option<LidarEntry>]) -> Option<CheckedLidars> {
        let keys = self.keys_of_lidars(entries);
        let mut found = Vec::new();
        for (index, entry) in numbered(entries) {
            let lidar = self.lidar(&keys[index], entry);
            // If another LiDAR has no data, the drive still has ticks.
            let Sweeps { files, stamps, missing } = self.sweeps(&keys[index], entry, index == 0);
            let lidar = lidar.map(|lidar| self.calibrated(&keys[index], entry, lidar, &files));
            let format = entry.format.clone();
            let LidarEntry { intensity_scale, map_origin, .. } = *entry;
            found.push(lidar.map(|lidar| DriveLidar {
                lidar,
                format,
                files,
                stamps,
                intensity_scale,
                map_origin,
                missing,
            }));
        }
        let mut found = found.into_iter().collect::<Option<Vec<_>>>()?.into_iter();
        Some(CheckedLidars { first: found.next()?, others: found.collect() })
    }

    /// Checks all LiDARs without the files of their sweeps.
    pub(super) fn models_of_lidars(&mut self, entries: &[Option<LidarEntry>]) {
        let keys = self.keys_of_lidars(entries);
        for (index, entry) in numbered(entries) {
            self.lidar(&keys[index], entry);
        }
    }

    /// Checks that several LiDARs can be distinguished. Returns the key of each in the file.
    fn keys_of_lidars(&mut self, entries: &[Option<LidarEntry>]) -> Vec<String> {
        let n = entries.len();
        if n < 2 {
            return vec!["lidar".to_owned(); n];
        }
        self.file.rule("lidar", n <= MAX_LIDARS, || format!("{n} LiDARs; at most {MAX_LIDARS} are supported"));
        for (index, entry) in numbered(entries) {
            let key = |name: &str| format!("lidar[{index}].{name}");
            let is_word = |name: &String| {
                !name.is_empty() && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_')
            };
            self.file.rule(&key("name"), entry.name.as_ref().is_some_and(is_word), || {
                "must be a word of letters, digits and _: it is part of the names of counters and doubts".into()
            });
            for (other, earlier) in numbered(entries).take_while(|(other, _)| *other < index) {
                self.file.rule(&key("name"), entry.name.is_none() || entry.name != earlier.name, || {
                    format!("value {:?} is also the name of lidar[{other}]; give each LiDAR its own name", entry.name)
                });
                let is_shared = Path::new(&entry.folder) == Path::new(&earlier.folder);
                self.file.rule(&key("folder"), !is_shared || are_told_apart(entry, earlier), || {
                    format!(
                        "{:?} is also the folder of lidar[{other}]; in one folder, only captures can be distinguished: by model, by sender or by port",
                        entry.folder
                    )
                });
            }
        }
        (0..n).map(|index| format!("lidar[{index}]")).collect()
    }

    fn lidar(&mut self, key: &str, entry: &LidarEntry) -> Option<Lidar> {
        rules::pose(&mut self.file, &format!("{key}.body_from_lidar"), &entry.body_from_lidar);
        if let Some(factor) = entry.intensity_scale {
            self.file.rule(&format!("{key}.intensity_scale"), IntensityScale::is_factor(factor), || {
                format!("value {factor} must be a positive number; intensities times it are 0 to 255")
            });
        }
        let origin = entry.map_origin.unwrap_or_default();
        self.file.rule(&format!("{key}.map_origin"), origin.iter().all(|value| value.abs() <= MAX_ORIGIN_M), || {
            format!("value {origin:?} must be three whole numbers of meters, up to {MAX_ORIGIN_M}")
        });
        if let Some(name) = &entry.calibration {
            self.inside(&format!("{key}.calibration"), name)?;
        }
        let lidar = match lidar_of(self.folder, key, entry) {
            Ok(lidar) => lidar,
            Err(problem) => {
                self.file.fault(&problem.key, problem.rule);
                return None;
            }
        };
        if !lidar.receives_calibration() {
            self.needs_no_file(key, entry, &lidar);
        }
        Some(lidar)
    }

    /// The LiDAR with the calibration in its packets, if no file contains one.
    fn calibrated(&mut self, key: &str, entry: &LidarEntry, lidar: Lidar, files: &[PathBuf]) -> Lidar {
        if entry.format != "pcap" || files.is_empty() {
            return lidar;
        }
        let is_unknown = lidar.receives_calibration();
        let lidar = lidar.with_calibration_of(files);
        if is_unknown {
            self.needs_no_file(key, entry, &lidar);
        }
        lidar
    }

    fn needs_no_file(&mut self, key: &str, entry: &LidarEntry, lidar: &Lidar) {
        let missing = lidar.missing_file().filter(|_| entry.format == "pcap");
        self.file.rule(&format!("{key}.calibration"), missing.is_none(), || {
            format!("is absent; packets of {:?} need {}", entry.model, missing.unwrap_or_default())
        });
    }

    /// Files of the sweeps and, for clouds, their stamps.
    fn sweeps(&mut self, key: &str, entry: &LidarEntry, is_first: bool) -> Sweeps {
        let none = Sweeps::default();
        let key_of = |name: &str| format!("{key}.{name}");
        let extensions: &[&str] = match entry.format.as_str() {
            "pcap" => &["pcap", "pcapng"],
            "pcd" => &["pcd"],
            "bin" | "nuscenes" => &["bin"],
            other => {
                self.file.fault(&key_of("format"), format!("value {other:?} must be one of pcap, pcd, bin, nuscenes"));
                return none;
            }
        };
        let Some(folder) = self.folder(&key_of("folder"), &entry.folder) else { return none };
        let is_capture = entry.format == "pcap";
        let listed = if is_capture { captures(&folder) } else { files_with_extension(&folder, extensions) };
        let mut files = self.listed(&key_of("folder"), listed).unwrap_or_default();
        if is_capture && let Err(rule) = sort_by_time(&mut files) {
            self.file.fault(&key_of("folder"), format!("{}: {rule}", folder.display()));
        }
        self.file.rule(&key_of("folder"), !files.is_empty() || !is_first, || {
            format!("{} contains no *.{}", folder.display(), extensions.join(", *."))
        });
        let is_nuscenes = |path: &PathBuf| path.to_string_lossy().ends_with(".pcd.bin");
        self.file.rule(&key_of("format"), entry.format != "bin" || !files.iter().any(is_nuscenes), || {
            "value \"bin\" is for sweeps of KITTI; *.pcd.bin are sweeps of nuScenes: set \"nuscenes\"".into()
        });
        if is_capture {
            return Sweeps { missing: missing_files(&files), files, stamps: Vec::new() };
        }
        match self.times(&key_of("folder"), &folder, files.len()) {
            Some(stamps) => Sweeps { files, stamps, missing: Missing::default() },
            None => Sweeps { stamps: assumed_stamps(&files), missing: missing_files(&files), files },
        }
    }

    /// Stamps of `times.txt`; `None` without this file.
    fn times(&mut self, key: &str, folder: &Path, n_sweeps: usize) -> Option<Vec<Stamp>> {
        let path = folder.join(TIMES_FILE);
        // A stamp in ns has up to 20 characters.
        let limit = 64 * (n_sweeps as u64 + 16);
        let text = match read_text(&path, limit) {
            Err(error) if !error.is_absent() => {
                self.file.fault(key, format!("{}: {error}", path.display()));
                return Some(Vec::new());
            }
            read => read.ok(),
        };
        let text = text?;
        let stamps = stamps_of_sweeps(&text, n_sweeps);
        if let Err(found) = &stamps {
            let path = path.display();
            self.file.fault(
                key,
                format!("{path} must have {n_sweeps} increasing stamps in ns, one per line for each sweep; {found}"),
            );
        }
        Some(stamps.unwrap_or_default())
    }
}

/// Increasing stamps, one per line. The error names the first line that is wrong.
fn stamps_of_sweeps(text: &str, n_sweeps: usize) -> Result<Vec<Stamp>, String> {
    let mut stamps: Vec<Stamp> = Vec::new();
    for (number, line) in (1..).zip(text.lines().map(str::trim)).filter(|(_, line)| !line.is_empty()) {
        let stamp = line.parse().map(Stamp).map_err(|_| format!("line {number} is {line:?}"))?;
        if let Some(previous) = stamps.last().filter(|previous| **previous >= stamp) {
            return Err(format!("line {number}, {}, is not after {}", stamp.0, previous.0));
        }
        stamps.push(stamp);
    }
    match median_interval_nanos(&stamps) {
        Some(median) if median < MIN_INTERVAL_NANOS && stamps[0].0 >= MIN_SECONDS => Err(format!(
            "its stamps have a median interval of {median} ns, and sweeps are at least {MIN_INTERVAL_NANOS} ns apart: check their unit"
        )),
        _ if stamps.len() == n_sweeps => Ok(stamps),
        _ => Err(format!("it has {}", stamps.len())),
    }
}

/// Median time from one stamp to the next; `None` for a single stamp.
pub(super) fn median_interval_nanos(stamps: &[Stamp]) -> Option<i64> {
    let mut intervals: Vec<i64> = stamps.windows(2).map(|pair| pair[1].0.saturating_sub(pair[0].0)).collect();
    let middle = intervals.len() / 2;
    (!intervals.is_empty()).then(|| *intervals.select_nth_unstable(middle).1)
}

/// Least median time between sweeps: no LiDAR has more than 500 sweeps per second.
const MIN_INTERVAL_NANOS: i64 = 2_000_000;

/// Smaller numbers are not seconds since 1970, nor a smaller unit: the stamps of a clock that was never set.
const MIN_SECONDS: i64 = 500_000_000;

/// Files of the sweeps of a LiDAR.
#[derive(Default)]
struct Sweeps {
    files: Vec<PathBuf>,
    /// Stamps of clouds.
    stamps: Vec<Stamp>,
    missing: Missing,
}

/// Stamps of clouds without `times.txt`: 10 sweeps per second. Missing numbers in the names leave their time.
fn assumed_stamps(files: &[PathBuf]) -> Vec<Stamp> {
    let positions = positions(files).unwrap_or_else(|| (0..files.len() as u64).collect());
    positions.into_iter().map(|k| Stamp(k as i64 * SWEEP_NANOS)).collect()
}

/// Whether the packets of two LiDARs in the same captures can be distinguished.
fn are_told_apart(a: &LidarEntry, b: &LidarEntry) -> bool {
    let differ = |a: Option<u32>, b: Option<u32>| a.is_some() && b.is_some() && a != b;
    let number = |sender: Option<std::net::Ipv4Addr>| sender.map(u32::from);
    let by_origin = differ(number(a.sender), number(b.sender)) || differ(a.port.map(u32::from), b.port.map(u32::from));
    [a, b].iter().all(|entry| entry.format == "pcap") && (a.model != b.model || by_origin)
}
