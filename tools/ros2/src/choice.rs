//! The choice of a topic for each sensor.

use crate::arguments::Args;
use crate::roles::{Role, clouds_refusal};
use anyhow::bail;
use import::LiveSensor;
use std::collections::BTreeMap;

const CAMERA_INFO: &str = "sensor_msgs/CameraInfo";

/// Topics with their types, as they were found.
pub type Topics = BTreeMap<String, String>;

/// The chosen topics.
pub struct ChosenTopics {
    pub roles: BTreeMap<Role, String>,
    /// Lines about omitted topics.
    pub notes: Vec<String>,
}

/// The chosen image topics.
struct CameraTopics {
    chosen: Vec<String>,
    notes: Vec<String>,
}

/// Chooses topics that `--topic` does not name by type, for the given targets.
pub fn choose(topics: &Topics, args: &Args) -> anyhow::Result<ChosenTopics> {
    let mut roles = BTreeMap::new();
    let mut notes = Vec::new();
    let is_wished = |role: &Role| args.topics.iter().any(|(wished, _)| wished == role);
    let of = |sensor: LiveSensor| -> Vec<&String> {
        let is_free = |topic: &&String| args.topics.iter().all(|(_, wished)| wished != *topic);
        let found = topics.iter().filter(|(_, kind)| LiveSensor::from_type(kind) == Some(sensor));
        found.map(|(topic, _)| topic).filter(is_free).collect()
    };
    let receiver_is_wished = is_wished(&Role::Nmea) || is_wished(&Role::Gnss);
    for (role, sensor) in [
        (Role::Imu, LiveSensor::Imu),
        (Role::Nmea, LiveSensor::Sentences),
        (Role::Gnss, LiveSensor::Fixes),
        (Role::Lidar(0), LiveSensor::Packets),
    ] {
        let is_receiver = matches!(role, Role::Nmea | Role::Gnss);
        if !args.has_target(&role) || is_wished(&role) || is_receiver && receiver_is_wished {
            continue;
        }
        let mut found = of(sensor);
        // Packets of an Ouster's IMU have the same type as packets of its LiDAR.
        found.retain(|topic| role != Role::Lidar(0) || !topic.ends_with("imu_packets"));
        if role == Role::Gnss && roles.contains_key(&Role::Nmea) {
            notes.extend(found.iter().map(|topic| format!("{topic}: not taken, the receiver's sentences are")));
            continue;
        }
        match found[..] {
            [] => {}
            [topic] => drop(roles.insert(role, topic.clone())),
            _ => bail!("several topics can be the {role}: {}; --topic {role}=TOPIC chooses", listed(&found)),
        }
    }
    let wants_lidar = args.has_target(&Role::Lidar(0)) && !is_wished(&Role::Lidar(0));
    if wants_lidar && !roles.contains_key(&Role::Lidar(0)) {
        notes.extend(
            of(LiveSensor::Clouds).into_iter().map(|topic| format!("{topic}: {}", clouds_refusal(&topics[topic]))),
        );
    }
    let names_cameras = args.topics.iter().any(|(role, _)| matches!(role, Role::Camera(_) | Role::Mosaic(_)));
    if args.cameras.is_some() && !names_cameras {
        let CameraTopics { chosen, notes: left_out } = cameras(topics, &of(LiveSensor::Camera));
        roles.extend(chosen.into_iter().enumerate().map(|(index, topic)| (Role::Camera(index), topic)));
        notes.extend(left_out);
    }
    Ok(ChosenTopics { roles, notes })
}

/// Image topics that have a `camera_info` in their namespace, one for each, by name: compressed images before raw ones.
fn cameras(topics: &Topics, images: &[&String]) -> CameraTopics {
    let mut by_info: BTreeMap<String, Vec<&String>> = BTreeMap::new();
    let mut notes = Vec::new();
    for topic in images {
        let info = infos(topic).into_iter().find(|info| topics.get(info).is_some_and(|kind| kind == CAMERA_INFO));
        match info {
            Some(info) => by_info.entry(info).or_default().push(topic),
            None => notes.push(format!("{topic}: no camera_info in its namespace; --topic camera.0={topic} takes it")),
        }
    }
    let mut chosen = Vec::new();
    for mut candidates in by_info.into_values() {
        // The bytes of compressed images are kept; raw images must be compressed here.
        candidates.sort_by_key(|topic| (topics[*topic] != "sensor_msgs/CompressedImage", topic.len(), *topic));
        let first = candidates[0];
        let others = &candidates[1..];
        notes.extend(others.iter().map(|topic| format!("{topic}: not taken, {first} shows the same camera")));
        chosen.push(first.clone());
    }
    CameraTopics { chosen, notes }
}

/// Names that the `camera_info` of an image topic may have: in its namespace, or in the namespace of the raw image of a
/// compressed one.
fn infos(topic: &str) -> Vec<String> {
    let parents = std::iter::successors(Some(topic), |topic| topic.rsplit_once('/').map(|(parent, _)| parent));
    parents.skip(1).take(2).map(|parent| format!("{parent}/camera_info")).collect()
}

fn listed(topics: &[&String]) -> String {
    topics.iter().map(|topic| topic.as_str()).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests;
