//! Names of mounts, for command lines.

use crate::mount::{KITTI_M, Mount};
use lidar::velodyne::Model;
use simulation::sensors::lidar::Pattern;

impl Mount {
    /// The mounts that have a name.
    pub const NAMED: &[(&'static str, Self)] = &[
        ("rig", Self::Rig),
        ("kitti", Self::KITTI),
        ("hdl32e", roof(Model::Hdl32e, KITTI_M, true)),
        ("hdl32e_low", roof(Model::Hdl32e, 1.0, true)),
        ("hdl32e_high", roof(Model::Hdl32e, 3.0, true)),
        ("vlp32c", roof(Model::Vlp32c, KITTI_M, true)),
        ("vlp16", roof(Model::Vlp16, KITTI_M, true)),
        ("no_rings", roof(Model::Hdl64e, KITTI_M, false)),
        ("rings128", Self::Pattern(Pattern::Rings128)),
        ("rosette", Self::Pattern(Pattern::Rosette)),
    ];

    /// The mount with this name; `None` if there is no such name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::NAMED.iter().find(|(known, _)| *known == name).map(|(_, mount)| *mount)
    }
}

const fn roof(model: Model, height_m: f64, has_rings: bool) -> Mount {
    Mount::Roof { model, height_m, has_rings }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_gives_its_own_mount() {
        for (index, (name, mount)) in Mount::NAMED.iter().enumerate() {
            assert_eq!(Mount::from_name(name), Some(*mount));
            assert!(Mount::NAMED[..index].iter().all(|(other, of)| other != name && of != mount), "{name}");
        }
        assert_eq!(Mount::from_name("Rig"), None);
    }
}
