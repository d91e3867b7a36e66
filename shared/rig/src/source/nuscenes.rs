//! The tables `calibrated_sensor.json` and `sensor.json` of nuScenes.

use super::lens::{Intrinsics, lens};
use super::{CameraPart, RigParts, SourceOptions, pose_of, text};
use crate::error::RigError;
use files::regular_file;
use geometry::Pose;
use serde::Deserialize;
use serde::de::{DeserializeOwned, Deserializer as _, SeqAccess, Visitor};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use std::io::BufReader;
use std::path::Path;

/// Images of all cameras of nuScenes, px.
const IMAGE_SIZE: [u32; 2] = [1600, 900];
const LIDAR: &str = "LIDAR_TOP";

#[derive(Deserialize)]
struct Calibrated {
    token: String,
    sensor_token: String,
    translation: [f64; 3],
    /// Quaternion w x y z.
    rotation: [f64; 4],
    #[serde(default)]
    camera_intrinsic: Vec<[f64; 3]>,
}

#[derive(Deserialize)]
struct Sensor {
    token: String,
    channel: String,
}

#[derive(Deserialize)]
struct Data {
    filename: String,
    calibrated_sensor_token: String,
}

/// `path` is `calibrated_sensor.json`; the other tables are in its folder. The body is the ego frame of nuScenes.
pub(super) fn read(path: &Path, options: &SourceOptions) -> Result<RigParts, RigError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let calibrated: Vec<Calibrated> = table(path)?;
    let sensors: Vec<Sensor> = table(&folder.join("sensor.json"))?;
    let channel_of: BTreeMap<&str, &str> =
        sensors.iter().map(|sensor| (sensor.token.as_str(), sensor.channel.as_str())).collect();
    let wanted = options.log.as_ref().map(|log| tokens_of(&folder.join("sample_data.json"), log)).transpose()?;
    let mut by_channel: BTreeMap<&str, Vec<&Calibrated>> = BTreeMap::new();
    for entry in calibrated.iter().filter(|entry| wanted.as_ref().is_none_or(|wanted| wanted.contains(&entry.token))) {
        let channel = channel_of.get(entry.sensor_token.as_str()).ok_or_else(|| {
            RigError::source(path, &entry.token, format!("sensor {} is not in sensor.json", entry.sensor_token))
        })?;
        by_channel.entry(channel).or_default().push(entry);
    }
    let ego_from_source = options.body_from_source.unwrap_or_else(Pose::identity);
    let mut parts = RigParts::default();
    let mut left = Vec::new();
    for (channel, entries) in by_channel {
        let [entry] = entries[..] else {
            let rule = format!(
                "{} calibrations of {channel}; give --log NAME, the start of the file names of one drive (n015-2018-07-24-11-22-45+0800); \
                 it is looked up in sample_data.json",
                entries.len()
            );
            return Err(RigError::source(path, "", rule));
        };
        let fault = |rule: String| RigError::source(path, &entry.token, rule);
        let [w, x, y, z] = entry.rotation;
        let pose = ego_from_source * pose_of(entry.translation, [x, y, z, w]).map_err(fault)?;
        if channel == LIDAR {
            parts.body_from_lidar = Some(pose);
        } else if let [a, b, _] = entry.camera_intrinsic[..] {
            let numbers = [a[0], b[1], a[2], b[2]];
            let size = options.image_size.unwrap_or(IMAGE_SIZE);
            let model = lens(Intrinsics { size, numbers }, "none", &[]).map_err(fault)?;
            let name = channel.to_owned();
            parts.cameras.push(CameraPart { name, frame: None, body_from_camera: Some(pose), model });
        } else {
            left.push(channel);
        }
    }
    let n_cameras = parts.cameras.len();
    let body = "body: the ego frame, on the road under the rear axle";
    parts.notes.push(format!("nuScenes: {n_cameras} cameras, LiDAR {LIDAR}; {body}"));
    if !left.is_empty() {
        parts.notes.push(format!("not taken: {}", left.join(", ")));
    }
    if parts.body_from_lidar.is_none() && parts.cameras.is_empty() {
        return Err(RigError::source(path, "", "has no calibration of this log"));
    }
    Ok(parts)
}

fn table<T: DeserializeOwned>(path: &Path) -> Result<Vec<T>, RigError> {
    serde_json::from_str(&text(path)?).map_err(|error| RigError::source(path, "", error.to_string()))
}

/// The calibrations referenced by the files of a log. The table has millions of rows, so it is read as a stream.
fn tokens_of(path: &Path, log: &str) -> Result<BTreeSet<String>, RigError> {
    let file = regular_file::open(path).map_err(|error| RigError::io(path, error))?;
    let mut reader = serde_json::Deserializer::from_reader(BufReader::new(file));
    let tokens = reader.deserialize_seq(TokensOf { log });
    let tokens = tokens.map_err(|error| RigError::source(path, "", error.to_string()))?;
    if tokens.is_empty() {
        return Err(RigError::source(path, "", format!("no file of a log {log}; must be the start of file names")));
    }
    Ok(tokens)
}

struct TokensOf<'a> {
    log: &'a str,
}

impl<'de> Visitor<'de> for TokensOf<'_> {
    type Value = BTreeSet<String>;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list of sample_data")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut rows: A) -> Result<Self::Value, A::Error> {
        let mut tokens = BTreeSet::new();
        while let Some(row) = rows.next_element::<Data>()? {
            let name = row.filename.rsplit('/').next().unwrap_or_default();
            if name.strip_prefix(self.log).is_some_and(|rest| rest.starts_with("__")) {
                tokens.insert(row.calibrated_sensor_token);
            }
        }
        Ok(tokens)
    }
}
