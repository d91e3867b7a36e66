//! The metadata file of a sensor (JSON), as the sensor and Ouster's tools write it.

use super::Profile;
use super::packet::serial_number;
use crate::MAX_BLOCKS;
use geometry::Vector3;
use serde_json::Value;

/// Most beams of a sensor.
const MAX_BEAMS: usize = 128;
/// Most columns of a revolution.
const MAX_COLUMNS: u64 = 4096;

/// Error of a metadata file that cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MetadataError {
    /// The file is not JSON.
    #[error("is not JSON: {0}")]
    Json(String),
    /// A required entry is missing.
    #[error("has no entry {0}; is it the metadata of an Ouster?")]
    Absent(&'static str),
    /// The value of an entry cannot be used.
    #[error("{key} is {found}; must be {rule}")]
    Value {
        /// The entry.
        key: &'static str,
        /// The value found.
        found: String,
        /// Rule that the value breaks.
        rule: String,
    },
}

/// The time source whose times are TAI if the network clock is a PTP clock.
const PTP: &str = "TIME_FROM_PTP_1588";
/// Largest difference of TAI and UTC, s: 37 since 2017.
const MAX_TAI_OFFSET_S: i64 = 100;

/// Distance of the origin of the beams from the axis by product line, mm, in files without it.
const BEAM_ORIGINS_MM: [(&str, f64); 3] = [("OS-0-", 27.67), ("OS-1-", 15.806), ("OS-2-", 13.762)];
/// Largest distance of the origin of the beams from the axis, mm: the sensor has a radius of 60.
const MAX_BEAM_ORIGIN_MM: f64 = 100.0;

/// Smallest vertical field of view of a LiDAR with several beams, deg. Sensors have 22 and more.
const MIN_FIELD_DEG: f64 = 1.0;
/// Largest error of products of rows of a rotation, which files have with few digits.
const MAX_SKEW: f64 = 1e-3;

/// Packet format and beams according to the metadata.
#[derive(Clone, Debug, PartialEq)]
pub struct Metadata {
    pub(super) profile: Profile,
    pub(super) n_columns: usize,
    pub(super) columns_per_turn: u16,
    /// First and last column that are measured.
    pub(super) window: [u16; 2],
    /// Angles above the horizon, deg, in the order of the pixels.
    pub(super) elevations_deg: Vec<f64>,
    /// Angles to the right of the encoder angle, deg.
    pub(super) azimuths_deg: Vec<f64>,
    /// Distance of the origin of the beams from the axis, and its height, m.
    pub(super) origin_m: [f64; 2],
    /// Rotation by columns, and translation in m.
    pub(super) sensor_from_lidar: ([[f64; 3]; 3], [f64; 3]),
    pub(super) turns_per_second: f64,
    /// Source of the times, if the file has it: `TIME_FROM_INTERNAL_OSC`, `TIME_FROM_SYNC_PULSE_IN` or `TIME_FROM_PTP_1588`.
    pub(crate) timestamp_mode: Option<String>,
    /// TAI minus UTC, ns, if the times are TAI by PTP and the file has the difference; otherwise 0.
    pub(super) tai_offset_nanos: i64,
    serial_number: Option<u64>,
}

impl Metadata {
    /// Reads a file. Entries may be at the top or in the groups of newer files.
    pub fn from_json(text: &str) -> Result<Self, MetadataError> {
        let root: Value = serde_json::from_str(text).map_err(|error| MetadataError::Json(error.to_string()))?;
        let elevations_deg = angles(&root, "beam_altitude_angles", MAX_BEAMS)?;
        check_elevations(&root, &elevations_deg)?;
        let azimuths_deg = angles(&root, "beam_azimuth_angles", MAX_BEAMS)?;
        let n_beams = elevations_deg.len();
        let (mode_columns, turns_per_second) = mode(&root)?;
        let profile = profile(&root)?;
        let whole = |key, default: u64, range: std::ops::RangeInclusive<u64>| match find(&root, key) {
            None => Ok(default),
            Some(found) => found.as_u64().filter(|n| range.contains(n)).ok_or_else(|| {
                value_error(key, found, format!("a whole number from {} to {}", range.start(), range.end()))
            }),
        };
        let columns_per_turn = whole("columns_per_frame", mode_columns, 256..=MAX_COLUMNS)?;
        let n_columns = whole("columns_per_packet", 16, 1..=MAX_BLOCKS as u64)? as usize;
        let n_pixels = whole("pixels_per_column", n_beams as u64, 1..=MAX_BEAMS as u64)?;
        for (key, n) in [("beam_altitude_angles", n_beams), ("beam_azimuth_angles", azimuths_deg.len())] {
            if n as u64 != n_pixels {
                let rule = format!("an array of {n_pixels} numbers, as pixels_per_column");
                return Err(MetadataError::Value { key, found: format!("an array of {n}"), rule });
            }
        }
        let window = match find(&root, "column_window") {
            None => [0, columns_per_turn as u16 - 1],
            Some(found) => pair(found)
                .filter(|window| window.iter().all(|n| *n < columns_per_turn))
                .ok_or_else(|| value_error("column_window", found, format!("two columns below {columns_per_turn}")))?
                .map(|n| n as u16),
        };
        let to_m = |mm: f64| mm * 1e-3;
        let origin_m = match find(&root, "beam_to_lidar_transform").map(|_| matrix(&root, "beam_to_lidar_transform")) {
            Some(matrix) => matrix.map(|m| [m[3], m[11]].map(to_m))?,
            None => [to_m(beam_origin_mm(&root)?), 0.0],
        };
        let m = matrix(&root, "lidar_to_sensor_transform")?;
        let serial = find(&root, "prod_sn");
        let timestamp_mode = find(&root, "timestamp_mode").and_then(Value::as_str).map(str::to_owned);
        Ok(Self {
            profile,
            n_columns,
            columns_per_turn: columns_per_turn as u16,
            window,
            elevations_deg,
            azimuths_deg,
            origin_m,
            sensor_from_lidar: (
                [[m[0], m[4], m[8]], [m[1], m[5], m[9]], [m[2], m[6], m[10]]],
                [m[3], m[7], m[11]].map(to_m),
            ),
            turns_per_second,
            tai_offset_nanos: if timestamp_mode.as_deref() == Some(PTP) { tai_offset_nanos(&root) } else { 0 },
            timestamp_mode,
            serial_number: serial.and_then(|found| found.as_u64().or_else(|| found.as_str()?.parse().ok())),
        })
    }

    /// Format of the packets.
    pub fn profile(&self) -> Profile {
        self.profile
    }

    /// Angles of the beams above the horizon, deg, in the order of the pixels.
    pub fn elevations_deg(&self) -> &[f64] {
        &self.elevations_deg
    }

    /// Columns of a revolution.
    pub fn columns_per_turn(&self) -> usize {
        usize::from(self.columns_per_turn)
    }

    pub(super) fn n_beams(&self) -> usize {
        self.elevations_deg.len()
    }

    /// Whether a payload is a data packet of this sensor.
    pub(crate) fn is_data(&self, payload: &[u8]) -> bool {
        self.has_size(payload) && self.other_serial_number(payload).is_none()
    }

    /// Serial number of the other sensor that sent a payload of the same size.
    pub(crate) fn other_serial_number(&self, payload: &[u8]) -> Option<u64> {
        let found = serial_number(payload, self.profile).filter(|_| self.has_size(payload))?;
        self.serial_number.filter(|own| *own != found).map(|_| found)
    }

    fn has_size(&self, payload: &[u8]) -> bool {
        let is_data = self.profile == Profile::Legacy || payload.starts_with(&[1, 0]);
        payload.len() == self.profile.packet_bytes(self.n_columns, self.n_beams()) && is_data
    }
}

/// An entry at the top, or in one of the groups.
fn find<'a>(root: &'a Value, key: &str) -> Option<&'a Value> {
    let groups = || root.as_object().into_iter().flat_map(|entries| entries.values());
    let found = root.get(key).or_else(|| groups().find_map(|group| group.get(key)));
    found.filter(|value| !value.is_null())
}

fn value_error(key: &'static str, found: &Value, rule: String) -> MetadataError {
    MetadataError::Value { key, found: found.to_string().chars().take(60).collect(), rule }
}

/// TAI minus UTC, ns, as announced by the network clock: `time_properties_data_set` in the sensor's reply to
/// `/api/v1/time/ptp`, in the entry `ptp` or in another group. 0 if the file does not have it, or if it states that the
/// times are not TAI.
fn tai_offset_nanos(root: &Value) -> i64 {
    let Some(properties) = find(root, "time_properties_data_set") else { return 0 };
    let is_set = |key: &str| properties.get(key).is_some_and(|value| value == 1 || value == true);
    let offset_s = properties.get("current_utc_offset").and_then(Value::as_i64);
    let is_valid = is_set("ptp_timescale") && is_set("current_utc_offset_valid");
    offset_s.filter(|offset_s| is_valid && (0..=MAX_TAI_OFFSET_S).contains(offset_s)).unwrap_or(0) * 1_000_000_000
}

/// An array of angles, deg.
fn angles(root: &Value, key: &'static str, max: usize) -> Result<Vec<f64>, MetadataError> {
    let found = find(root, key).ok_or(MetadataError::Absent(key))?;
    let angle = |value: &Value| value.as_f64().filter(|angle| angle.abs() <= 180.0);
    let read: Option<Vec<f64>> = found.as_array().and_then(|values| values.iter().map(angle).collect());
    let read = read.filter(|angles| (1..=max).contains(&angles.len()));
    read.ok_or_else(|| value_error(key, found, format!("an array of 1 to {max} angles in deg")))
}

/// Refuses beams at one elevation: metadata of a sensor that has not measured itself has zeros.
fn check_elevations(root: &Value, elevations_deg: &[f64]) -> Result<(), MetadataError> {
    let [low, high] = elevations_deg.iter().fold([f64::MAX, f64::MIN], |[low, high], e| [low.min(*e), high.max(*e)]);
    if elevations_deg.len() == 1 || high - low >= MIN_FIELD_DEG {
        return Ok(());
    }
    let key = "beam_altitude_angles";
    let rule = format!("angles over at least {MIN_FIELD_DEG} deg, as the sensor sends them after its start");
    Err(value_error(key, find(root, key).unwrap_or(&Value::Null), rule))
}

/// A rigid transform of 4 x 4 numbers, row by row; lengths in mm.
fn matrix(root: &Value, key: &'static str) -> Result<[f64; 16], MetadataError> {
    let found = find(root, key).ok_or(MetadataError::Absent(key))?;
    let number = |value: &Value| value.as_f64().filter(|n| n.abs() < 1e4);
    let read: Option<Vec<f64>> = found.as_array().and_then(|values| values.iter().map(number).collect());
    let read = read.and_then(|numbers| <[f64; 16]>::try_from(numbers).ok());
    let read = read.ok_or_else(|| value_error(key, found, "an array of 16 numbers".into()))?;
    if is_rigid(&read) {
        return Ok(read);
    }
    let rule = "a rotation and a translation: orthogonal rows of length 1, and 0 0 0 1 at the end".into();
    Err(value_error(key, found, rule))
}

/// Whether the numbers are a rotation, a translation, and `0 0 0 1`.
fn is_rigid(m: &[f64; 16]) -> bool {
    let rows = [[m[0], m[1], m[2]], [m[4], m[5], m[6]], [m[8], m[9], m[10]]].map(Vector3::from);
    let is_near = |a: f64, b: f64| (a - b).abs() <= MAX_SKEW;
    let is_orthogonal = (0..3).all(|i| (0..3).all(|j| is_near(rows[i].dot(&rows[j]), f64::from(u8::from(i == j)))));
    is_orthogonal && is_near(rows[0].cross(&rows[1]).dot(&rows[2]), 1.0) && m[12..] == [0.0, 0.0, 0.0, 1.0]
}

fn pair(found: &Value) -> Option<[u64; 2]> {
    let values: Option<Vec<u64>> = found.as_array()?.iter().map(Value::as_u64).collect();
    values?.try_into().ok()
}

/// Distance of the origin of the beams from the axis, mm. Files of old firmware do not have it; Ouster's tools then use the
/// value of the product line.
fn beam_origin_mm(root: &Value) -> Result<f64, MetadataError> {
    const KEY: &str = "lidar_origin_to_beam_origin_mm";
    if let Some(found) = find(root, KEY) {
        let number = found.as_f64().filter(|mm| (0.0..MAX_BEAM_ORIGIN_MM).contains(mm));
        return number.ok_or_else(|| value_error(KEY, found, format!("a number from 0 to {MAX_BEAM_ORIGIN_MM}")));
    }
    let line = find(root, "prod_line").and_then(Value::as_str).unwrap_or_default();
    let of_line = BEAM_ORIGINS_MM.into_iter().find(|(prefix, _)| line.starts_with(prefix));
    of_line.map(|(_, mm)| mm).ok_or(MetadataError::Absent(KEY))
}

/// Columns of a revolution, and revolutions per second.
fn mode(root: &Value) -> Result<(u64, f64), MetadataError> {
    let found = find(root, "lidar_mode").ok_or(MetadataError::Absent("lidar_mode"))?;
    let (columns, rate) = found.as_str().and_then(|text| text.split_once('x')).unwrap_or_default();
    match (columns.parse(), rate.parse()) {
        (Ok(columns), Ok(rate)) if (256..=MAX_COLUMNS).contains(&columns) && (1.0..=100.0).contains(&rate) => {
            Ok((columns, rate))
        }
        _ => Err(value_error("lidar_mode", found, "columns and revolutions per second, for example 1024x10".into())),
    }
}

fn profile(root: &Value) -> Result<Profile, MetadataError> {
    let Some(found) = find(root, "udp_profile_lidar") else { return Ok(Profile::Legacy) };
    let known = Profile::ALL.into_iter().find(|profile| found.as_str() == Some(profile.name()));
    known.ok_or_else(|| {
        let rule =
            format!("one of {}; configure the sensor to use one of them", Profile::ALL.map(Profile::name).join(", "));
        value_error("udp_profile_lidar", found, rule)
    })
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A sensor with two beams.
    pub(crate) const TWO_BEAMS: &str = r#"{"beam_altitude_angles": [10, -10], "beam_azimuth_angles": [2, -2],
        "data_format": {"columns_per_frame": 512, "columns_per_packet": 16, "pixels_per_column": 2, "column_window": [0, 511],
        "udp_profile_lidar": "RNG19_RFL8_SIG16_NIR16_DUAL"}, "lidar_mode": "512x10", "lidar_origin_to_beam_origin_mm": 20,
        "lidar_to_sensor_transform": [-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 40, 0, 0, 0, 1], "prod_sn": "5"}"#;

    #[test]
    fn entries_are_read_from_the_top_and_from_groups() {
        let flat = Metadata::from_json(TWO_BEAMS).expect("reads");
        let grouped = TWO_BEAMS
            .replace(r#""lidar_mode": "512x10""#, r#""config_params": {"lidar_mode": "512x10"}"#)
            .replace(r#""prod_sn": "5""#, r#""sensor_info": {"prod_sn": "5"}"#)
            .replace("data_format", "lidar_data_format");
        assert_eq!(Metadata::from_json(&grouped).expect("reads"), flat);
        assert_eq!((flat.columns_per_turn(), flat.profile(), flat.origin_m), (512, Profile::Dual, [0.02, 0.0]));
        assert_eq!(flat.sensor_from_lidar, ([[-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0]], [0.0, 0.0, 0.04]));
    }

    #[test]
    fn times_are_tai_where_the_clock_on_the_network_says_so() {
        let with = |mode: &str, properties: &str| {
            let entries =
                format!(r#"{{"timestamp_mode": "{mode}", "ptp": {{"time_properties_data_set": {properties}}}, "#);
            Metadata::from_json(&TWO_BEAMS.replacen('{', &entries, 1)).expect("reads").tai_offset_nanos
        };
        let tai = r#"{"current_utc_offset": 37, "current_utc_offset_valid": 1, "ptp_timescale": 1}"#;
        assert_eq!(with(PTP, tai), 37_000_000_000);
        assert_eq!(with("TIME_FROM_SYNC_PULSE_IN", tai), 0);
        assert_eq!(with(PTP, &tai.replace("timescale\": 1", "timescale\": 0")), 0);
        assert_eq!(with(PTP, &tai.replace("valid\": 1", "valid\": 0")), 0);
        assert_eq!(with(PTP, &tai.replace("37", "3700")), 0);
        assert_eq!(Metadata::from_json(TWO_BEAMS).expect("reads").tai_offset_nanos, 0);
    }

    #[test]
    fn errors_name_entry_value_and_rule() {
        let error =
            |from: &str, to: &str| Metadata::from_json(&TWO_BEAMS.replace(from, to)).expect_err("is wrong").to_string();
        assert!(error("{", "").starts_with("is not JSON: "));
        assert_eq!(error("beam_altitude", "x"), "has no entry beam_altitude_angles; is it the metadata of an Ouster?");
        assert_eq!(
            error("[2, -2]", "[2, -2, 1]"),
            "beam_azimuth_angles is an array of 3; must be an array of 2 numbers, as pixels_per_column"
        );
        assert!(
            error("_DUAL", "_TRIPLE")
                .starts_with("udp_profile_lidar is \"RNG19_RFL8_SIG16_NIR16_TRIPLE\"; must be one of LEGACY")
        );
        assert!(error("512x10", "fast").starts_with("lidar_mode is \"fast\"; must be"));
        assert!(error("[0, 511]", "[0, 512]").starts_with("column_window is [0,512]; must be two columns below 512"));
        assert!(error("\"columns_per_packet\": 16", "\"columns_per_packet\": 99").contains("from 1 to 16"));
        assert!(error("[-1, 0, 0, 0,", "[-1,").contains("an array of 16 numbers"));
    }

    /// Files of old firmware, and files that someone has reduced.
    #[test]
    fn origin_of_the_beams_is_of_the_product_line_or_the_file_is_refused() {
        let origin = |entry: &str| {
            let text = TWO_BEAMS.replace(r#""lidar_origin_to_beam_origin_mm": 20"#, entry);
            Metadata::from_json(&text).map(|metadata| metadata.origin_m).map_err(|error| error.to_string())
        };
        for (line, mm) in [("OS-0-128", 27.67), ("OS-1-64", 15.806), ("OS-2-32-U1", 13.762)] {
            let [found_m, height_m] = origin(&format!(r#""prod_line": "{line}""#)).expect("reads");
            assert!((found_m - mm * 1e-3).abs() < 1e-9 && height_m == 0.0, "{line}: {found_m}");
        }
        let error = origin(r#""x": 1"#).expect_err("is not known");
        assert!(error.starts_with("has no entry lidar_origin_to_beam_origin_mm"), "{error}");
        let error = origin(r#""lidar_origin_to_beam_origin_mm": "27""#).expect_err("is a text");
        assert_eq!(error, "lidar_origin_to_beam_origin_mm is \"27\"; must be a number from 0 to 100");
        let reduced = TWO_BEAMS.replace("lidar_to_sensor", "x");
        let error = Metadata::from_json(&reduced).expect_err("has no mounting").to_string();
        assert!(error.starts_with("has no entry lidar_to_sensor_transform"), "{error}");
    }

    #[test]
    fn zeros_of_a_sensor_that_has_not_measured_itself_are_refused() {
        let error = |from: &str, to: &str| Metadata::from_json(&TWO_BEAMS.replace(from, to)).map_err(|e| e.to_string());
        let rule = "beam_altitude_angles is [0,0]; must be angles over at least 1 deg, as the sensor sends them after its start";
        assert_eq!(error("[10, -10]", "[0, 0]"), Err(rule.to_owned()));
        let transform = "[-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 40, 0, 0, 0, 1]";
        for wrong in [
            "[0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]",
            "[-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 40, 0, 0, 0, 1]",
            "[-2, 0, 0, 0, 0, -2, 0, 0, 0, 0, 2, 40, 0, 0, 0, 1]",
            "[-1, 0, 0, 0, 0, -1, 0, 0, 0, 0, 1, 40, 0, 0, 0, 0]",
        ] {
            let text = error(transform, wrong).expect_err(wrong);
            assert!(
                text.starts_with("lidar_to_sensor_transform is [") && text.contains("must be a rotation"),
                "{text}"
            );
        }
        // Zeros of the azimuths occur in simulators.
        assert!(error("[2, -2]", "[0, 0]").is_ok());
    }
}
