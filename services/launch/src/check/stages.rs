//! The stages of a launch file: their tables, and the descriptions of their programs.

use super::problems::Problems;
use crate::manifest::{Run, StageTable};
use crate::plan::{PlannedStage, Selection};
use crate::programs::{self, ProgramError};
use run::assignment::{CONTRACT_VERSION, Description};
use run::process::{interpreter, sibling};
use run::{Change, DescribeRequest, Remote, SUPERVISOR_KEYS, files_of_settings};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Tables that are not stages.
const OWN_TABLES: [&str; 2] = ["run", "simulate"];

struct Table {
    name: String,
    span: Option<Range<usize>>,
    keys: StageTable,
    remote: Option<Remote>,
}

/// The stages of a launch file.
pub struct FileStages {
    /// The stages whose programs have described themselves.
    pub described: Vec<PlannedStage>,
    /// Whether these are all stages of the file, so that a topic without a producer is a problem.
    pub are_all: bool,
}

/// Reads all stages of the file except deselected ones, in its order.
pub fn read(
    problems: &mut Problems,
    folder: &Path,
    launch_file: &Path,
    changes: &[Change],
    selection: &Selection,
    run: &Run,
) -> FileStages {
    let tables = tables(problems, folder, &selection.without, run);
    let described = programs::ask_all(&tables, |table| {
        let request = DescribeRequest {
            launch_file: launch_file.to_owned(),
            changes: changes.to_vec(),
            table: table.name.clone(),
            remote: table.remote.clone(),
        };
        let program = match &table.remote {
            Some(_) => sibling("replica-remote")?,
            None => programs::find(&table.name, &table.keys.program, folder)?,
        };
        programs::describe(&program, &table.keys.python, &request)
            .map(|description| DescribedProgram { program, description })
    });
    let n_tables = tables.len();
    let described = tables.into_iter().zip(described);
    let planned = described.filter_map(|(table, described)| planned(table, described, folder, problems));
    let described: Vec<PlannedStage> = planned.collect();
    FileStages { are_all: described.len() == n_tables, described }
}

fn tables(problems: &mut Problems, folder: &Path, without: &[String], run: &Run) -> Vec<Table> {
    let mut tables = Vec::new();
    for (name, span) in problems.file().tables() {
        if OWN_TABLES.contains(&name.as_str()) || without.contains(&name) {
            continue;
        }
        let is_plain = |b: u8| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_';
        if !name.bytes().all(is_plain) || name.is_empty() || name == "settings" {
            let rule = "a stage's name has lower-case letters, digits and _ only, and is not `settings`";
            problems.add_at(&name, span, rule.to_owned());
            continue;
        }
        let mut keys: StageTable = problems.table(&name, |key| SUPERVISOR_KEYS.contains(&key));
        let remote = keys.remote(folder, run.hang_s);
        if remote.is_none() {
            keys.python = interpreter(&keys.python, folder);
        }
        tables.push(Table { name, span, keys, remote });
    }
    tables
}

/// A program that has described itself.
struct DescribedProgram {
    program: PathBuf,
    description: Description,
}

fn planned(
    table: Table,
    described: Result<DescribedProgram, ProgramError>,
    folder: &Path,
    problems: &mut Problems,
) -> Option<PlannedStage> {
    let Table { name, span, keys, remote } = table;
    let DescribedProgram { program, mut description } = match described {
        Ok(described) => described,
        Err(error) => {
            problems.add_program(&name, span, &error);
            return None;
        }
    };
    if description.contract != CONTRACT_VERSION {
        let text = format!(
            "{} has contract version {}, this supervisor has {CONTRACT_VERSION}; build both from the same commit",
            program.display(),
            description.contract
        );
        problems.add_at(&name, span, text);
        return None;
    }
    for field in description.settings.iter().filter(|field| SUPERVISOR_KEYS.contains(&field.key.as_str())) {
        let text = format!("its setting `{}` cannot be set: the supervisor uses this key itself", field.key);
        problems.add_at(&name, span.clone(), text);
    }
    for text in keys.remap.apply(&mut description) {
        let problem = problems.at_value(&name, "remap", text);
        problems.add(&name, problem);
    }
    let remote = remote.map(|remote| Remote { files: description.files.clone(), ..remote });
    // Files of another host are not part of the run.
    let files = match &remote {
        Some(_) => Vec::new(),
        None => files_of_settings(problems.file(), &name, &description.settings, folder).into_iter().collect(),
    };
    let inputs = Vec::new();
    let outputs = Vec::new();
    Some(PlannedStage { name, span, program, table: keys, remote, description, files, inputs, outputs })
}
