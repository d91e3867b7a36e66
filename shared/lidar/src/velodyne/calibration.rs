//! Calibration files of Velodyne units: `db.xml` (VeloView, in deg and cm) and YAML (ROS drivers, in rad and m).

use super::{Laser, Model};
use std::collections::BTreeMap;

/// Error of a file from which the lasers cannot be read.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LaserFileError {
    /// The file is not XML.
    #[error("is not XML: {0}")]
    Xml(String),
    /// A value is not a number.
    #[error("line {line}: {key} is {value:?}; must be a finite number")]
    Number {
        /// Line in the file.
        line: usize,
        /// The key.
        key: String,
        /// The text found.
        value: String,
    },
    /// A laser of the model is absent.
    #[error("has no laser {laser}; a {model} has lasers 0 to {last}")]
    Absent {
        /// Number of the laser.
        laser: usize,
        /// The model.
        model: &'static str,
        /// Number of the last laser of the model.
        last: usize,
    },
    /// A laser lacks a required value.
    #[error("laser {laser} has no {key}")]
    Incomplete {
        /// Number of the laser.
        laser: usize,
        /// The key.
        key: &'static str,
    },
    /// The file is of another model.
    #[error("is of another model: {what} {found}; a {model} has {expected}")]
    OtherModel {
        /// The property that differs.
        what: &'static str,
        /// The value found.
        found: f64,
        /// The model.
        model: &'static str,
        /// The value of the model.
        expected: f64,
    },
    /// A value is outside its range.
    #[error("laser {laser}: {key} is {value}; must be {min} to {max}")]
    Range {
        /// Number of the laser.
        laser: usize,
        /// The key.
        key: &'static str,
        /// The value found.
        value: f64,
        /// Least value.
        min: f64,
        /// Largest value.
        max: f64,
    },
}

/// Keys and units of a format.
struct Keys {
    id: &'static str,
    elevation: &'static str,
    azimuth: &'static str,
    range: &'static str,
    up: &'static str,
    left: &'static str,
    /// Degrees per unit of angles.
    deg: f64,
    /// Meters per unit of lengths.
    m: f64,
}

const XML: Keys = Keys {
    id: "id_",
    elevation: "vertCorrection_",
    azimuth: "rotCorrection_",
    range: "distCorrection_",
    up: "vertOffsetCorrection_",
    left: "horizOffsetCorrection_",
    deg: 1.0,
    m: 0.01,
};
const YAML: Keys = Keys {
    id: "laser_id",
    elevation: "vert_correction",
    azimuth: "rot_correction",
    range: "dist_correction",
    up: "vert_offset_correction",
    left: "horiz_offset_correction",
    deg: 180.0 / std::f64::consts::PI,
    m: 1.0,
};

/// Values of one laser by key.
type Values<'a> = BTreeMap<&'a str, f64>;

/// Content of a file.
#[derive(Default)]
struct Content<'a> {
    lasers: Vec<Values<'a>>,
    /// Number of lasers, if the file has it.
    n_lasers: Option<f64>,
    /// Resolution of ranges, m, if the file has it.
    range_unit_m: Option<f64>,
}

/// The lasers of a unit, in firing order. The file is XML if it begins with `<`, else YAML. Intensity corrections and corrections of near
/// ranges along x and y are ignored.
pub fn lasers_from_file(text: &str, model: Model) -> Result<Vec<Laser>, LaserFileError> {
    let text = text.trim_start_matches('\u{feff}');
    let (content, keys) =
        if text.trim_start().starts_with('<') { (xml_content(text)?, XML) } else { (yaml_content(text)?, YAML) };
    let expected = f64::from(model.range_unit_m());
    if let Some(found) = content.range_unit_m.filter(|found| (found - expected).abs() > 1e-6) {
        return Err(LaserFileError::OtherModel {
            what: "resolution of ranges in m",
            found,
            model: model.title(),
            expected: (expected * 1e6).round() * 1e-6,
        });
    }
    let n_expected = model.n_rings() as f64;
    if let Some(found) = content.n_lasers.filter(|found| *found != n_expected) {
        return Err(LaserFileError::OtherModel {
            what: "number of lasers",
            found,
            model: model.title(),
            expected: n_expected,
        });
    }
    let of_laser = |laser: usize| {
        let is_laser = |values: &&Values<'_>| values.get(keys.id).is_some_and(|id| *id == laser as f64);
        let values = content.lasers.iter().find(is_laser).ok_or(LaserFileError::Absent {
            laser,
            model: model.title(),
            last: model.n_rings() - 1,
        })?;
        keys.laser(laser, values)
    };
    (0..model.n_rings()).map(of_laser).collect()
}

impl Keys {
    fn laser(&self, laser: usize, values: &Values<'_>) -> Result<Laser, LaserFileError> {
        let value = |key: &'static str, scale: f64, [min, max]: [f64; 2], is_optional: bool| {
            let value = values.get(key).copied().or(is_optional.then_some(0.0));
            let value = value.ok_or(LaserFileError::Incomplete { laser, key })?;
            // Limits in the unit of the file.
            let [min, max] = [min / scale, max / scale].map(|limit| (limit * 1e3).round() * 1e-3);
            let is_valid = (min..=max).contains(&value);
            if is_valid { Ok(value * scale) } else { Err(LaserFileError::Range { laser, key, value, min, max }) }
        };
        Ok(Laser {
            elevation_deg: value(self.elevation, self.deg, [-90.0, 90.0], false)?,
            azimuth_deg: value(self.azimuth, self.deg, [-180.0, 180.0], false)?,
            range_m: value(self.range, self.m, [-10.0, 10.0], true)?,
            up_m: value(self.up, self.m, [-1.0, 1.0], true)?,
            left_m: value(self.left, self.m, [-1.0, 1.0], true)?,
        })
    }
}

/// Parses a number. `line` is called only for an error.
fn number(key: &str, text: &str, line: impl FnOnce() -> usize) -> Result<f64, LaserFileError> {
    let found = text.trim().parse().ok().filter(|value: &f64| value.is_finite());
    found.ok_or_else(|| LaserFileError::Number {
        line: line(),
        key: key.to_owned(),
        value: text.trim().chars().take(40).collect(),
    })
}

/// `<px>` elements, one per laser.
fn xml_content(text: &str) -> Result<Content<'static>, LaserFileError> {
    // The parser refuses document types, which could expand without limit; this one is empty.
    let text = text.replacen("<!DOCTYPE boost_serialization>", "", 1);
    let document = roxmltree::Document::parse(&text).map_err(|error| LaserFileError::Xml(error.to_string()))?;
    let read = |node: roxmltree::Node<'_, '_>| {
        // Counts the lines from the start of the text.
        let line = || document.text_pos_at(node.range().start).row as usize;
        number(node.tag_name().name(), node.text().unwrap_or_default(), line)
    };
    let mut content = Content::default();
    for node in document.descendants() {
        match node.tag_name().name() {
            // In cm.
            "distLSB_" => content.range_unit_m = Some(read(node)? * 0.01),
            "px" => {
                let mut values = Values::new();
                for child in node.children() {
                    let known = [XML.id, XML.elevation, XML.azimuth, XML.range, XML.up, XML.left];
                    if let Some(key) = known.into_iter().find(|key| *key == child.tag_name().name()) {
                        values.insert(key, read(child)?);
                    }
                }
                content.lasers.push(values);
            }
            _ => {}
        }
    }
    Ok(content)
}

/// The list `lasers` of maps, in block or flow style. Other keys of the maps are ignored.
fn yaml_content(text: &str) -> Result<Content<'_>, LaserFileError> {
    let mut content = Content::default();
    for (index, line) in text.lines().enumerate() {
        let line = line.split('#').next().unwrap_or_default();
        for entry in line.split(['{', '}', ',']) {
            let mut entry = entry.trim();
            if let Some(rest) = entry.strip_prefix('-').filter(|rest| rest.is_empty() || rest.starts_with(' ')) {
                content.lasers.push(Values::new());
                entry = rest.trim();
            }
            let Some((key, value)) = entry.split_once(':') else { continue };
            let key = key.trim();
            let read = || number(key, value, || index + 1);
            match key {
                "num_lasers" => content.n_lasers = Some(read()?),
                "distance_resolution" => content.range_unit_m = Some(read()?),
                _ if [YAML.id, YAML.elevation, YAML.azimuth, YAML.range, YAML.up, YAML.left].contains(&key) => {
                    let value = read()?;
                    if let Some(values) = content.lasers.last_mut() {
                        values.insert(key, value);
                    }
                }
                _ => {}
            }
        }
    }
    Ok(content)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn yaml(n: usize) -> String {
        let laser = |id: usize| {
            format!("- {{dist_correction: 0.01, laser_id: {id}, rot_correction: 0.02, vert_correction: -0.1}}\n")
        };
        let lasers: String = (0..n).map(laser).collect();
        format!("lasers:\n{lasers}num_lasers: {n}\ndistance_resolution: 0.002\n")
    }

    #[test]
    fn lasers_are_read_from_yaml_in_flow_and_block_style() {
        let flow = lasers_from_file(&yaml(16), Model::Vlp16).expect("reads");
        let block = yaml(16).replace("- {", "- ").replace(", ", "\n  ").replace('}', "  # of this unit");
        assert_eq!(lasers_from_file(&block, Model::Vlp16).expect("reads"), flow);
        let expected = (f64::to_degrees(0.02), f64::to_degrees(-0.1), 0.01);
        assert_eq!((flow[3].azimuth_deg, flow[3].elevation_deg, flow[3].range_m), expected);
    }

    #[test]
    fn errors_name_laser_key_and_rule() {
        let error = |text: &str, model| lasers_from_file(text, model).expect_err("is wrong").to_string();
        assert_eq!(error(&yaml(16), Model::Hdl32e), "is of another model: number of lasers 16; a HDL-32E has 32");
        let unit = yaml(32).replace("0.002", "0.004");
        assert_eq!(
            error(&unit, Model::Hdl32e),
            "is of another model: resolution of ranges in m 0.004; a HDL-32E has 0.002"
        );
        let text = yaml(16).replace("laser_id: 7,", "laser_id: 70,");
        assert_eq!(error(&text, Model::Vlp16), "has no laser 7; a VLP-16 has lasers 0 to 15");
        let text = yaml(16).replacen("-0.1", "-4", 1);
        assert_eq!(error(&text, Model::Vlp16), "laser 0: vert_correction is -4; must be -1.571 to 1.571");
        let text = yaml(16).replacen("-0.1", "low", 1);
        assert_eq!(error(&text, Model::Vlp16), "line 2: vert_correction is \"low\"; must be a finite number");
        let text = yaml(16).replacen(", vert_correction: -0.1", "", 1);
        assert_eq!(error(&text, Model::Vlp16), "laser 0 has no vert_correction");
        assert!(error("<a>", Model::Vlp16).starts_with("is not XML: "));
        assert_eq!(error("", Model::Vlp16), "has no laser 0; a VLP-16 has lasers 0 to 15");
    }
}
