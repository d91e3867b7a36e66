//! The facts of a report, for programs: `report.json`.

use super::accuracy::Accuracy;
use super::bands::{Band, Diagnosis};
use super::costs::pieces_s;
use super::finished_run::FinishedRun;
use super::place::Place;
use super::uncertain::{CameraShare, Loss};
use super::verdict::Verdict;
use crate::data::inspect::drive::DriveReport;
use crate::data::inspect::drive::stream::Stream;
use delivery::GeoreferenceFile;
use files::shell;
use run::health::ReportedDoubt;
use run::launch_file::LaunchFile;
use run::summary::{Summary, Total};
use run::{Change, Outcome};
use serde::Serialize;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::PathBuf;
use surveying::objects::ObjectSummary;

/// `report.json`.
#[derive(Serialize)]
pub struct Facts {
    /// Version of this file format.
    pub version: u32,
    /// Version of the program that wrote the report.
    pub replica_version: &'static str,
    pub run: PathBuf,
    pub outcome: Outcome,
    pub accuracy: Accuracy,
    pub verdict: Verdict,
    /// `None` if the drive folder is no longer there.
    pub input: Option<Input>,
    pub path: Option<Place>,
    pub georeference: Option<GeoreferenceFile>,
    pub points: Points,
    pub bands: Vec<Band>,
    pub diagnosis: Vec<Diagnosis>,
    pub objects: Vec<ObjectFacts>,
    pub n_objects: usize,
    pub colored_by: Vec<CameraShare>,
    pub losses: Vec<Loss>,
    pub doubts: Vec<StageDoubt>,
    pub notes: BTreeMap<String, Vec<String>>,
    pub faults: Vec<String>,
    pub total: Total,
    pub stages: Vec<StageCosts>,
    pub settings: Settings,
}

/// The input of the run.
#[derive(Serialize)]
pub struct Input {
    pub drive: PathBuf,
    pub name: String,
    pub sensors: Vec<Sensor>,
    /// Remarks about the recording; they are not doubts of the run.
    pub remarks: Vec<String>,
}

/// One sensor.
#[derive(Serialize)]
pub struct Sensor {
    pub name: String,
    pub kind: String,
    pub messages: usize,
    /// Whether only the start of the sensor's data was read.
    pub is_partial: bool,
    pub rate_hz: Option<f64>,
    pub jitter_s: Option<f64>,
    pub gaps: usize,
    pub longest_gap_s: Option<f64>,
}

impl Sensor {
    pub fn from_stream(stream: &Stream) -> Self {
        let gaps = stream.gaps();
        Self {
            name: stream.name.clone(),
            kind: stream.kind.clone(),
            messages: stream.len(),
            is_partial: stream.is_partial(),
            rate_hz: stream.rate_hz(),
            jitter_s: stream.jitter_s(),
            gaps: gaps.n,
            longest_gap_s: gaps.longest.map(|gap| gap.seconds),
        }
    }
}

impl Input {
    pub fn from_report(drive: PathBuf, report: &DriveReport) -> Self {
        let sensors = report.streams.iter().map(Sensor::from_stream).collect();
        Self { drive, name: report.name.clone(), sensors, remarks: report.doubts.clone() }
    }
}

/// Totals of all clouds.
#[derive(Serialize)]
pub struct Points {
    pub n: u64,
    pub n_colored: Option<u64>,
    pub n_spectra: u64,
    /// Number of points by class.
    pub classes: BTreeMap<String, u64>,
    /// Ground with points, in cells of 1 m, m^2.
    pub area_m2: Option<f64>,
}

impl Points {
    pub fn from_run(run: &FinishedRun, area_m2: Option<f64>) -> Self {
        let clouds = || run.index.iter().flat_map(|index| &index.clouds);
        let mut classes = BTreeMap::new();
        for (name, n) in clouds().filter_map(|cloud| cloud.classes.as_ref()).flatten() {
            *classes.entry(name.clone()).or_default() += n;
        }
        let colored: Vec<u64> = clouds().filter_map(|cloud| cloud.n_colored).collect();
        Self {
            n: clouds().map(|cloud| cloud.n_points).sum(),
            n_colored: (!colored.is_empty()).then(|| colored.iter().sum()),
            n_spectra: clouds().filter_map(|cloud| cloud.spectra.as_ref()).map(|spectra| spectra.n_spectra).sum(),
            classes,
            area_m2,
        }
    }
}

/// One object.
#[derive(Serialize)]
pub struct ObjectFacts {
    pub id: i64,
    pub class: &'static str,
    /// Estimate from the points that were read.
    pub points: u64,
    /// Center of the footprint, m, and height of the lowest point, m.
    pub position_m: [f64; 3],
    /// Length, width, height, m.
    pub size_m: [f64; 3],
}

impl ObjectFacts {
    pub fn from_summary(object: &ObjectSummary) -> Self {
        let footprint = &object.footprint;
        Self {
            id: object.id,
            class: object.class,
            points: object.n_points,
            position_m: [footprint.center[0], footprint.center[1], object.low_m],
            size_m: [footprint.length_m, footprint.width_m, object.high_m - object.low_m],
        }
    }
}

/// A doubt and its stage.
#[derive(Serialize)]
pub struct StageDoubt {
    pub stage: String,
    #[serde(flatten)]
    pub doubt: ReportedDoubt,
}

impl StageDoubt {
    /// All doubts of a run.
    pub fn from_summary(summary: &Summary) -> Vec<Self> {
        summary.doubts().map(|(stage, doubt)| Self { stage: stage.to_owned(), doubt: doubt.clone() }).collect()
    }
}

/// Time and memory of a stage.
#[derive(Serialize)]
pub struct StageCosts {
    pub name: String,
    pub cpu_s: f64,
    pub working_s: f64,
    pub waiting_for_output_s: f64,
    pub waiting_for_input_s: f64,
    pub longest_step_ms: f64,
    pub peak_private_bytes: u64,
    pub faults: u32,
}

impl StageCosts {
    pub fn from_run(run: &FinishedRun) -> Vec<Self> {
        let stages = run.summary.stages.iter().map(|stage| {
            let [working_s, waiting_for_output_s, waiting_for_input_s] = pieces_s(stage);
            Self {
                name: stage.name.clone(),
                cpu_s: stage.cpu_s,
                working_s,
                waiting_for_output_s,
                waiting_for_input_s,
                longest_step_ms: stage.step.max_ms,
                peak_private_bytes: stage.peak_private_bytes,
                faults: stage.faults,
            }
        });
        stages.collect()
    }
}

/// Data needed to repeat the run.
#[derive(Serialize)]
pub struct Settings {
    pub command: Option<String>,
    /// Changes by swaps, in the order of the swaps.
    pub swaps: Vec<Vec<String>>,
    /// Digests of programs, models and other files, by file.
    pub digests: BTreeMap<PathBuf, String>,
}

impl Settings {
    pub fn from_run(run: &FinishedRun) -> Self {
        let begun = run.begun.as_ref();
        let command = begun.and_then(|begun| {
            let changes = begun.changes.as_ref()?;
            let mut command = format!("replica-launch {}", shell::word(&begun.launch_file.display().to_string()));
            for (option, value) in changes.iter().map(Change::option) {
                // Writing to a string cannot fail.
                let _ = write!(command, " {option} {}", shell::word(&value));
            }
            Some(command + &selection(run, changes))
        });
        let files = begun.iter().flat_map(|begun| begun.files.values().flatten());
        Self {
            command,
            swaps: run.summary.swaps.iter().map(|swap| swap.changes.clone()).collect(),
            digests: files.map(|(path, file)| (path.clone(), file.digest.clone())).collect(),
        }
    }
}

/// Options that select the stages of the run among the tables of its launch file.
fn selection(run: &FinishedRun, changes: &[Change]) -> String {
    let is_stage = |table: &str| run.summary.stages.iter().any(|stage| stage.name == table);
    if is_stage("replay") {
        return " --source replay".to_owned();
    }
    let Ok(file) = LaunchFile::load(&run.folder.join("run/launch.toml"), changes) else { return String::new() };
    let tables = file.tables().into_iter().map(|(table, _)| table);
    let left_out = tables.filter(|table| !["run", "simulate", "replay"].contains(&table.as_str()) && !is_stage(table));
    let options: Vec<String> = left_out.map(|table| format!(" --without {}", shell::word(&table))).collect();
    options.concat()
}
