//! The LiDARs of a rig file: one table `[lidar]`, or several tables `[[lidar]]`.

use super::{RawLidar, one_of, pose};
use crate::rig::{LidarSpec, OtherLidarSpec};
use files::toml_file::TomlFile;
use lidar::velodyne::Model;
use messages::MAX_LIDARS;
use std::collections::BTreeSet;

/// The LiDARs of a rig.
pub(super) struct RigLidars {
    pub first: LidarSpec,
    pub first_name: Option<String>,
    pub others: Vec<OtherLidarSpec>,
}

/// Checks the LiDARs; `None` if one of them has problems.
pub(super) fn lidars(file: &mut TomlFile, raws: Vec<Option<RawLidar>>) -> Option<RigLidars> {
    let n = raws.len();
    file.rule("lidar", n <= MAX_LIDARS, || format!("{n} LiDARs; at most {MAX_LIDARS} are supported"));
    let mut names = BTreeSet::new();
    let mut found = Vec::new();
    for (index, raw) in raws.into_iter().enumerate() {
        let key = if n == 1 { "lidar".to_owned() } else { format!("lidar[{index}]") };
        let raw = raw?;
        let spec = lidar(file, &key, &raw);
        // The name is used in the name of a folder of the drive.
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        let name = raw.name.unwrap_or_default();
        let is_word = !name.is_empty() && name.chars().all(plain) && names.insert(name.clone());
        file.rule(&format!("{key}.name"), n == 1 || is_word, || {
            format!("value {name:?} must be a name of its own: a to z, 0 to 9, _")
        });
        found.push(OtherLidarSpec { name, lidar: spec? });
    }
    let mut found = found.into_iter();
    let OtherLidarSpec { name, lidar: first } = found.next()?;
    let first_name = Some(name).filter(|name| !name.is_empty());
    Some(RigLidars { first, first_name, others: found.collect() })
}

fn lidar(file: &mut TomlFile, key: &str, raw: &RawLidar) -> Option<LidarSpec> {
    let body_from_lidar = pose(file, &format!("{key}.mounting"), &raw.mounting);
    let model = one_of(file, &format!("{key}.model"), &raw.model, &Model::ALL, |model| model.name())?;
    Some(LidarSpec { model, body_from_lidar })
}
