//! User-facing settings of a drive: the table `[simulate]` of a launch file and the options of `replica simulate`.

use crate::limits;
use crate::rig::{CalibrationError, RigSpec};
use crate::sensors::lidar::{LidarErrors, LidarGrade};
use crate::spec::DriveSpec;
use files::problems::{FileError, FileProblem};
use files::regular_file;
use settings::{Rule, any, one_word};
use std::path::Path;
use town::{Town, Traffic};

settings::settings! {
    /// Settings of a drive.
    pub struct DriveSettings {
        /// Kind of town.
        pub town: Town = Town::Urban => one_word();
        /// Seed of the town, its traffic and the sensor noise.
        pub seed: u64 = 1 => any();
        /// Pass through this town: 0 is the first drive, odd passes drive back in the opposite lane, even ones follow the first.
        /// Each has its own time, traffic and sensor noise.
        pub pass: u64 = 0 => any();
        /// Length of the drive, s.
        pub seconds: f64 = 12.0 => limits::SECONDS;
        /// The vehicle. In a launch file, a path is relative to the folder of that file.
        pub rig: String = RigSpec::DEFAULT.to_owned() => NameOrFile;
        /// Rotation error of the sensors relative to drive.toml, degrees (standard deviation).
        pub calibration_error_deg: f64 = 0.0 => limits::CALIBRATION_ERROR_DEG;
        /// Position error of the sensors relative to drive.toml, cm (standard deviation along each axis).
        pub calibration_error_cm: f64 = 0.0 => limits::CALIBRATION_ERROR_CM;
        /// Errors of the LiDAR beams relative to the nominal table: elevation, range and gain of each ring. typical: up
        /// to 0.1 degrees and 2 cm. poor: 0.1 to 0.2 degrees for all rings, up to 0.2 more for each, 3 cm.
        pub lidar_errors: LidarGrade = LidarGrade::None => one_word();
        /// Seed of the LiDAR unit: drives with the same seed are recorded by the same unit with the same errors.
        pub unit_seed: u64 = LidarErrors::NONE.unit_seed => any();
        /// Density of the traffic. dense: the vehicle starts from rest in a queue, next to a bus.
        pub traffic: Traffic = Traffic::Normal => one_word();
        /// Exposure of the mosaic cameras, ms.
        pub mosaic_exposure_ms: f64 = 5.0 => limits::MOSAIC_EXPOSURE_MS;
        /// Also write truth/visibility: the cameras in which each return is visible. Doubles the time of the simulation.
        pub truth_visibility: bool = false => any();
    }
}

/// A built-in rig by name, or the path of a rig file, which [`DriveSettings::spec`] reads.
struct NameOrFile;

impl Rule<String> for NameOrFile {
    fn allows(&self, _rig: &String) -> bool {
        true
    }
    fn text(&self) -> String {
        let names: Vec<&str> = RigSpec::built_in_names().collect();
        format!("must be one of {}, or the path of a rig file", names.join(", "))
    }
}

impl DriveSettings {
    /// The drive; reads the rig file, if `rig` is a path. The error lists all problems of that file.
    pub fn spec(&self) -> Result<DriveSpec, FileError> {
        let Self { calibration_error_deg: rotation_deg, calibration_error_cm: cm, .. } = *self;
        Ok(DriveSpec {
            town: self.town,
            lidar_errors: LidarErrors { unit_seed: self.unit_seed, ..self.lidar_errors.errors() },
            traffic: self.traffic,
            mosaic_exposure_nanos: (self.mosaic_exposure_ms * 1e6).round() as u64,
            truth_visibility: self.truth_visibility,
            pass: self.pass,
            rig: self.rig_spec()?,
            calibration_error: CalibrationError { rotation_deg, translation_m: cm * 0.01 },
            ..DriveSpec::urban(self.seed, self.seconds)
        })
    }

    /// Arguments of `replica` that simulate this drive, without the output folder.
    pub fn arguments(&self) -> Vec<String> {
        let Self { calibration_error_deg: deg, calibration_error_cm: cm, .. } = self;
        let mut arguments = vec!["simulate".to_owned()];
        for (name, value) in [
            ("--town", self.town.to_string()),
            ("--seed", self.seed.to_string()),
            ("--pass", self.pass.to_string()),
            ("--seconds", self.seconds.to_string()),
            ("--rig", self.rig.clone()),
            ("--calibration-error", format!("{deg},{cm}")),
            ("--lidar-errors", self.lidar_errors.to_string()),
            ("--unit-seed", self.unit_seed.to_string()),
            ("--traffic", self.traffic.to_string()),
            ("--mosaic-exposure-ms", self.mosaic_exposure_ms.to_string()),
        ] {
            arguments.extend([name.to_owned(), value]);
        }
        arguments.extend(self.truth_visibility.then(|| "--truth-visibility".to_owned()));
        arguments
    }

    fn rig_spec(&self) -> Result<RigSpec, FileError> {
        if let Some(rig) = RigSpec::built_in(&self.rig) {
            return Ok(rig);
        }
        let path = Path::new(&self.rig);
        let text = regular_file::read_to_string(path).map_err(|error| {
            FileProblem::for_file(path, format!("cannot be read ({error}); a rig {}", NameOrFile.text()))
        })?;
        RigSpec::from_toml(path, &text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use settings::{Settings, parse_table};
    use toml::de::DeTable;

    fn parse(text: &str) -> Result<DriveSettings, Vec<String>> {
        let table = DeTable::parse(text).expect("TOML");
        let (settings, problems) = parse_table::<DriveSettings>(table.get_ref());
        let texts: Vec<String> = problems.into_iter().map(|problem| problem.key + ": " + &problem.text).collect();
        if texts.is_empty() { Ok(settings) } else { Err(texts) }
    }

    #[test]
    fn every_field_can_be_set_and_unknown_keys_are_refused() {
        let lines = DriveSettings::fields().into_iter().map(|field| {
            let value = match (field.kind.as_str(), field.key.as_str()) {
                ("f64", _) => "7.0",
                ("u64", _) => "7",
                ("bool", _) => "true",
                (_, "town") => "'rural'",
                (_, "lidar_errors") => "'poor'",
                (_, "traffic") => "'dense'",
                _ => "'kitti'",
            };
            format!("{} = {value}\n", field.key)
        });
        let settings = parse(&lines.collect::<String>()).expect("valid");
        let spec = settings.spec().expect("built in");
        assert_eq!((spec.town, spec.seed, spec.seconds, spec.rig.name.as_str()), (Town::Rural, 7, 7.0, "kitti"));
        assert_eq!((spec.mosaic_exposure_nanos, spec.calibration_error.translation_m), (7_000_000, 0.07));
        assert_eq!(spec.lidar_errors, LidarErrors { unit_seed: 7, ..LidarErrors::POOR });
        assert_eq!(spec.traffic, Traffic::Dense);
        assert_eq!(parse("second = 1.0").expect_err("refused"), ["second: unknown key; did you mean `seconds`?"]);
    }

    #[test]
    fn rejected_value_is_named_with_key_and_rule() {
        let refused = |text: &str| parse(text).expect_err("refused").remove(0);
        assert_eq!(refused("seconds = 3000"), "seconds: value 3000 must be between 0.2 and 2400");
        assert_eq!(
            refused("calibration_error_cm = -1.0"),
            "calibration_error_cm: value -1.0 must be between 0 and 100"
        );
        assert_eq!(
            refused("town = 'citty'"),
            "town: value \"citty\" must be one of urban, suburban, rural, field, tunnel, motorway"
        );
        let error = DriveSettings { rig: "none.toml".into(), ..DriveSettings::default() }.spec().expect_err("no file");
        assert!(
            error.to_string().contains("must be one of l3d2, survey, nuscenes, kitti, twin, or the path"),
            "{error}"
        );
    }

    #[test]
    fn every_setting_becomes_an_argument() {
        let settings = DriveSettings {
            town: Town::Rural,
            seed: 7,
            pass: 3,
            seconds: 0.5,
            rig: "rigs/mine.toml".to_owned(),
            calibration_error_deg: 0.2,
            calibration_error_cm: 1.5,
            lidar_errors: LidarGrade::Typical,
            unit_seed: 4,
            traffic: Traffic::Dense,
            mosaic_exposure_ms: 100.0,
            truth_visibility: true,
        };
        let expected = "simulate --town rural --seed 7 --pass 3 --seconds 0.5 --rig rigs/mine.toml --calibration-error 0.2,1.5 \
                        --lidar-errors typical --unit-seed 4 --traffic dense --mosaic-exposure-ms 100 --truth-visibility";
        assert_eq!(settings.arguments().join(" "), expected);
        assert_eq!(DriveSettings::default().arguments().len(), 21);
    }
}
