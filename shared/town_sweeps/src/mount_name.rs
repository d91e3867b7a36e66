//! Names of mounts, for command lines.

use crate::mount::Mount;

impl Mount {
    /// The mounts that have a name. A further one is a line here.
    pub const NAMED: &[(&'static str, Self)] = &[("rig", Self::Rig), ("kitti", Self::Kitti)];

    /// The mount of a name; `None` if there is no such name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::NAMED.iter().find(|(known, _)| *known == name).map(|(_, mount)| *mount)
    }
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
