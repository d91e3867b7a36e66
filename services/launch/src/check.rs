//! Everything that can be known before the start, all faults at once.

use crate::graph;
use crate::manifest::{Run, Simulate, StageTable};
use crate::plan::{Plan, PlannedStage};
use crate::programs;
use crate::run_folder::domain_of;
use stage::assignment::CONTRACT_VERSION;
use stage::launch_file::{LaunchFile, render};
use stage::{CheckRequest, Context, Mode, Problem, SUPERVISOR_KEYS, parse_table};
use std::path::{Path, PathBuf};

/// Tables that are no stages.
const OWN_TABLES: [&str; 2] = ["run", "simulate"];

/// Free shared memory without which no run is begun, bytes: two submaps of 4 million points of 28 bytes with their
/// columns, once in work and once waiting.
const MIN_SHARED_MEMORY: u64 = 512 << 20;

/// Reads and checks the launch file and everything that it names. Faults come rendered, in the order of the file.
pub fn plan(path: &Path, overrides: &[String]) -> Result<Plan, Vec<String>> {
    let path = std::path::absolute(path).map_err(|error| vec![format!("{}: {error}", path.display())])?;
    let file = LaunchFile::load(&path, overrides).map_err(|problems| {
        let text = std::fs::read_to_string(&path).unwrap_or_default();
        problems.iter().map(|problem| render(&path, &text, problem)).collect::<Vec<_>>()
    })?;
    let mut faults = Faults { file: &file, problems: Vec::new() };
    let run: Run = faults.table("run", |_| true);
    let has_simulate = file.tables().iter().any(|(name, _)| name == "simulate");
    let simulate: Simulate = faults.table("simulate", |_| true);
    let folder = path.parent().unwrap_or(Path::new("/")).to_owned();
    let drive = faults.path("drive", &run.drive, &folder);
    let output = faults.path("output", &run.output, &folder);
    let drive_is_there = drive.exists();
    if !drive_is_there && !has_simulate && !run.drive.is_empty() {
        let text = format!("{} is not there, and there is no [simulate] to make it", drive.display());
        faults.add("run", faults.value_problem("run", "drive", text));
    }
    faults.shared_memory(&output);

    let mut stages = faults.stages(&folder);
    for (stage, problem) in graph::connect(&mut stages) {
        faults.add(&stage, problem);
    }
    if stages.is_empty() && faults.problems.is_empty() {
        faults.add("", Problem::of_key("", "names no stage: there is nothing to run"));
    }
    let connected = stages.iter().flat_map(|s| s.outputs.iter().map(|topic| topic.topic.clone())).collect();
    let context = Context { drive, output, launch_folder: folder, mode: Mode::Offline, connected };
    for stage in &stages {
        let request = CheckRequest {
            launch_file: path.clone(),
            overrides: overrides.to_vec(),
            table: stage.name.clone(),
            context: context.clone(),
        };
        match programs::check(&stage.program, &request) {
            // These are located already.
            Ok(problems) => faults.problems.extend(problems),
            Err(text) => faults.add(&stage.name, Problem { key: String::new(), span: stage.span.clone(), text }),
        }
    }
    let problems = faults.into_rendered();
    if !problems.is_empty() {
        return Err(problems);
    }
    let simulate = (!drive_is_there).then_some(simulate);
    Ok(Plan { launch_file: path, overrides: overrides.to_vec(), run, simulate, context, stages })
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

    /// What a dead run into the same output has left counts as free: it is wiped before the start.
    fn shared_memory(&mut self, output: &Path) {
        let Ok(space) = rustix::fs::statvfs("/dev/shm") else {
            self.add("", Problem::of_key("", "shared memory: /dev/shm cannot be examined"));
            return;
        };
        let left_over = domain_of(output).map_or(0, |domain| domain.used_bytes());
        let free = space.f_bavail * space.f_frsize + left_over;
        if free < MIN_SHARED_MEMORY {
            let text = format!(
                "shared memory: {} MiB are free in /dev/shm, at least {} MiB are needed",
                free >> 20,
                MIN_SHARED_MEMORY >> 20
            );
            self.add("", Problem::of_key("", text));
        }
    }

    fn stages(&mut self, folder: &Path) -> Vec<PlannedStage> {
        let mut stages = Vec::new();
        for (name, span) in self.file.tables() {
            if OWN_TABLES.contains(&name.as_str()) {
                continue;
            }
            let plain = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_';
            if !name.bytes().all(plain) || name.is_empty() || name == "settings" {
                let text = "a stage's name has lower-case letters, digits and _ only, and is not `settings`".to_owned();
                self.add(&name, Problem { key: String::new(), span, text });
                continue;
            }
            let table: StageTable = self.table(&name, |key| SUPERVISOR_KEYS.contains(&key));
            let described = programs::find(&name, &table.program, folder)
                .and_then(|program| programs::describe(&program).map(|description| (program, description)));
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
