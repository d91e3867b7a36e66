//! Lidars and their mountings.

use formats::velodyne::Model;
use geometry::{Isometry3, Pose, UnitQuaternion, Vector3};
use random::Random;
use simulation::rig::RigSpec;

/// The lidar and its mounting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mount {
    /// The HDL-32E of the L3D2 vehicle.
    Rig,
    /// With equal probability: either the same with random errors of up to 3 degrees and 20 cm; or an HDL-64E, HDL-32E or VLP-16
    /// upright on a roof, 1.6 to 2.4 m above the road.
    Random,
    /// The HDL-64E of KITTI, upright 1.73 m above the road.
    Kitti,
}

impl Mount {
    /// Model and `body_from_lidar`, which may be random.
    pub(crate) fn lidar(self, random: &mut Random) -> (Model, Pose) {
        let mut near = |degrees: f32| f64::from(random.range(-degrees, degrees)).to_radians();
        let jitter = UnitQuaternion::from_euler_angles(near(3.0), near(3.0), near(3.0));
        let rig = RigSpec::l3d2().lidar.body_from_lidar;
        match self {
            Self::Rig => (Model::Hdl32e, rig),
            // The body frame is 1 m above the road.
            Self::Kitti => (Model::Hdl64e, Isometry3::translation(0.0, 0.0, 0.73)),
            Self::Random if random.chance(0.5) => {
                let moved = Vector3::from_fn(|_, _| f64::from(random.range(-0.2, 0.2)));
                let pose = Isometry3::from_parts((rig.translation.vector + moved).into(), rig.rotation * jitter);
                (Model::Hdl32e, pose)
            }
            Self::Random => {
                let height = f64::from(random.range(0.6, 1.4));
                let along = f64::from(random.range(-1.0, 0.5));
                let model = [Model::Hdl64e, Model::Hdl64e, Model::Hdl32e, Model::Vlp16][random.index(4)];
                (model, Isometry3::from_parts(Vector3::new(along, 0.0, height).into(), jitter))
            }
        }
    }
}
