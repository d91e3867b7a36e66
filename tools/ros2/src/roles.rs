//! The roles that topics have.

use anyhow::{bail, ensure};
use import::LiveSensor;
use std::fmt;

/// Largest index of cameras and LiDARs that an option may name.
const MAX_INDEX: usize = 255;

/// Use of a topic.
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

/// An invalid `--topic`.
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

    /// The option of the role's target.
    pub fn option(&self) -> &'static str {
        match self {
            Self::Camera(_) | Self::Mosaic(_) => "--cameras",
            Self::Imu => "--imu",
            Self::Gnss | Self::Nmea => "--nmea",
            Self::Lidar(_) => "--lidar",
        }
    }

    /// Rejects types that do not fit the role.
    pub fn check(&self, topic: &str, kind: &str) -> anyhow::Result<()> {
        let sensor = LiveSensor::from_type(kind);
        if matches!(self, Self::Lidar(_)) && sensor == Some(LiveSensor::Clouds) {
            bail!("{self}={topic}: {}", clouds_refusal(kind));
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

/// Explains why clouds are refused, with a remedy.
pub fn clouds_refusal(kind: &str) -> String {
    format!(
        "{kind} is not taken live, because a cloud has lost the packets' times and returns; let acquire.listen receive the packets of \
         the sensor itself or take the driver's topic of packets, or record a bag and import it with `replica import`"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wishes_name_a_role_and_a_topic() {
        assert_eq!(Role::parse_wish("camera.3=/a=b"), Ok((Role::Camera(3), "/a=b".into())));
        assert_eq!(Role::parse_wish("mosaic.hs02=/h"), Ok((Role::Mosaic("hs02".into()), "/h".into())));
        assert_eq!(Role::parse_wish("lidar.1=/p"), Ok((Role::Lidar(1), "/p".into())));
        assert_eq!(Role::parse_wish("imu"), Err(WishError::NoTopic));
        assert_eq!(Role::parse_wish("imu=data"), Err(WishError::Relative("data".into())));
        for role in ["mosaic.../x", "mosaic.", "camera.256", "camera.-1", "lidar.0", "points"] {
            assert_eq!(Role::parse_wish(&format!("{role}=/a")), Err(WishError::Role(role.into())));
        }
    }
}
