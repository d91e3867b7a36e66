//! `--other-lidar` of `replica rig new`.

use drive::manifest::LidarEntry;
use geometry::{Pose, Translation3, UnitQuaternion};
use lidar::Model;
use rig::rotation;

/// A secondary LiDAR: `NAME=MODEL@X,Y,Z` or `NAME=MODEL@X,Y,Z@ROTATION`.
#[derive(Clone, Debug, PartialEq)]
pub struct SecondaryLidar {
    name: String,
    model: Model,
    body_from_lidar: Pose,
}

impl SecondaryLidar {
    /// The entry of the LiDAR in `drive.toml`; its files are in a folder with its name.
    pub fn entry(&self, format: &str) -> LidarEntry {
        let folder = format!("lidar_{}", self.name);
        let entry = LidarEntry::new(self.model.name(), format, &folder, self.body_from_lidar.into());
        LidarEntry { name: Some(self.name.clone()), ..entry }
    }
}

pub fn parse(text: &str) -> Result<SecondaryLidar, String> {
    let rule = || {
        "must be NAME=MODEL@X,Y,Z or NAME=MODEL@X,Y,Z@ROTATION, for example rear=vlp16@-1.4,0,1.3@rpy deg 0,0,180"
            .to_owned()
    };
    let (name, rest) = text.split_once('=').ok_or_else(rule)?;
    let mut parts = rest.splitn(3, '@');
    let (model, position) = parts.next().zip(parts.next()).ok_or_else(rule)?;
    let is_word = !name.is_empty() && name.bytes().all(|byte| byte.is_ascii_alphanumeric() || byte == b'_');
    if !is_word {
        return Err(format!("name {name:?} must be a word of letters, digits and _"));
    }
    let model = Model::from_name(model).ok_or_else(|| format!("model {model:?} must be one of {}", Model::names()))?;
    let numbers: Option<Vec<f64>> = position.split(',').map(|number| number.trim().parse().ok()).collect();
    let numbers = numbers.filter(|numbers| numbers.iter().all(|number| number.is_finite()));
    let position: [f64; 3] = numbers.and_then(|numbers| numbers.try_into().ok()).ok_or_else(rule)?;
    let rotation = match parts.next() {
        Some(text) => rotation::parse(text).map_err(|error| error.to_string())?,
        None => UnitQuaternion::identity(),
    };
    Ok(SecondaryLidar {
        name: name.to_owned(),
        model,
        body_from_lidar: Pose::from_parts(Translation3::from(position), rotation),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_lidar_has_name_model_and_mounting() {
        let found = parse("rear=vlp16@-1.4,0,1.3").expect("valid").entry("pcap");
        assert_eq!(
            (found.name.as_deref(), found.model.as_str(), found.folder.as_str()),
            (Some("rear"), "vlp16", "lidar_rear")
        );
        assert_eq!(found.body_from_lidar.translation, [-1.4, 0.0, 1.3]);
        let turned = parse("rear=vlp16@0,0,1@rpy deg 0,0,180").expect("valid").entry("pcd");
        assert!((turned.body_from_lidar.rotation[2].abs() - 1.0).abs() < 1e-12, "{turned:?}");
        for (text, part) in [
            ("vlp16@0,0,1", "must be NAME=MODEL"),
            ("a b=vlp16@0,0,1", "must be a word"),
            ("a=vlp17@0,0,1", "must be one of"),
            ("a=vlp16@0,1", "must be NAME=MODEL"),
            ("a=vlp16@0,0,nan", "must be NAME=MODEL"),
        ] {
            let error = parse(text).expect_err("refused");
            assert!(error.contains(part), "{error}");
        }
    }
}
