//! Which topic is which sensor.

use crate::arguments::Args;
use anyhow::{bail, ensure};
use import::LiveSensor;
use std::collections::BTreeMap;
use std::fmt;

/// Most cameras, and most LiDARs, that an option may name.
const MAX_INDEX: usize = 255;
const CAMERA_INFO: &str = "sensor_msgs/CameraInfo";

/// What a topic is used for.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Role {
    /// Images of the camera of this index.
    Camera(usize),
    /// Images of the mosaic camera of this folder.
    Mosaic(String),
    Imu,
    /// Positions.
    Gnss,
    /// Sentences.
    Nmea,
    /// Packets of the LiDAR of this index.
    Lidar(usize),
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Camera(index) => write!(f, "camera.{index}"),
            Self::Mosaic(folder) => write!(f, "mosaic.{folder}"),
            Self::Imu => f.write_str("imu"),
            Self::Gnss => f.write_str("gnss"),
            Self::Nmea => f.write_str("nmea"),
            Self::Lidar(0) => f.write_str("lidar"),
            Self::Lidar(index) => write!(f, "lidar.{index}"),
        }
    }
}

/// A `--topic` that cannot be followed.
#[derive(Debug, PartialEq, Eq, thiserror::Error)]
pub enum WishError {
    #[error("must be ROLE=TOPIC")]
    NoTopic,
    #[error("topic {0:?} must begin with /")]
    Relative(String),
    #[error("role {0:?} must be camera.0 and so on, mosaic.FOLDER, imu, gnss, nmea, lidar, or lidar.1 and so on")]
    Role(String),
}

impl Role {
    /// Reads `ROLE=TOPIC`.
    pub fn parse_wish(text: &str) -> Result<(Self, String), WishError> {
        let (role, topic) = text.split_once('=').ok_or(WishError::NoTopic)?;
        if !topic.starts_with('/') {
            return Err(WishError::Relative(topic.into()));
        }
        let index = |prefix: &str| role.strip_prefix(prefix)?.parse().ok().filter(|index| *index <= MAX_INDEX);
        let folder = role.strip_prefix("mosaic.").filter(|folder| {
            let is_plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '-');
            (1..=64).contains(&folder.len()) && folder.chars().all(is_plain)
        });
        let found = match role {
            "imu" => Some(Self::Imu),
            "gnss" => Some(Self::Gnss),
            "nmea" => Some(Self::Nmea),
            "lidar" => Some(Self::Lidar(0)),
            _ => index("camera.")
                .map(Self::Camera)
                .or_else(|| index("lidar.").filter(|index| *index > 0).map(Self::Lidar))
                .or_else(|| folder.map(|folder| Self::Mosaic(folder.into()))),
        };
        found.map(|found| (found, topic.to_owned())).ok_or_else(|| WishError::Role(role.into()))
    }

    /// Whether the role's data have a target.
    pub fn has_target(&self, args: &Args) -> bool {
        match self {
            Self::Camera(_) | Self::Mosaic(_) => args.cameras.is_some(),
            Self::Imu => args.imu.is_some(),
            Self::Gnss | Self::Nmea => args.nmea.is_some(),
            Self::Lidar(index) => *index < args.lidar.len(),
        }
    }

    /// The option of the role's target.
    pub fn option(&self) -> &'static str {
        match self {
            Self::Camera(_) | Self::Mosaic(_) => "--cameras",
            Self::Imu => "--imu",
            Self::Gnss | Self::Nmea => "--nmea",
            Self::Lidar(_) => "--lidar",
        }
    }

    /// Refuses types that cannot have the role.
    pub fn check(&self, topic: &str, kind: &str) -> anyhow::Result<()> {
        let sensor = LiveSensor::of_type(kind);
        if matches!(self, Self::Lidar(_)) && sensor == Some(LiveSensor::Clouds) {
            bail!("{self}={topic}: {}", of_clouds(kind));
        }
        let fits = match self {
            Self::Camera(_) | Self::Mosaic(_) => LiveSensor::Camera,
            Self::Imu => LiveSensor::Imu,
            Self::Gnss => LiveSensor::Fixes,
            Self::Nmea => LiveSensor::Sentences,
            Self::Lidar(_) => LiveSensor::Packets,
        };
        ensure!(sensor == Some(fits), "{self}={topic}: messages of type {kind} cannot have this role");
        Ok(())
    }
}

/// Why clouds are refused, and what to do.
fn of_clouds(kind: &str) -> String {
    format!(
        "{kind} is not taken live, because a cloud has lost the packets' times and returns; let acquire.listen receive the packets of \
         the sensor itself or take the driver's topic of packets, or record a bag and import it with `replica import`"
    )
}

/// Topics with their types, as they were found.
pub type Topics = BTreeMap<String, String>;

/// Chooses by type what `--topic` does not name, for the targets that are given. Returns the choice, and lines on what is left out.
pub fn choose(topics: &Topics, args: &Args) -> anyhow::Result<(BTreeMap<Role, String>, Vec<String>)> {
    let mut roles = BTreeMap::new();
    let mut notes = Vec::new();
    let is_wished = |role: &Role| args.topics.iter().any(|(wished, _)| wished == role);
    let of = |sensor: LiveSensor| -> Vec<&String> {
        let is_free = |topic: &&String| args.topics.iter().all(|(_, wished)| wished != *topic);
        let found = topics.iter().filter(|(_, kind)| LiveSensor::of_type(kind) == Some(sensor));
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
        if !role.has_target(args) || is_wished(&role) || is_receiver && receiver_is_wished {
            continue;
        }
        let mut found = of(sensor);
        // Packets of an Ouster's IMU have the type of those of its LiDAR.
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
    let wants_lidar = Role::Lidar(0).has_target(args) && !is_wished(&Role::Lidar(0));
    if wants_lidar && !roles.contains_key(&Role::Lidar(0)) {
        notes.extend(of(LiveSensor::Clouds).into_iter().map(|topic| format!("{topic}: {}", of_clouds(&topics[topic]))));
    }
    let names_cameras = args.topics.iter().any(|(role, _)| matches!(role, Role::Camera(_) | Role::Mosaic(_)));
    if args.cameras.is_some() && !names_cameras {
        let (cameras, left_out) = cameras(topics, &of(LiveSensor::Camera));
        roles.extend(cameras.into_iter().enumerate().map(|(index, topic)| (Role::Camera(index), topic)));
        notes.extend(left_out);
    }
    Ok((roles, notes))
}

/// Image topics that have a `camera_info` in their namespace, one for each, by name: compressed images before raw ones.
fn cameras(topics: &Topics, images: &[&String]) -> (Vec<String>, Vec<String>) {
    let mut by_info: BTreeMap<String, Vec<&String>> = BTreeMap::new();
    let mut notes = Vec::new();
    for topic in images {
        let info = infos(topic).into_iter().find(|info| topics.get(info).is_some_and(|kind| kind == CAMERA_INFO));
        match info {
            Some(info) => by_info.entry(info).or_default().push(topic),
            None => notes.push(format!("{topic}: no camera_info beside it; --topic camera.0={topic} takes it")),
        }
    }
    let mut chosen = Vec::new();
    for mut candidates in by_info.into_values() {
        // The bytes of compressed images are kept, and raw ones must be compressed here.
        candidates.sort_by_key(|topic| (topics[*topic] != "sensor_msgs/CompressedImage", topic.len(), *topic));
        let first = candidates[0];
        let others = &candidates[1..];
        notes.extend(others.iter().map(|topic| format!("{topic}: not taken, {first} shows the same camera")));
        chosen.push(first.clone());
    }
    (chosen, notes)
}

/// Names that the `camera_info` of an image topic may have: beside it, or beside the raw image of a compressed one.
fn infos(topic: &str) -> Vec<String> {
    let parents = std::iter::successors(Some(topic), |topic| topic.rsplit_once('/').map(|(parent, _)| parent));
    parents.skip(1).take(2).map(|parent| format!("{parent}/camera_info")).collect()
}

fn listed(topics: &[&String]) -> String {
    topics.iter().map(|topic| topic.as_str()).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests;
