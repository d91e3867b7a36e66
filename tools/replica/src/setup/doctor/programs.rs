//! The programs of the project, the default model, and a launch file with the needs of its drive.

use super::check::{Check, State};
use delivery::{CloudFields, SpaceNeed, space_need};
use drive::Drive;
use run::Change;
use run::launch_file::LaunchFile;
use run::process::{own_folder, sibling};
use std::path::{Path, PathBuf};
use std::process::Command;

const SUPERVISOR: &str = "replica-launch";
/// The stages of the launch file of the sample.
const STAGES: [&str; 7] = ["acquire", "calibrate", "slam_aggregate", "colorize", "infer", "instance", "export"];

/// Drive and output of a launch file.
pub struct PlannedRun {
    drive: PathBuf,
    pub output: PathBuf,
}

impl PlannedRun {
    /// Reads a launch file. `None` if it cannot be read or names no output; `replica-launch --check` explains why.
    pub fn read(file: &Path, changes: &[Change]) -> Option<Self> {
        let file = std::path::absolute(file).ok()?;
        let run = LaunchFile::load(&file, changes).ok()?.table("run").ok()?;
        let path = |key: &str| {
            let (_, value) = run.iter().find(|(name, _)| name.get_ref() == key)?;
            Some(file.parent()?.join(value.get_ref().as_str()?))
        };
        Some(Self { drive: path("drive")?, output: path("output")? })
    }

    /// Space for clouds with all columns; `None` if the drive cannot be read yet.
    pub fn space_need(&self) -> Option<SpaceNeed> {
        space_need(&Drive::open(&self.drive).ok()?, &CloudFields::for_default_run(), true).ok()
    }
}

/// Whether all programs are in the folder of this program and have its version.
pub fn installed() -> Vec<Check> {
    let names = STAGES.map(|stage| format!("replica-{stage}"));
    let all: Vec<&str> = std::iter::once(SUPERVISOR).chain(names.iter().map(String::as_str)).collect();
    let absent: Vec<&str> = all.iter().copied().filter(|name| sibling(name).is_err()).collect();
    let folder = own_folder();
    let place = folder.display();
    let rule = format!("{SUPERVISOR} and {} stages", STAGES.len());
    if !absent.is_empty() {
        let found = format!("absent in {place}: {}", absent.join(", "));
        let advice = || "cargo build --release --locked, or install all programs into one folder".to_owned();
        return vec![Check::ok("programs", found, rule).or(State::Problem, advice)];
    }
    let own = env!("REPLICA_VERSION");
    let version = version_of(SUPERVISOR).unwrap_or("unknown".to_owned());
    let state = if version == own { State::Ok } else { State::Warning };
    let advice = || "build or install all programs together".to_owned();
    vec![
        Check::ok("programs", format!("all {} in {place}", all.len()), rule),
        Check::ok("version", version, format!("as this program, {own}")).or(state, advice),
    ]
}

fn version_of(program: &str) -> Option<String> {
    let output = Command::new(sibling(program).ok()?).arg("--version").output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    Some(text.trim().strip_prefix(program)?.trim().to_owned())
}

/// Result of `replica-launch --check`.
pub fn launch_file(file: &Path, changes: &[Change]) -> Check {
    let rule = format!("{SUPERVISOR} --check has no problems");
    let Ok(program) = sibling(SUPERVISOR) else {
        return Check::ok("launch file", format!("{SUPERVISOR} is absent"), rule)
            .or(State::Problem, || "see programs".to_owned());
    };
    let options = changes.iter().map(Change::option).flat_map(|(option, value)| [option.to_owned(), value]);
    match Command::new(program).arg(file).arg("--check").args(options).output() {
        Ok(output) if output.status.success() => {
            let text = String::from_utf8_lossy(&output.stdout).into_owned();
            Check::ok("launch file", text.lines().collect::<Vec<_>>().join("; "), rule)
        }
        Ok(output) => Check::ok("launch file", file.display().to_string(), rule)
            .or(State::Problem, || String::from_utf8_lossy(&output.stderr).trim_end().to_owned()),
        Err(error) => {
            Check::ok("launch file", error.to_string(), rule).or(State::Problem, || "see programs".to_owned())
        }
    }
}
