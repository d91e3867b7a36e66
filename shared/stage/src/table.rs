//! Describes and checks a stage with the settings of a launch file's table, on this host or for a run on another.

use crate::own_table::own_table;
use crate::program::Program;
use crate::{Context, Port, Problem, StepError};
use run::assignment::{CONTRACT_VERSION, Description};
use run::launch_file::LaunchFile;
use std::path::Path;

/// Topics and settings of a program with default settings.
pub(crate) fn description(program: &dyn Program) -> Description {
    Description {
        contract: CONTRACT_VERSION,
        name: program.name().to_owned(),
        inputs: program.inputs().iter().map(Port::describe).collect(),
        outputs: program.outputs().iter().map(Port::describe).collect(),
        settings: program.fields(),
        files: [].into(),
    }
}

/// The description with the settings of a table, if the launch file can be read.
pub(crate) fn describe_table(
    program: &dyn Program,
    file: Option<&LaunchFile>,
    name: &str,
    launch_folder: &Path,
) -> Result<Description, StepError> {
    let mut description = description(program);
    if let Some(table) = file.and_then(|file| own_table(file, name).ok()) {
        let (stage, _) = program.configured(&table);
        description.inputs = stage.inputs(launch_folder)?.iter().map(Port::describe).collect();
        description.outputs = stage.outputs(launch_folder)?.iter().map(Port::describe).collect();
    }
    Ok(description)
}

/// The problems of a table.
pub(crate) fn check_table(program: &dyn Program, file: &LaunchFile, name: &str, context: &Context) -> Vec<Problem> {
    let table = match own_table(file, name) {
        Ok(table) => table,
        Err(problem) => return vec![problem],
    };
    let (stage, mut problems) = program.configured(&table);
    // A setting that is invalid by itself would only cause further errors.
    if problems.is_empty() {
        for mut problem in stage.check(context) {
            let value = table.iter().find(|(key, _)| key.get_ref() == problem.key.as_str());
            problem.span = value.map(|(_, value)| value.span());
            problems.push(problem);
        }
    }
    problems.into_iter().map(|problem| file.located(name, problem)).collect()
}
