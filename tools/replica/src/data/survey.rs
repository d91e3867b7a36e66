//! `replica survey`: several drives through the same streets as one survey, tied to control points.

mod answer;
mod survey_file;
mod tables;

use super::deliver::frame::unplaced;
use super::deliver::{open_finished_run, progress_bar};
use super::new_folder::NewFolder;
use adjustment::{Submaps, Survey, accuracy, adjust_survey, control_points, mean_residuals};
use answer::{Answered, Facts, doubts};
use anyhow::Context;
use command_line::answer::Answer;
use command_line::exit_code::INCOMPLETE;
use command_line::say_error;
use files::atomic_file::write_atomic;
use std::collections::BTreeSet;
use std::path::PathBuf;
use std::process::ExitCode;
use survey_file::Wanted;
use surveying::accuracy::{accuracy_table, heights_rows};
use surveying::check_points::load_check_points;
use surveying::{AdjustedCloud, AdjustedDrive, RunFolder, SURVEY, SurveyFile};

/// Control points with a horizontal position that determine place and heading of a survey: two, and one that shows an error.
const MIN_MARKS: usize = 3;

/// Adjust several drives and control points as one survey
///
/// The clouds stay in their runs: the folder holds the adjusted poses of their submaps, and tables of what was compared. `replica
/// deliver` writes the points of the survey.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, 1 failed, 2 wrong usage, 3 done, but a drive or a point does not fit\n\n\
                        Example: replica survey survey.toml --out out/survey")]
pub struct Args {
    /// The drives and points of the survey (TOML)
    survey: PathBuf,
    /// Folder for the files; created if absent, must be empty
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten)]
    answer: Answer,
}

/// Runs the command.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let wanted = Wanted::load(&args.survey)?;
    let table = wanted.points.as_ref().map(|points| load_check_points(&points.file)).transpose()?;
    let system = wanted.points.as_ref().map(survey_file::Points::system).transpose()?;
    let mut runs: Vec<(String, RunFolder)> = Vec::new();
    // Why each drive does not determine its place on the Earth.
    let mut unplaced_drives = Vec::new();
    for drive in &wanted.drives {
        let (summary, run) = open_finished_run(&drive.run, "survey")?;
        unplaced_drives.push(unplaced(&summary));
        runs.push((drive.name.clone(), run));
    }
    let folder = NewFolder::create(&args.out)?;
    let n_clouds: usize = runs.iter().map(|(_, run)| run.index.clouds.len()).sum();
    let bar = progress_bar("survey", n_clouds as u64);
    let submaps = Submaps::read(runs, |n| bar.inc(n as u64))?;
    bar.finish_and_clear();
    let points = match (&wanted.points, table, system) {
        (Some(points), Some(table), Some(system)) => {
            control_points(&submaps, table, &points.file, |xyz| system.geodetic(xyz))?
        }
        _ => Vec::new(),
    };
    let survey = adjust_survey(&submaps, &points)?;
    let means = mean_residuals(&survey, &points);
    let accuracy = accuracy(&submaps, &survey, &points);
    let facts = Facts { submaps: &submaps, survey: &survey, points: &points, means: &means, accuracy: &accuracy };
    let answered = Answered::new(&facts, &args.out);
    let doubts = doubts(&submaps, &survey, &points);
    let is_placed = unplaced_drives.iter().any(Vec::is_empty) || n_marks(&survey) >= MIN_MARKS;
    let unplaced = if is_placed { Vec::new() } else { unplaced_drives.concat() };
    let accuracy_csv = accuracy_table(&accuracy.points) + &heights_rows(&accuracy.heights);
    let mut file = SurveyFile::new(submaps.frame.origin(), adjusted(&submaps, &survey)?);
    file.doubts.clone_from(&doubts);
    file.unplaced = unplaced;
    file.accuracy = accuracy;
    let text = serde_json::to_string_pretty(&file)? + "\n";
    for (name, text) in [
        (SURVEY, text),
        ("submaps.csv", tables::submaps(&submaps, &survey)),
        ("matches.csv", tables::matches(&submaps, &survey)),
        ("points.csv", tables::points(&submaps, &survey, &points)),
        ("residuals.csv", tables::residuals(&means)),
        ("accuracy.csv", accuracy_csv),
    ] {
        let path = folder.files.join(name);
        write_atomic(&path, text.as_bytes()).with_context(|| format!("{}: cannot write", path.display()))?;
    }
    folder.finish()?;
    args.answer.print(&answered, || answered.text())?;
    for doubt in &doubts {
        say_error!("doubt: {doubt}");
    }
    Ok(if doubts.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(INCOMPLETE) })
}

/// Number of control points with a horizontal position that agree with the result.
fn n_marks(survey: &Survey) -> usize {
    let agreeing = survey.control.iter().filter(|seen| seen.agrees && seen.measured.sigma_m[0].is_some());
    agreeing.map(|seen| seen.measured.point).collect::<BTreeSet<_>>().len()
}

fn adjusted(submaps: &Submaps, survey: &Survey) -> anyhow::Result<Vec<AdjustedDrive>> {
    let mut drives = Vec::new();
    for (index, drive) in submaps.drives.iter().enumerate() {
        let of_drive = (0..submaps.all.len()).filter(|k| submaps.all[*k].drive == index);
        let cloud = |k: usize| {
            let entry = drive.run.index.clouds.iter().find(|entry| entry.seq == submaps.all[k].seq)?;
            let pose = &survey.after[k];
            Some(AdjustedCloud {
                seq: entry.seq,
                run_translation: entry.translation,
                run_rotation: entry.rotation,
                translation: pose.translation.vector.into(),
                rotation: pose.rotation.coords.into(),
                sigma_m: survey.sigma_m[k],
            })
        };
        let run = std::path::absolute(drive.run.path())?;
        drives.push(AdjustedDrive { name: drive.name.clone(), run, clouds: of_drive.filter_map(cloud).collect() });
    }
    Ok(drives)
}
