//! Checks a launch file and everything that it names before any stage starts. All problems are reported at once.

pub mod dataflow;
mod problems;
mod source_selection;
mod stages;

use crate::limits;
use crate::manifest::Run;
use crate::plan::{Plan, PlannedStage, Selection};
use crate::programs;
use crate::resources::lacks_shared_memory;
use crate::run_folder::last_domain;
use dataflow::StageProblem;
use files::text_file::{MAX_SETTINGS_BYTES, read_text};
use problems::Problems;
pub use problems::Refusal;
use run::launch_file::{LaunchFile, render};
use run::{Change, CheckRequest, Context, DRIVE_MANIFEST, DescribeDriveRequest, DriveDescription, Mode};
use stages::FileStages;
use std::path::{Path, PathBuf};

/// Reads and checks the launch file and everything that it names.
pub fn plan(path: &Path, changes: &[Change], selection: &Selection) -> Result<Plan, Refusal> {
    let path = std::path::absolute(path).map_err(|error| {
        let problems = vec![format!("{}: {error}", path.display())];
        Refusal { problems, is_failure: false }
    })?;
    plan_as(&path, &path, changes, selection)
}

/// [`plan`] from `copy` instead of the launch file at `path`. Both paths are absolute.
pub fn plan_as(copy: &Path, path: &Path, changes: &[Change], selection: &Selection) -> Result<Plan, Refusal> {
    let file = LaunchFile::load(copy, changes).map_err(|problems| {
        let text = read_text(copy, MAX_SETTINGS_BYTES).unwrap_or_default();
        let problems = problems.iter().map(|problem| render(copy, &text, problem)).collect();
        Refusal { problems, is_failure: false }
    })?;
    let mut problems = Problems::new(&file);
    let mut run: Run = problems.table("run", |_| true);
    let folder = path.parent().unwrap_or(Path::new("/")).to_owned();
    let mode = run.mode;
    let rig = rig(&mut run, mode, &folder, &mut problems);
    let simulated = simulated_drive(&mut problems, copy, changes, &folder.join(&run.drive));
    let DriveFolder { path: drive, is_simulated } = drive(&run, &simulated.differences, mode, &folder, &mut problems);
    let output = problems.path("output", &run.output, &folder);
    if let Some(text) = lacks_shared_memory(last_domain(&output).as_ref()) {
        problems.add_without_place(text);
    }
    let FileStages { described: mut stages, are_all } =
        stages::read(&mut problems, &folder, copy, changes, selection, &run);
    let SelectedStages { remark, missing } = select(&mut stages, selection, &mut problems);
    let unconnected = dataflow::connect(&mut stages, mode);
    // A stage that has not described itself may produce the missing topic.
    for StageProblem { stage, problem } in unconnected.into_iter().filter(|_| are_all) {
        problems.add(&stage, problem);
    }
    if stages.is_empty() && problems.is_empty() {
        problems.add_without_place("names no stage: nothing to run");
    }
    for text in limits::lacks(&stages) {
        problems.add_without_place(text);
    }
    check_recording(mode, selection, &stages, &mut problems);
    let connected = stages.iter().flat_map(|s| s.outputs.iter().map(|topic| topic.topic.clone())).collect();
    let drive = rig.unwrap_or(drive);
    let context = Context { drive, output, launch_folder: folder, mode, connected, missing };
    check_settings(&stages, copy, changes, &context, &mut problems);
    if let Some(refusal) = problems.into_refusal() {
        return Err(refusal);
    }
    Ok(Plan {
        launch_file: path.to_owned(),
        changes: changes.to_vec(),
        settings: run,
        simulate: is_simulated.then_some(simulated.arguments),
        context,
        stages,
        selection: selection.clone(),
        remark,
    })
}

/// The description of `[simulate]` by the simulator; nothing if the file has no such table. Problems of the table are
/// added.
fn simulated_drive(problems: &mut Problems, copy: &Path, changes: &[Change], drive: &Path) -> DriveDescription {
    if !problems.has_table("simulate") {
        return DriveDescription::default();
    }
    let request =
        DescribeDriveRequest { launch_file: copy.to_owned(), changes: changes.to_vec(), drive: drive.to_owned() };
    match programs::describe_drive(&request) {
        Ok(mut description) => {
            problems.add_located(std::mem::take(&mut description.problems));
            description
        }
        Err(error) => {
            problems.add_program("simulate", problems.place_of("simulate"), &error);
            DriveDescription::default()
        }
    }
}

/// The folder of a drive.
struct DriveFolder {
    path: PathBuf,
    /// Whether it must be simulated first.
    is_simulated: bool,
}

/// Checks the folder of the drive. `differences`: between a simulated drive and
/// `[simulate]`. Live, the drive only defines the mounting of the sensors, and may be left out.
fn drive(run: &Run, differences: &[String], mode: Mode, folder: &Path, problems: &mut Problems) -> DriveFolder {
    let is_live = mode == Mode::Live;
    let path = if is_live { folder.join(&run.drive) } else { problems.path("drive", &run.drive, folder) };
    if run.drive.is_empty() {
        return DriveFolder { path, is_simulated: false };
    }
    let file = problems.file();
    let written = file.written_text("run", "drive");
    let is_written = written.is_some_and(|written| is_same(&folder.join(written), &path));
    let may_simulate = !is_live && file.is_written("simulate");
    let text = match path.exists() {
        false if may_simulate && is_written => return DriveFolder { path, is_simulated: true },
        // Otherwise the drive of a mistyped path would be simulated and processed.
        false if may_simulate => format!(
            "{} does not exist; [simulate] creates only the drive that the launch file itself names, {}; simulate another one \
             with `replica simulate --out {}`",
            path.display(),
            written.unwrap_or("none"),
            files::shell::path(&path)
        ),
        false if is_live => {
            format!(
                "{} does not exist; set run.drive to a drive with the sensor's mounting, or set run.rig",
                path.display()
            )
        }
        false => {
            format!("{} does not exist, and the launch file has no [simulate] to simulate it", path.display())
        }
        true if may_simulate && is_written && !differences.is_empty() => format!(
            "{} was simulated with {}; remove it to simulate it again, or name another drive",
            path.display(),
            differences.join(", ")
        ),
        true => return DriveFolder { path, is_simulated: false },
    };
    problems.add("run", problems.at_value("run", "drive", text));
    DriveFolder { path, is_simulated: false }
}

/// Whether two paths lead to the same file, or are the same.
fn is_same(a: &Path, b: &Path) -> bool {
    a == b || a.canonicalize().is_ok_and(|a| b.canonicalize().is_ok_and(|b| a == b))
}

/// The manifest that `run.rig` names for a live run, which then needs no drive.
fn rig(run: &mut Run, mode: Mode, folder: &Path, problems: &mut Problems) -> Option<PathBuf> {
    if run.rig.is_empty() {
        return None;
    }
    let named = folder.join(&run.rig);
    let path = if named.is_dir() { named.join(DRIVE_MANIFEST) } else { named };
    let fault = match mode {
        Mode::Offline => Some("is for live runs; a recorded drive has its own drive.toml".to_owned()),
        Mode::Live => (!path.is_file()).then(|| format!("{} is not a file", path.display())),
    };
    if let Some(text) = fault {
        problems.add("run", problems.at_value("run", "rig", text));
    }
    if mode == Mode::Live {
        run.drive.clear();
    }
    Some(path)
}

/// Consequences of the selection of stages.
struct SelectedStages {
    /// Stages left out because the source replaces their topics, for the operator.
    remark: Option<String>,
    /// [`Context::missing`].
    missing: Vec<String>,
}

/// Leaves out the stages that the command line deselects.
fn select(stages: &mut Vec<PlannedStage>, selection: &Selection, problems: &mut Problems) -> SelectedStages {
    for name in selection.without.iter().chain(&selection.source) {
        if !problems.has_table(name) {
            problems
                .add_without_place(format!("the command line names stage {name}: {}", problems.nearest_table(name)));
        }
    }
    let Some(source) = &selection.source else { return SelectedStages { remark: None, missing: Vec::new() } };
    let before = stages.clone();
    let left_out = source_selection::leave_out(stages, source);
    let remark =
        (!left_out.is_empty()).then(|| format!("[{source}] replaces their topics; left out: {}", left_out.join(", ")));
    SelectedStages { remark, missing: source_selection::missing_topics(&before, stages) }
}

/// Refuses a recording that would have gaps.
fn check_recording(mode: Mode, selection: &Selection, stages: &[PlannedStage], problems: &mut Problems) {
    for topic in &selection.recorded {
        if !stages.iter().any(|stage| stage.outputs.iter().any(|output| output.topic == *topic)) {
            problems.add_without_place(format!("--topics: no stage of this run produces topic {topic}"));
        }
    }
    if mode == Mode::Live && !selection.recorded.is_empty() {
        problems.add_without_place(
            "--record: a live run drops messages, a recording must not; acquire records the sensors of a live run",
        );
    }
}

/// Every program checks the settings of its own table.
fn check_settings(
    stages: &[PlannedStage],
    copy: &Path,
    changes: &[Change],
    context: &Context,
    problems: &mut Problems,
) {
    let checked = programs::ask_all(stages, |stage| {
        let request = CheckRequest {
            launch_file: copy.to_owned(),
            changes: changes.to_vec(),
            table: stage.name.clone(),
            context: stage.table.remap.context(context),
            remote: stage.remote.clone(),
        };
        programs::check(&stage.program, &stage.table.python, &request)
    });
    for (stage, checked) in stages.iter().zip(checked) {
        match checked {
            Ok(found) => problems.add_located(found),
            Err(error) => problems.add_program(&stage.name, stage.span.clone(), &error),
        }
    }
}
