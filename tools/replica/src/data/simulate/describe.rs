//! `replica simulate --describe`: the table `[simulate]` of a launch file, for the supervisor, which does not link the simulator.

use anyhow::Context;
use command_line::say;
use run::launch_file::LaunchFile;
use run::{DescribeDriveRequest, DriveDescription};
use settings::{Settings, parse_table};
use simulation::{DriveSettings, SimulatedDrive};
use std::process::ExitCode;

/// `--describe` without a request.
pub const NO_REQUEST: &str = "";
const TABLE: &str = "simulate";

/// Answers the request, a [`DescribeDriveRequest`] as JSON.
pub fn run(request: &str) -> anyhow::Result<ExitCode> {
    let description = if request == NO_REQUEST {
        description(&DriveSettings::default())
    } else {
        let request = serde_json::from_str(request).with_context(|| format!("--describe {request}"))?;
        describe(&request)
    };
    say!("{}", serde_json::to_string(&description)?)?;
    Ok(ExitCode::SUCCESS)
}

fn describe(request: &DescribeDriveRequest) -> DriveDescription {
    let file = match LaunchFile::load(&request.launch_file, &request.changes) {
        Ok(file) => file,
        Err(problems) => return DriveDescription { problems, ..description(&DriveSettings::default()) },
    };
    let table = match file.table(TABLE) {
        Ok(table) => table,
        Err(problem) => return DriveDescription { problems: vec![problem], ..description(&DriveSettings::default()) },
    };
    let (settings, problems) = parse_table::<DriveSettings>(&table);
    let marked = SimulatedDrive::read(&request.drive);
    DriveDescription {
        problems: problems.into_iter().map(|problem| file.located(TABLE, problem)).collect(),
        differences: marked.map(|drive| drive.differences(&settings)).unwrap_or_default(),
        ..description(&settings)
    }
}

fn description(settings: &DriveSettings) -> DriveDescription {
    let arguments = settings.arguments();
    DriveDescription { settings: DriveSettings::fields(), arguments, ..DriveDescription::default() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use run::Change;

    #[test]
    fn supervisor_knows_the_manifest_of_drives_by_its_name() {
        assert_eq!(run::DRIVE_MANIFEST, drive::MANIFEST_FILE);
    }

    #[test]
    fn description_has_the_problems_of_the_table_and_what_differs_in_the_drive() {
        let folder = tempfile::tempdir().expect("a folder");
        let launch_file = folder.path().join("launch.toml");
        std::fs::write(&launch_file, "[run]\n[simulate]\nseconds = 9000.0\ntown = 'urban'\n").expect("written");
        let mark = "town = 'urban'\nseed = 1\nseconds = 12.0\n";
        std::fs::write(folder.path().join(SimulatedDrive::FILE), mark).expect("written");
        let changes = vec![Change::set("simulate.seed=2").expect("valid")];
        let drive = folder.path().to_owned();
        let described = describe(&DescribeDriveRequest { launch_file, changes, drive });
        let [problem] = &described.problems[..] else { panic!("{:?}", described.problems) };
        assert_eq!(problem.key, "simulate.seconds");
        assert_eq!(problem.text, "value 9000.0 must be between 0.2 and 2400");
        assert!(problem.span.is_some(), "the place in the file");
        assert_eq!(described.differences, ["seed = 1, not 2"]);
        assert_eq!(described.arguments[..5], ["simulate", "--town", "urban", "--seed", "2"]);
        assert_eq!(described.settings.len(), DriveSettings::fields().len());
    }
}
