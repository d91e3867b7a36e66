//! The built-in rigs.

use super::spec::RigSpec;
use std::path::Path;

/// Names and texts of the built-in rigs, the default one first.
const BUILT_IN: [(&str, &str); 5] = [
    ("l3d2", include_str!("../../rigs/l3d2.toml")),
    ("survey", include_str!("../../rigs/survey.toml")),
    ("nuscenes", include_str!("../../rigs/nuscenes.toml")),
    ("kitti", include_str!("../../rigs/kitti.toml")),
    ("twin", include_str!("../../rigs/twin.toml")),
];

impl RigSpec {
    /// Name of the default rig.
    pub const DEFAULT: &str = "l3d2";

    /// The default rig, the vehicle of the thesis.
    pub fn l3d2() -> Self {
        Self::built_in(Self::DEFAULT).expect("a test reads all built-in rigs")
    }

    /// Names of the built-in rigs.
    pub fn built_in_names() -> impl Iterator<Item = &'static str> {
        BUILT_IN.into_iter().map(|(name, _)| name)
    }

    /// A built-in rig by name.
    pub fn built_in(name: &str) -> Option<Self> {
        let (name, text) = BUILT_IN.into_iter().find(|(known, _)| *known == name)?;
        Self::from_toml(Path::new(name), text).ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::Vector3;

    #[test]
    fn built_in_rigs_parse() {
        for (name, text) in BUILT_IN {
            match RigSpec::from_toml(Path::new(name), text) {
                Ok(rig) => assert_eq!(rig.name, name),
                Err(error) => panic!("{error}"),
            }
        }
        assert_eq!(RigSpec::built_in("unknown"), None);
    }

    #[test]
    fn l3d2_lidar_axis_is_tilted_30_degrees_to_the_back() {
        let body_from_lidar = RigSpec::l3d2().lidar.body_from_lidar;
        let expected = Vector3::new(-30.0_f64.to_radians().cos(), 0.0, 0.5);
        assert!((body_from_lidar * Vector3::z() - expected).norm() < 1e-12);
        assert!((body_from_lidar * Vector3::y() - Vector3::y()).norm() < 1e-12);
    }

    #[test]
    fn l3d2_cameras_have_their_directions() {
        let rig = RigSpec::l3d2();
        assert_eq!((rig.cameras.len(), rig.mosaics.len()), (6, 2));
        for (k, camera) in rig.cameras.iter().take(5).enumerate() {
            let yaw = -72.0_f64.to_radians() * k as f64;
            let outward = Vector3::new(yaw.cos(), yaw.sin(), 0.0);
            let pose = camera.body_from_camera;
            assert!((pose * Vector3::z() - outward).norm() < 1e-9);
            assert!((pose * Vector3::y() + Vector3::z()).norm() < 1e-9, "image rows run down");
            let from_head = pose.translation.vector - Vector3::new(-0.4, 0.0, 2.2);
            assert!((from_head - outward * 0.042).norm() < 2e-6, "{from_head}");
        }
        let up = rig.cameras[5].body_from_camera;
        assert!((up * Vector3::z() - Vector3::z()).norm() < 1e-9);
        assert!((up * Vector3::y() - Vector3::x()).norm() < 1e-9, "its image has the back at the top");
        for mosaic in &rig.mosaics {
            let pose = mosaic.body_from_camera;
            assert!((pose * Vector3::z() - Vector3::y()).norm() < 1e-9);
            assert!((pose * Vector3::x() - Vector3::x()).norm() < 1e-9, "forward is right of a look to the left");
        }
    }
}
