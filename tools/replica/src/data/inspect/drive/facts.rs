//! The report as JSON.

use super::stream::{Stream, seconds_between};
use super::{DriveReport, Section};
use geometry::Stamp;
use serde::Serialize;

/// What was found in a drive.
#[derive(Serialize)]
pub struct DriveFacts<'a> {
    path: &'a str,
    name: &'a str,
    sensors: Vec<SensorFacts>,
    sections: &'a [Section],
    doubts: &'a [String],
}

/// Messages of a sensor. `None`: too few messages.
#[derive(Serialize)]
struct SensorFacts {
    name: String,
    kind: String,
    files: usize,
    bytes: u64,
    messages: usize,
    /// Whether only the start of the stream was read.
    is_partial: bool,
    /// Stamps of the first and the last message, ns since the Unix epoch.
    stamps: Option<[Stamp; 2]>,
    rate_hz: Option<f64>,
    jitter_s: Option<f64>,
    gaps: usize,
    longest_gap: Option<GapFacts>,
}

#[derive(Serialize)]
struct GapFacts {
    seconds: f64,
    /// Seconds after the start of the LiDAR.
    at_s: f64,
}

impl<'a> DriveFacts<'a> {
    pub fn from_report(report: &'a DriveReport) -> Self {
        let origin = report.origin();
        Self {
            path: &report.folder,
            name: &report.name,
            sensors: report.streams.iter().map(|stream| SensorFacts::from_stream(stream, origin)).collect(),
            sections: &report.sections,
            doubts: &report.doubts,
        }
    }
}

impl SensorFacts {
    fn from_stream(stream: &Stream, origin: Stamp) -> Self {
        let gaps = stream.gaps();
        Self {
            name: stream.name.clone(),
            kind: stream.kind.clone(),
            files: stream.n_files,
            bytes: stream.n_bytes,
            messages: stream.len(),
            is_partial: stream.is_partial(),
            stamps: stream.span(),
            rate_hz: stream.rate_hz(),
            jitter_s: stream.jitter_s(),
            gaps: gaps.n,
            longest_gap: gaps
                .longest
                .map(|gap| GapFacts { seconds: gap.seconds, at_s: seconds_between(gap.begin, origin) }),
        }
    }
}
