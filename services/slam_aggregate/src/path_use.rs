//! The post-processed trajectory of the drive.

use crate::Settings;
use drive::Drive;
use geometry::{LocalFrame, Stamp};
use georeference::PathSource;
use given_path::{ASSUMED_DEG, ASSUMED_M, Evidence, GivenPath, check};
use stage::{Context, Mode, Problem, StepError};

/// The path of a drive, and what was found when it was compared with the drive.
#[derive(Default)]
pub(crate) struct PathOfDrive {
    pub path: Option<GivenPath>,
    pub notes: Vec<String>,
}

/// Problems of the path before the start.
pub(crate) fn problems(settings: &Settings, context: &Context) -> Vec<Problem> {
    let for_path = |text: String| Problem::for_key("path", text);
    if settings.path == PathSource::Odometry {
        return Vec::new();
    }
    if context.mode == Mode::Live {
        return vec![for_path(
            "must be \"odometry\" in a live run: a post-processed trajectory exists only after the drive".into(),
        )];
    }
    // acquire reports the problems of a drive that cannot be opened.
    let Ok(drive) = Drive::open(&context.drive) else { return Vec::new() };
    match GivenPath::from_drive(&drive) {
        None => vec![for_path(format!(
            "needs [trajectory] in {}; name the file there, or set path = \"odometry\"",
            context.drive.join(drive::MANIFEST_FILE).display()
        ))],
        Some(Err(problem)) => vec![Problem::for_key("", problem.to_string())],
        Some(Ok(path)) if settings.check_path => match checked(path, &drive) {
            Ok(_) => Vec::new(),
            Err(problems) => problems.into_iter().map(|text| Problem::for_key("", text)).collect(),
        },
        Some(Ok(_)) => Vec::new(),
    }
}

/// The path of a drive. If it is only compared with the result, a path that cannot be read is a note.
pub(crate) fn from_drive(settings: &Settings, drive: &Drive) -> Result<PathOfDrive, StepError> {
    let path = match GivenPath::from_drive(drive) {
        None => return Ok(PathOfDrive::default()),
        Some(Ok(path)) => path,
        Some(Err(problem)) if settings.path == PathSource::Odometry => {
            return Ok(PathOfDrive { path: None, notes: vec![format!("the given path is not compared: {problem}")] });
        }
        Some(Err(problem)) => return Err(StepError::configuration(problem.to_string())),
    };
    let unchecked = |path: GivenPath, notes: Vec<String>| PathOfDrive { path: Some(path), notes };
    let mut found = match settings.path {
        PathSource::Odometry => return Ok(unchecked(path, Vec::new())),
        _ if !settings.check_path => {
            unchecked(path, vec!["check_path = false: the given path was not compared with the drive".into()])
        }
        PathSource::Given | PathSource::Refined => {
            checked(path, drive).map_err(|problems| StepError::configuration(problems.join("\n")))?
        }
    };
    if found.path.as_ref().is_some_and(|path| !path.states_deviations()) {
        found.notes.push(format!(
            "given path: it does not state all standard deviations; {ASSUMED_M} m and {ASSUMED_DEG} degrees are assumed: write \
             deviation_m and deviation_deg into [trajectory]"
        ));
    }
    Ok(found)
}

/// Compares a path with its drive.
fn checked(path: GivenPath, drive: &Drive) -> Result<PathOfDrive, Vec<String>> {
    let evidence = Evidence::from_drive(drive).map_err(|problem| vec![problem.to_string()])?;
    let findings = check(&path, &evidence);
    let file = path.file().display().to_string();
    if !findings.problems.is_empty() {
        return Err(findings.problems.into_iter().map(|text| format!("{file}: {text}")).collect());
    }
    let notes = findings.notes.into_iter().map(|text| format!("given path: {text}")).collect();
    Ok(PathOfDrive { path: Some(path), notes })
}

/// Refuses a sweep that the path does not cover.
pub(crate) fn covers(path: &GivenPath, seq: u64, begin: Stamp, duration_nanos: u32) -> Result<(), StepError> {
    let end = begin.plus_nanos(i64::from(duration_nanos));
    path.covers(begin, end)
        .map_err(|reason| StepError::data(format!("sweep {seq}: {}: {reason}", path.file().display())))
}

/// Origin of the world of a path.
pub(crate) fn origin(path: &GivenPath) -> Option<geometry::Geodetic> {
    path.local_frame().map(LocalFrame::origin)
}
