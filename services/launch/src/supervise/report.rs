//! `replica report` after the run. The run and its exit code do not depend on it.

use run::process::sibling;
use run::summary::REPORT_FILES;
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Stdio};

/// Writes the report of the run in `output`. A failure is a warning.
pub fn write(output: &Path) {
    match try_write(output) {
        Ok(()) => tracing::info!("report: {}", output.join(REPORT_FILES[0]).display()),
        Err(reason) => {
            tracing::warn!("no report: {reason}; `replica report {}` writes it later", files::shell::path(output));
        }
    }
}

fn try_write(output: &Path) -> Result<(), String> {
    let program = sibling("replica").map_err(|error| error.to_string())?;
    let result = Command::new(&program)
        .arg("report")
        .arg(output)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        // A Ctrl-C at the terminal is for the supervisor; the run is over.
        .process_group(0)
        .output()
        .map_err(|error| format!("{}: cannot be started: {error}", program.display()))?;
    if result.status.success() {
        return Ok(());
    }
    let text = String::from_utf8_lossy(&result.stderr);
    let last = text.lines().last().unwrap_or_default().trim();
    Err(format!("replica report failed ({}): {last}", result.status))
}
