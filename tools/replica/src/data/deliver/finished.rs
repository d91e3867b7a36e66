//! The output folder of a finished run, and what else a folder may be.

use super::facts::FILE as DELIVERY;
use anyhow::{Context, bail};
use drive::MANIFEST_FILE;
use run::summary::Summary;
use std::path::Path;
use surveying::{RunFolder, SURVEY};

/// Reads the summary and the files of a finished run, for a command. The error for another folder names what it is.
pub fn open_finished_run(folder: &Path, command: &str) -> anyhow::Result<(Summary, RunFolder)> {
    let place = folder.display();
    let needs = format!("`{command}` needs the output folder of a finished run, `run.output` of its launch file");
    if !folder.exists() {
        bail!("{place}: no such folder; {needs}");
    }
    if !folder.is_dir() {
        bail!("{place}: is a file; {needs}");
    }
    if !Summary::file(folder).exists() {
        if folder.join(MANIFEST_FILE).exists() {
            bail!(
                "{place}: is a drive, it has {MANIFEST_FILE}; {needs}\nhint: `replica-launch launch.toml --set run.drive={} --set \
                 run.output=out/NAME`, then `replica {command} out/NAME`",
                files::shell::path(folder)
            );
        }
        if folder.join(SURVEY).exists() {
            bail!(
                "{place}: is a survey, it has {SURVEY}; {needs}\nhint: `replica deliver {} --out DIR --copc`, then `replica view \
                 DIR/points.copc.laz`",
                files::shell::path(folder)
            );
        }
        if folder.join(DELIVERY).exists() {
            bail!("{place}: is a delivery, it has {DELIVERY}; {needs}");
        }
        if folder.join("run").is_dir() || folder.join("clouds").is_dir() {
            bail!(
                "{place}: the run is not finished, it has no summary.json; {needs}\nhint: wait for its end (`replica status`), or \
                 continue a run that was interrupted: `replica-launch LAUNCH_FILE --resume`"
            );
        }
        bail!("{place}: is not a run, it has no summary.json; {needs}");
    }
    let summary = Summary::load(folder).context("the summary of the run cannot be read")?;
    Ok((summary, RunFolder::open(folder)?))
}
