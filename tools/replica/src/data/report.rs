//! `replica report`: the report of finished runs.
//!
//! | idea | module |
//! |---|---|
//! | the small files in the output of a run | `finished_run` |
//! | how accurate positions are; whether the result can be relied on | `accuracy`; `verdict` |
//! | the drive, clouds and pictures, read in addition | `material`: `cloud_survey`, `moment`, `overlays`, `range_picture`, `bands` |
//! | path and fixes; losses and deviations; time and memory | `place`, `uncertain`, `costs` |
//! | `report.json`; `report.html` | `facts`; `sections`, `overview`, `view_drawing` |
//! | several runs in one table | `comparison` |

mod accuracy;
mod bands;
mod cloud_survey;
mod comparison;
mod costs;
mod facts;
pub mod finished_run;
mod material;
mod moment;
pub mod overlays;
mod overview;
mod place;
mod range_picture;
mod sections;
mod uncertain;
mod verdict;
mod view_drawing;

use accuracy::Accuracy;
use anyhow::Context;
use command_line::answer::Answer;
use command_line::say_error;
use comparison::{ComparedRun, Comparison};
pub use facts::StageDoubt;
use facts::{Facts, Input, ObjectFacts, Points, Settings, StageCosts};
use files::atomic_file::write_atomic;
use finished_run::FinishedRun;
use material::Material;
use place::Place;
use run::summary::REPORT_FILES;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use verdict::Verdict;

/// Write the report of a run as one page, or compare several runs.
///
/// Writes report.html and report.json into the output folder of the run, as replica-launch does at its end. With several runs,
/// writes comparison.html and comparison.json: one table of all.
#[derive(clap::Args, Debug)]
#[command(after_help = "Exit codes: 0 done, also if a run has doubts; 1 failed, 2 wrong usage\n\n\
                  Example: replica report out/sample")]
pub struct Args {
    /// Output folders of runs that have ended
    #[arg(required = true, value_name = "RUN")]
    runs: Vec<PathBuf>,
    /// Folder for the files [default: the run; with several runs, the current folder]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    answer: Answer,
}

/// Writes the files.
pub fn run(args: &Args) -> anyhow::Result<ExitCode> {
    let runs: Vec<FinishedRun> = args.runs.iter().map(|folder| FinishedRun::load(folder)).collect::<Result<_, _>>()?;
    if let [run] = runs.as_slice() {
        let RunReport { page, facts } = report(run).with_context(|| run.folder.display().to_string())?;
        write(args.out.as_deref().unwrap_or(&run.folder), REPORT_FILES, &page, &facts)?;
        args.answer.print(&facts, String::new)?;
    } else {
        let comparison = Comparison { version: 1, runs: runs.iter().map(ComparedRun::from_run).collect() };
        let out = args.out.as_deref().unwrap_or(Path::new("."));
        write(out, ["comparison.html", "comparison.json"], &comparison.page(), &comparison)?;
        args.answer.print(&comparison, String::new)?;
    }
    Ok(ExitCode::SUCCESS)
}

/// The report on a run.
struct RunReport {
    page: String,
    facts: Facts,
}

fn report(run: &FinishedRun) -> anyhow::Result<RunReport> {
    let material = Material::from_run(run)?;
    let fixes = material.drive_report.as_ref().map(|report| report.fixes.as_slice()).unwrap_or_default();
    let survey = material.survey.as_ref();
    let path = Place::from_run(run, material.drive.as_ref(), fixes);
    let summary = &run.summary;
    let facts = Facts {
        version: 1,
        replica_version: env!("CARGO_PKG_VERSION"),
        run: run.folder.clone(),
        outcome: summary.outcome,
        accuracy: Accuracy::from_run(run, path.as_ref()),
        verdict: Verdict::from_run(run),
        input: run.drive().zip(material.drive_report.as_ref()).map(|(drive, report)| Input::from_report(drive, report)),
        path,
        georeference: run.georeference.clone(),
        points: Points::from_run(run, survey.and_then(|survey| survey.area_m2)),
        bands: material.bands.as_ref().map(|bands| bands.bands.clone()).unwrap_or_default(),
        diagnosis: material.bands.as_ref().map(|bands| bands.diagnosis.clone()).unwrap_or_default(),
        objects: survey.iter().flat_map(|survey| &survey.objects).map(ObjectFacts::from_summary).collect(),
        n_objects: survey.map_or(0, |survey| survey.objects.len()),
        colored_by: survey.map(|survey| uncertain::camera_shares(survey, material.drive.as_ref())).unwrap_or_default(),
        losses: uncertain::losses(run),
        doubts: StageDoubt::from_summary(summary),
        notes: summary
            .stages
            .iter()
            .filter(|stage| !stage.notes.is_empty())
            .map(|stage| (stage.name.clone(), stage.notes.clone()))
            .collect(),
        faults: summary.faults.clone(),
        total: summary.total.clone(),
        stages: StageCosts::from_run(run),
        settings: Settings::from_run(run),
    };
    Ok(RunReport { page: sections::page(run, &facts, &material), facts })
}

/// Writes both files, each atomically.
fn write(folder: &Path, [page_name, facts_name]: [&str; 2], page: &str, facts: &impl Serialize) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let page_file = folder.join(page_name);
    let facts_file = folder.join(facts_name);
    let facts = serde_json::to_string_pretty(facts)? + "\n";
    write_atomic(&facts_file, facts.as_bytes()).with_context(|| facts_file.display().to_string())?;
    write_atomic(&page_file, page.as_bytes()).with_context(|| page_file.display().to_string())?;
    say_error!("wrote {}", page_file.display());
    Ok(())
}
