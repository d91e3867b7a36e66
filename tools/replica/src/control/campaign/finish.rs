//! `replica campaign finish`: survey and deliveries of the drives that are finished. The job after all drives runs it.

use super::File;
use super::campaign_file::{Campaign, DELIVERIES, DeliverOptions, SURVEY, SurveyOptions};
use crate::control::batch::drives::BatchDrive;
use crate::control::batch::results::Row;
use anyhow::Context;
use files::atomic_file::write_atomic;
use run::exit;
use run::process::sibling;
use std::path::Path;
use std::process::{Command, ExitCode};

/// Survey and deliver the finished drives of a campaign.
///
/// Writes OUT/survey and OUT/deliveries/NAME. Existing deliveries are kept; the survey is made again if other drives are finished.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Exit codes: 0 done, 1 a survey or delivery failed, 2 wrong usage, 3 a drive is not finished, or a result has \
                        doubts, 78 refused\n\n\
                        Example: replica campaign finish campaign.toml"
)]
pub struct Args {
    #[command(flatten)]
    file: File,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let campaign = args.file.load()?;
    let rows: Vec<Row> = campaign.drives.iter().map(Row::read).collect();
    let finished: Vec<&BatchDrive> =
        campaign.drives.iter().zip(&rows).filter(|(_, row)| row.is_finished()).map(|(drive, _)| drive).collect();
    let mut codes = Vec::new();
    for row in rows.iter().filter(|row| !row.is_finished()) {
        super::print(&format!("{row}: left out\n"));
        codes.push(exit::INCOMPLETE);
    }
    if let Some(options) = &campaign.survey {
        codes.push(survey(&campaign, options, &finished)?);
    }
    if let Some(options) = &campaign.deliver {
        for drive in &finished {
            codes.push(deliver(&campaign, options, drive)?);
        }
    }
    let is_failed = |code: &u8| ![exit::DONE, exit::INCOMPLETE].contains(code);
    let worst = if codes.iter().any(is_failed) { exit::FAILED } else { codes.into_iter().max().unwrap_or(exit::DONE) };
    Ok(ExitCode::from(worst))
}

/// Makes the survey of the finished drives, unless it is there. Returns the exit code.
fn survey(campaign: &Campaign, options: &SurveyOptions, finished: &[&BatchDrive]) -> anyhow::Result<u8> {
    let file = campaign.own_folder().join("survey.toml");
    let out = campaign.out.join(SURVEY);
    if finished.is_empty() {
        super::print("survey: no drive is finished\n");
        return Ok(exit::INCOMPLETE);
    }
    let text = survey_file(campaign, options, finished)?;
    let is_same = std::fs::read_to_string(&file).is_ok_and(|found| found == text);
    if is_same && is_complete(&out) {
        super::print("survey: done before\n");
        return Ok(exit::DONE);
    }
    if out.exists() {
        std::fs::remove_dir_all(&out).with_context(|| out.display().to_string())?;
    }
    std::fs::create_dir_all(campaign.own_folder()).with_context(|| campaign.own_folder().display().to_string())?;
    write_atomic(&file, text.as_bytes()).with_context(|| file.display().to_string())?;
    replica("survey", |command| command.arg(&file).arg("--out").arg(&out))
}

/// The text of survey.toml.
fn survey_file(campaign: &Campaign, options: &SurveyOptions, finished: &[&BatchDrive]) -> anyhow::Result<String> {
    let mut table = toml::Table::new();
    table.insert("version".to_owned(), 1.into());
    if let Some(points) = &options.points {
        let mut points = points.clone();
        // Paths of the campaign are relative to its file.
        let folder = campaign.file.parent().unwrap_or(Path::new("/"));
        for key in ["file", "geoid", "grid"] {
            if let Some(toml::Value::String(path)) = points.get_mut(key) {
                *path = folder.join(&*path).to_string_lossy().into_owned();
            }
        }
        table.insert("points".to_owned(), points.into());
    }
    let drives = finished.iter().map(|drive| {
        let entries = [("run", drive.output.to_string_lossy().into_owned()), ("name", drive.name.clone())];
        toml::Value::Table(entries.map(|(key, value)| (key.to_owned(), value.into())).into_iter().collect())
    });
    table.insert("drives".to_owned(), toml::Value::Array(drives.collect()));
    Ok(toml::to_string(&table)?)
}

/// Delivers a drive, unless its delivery is there. Returns the exit code.
fn deliver(campaign: &Campaign, options: &DeliverOptions, drive: &BatchDrive) -> anyhow::Result<u8> {
    let out = campaign.out.join(DELIVERIES).join(&drive.name);
    if is_complete(&out) {
        super::print(&format!("delivery of {}: done before\n", drive.name));
        return Ok(exit::DONE);
    }
    replica("deliver", |command| command.arg(&drive.output).arg("--out").arg(&out).args(&options.options))
}

/// Whether a command has filled this folder: it works in `.unfinished` until the end.
fn is_complete(folder: &Path) -> bool {
    let has_files = std::fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some());
    has_files && !folder.join(".unfinished").exists()
}

/// Runs another command of this program. Returns its exit code.
fn replica(name: &str, arguments: impl FnOnce(&mut Command) -> &mut Command) -> anyhow::Result<u8> {
    let mut command = Command::new(sibling("replica")?);
    let status = arguments(command.arg(name)).status().with_context(|| format!("replica {name}"))?;
    Ok(status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(exit::FAILED))
}
