//! The table of a stage in launch.toml.

use crate::Problem;
use run::SUPERVISOR_KEYS;
use run::launch_file::LaunchFile;
use toml::de::DeTable;

/// The stage's own settings of a table: without the supervisor's keys.
pub(crate) fn own_table(launch_file: &LaunchFile, name: &str) -> Result<DeTable<'static>, Problem> {
    let table = launch_file.table(name)?;
    Ok(table.into_iter().filter(|(key, _)| !SUPERVISOR_KEYS.contains(&key.get_ref().as_ref())).collect())
}
