//! Everything that can be known before the start, all faults at once.

use crate::exhausted::lacks_shared_memory;
use crate::graph;
use crate::manifest::{Run, Simulate, StageTable};
use crate::plan::{Plan, PlannedStage, Selection};
use crate::programs;
use crate::run_folder::domain_of;
use crate::sourced;
use ipc::Transport;
use stage::assignment::CONTRACT_VERSION;
use stage::launch_file::{LaunchFile, render};
use stage::{CheckRequest, Context, DescribeRequest, Mode, Problem, SUPERVISOR_KEYS, parse_table};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Tables that are no stages.
const OWN_TABLES: [&str; 2] = ["run", "simulate"];

/// Reads and checks the launch file and everything that it names. Faults come rendered, in the order of the file.
pub fn plan(path: &Path, overrides: &[String], selection: &Selection) -> Result<Plan, Vec<String>> {
    let path = std::path::absolute(path).map_err(|error| vec![format!("{}: {error}", path.display())])?;
    plan_as(&path, &path, overrides, selection)
}

/// As [`plan`]: reads `copy` as if it were the launch file at `path`. Both are absolute.
pub fn plan_as(copy: &Path, path: &Path, overrides: &[String], selection: &Selection) -> Result<Plan, Vec<String>> {
    let file = LaunchFile::load(copy, overrides).map_err(|problems| {
        let text = std::fs::read_to_string(copy).unwrap_or_default();
        problems.iter().map(|problem| render(copy, &text, problem)).collect::<Vec<_>>()
    })?;
    let mut faults = Faults { file: &file, problems: Vec::new() };
    let run: Run = faults.table("run", |_| true);
    let has_simulate = file.tables().iter().any(|(name, _)| name == "simulate");
    let simulate: Simulate = faults.table("simulate", |_| true);
    let folder = path.parent().unwrap_or(Path::new("/")).to_owned();
    let mode = if run.mode == "live" { Mode::Live } else { Mode::Offline };
    let is_live = mode == Mode::Live;
    // Live, the drive says only where the sensors are mounted, and may be left out.
    let drive = if is_live { folder.join(&run.drive) } else { faults.path("drive", &run.drive, &folder) };
    let output = faults.path("output", &run.output, &folder);
    let drive_is_there = drive.exists();
    if !drive_is_there && (!has_simulate || is_live) && !run.drive.is_empty() {
        let text = format!("{} is not there, and there is no [simulate] to make it", drive.display());
        faults.add("run", faults.value_problem("run", "drive", text));
    }
    if let Some(text) = lacks_shared_memory(domain_of(&output).ok().as_ref()) {
        faults.add("", Problem::of_key("", text));
    }

    let mut stages = faults.stages(&folder, copy, overrides, &selection.without);
    let known: Vec<String> = file.tables().into_iter().map(|(name, _)| name).collect();
    for absent in selection.without.iter().chain(&selection.source).filter(|name| !known.contains(name)) {
        faults
            .add("", Problem::of_key("", format!("the command line names stage {absent}, of which there is no table")));
    }
    let mut remark = None;
    if let Some(source) = &selection.source {
        let left_out = sourced::leave_out(&mut stages, source);
        if !left_out.is_empty() {
            remark = Some(format!("in the place of [{source}]'s topics left out: {}", left_out.join(", ")));
        }
    }
    for (stage, problem) in graph::connect(&mut stages, mode) {
        faults.add(&stage, problem);
    }
    graph::set_transport(&mut stages, run.transport());
    if stages.is_empty() && faults.problems.is_empty() {
        faults.add("", Problem::of_key("", "names no stage: there is nothing to run"));
    }
    for topic in &selection.recorded {
        if !stages.iter().any(|stage| stage.outputs.iter().any(|output| output.topic == *topic)) {
            faults.add("", Problem::of_key("", format!("--topics: no stage of this run produces topic {topic}")));
        }
    }
    let (is_recorded, is_copying) = (!selection.recorded.is_empty(), run.transport() == Transport::Copying);
    for (is_faulty, rule) in [
        (
            is_live && is_recorded,
            "--record: a live run drops messages, a recording must not; it records its sensors by itself",
        ),
        (
            is_live && is_copying,
            "run.transport: a live run needs \"shared\": only there may the oldest message make way",
        ),
        (
            is_copying && is_recorded,
            "--record: topics that are copied cannot be looked on at; run.transport must be \"shared\"",
        ),
    ] {
        if is_faulty {
            faults.add("", Problem::of_key("", rule));
        }
    }
    let connected = stages.iter().flat_map(|s| s.outputs.iter().map(|topic| topic.topic.clone())).collect();
    let context = Context { drive, output, launch_folder: folder, mode, connected };
    let checked = programs::at_once(&stages, |stage| {
        let request = CheckRequest {
            launch_file: copy.to_owned(),
            overrides: overrides.to_vec(),
            table: stage.name.clone(),
            context: context.clone(),
        };
        programs::check(&stage.program, &request)
    });
    for (stage, checked) in stages.iter().zip(checked) {
        match checked {
            // These are located already.
            Ok(problems) => faults.problems.extend(problems),
            Err(text) => faults.add(&stage.name, Problem { key: String::new(), span: stage.span.clone(), text }),
        }
    }
    let problems = faults.into_rendered();
    if !problems.is_empty() {
        return Err(problems);
    }
    let simulate = (!drive_is_there && !is_live).then_some(simulate);
    Ok(Plan {
        launch_file: path.to_owned(),
        overrides: overrides.to_vec(),
        run,
        simulate,
        context,
        stages,
        selection: selection.clone(),
        remark,
    })
}

struct Faults<'a> {
    file: &'a LaunchFile,
    problems: Vec<Problem>,
}

impl Faults<'_> {
    fn add(&mut self, table: &str, problem: Problem) {
        self.problems.push(self.file.located(table, problem));
    }

    /// Parses the keys of a table that `wanted` selects; problems are taken down.
    fn table<S: stage::Settings>(&mut self, name: &str, wanted: impl Fn(&str) -> bool) -> S {
        match self.file.table(name) {
            Ok(table) => {
                let table = table.into_iter().filter(|(key, _)| wanted(key.get_ref())).collect();
                let (settings, problems) = parse_table::<S>(&table);
                for problem in problems {
                    self.add(name, problem);
                }
                settings
            }
            Err(problem) => {
                self.problems.push(problem);
                S::default()
            }
        }
    }

    /// A problem at the place of a value, or at the table if the key is absent.
    fn value_problem(&self, table: &str, key: &str, text: String) -> Problem {
        let span = self.file.table(table).ok().and_then(|table| {
            let (_, value) = table.iter().find(|(name, _)| name.get_ref() == key)?;
            Some(value.span())
        });
        Problem { key: key.to_owned(), span, text }
    }

    fn path(&mut self, key: &str, value: &str, folder: &Path) -> PathBuf {
        if value.is_empty() {
            let problem = self.value_problem("run", key, "must be given".to_owned());
            self.add("run", problem);
        }
        let path = folder.join(value);
        // Symbolic links and `..` resolved, so that one folder has one name.
        path.canonicalize().unwrap_or(path)
    }

    fn stages(
        &mut self,
        folder: &Path,
        launch_file: &Path,
        overrides: &[String],
        without: &[String],
    ) -> Vec<PlannedStage> {
        let mut tables: Vec<(String, Option<Range<usize>>, StageTable)> = Vec::new();
        for (name, span) in self.file.tables() {
            if OWN_TABLES.contains(&name.as_str()) || without.contains(&name) {
                continue;
            }
            let plain = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_';
            if !name.bytes().all(plain) || name.is_empty() || name == "settings" {
                let text = "a stage's name has lower-case letters, digits and _ only, and is not `settings`".to_owned();
                self.add(&name, Problem { key: String::new(), span, text });
                continue;
            }
            let table = self.table(&name, |key| SUPERVISOR_KEYS.contains(&key));
            tables.push((name, span, table));
        }
        let described = programs::at_once(&tables, |(name, _, table)| {
            let request = DescribeRequest {
                launch_file: launch_file.to_owned(),
                overrides: overrides.to_vec(),
                table: name.clone(),
            };
            let program = programs::find(name, &table.program, folder)?;
            programs::describe(&program, &request).map(|description| (program, description))
        });
        let mut stages = Vec::new();
        for ((name, span, table), described) in tables.into_iter().zip(described) {
            match described {
                Ok((_, description)) if description.contract != CONTRACT_VERSION => {
                    let text = format!("speaks contract {}, this is contract {CONTRACT_VERSION}", description.contract);
                    self.add(&name, Problem { key: String::new(), span, text });
                }
                Ok((program, description)) => {
                    for field in description.settings.iter().filter(|f| SUPERVISOR_KEYS.contains(&f.key.as_str())) {
                        let text =
                            format!("its setting `{}` cannot be reached: the key is the supervisor's", field.key);
                        self.add(&name, Problem { key: String::new(), span: span.clone(), text });
                    }
                    let (inputs, outputs) = (Vec::new(), Vec::new());
                    stages.push(PlannedStage { name, span, program, table, description, inputs, outputs });
                }
                Err(text) => self.add(&name, Problem { key: String::new(), span, text }),
            }
        }
        stages
    }

    /// In the order of the file; what has no place in it comes first.
    fn into_rendered(mut self) -> Vec<String> {
        self.problems.sort_by_key(|problem| problem.span.as_ref().map(|span| span.start));
        self.problems.dedup();
        self.problems.iter().map(|problem| self.file.render(problem)).collect()
    }
}
