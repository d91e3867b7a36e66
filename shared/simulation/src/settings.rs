//! Settings of a drive as people write them: the table `[simulate]` of a launch file and the options of `replica simulate`.

use crate::limits::{self, SettingError};
use crate::rig::{CalibrationError, RigSpec};
use crate::sensors::lidar::{GRADES, LidarErrors};
use crate::spec::DriveSpec;
use files::problems::{FileError, FileProblem};
use serde::{Deserialize, Deserializer, Serialize};
use std::path::Path;
use town::{Town, Traffic};

/// Settings of a drive.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DriveSettings {
    /// Kind of town, by name.
    pub town: String,
    /// Seed of the town, its traffic and the sensor noise.
    pub seed: u64,
    /// Length of the drive, s.
    pub seconds: f64,
    /// Name of a built-in rig, or path of a rig file.
    pub rig: String,
    /// Rotation errors of the nominal mountings, degrees (standard deviation).
    pub calibration_error_deg: f64,
    /// Translation errors of the nominal mountings, cm (standard deviation).
    pub calibration_error_cm: f64,
    /// Errors of the LiDAR's beams, by the name of their grade.
    pub lidar_errors: String,
    /// Seed of the LiDAR unit: it determines those errors.
    pub unit_seed: u64,
    /// Density of the traffic, by name.
    pub traffic: String,
    /// Exposure of the mosaic cameras, ms.
    pub mosaic_exposure_ms: f64,
    /// Whether `truth/visibility` is written.
    pub truth_visibility: bool,
}

/// Description of one setting.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SettingField {
    /// Key.
    pub key: &'static str,
    /// Type of the value.
    pub kind: &'static str,
    /// Default, as TOML.
    pub default: String,
    /// The rule, "must be ..."; empty if every value is allowed.
    pub rule: String,
    /// Meaning, with unit.
    pub meaning: &'static str,
}

impl Default for DriveSettings {
    fn default() -> Self {
        Self {
            town: Town::Urban.name().to_owned(),
            seed: 1,
            seconds: 12.0,
            rig: RigSpec::DEFAULT.to_owned(),
            calibration_error_deg: 0.0,
            calibration_error_cm: 0.0,
            lidar_errors: GRADES[0].0.to_owned(),
            unit_seed: LidarErrors::NONE.unit_seed,
            traffic: Traffic::Normal.name().to_owned(),
            mosaic_exposure_ms: 5.0,
            truth_visibility: false,
        }
    }
}

impl DriveSettings {
    /// All settings in their order.
    pub fn fields() -> Vec<SettingField> {
        let Self { town, seed, seconds, rig, .. } = Self::default();
        let Self { calibration_error_deg, calibration_error_cm, mosaic_exposure_ms, truth_visibility, .. } =
            Self::default();
        let Self { lidar_errors, unit_seed, traffic, .. } = Self::default();
        let field =
            |key, kind, default: String, rule: String, meaning| SettingField { key, kind, default, rule, meaning };
        vec![
            field("town", "String", format!("{town:?}"), town_rule(), "Kind of town."),
            field(
                "seed",
                "u64",
                seed.to_string(),
                String::new(),
                "Seed of the town, its traffic and the sensor noise.",
            ),
            field("seconds", "f64", format!("{seconds:?}"), limits::SECONDS.to_string(), "Length of the drive, s."),
            field(
                "rig",
                "String",
                format!("{rig:?}"),
                rig_rule(),
                "The vehicle. In a launch file, a path is relative to the folder of that file.",
            ),
            field(
                "calibration_error_deg",
                "f64",
                format!("{calibration_error_deg:?}"),
                limits::CALIBRATION_ERROR_DEG.to_string(),
                "Rotation of the sensors away from drive.toml, degrees (standard deviation).",
            ),
            field(
                "calibration_error_cm",
                "f64",
                format!("{calibration_error_cm:?}"),
                limits::CALIBRATION_ERROR_CM.to_string(),
                "Shift of the sensors away from drive.toml, cm (standard deviation along each axis).",
            ),
            field(
                "lidar_errors",
                "String",
                format!("{lidar_errors:?}"),
                grade_rule(),
                "Errors of the LiDAR's beams against its nominal table: elevation, range and gain of each ring. typical: up to \
                 0.1 degrees and 2 cm. poor: 0.1 to 0.2 degrees for all rings, up to 0.2 more for each, 3 cm.",
            ),
            field(
                "unit_seed",
                "u64",
                unit_seed.to_string(),
                String::new(),
                "Seed of the LiDAR unit: drives with the same seed are recorded by the same unit with the same errors.",
            ),
            field(
                "traffic",
                "String",
                format!("{traffic:?}"),
                traffic_rule(),
                "Density of the traffic. dense: the vehicle drives in a queue that starts with it from rest, a bus beside it.",
            ),
            field(
                "mosaic_exposure_ms",
                "f64",
                format!("{mosaic_exposure_ms:?}"),
                limits::MOSAIC_EXPOSURE_MS.to_string(),
                "Exposure of the mosaic cameras, ms.",
            ),
            field(
                "truth_visibility",
                "bool",
                truth_visibility.to_string(),
                String::new(),
                "Also write truth/visibility: which cameras see each return. Doubles the time of the simulation.",
            ),
        ]
    }

    /// Sets one value; the error names key, value and rule. `None`: there is no such key.
    pub fn set<'de, D: Deserializer<'de>>(&mut self, key: &str, value: D) -> Option<Result<(), SettingError>> {
        Some(match key {
            "town" => read("town", value)
                .and_then(|name: String| town_of(&name))
                .map(|town| town.name().clone_into(&mut self.town)),
            "seed" => read("seed", value).map(|seed| self.seed = seed),
            "seconds" => read_within("seconds", value, limits::SECONDS).map(|seconds| self.seconds = seconds),
            "rig" => read("rig", value).map(|rig| self.rig = rig),
            "calibration_error_deg" => read_within("calibration_error_deg", value, limits::CALIBRATION_ERROR_DEG)
                .map(|deg| self.calibration_error_deg = deg),
            "calibration_error_cm" => read_within("calibration_error_cm", value, limits::CALIBRATION_ERROR_CM)
                .map(|cm| self.calibration_error_cm = cm),
            "lidar_errors" => read("lidar_errors", value).and_then(|name: String| {
                grade_of(&name)?;
                self.lidar_errors = name;
                Ok(())
            }),
            "unit_seed" => read("unit_seed", value).map(|seed| self.unit_seed = seed),
            "traffic" => read("traffic", value)
                .and_then(|name: String| traffic_of(&name))
                .map(|traffic| traffic.name().clone_into(&mut self.traffic)),
            "mosaic_exposure_ms" => read_within("mosaic_exposure_ms", value, limits::MOSAIC_EXPOSURE_MS)
                .map(|ms| self.mosaic_exposure_ms = ms),
            "truth_visibility" => read("truth_visibility", value).map(|is_written| self.truth_visibility = is_written),
            _ => return None,
        })
    }

    /// The drive; reads the rig file, if `rig` is a path. The error lists all problems of that file.
    pub fn spec(&self) -> Result<DriveSpec, FileError> {
        let Self { calibration_error_deg: rotation_deg, calibration_error_cm: cm, .. } = *self;
        let problem = |error: SettingError| FileProblem::of_file(Path::new(""), error.to_string());
        Ok(DriveSpec {
            town: town_of(&self.town).map_err(problem)?,
            lidar_errors: LidarErrors { unit_seed: self.unit_seed, ..grade_of(&self.lidar_errors).map_err(problem)? },
            traffic: traffic_of(&self.traffic).map_err(problem)?,
            mosaic_exposure_nanos: (self.mosaic_exposure_ms * 1e6).round() as u64,
            truth_visibility: self.truth_visibility,
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
            ("--town", self.town.clone()),
            ("--seed", self.seed.to_string()),
            ("--seconds", self.seconds.to_string()),
            ("--rig", self.rig.clone()),
            ("--calibration-error", format!("{deg},{cm}")),
            ("--lidar-errors", self.lidar_errors.clone()),
            ("--unit-seed", self.unit_seed.to_string()),
            ("--traffic", self.traffic.clone()),
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
        let text = std::fs::read_to_string(path)
            .map_err(|error| FileProblem::of_file(path, format!("cannot be read ({error}); a rig {}", rig_rule())))?;
        RigSpec::from_toml(path, &text)
    }
}

fn town_of(name: &str) -> Result<Town, SettingError> {
    let found = Town::ALL.into_iter().find(|town| town.name() == name);
    found.ok_or_else(|| SettingError::Rule { key: "town", value: format!("{name:?}"), rule: town_rule() })
}

fn town_rule() -> String {
    format!("must be one of {}", Town::ALL.map(Town::name).join(", "))
}

fn grade_of(name: &str) -> Result<LidarErrors, SettingError> {
    let found = GRADES.into_iter().find(|(known, _)| *known == name).map(|(_, errors)| errors);
    found.ok_or_else(|| SettingError::Rule { key: "lidar_errors", value: format!("{name:?}"), rule: grade_rule() })
}

fn grade_rule() -> String {
    format!("must be one of {}", GRADES.map(|(name, _)| name).join(", "))
}

fn traffic_of(name: &str) -> Result<Traffic, SettingError> {
    let found = Traffic::ALL.into_iter().find(|traffic| traffic.name() == name);
    found.ok_or_else(|| SettingError::Rule { key: "traffic", value: format!("{name:?}"), rule: traffic_rule() })
}

fn traffic_rule() -> String {
    format!("must be one of {}", Traffic::ALL.map(Traffic::name).join(", "))
}

fn rig_rule() -> String {
    let names: Vec<&str> = RigSpec::built_in_names().collect();
    format!("must be one of {}, or the path of a rig file", names.join(", "))
}

fn read<'de, T: Deserialize<'de>, D: Deserializer<'de>>(key: &'static str, value: D) -> Result<T, SettingError> {
    T::deserialize(value).map_err(|error| SettingError::Type { key, problem: error.to_string().trim_end().to_owned() })
}

fn read_within<'de, D: Deserializer<'de>>(
    key: &'static str,
    value: D,
    limits: limits::Limits,
) -> Result<f64, SettingError> {
    limits.check(key, read(key, value)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde::de::IntoDeserializer;
    use serde::de::value::Error as ValueError;

    fn text(value: &str) -> impl Deserializer<'_> {
        IntoDeserializer::<ValueError>::into_deserializer(value)
    }

    fn number(value: f64) -> impl Deserializer<'static> {
        IntoDeserializer::<ValueError>::into_deserializer(value)
    }

    #[test]
    fn every_field_can_be_set_and_unknown_keys_are_refused() {
        let mut settings = DriveSettings::default();
        for field in DriveSettings::fields() {
            let result = match field.kind {
                "f64" => settings.set(field.key, number(7.0)),
                "u64" => settings.set(field.key, IntoDeserializer::<ValueError>::into_deserializer(7_u64)),
                "bool" => settings.set(field.key, IntoDeserializer::<ValueError>::into_deserializer(true)),
                _ => {
                    let value = match field.key {
                        "town" => "rural",
                        "lidar_errors" => "poor",
                        "traffic" => "dense",
                        _ => "kitti",
                    };
                    settings.set(field.key, text(value))
                }
            };
            assert_eq!(result, Some(Ok(())), "{}", field.key);
        }
        let spec = settings.spec().expect("built in");
        assert_eq!((spec.town, spec.seed, spec.seconds, spec.rig.name.as_str()), (Town::Rural, 7, 7.0, "kitti"));
        assert_eq!((spec.mosaic_exposure_nanos, spec.calibration_error.translation_m), (7_000_000, 0.07));
        assert_eq!(spec.lidar_errors, LidarErrors { unit_seed: 7, ..LidarErrors::POOR });
        assert_eq!(spec.traffic, Traffic::Dense);
        assert_eq!(settings.set("second", number(1.0)), None);
    }

    #[test]
    fn rejected_value_is_named_with_key_and_rule() {
        let mut settings = DriveSettings::default();
        let mut error =
            |key: &str, value: f64| settings.set(key, number(value)).expect("a key").expect_err("refused").to_string();
        assert_eq!(error("seconds", 3000.0), "seconds: value 3000 must be between 0.2 and 2400");
        assert_eq!(error("calibration_error_cm", -1.0), "calibration_error_cm: value -1 must be between 0 and 100");
        let error = settings.set("town", text("citty")).expect("a key").expect_err("refused");
        assert_eq!(
            error.to_string(),
            "town: value \"citty\" must be one of urban, suburban, rural, field, tunnel, motorway"
        );
        let error = DriveSettings { rig: "none.toml".into(), ..settings }.spec().expect_err("no file");
        assert!(
            error.to_string().contains("must be one of l3d2, survey, nuscenes, kitti, twin, or the path"),
            "{error}"
        );
    }

    #[test]
    fn every_setting_becomes_an_argument() {
        let settings = DriveSettings {
            town: "rural".to_owned(),
            seed: 7,
            seconds: 0.5,
            rig: "rigs/mine.toml".to_owned(),
            calibration_error_deg: 0.2,
            calibration_error_cm: 1.5,
            lidar_errors: "typical".to_owned(),
            unit_seed: 4,
            traffic: "dense".to_owned(),
            mosaic_exposure_ms: 100.0,
            truth_visibility: true,
        };
        let expected = "simulate --town rural --seed 7 --seconds 0.5 --rig rigs/mine.toml --calibration-error 0.2,1.5 \
                        --lidar-errors typical --unit-seed 4 --traffic dense --mosaic-exposure-ms 100 --truth-visibility";
        assert_eq!(settings.arguments().join(" "), expected);
        assert_eq!(DriveSettings::default().arguments().len(), 19);
    }
}
