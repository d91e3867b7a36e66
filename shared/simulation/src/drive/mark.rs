//! `simulated.toml`: the mark of a simulated drive, with what it was simulated from.

use crate::settings::DriveSettings;
use crate::spec::DriveSpec;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Content of the file: the settings that tell one drive from another at a glance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SimulatedDrive {
    /// Kind of town.
    pub town: String,
    /// Seed.
    pub seed: u64,
    /// Length, s.
    pub seconds: f64,
}

impl SimulatedDrive {
    /// Name of the file in a drive folder.
    pub const FILE: &str = "simulated.toml";

    /// The mark of a drive folder; `None` if the folder has none: it was recorded, or simulated by an earlier version.
    pub fn read(folder: &Path) -> Option<Self> {
        toml::from_str(&std::fs::read_to_string(folder.join(Self::FILE)).ok()?).ok()
    }

    /// A text for each setting in which the drive differs from `settings`.
    pub fn differences(&self, settings: &DriveSettings) -> Vec<String> {
        let Self { town, seed, seconds } = self;
        let values = [
            ("town", format!("{town:?}"), format!("{:?}", settings.town)),
            ("seed", seed.to_string(), settings.seed.to_string()),
            ("seconds", seconds.to_string(), settings.seconds.to_string()),
        ];
        let different = values.into_iter().filter(|(_, drive, wanted)| drive != wanted);
        different.map(|(key, drive, wanted)| format!("{key} = {drive}, not {wanted}")).collect()
    }
}

impl From<&DriveSpec> for SimulatedDrive {
    fn from(spec: &DriveSpec) -> Self {
        Self { town: spec.town.name().to_owned(), seed: spec.seed, seconds: spec.seconds }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mark_names_the_settings_that_differ() {
        let folder = tempfile::tempdir().expect("a folder");
        assert_eq!(SimulatedDrive::read(folder.path()), None);
        let mark = SimulatedDrive::from(&DriveSpec::urban(3, 4.0));
        std::fs::write(folder.path().join(SimulatedDrive::FILE), toml::to_string(&mark).expect("TOML"))
            .expect("writes");
        assert_eq!(SimulatedDrive::read(folder.path()), Some(mark.clone()));
        let same = DriveSettings { seed: 3, seconds: 4.0, ..DriveSettings::default() };
        assert_eq!(mark.differences(&same), Vec::<String>::new());
        let other = DriveSettings { seed: 7, town: "rural".to_owned(), ..same };
        assert_eq!(mark.differences(&other), ["town = \"urban\", not \"rural\"", "seed = 3, not 7"]);
    }
}
