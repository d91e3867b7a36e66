//! `simulated.toml`: marks a drive as simulated and records its settings.

use crate::drive_settings::DriveSettings;
use crate::sensors::lidar::{LidarErrors, LidarGrade};
use crate::spec::DriveSpec;
use files::text_file::read_toml;
use serde::{Deserialize, Serialize};
use settings::Word;
use std::path::Path;
use town::Traffic;

/// Content of the file: the settings that distinguish drives at a glance.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SimulatedDrive {
    /// Kind of town.
    pub town: String,
    /// Seed.
    pub seed: u64,
    /// Pass through the town; absent for the first one.
    #[serde(default, skip_serializing_if = "is_first")]
    pub pass: u64,
    /// Length, s.
    pub seconds: f64,
    /// Errors of the LiDAR and the unit that they belong to; absent for a perfect unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lidar_unit: Option<String>,
    /// Density of the traffic; absent if normal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub traffic: Option<String>,
}

impl SimulatedDrive {
    /// Name of the file in a drive folder.
    pub const FILE: &str = "simulated.toml";

    /// The mark of a drive folder. `None` if there is no mark: the drive was recorded, or simulated by an earlier
    /// version.
    pub fn read(folder: &Path) -> Option<Self> {
        read_toml(&folder.join(Self::FILE)).ok()
    }

    /// A text for each setting in which the drive differs from `settings`.
    pub fn differences(&self, settings: &DriveSettings) -> Vec<String> {
        let Self { town, seed, pass, seconds, lidar_unit, traffic } = self;
        let normal = |value: &Option<String>, default: &str| value.clone().unwrap_or_else(|| default.to_owned());
        let wanted_unit = match settings.lidar_errors {
            LidarGrade::None => LidarGrade::None.to_string(),
            grade => unit_name(grade.word(), settings.unit_seed),
        };
        let values = [
            ("town", format!("{town:?}"), format!("{:?}", settings.town.word())),
            ("seed", seed.to_string(), settings.seed.to_string()),
            ("pass", pass.to_string(), settings.pass.to_string()),
            ("seconds", seconds.to_string(), settings.seconds.to_string()),
            ("lidar_errors", normal(lidar_unit, LidarGrade::None.word()), wanted_unit),
            ("traffic", normal(traffic, Traffic::Normal.word()), settings.traffic.to_string()),
        ];
        let different = values.into_iter().filter(|(_, drive, wanted)| drive != wanted);
        different.map(|(key, drive, wanted)| format!("{key} = {drive}, not {wanted}")).collect()
    }
}

impl From<&DriveSpec> for SimulatedDrive {
    fn from(spec: &DriveSpec) -> Self {
        let LidarErrors { unit_seed, .. } = spec.lidar_errors;
        let is_of = |grade: LidarGrade| LidarErrors { unit_seed, ..grade.errors() } == spec.lidar_errors;
        let grade = LidarGrade::ALL.iter().copied().find(|grade| is_of(*grade));
        let name = grade.map_or("custom", LidarGrade::word);
        Self {
            town: spec.town.to_string(),
            seed: spec.seed,
            pass: spec.pass,
            seconds: spec.seconds,
            lidar_unit: (grade != Some(LidarGrade::None)).then(|| unit_name(name, unit_seed)),
            traffic: (spec.traffic != Traffic::Normal).then(|| spec.traffic.to_string()),
        }
    }
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "the signature that serde calls")]
fn is_first(pass: &u64) -> bool {
    *pass == 0
}

fn unit_name(grade: &str, unit_seed: u64) -> String {
    format!("{grade}, unit {unit_seed}")
}

#[cfg(test)]
mod tests {
    use super::*;
    use town::Town;

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
        let other = DriveSettings { seed: 7, town: Town::Rural, ..same.clone() };
        assert_eq!(mark.differences(&other), ["town = \"urban\", not \"rural\"", "seed = 3, not 7"]);
        let back = DriveSettings { pass: 1, ..same.clone() };
        assert_eq!(mark.differences(&back), ["pass = 0, not 1"]);
        let dense = DriveSettings { traffic: Traffic::Dense, lidar_errors: LidarGrade::Poor, ..same };
        let texts = ["lidar_errors = none, not poor, unit 1", "traffic = normal, not dense"];
        assert_eq!(mark.differences(&dense), texts);
        let marked = SimulatedDrive::from(&dense.spec().expect("valid"));
        assert_eq!(marked.differences(&dense), Vec::<String>::new());
    }
}
