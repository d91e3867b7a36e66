//! `replica inspect DRIVE`: sensors, rates, gaps, clocks, coverage and first pictures of a drive, before it is processed.

mod cameras;
mod clocks;
mod facts;
mod inertial;
mod lidar;
mod packets;
pub mod page;
pub mod pictures;
mod processing;
mod receiver;
mod secondary_lidars;
pub mod stream;
pub mod text;

use ::lidar::nmea::Fix;
use ::lidar::pcap::{Compression, has_capture_magic, is_capture_name};
use anyhow::Context;
use command_line::answer::Answer;
use command_line::exit_code;
use command_line::say_error;
use drive::{Drive, MANIFEST_FILE};
use facts::DriveFacts;
use geometry::Stamp;
use pictures::Picture;
use serde::Serialize;
use std::path::Path;
use std::process::ExitCode;
use stream::Stream;

/// The part of a drive that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reading {
    /// Stamps of all files, the start of captures, a few sweeps; no image.
    Stamps,
    /// Also a few images.
    Samples,
    /// All sweeps and images.
    All,
}

/// What was found in a drive.
pub struct DriveReport {
    /// Name in the manifest.
    pub name: String,
    folder: String,
    /// Messages over time, one stream per sensor.
    pub streams: Vec<Stream>,
    /// Facts by heading.
    pub sections: Vec<Section>,
    /// Reasons not to rely on the data.
    pub doubts: Vec<String>,
    pictures: Vec<Picture>,
    /// Path by GNSS: metres east and north of the first fix.
    path_m: Vec<[f64; 2]>,
    /// Fixes of the receiver.
    pub fixes: Vec<Fix>,
}

/// Facts about one subject.
#[derive(Serialize)]
pub struct Section {
    pub heading: String,
    pub lines: Vec<String>,
}

impl DriveReport {
    fn section(&mut self, heading: &str, lines: Vec<String>) {
        if !lines.is_empty() {
            self.sections.push(Section { heading: heading.to_owned(), lines });
        }
    }

    fn doubt(&mut self, text: impl Into<String>) {
        self.doubts.push(text.into());
    }

    /// Start of the LiDAR, from which times are counted.
    pub fn origin(&self) -> Stamp {
        self.lidar_span().map_or(Stamp(0), |[first, _]| first)
    }

    /// Start and end of the LiDAR.
    fn lidar_span(&self) -> Option<[Stamp; 2]> {
        self.streams.iter().find(|stream| stream.is_reference).and_then(Stream::span)
    }
}

/// Whether `inspect` reads a path as a drive: a manifest, a capture, or a folder of sweeps without clouds of a run.
pub fn is_drive(path: &Path) -> bool {
    let has_extension = |file: &Path, known: &[&str]| {
        let extension = file.extension().map(|extension| extension.to_string_lossy().to_lowercase());
        extension.is_some_and(|extension| known.contains(&extension.as_str()))
    };
    if path.is_file() {
        return is_capture_name(path) || has_capture_magic(path) || Compression::find(path).is_some();
    }
    if path.join(MANIFEST_FILE).is_file() {
        return true;
    }
    let files = || path.read_dir().into_iter().flatten().flatten().map(|entry| entry.path());
    !path.join("clouds").is_dir()
        && !files().any(|file| has_extension(&file, &["ply"]))
        && (files().any(|file| {
            is_capture_name(&file) || Compression::find(&file).is_some() || has_extension(&file, &["pcd", "bin"])
        }) || !drive::unnamed_captures(path).unwrap_or_default().is_empty())
}

/// Prints the report and writes the page.
pub fn run(path: &Path, reading: Reading, page: Option<&Path>, answer: Answer) -> anyhow::Result<ExitCode> {
    let report = DriveReport::from_drive(&Drive::open(path)?, path, reading)?;
    answer.print(&DriveFacts::from_report(&report), || text::render(&report))?;
    if let Some(page) = page {
        std::fs::write(page, page::render(&report)).with_context(|| page.display().to_string())?;
        say_error!("wrote {}", page.display());
    }
    Ok(if report.doubts.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(exit_code::INCOMPLETE) })
}

impl DriveReport {
    /// Reads a drive.
    pub fn from_drive(drive: &Drive, path: &Path, reading: Reading) -> anyhow::Result<Self> {
        let mut report = Self {
            name: drive.manifest().name.clone(),
            folder: path.display().to_string(),
            streams: Vec::new(),
            sections: Vec::new(),
            doubts: acquisition::recorded::drive_problems(path),
            pictures: Vec::new(),
            path_m: Vec::new(),
            fixes: Vec::new(),
        };
        if drive.is_inferred() {
            let lines = vec![format!("no {MANIFEST_FILE}: sweeps of one LiDAR, whose frame is the body frame")];
            report.section("Drive", lines);
        }
        for text in drive.lidars().flat_map(|lidar| &lidar.missing.texts) {
            report.doubt(format!("lidar: files are missing: {text}"));
        }
        let lidar = lidar::add(drive, reading == Reading::All, &mut report)?;
        secondary_lidars::add(drive, &mut report);
        receiver::add(drive, &lidar, &mut report)?;
        inertial::add(drive, &mut report)?;
        cameras::add(drive, reading, &mut report);
        clocks::add(&lidar, &mut report);
        processing::add(drive, path, &mut report);
        Ok(report)
    }
}
