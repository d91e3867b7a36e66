//! Lidars and their mountings.

use geometry::{Isometry3, Pose, UnitQuaternion, Vector3};
use lidar::velodyne::Model;
use random::Random;
use simulation::rig::RigSpec;
use simulation::sensors::lidar::{LidarErrors, Pattern};

/// The lidar and its mounting.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mount {
    /// The HDL-32E of the L3D2 vehicle.
    Rig,
    /// A lidar of any model on any vehicle:
    ///
    /// - in three of ten cases the lidar of [`Mount::Rig`], with random errors of up to 3 degrees and 20 cm; otherwise a
    ///   lidar on a roof, 1 to 3 m above the road, upright within 3 degrees: an HDL-64E (three of eight), HDL-32E,
    ///   VLP-32C, VLP-16, or one of each [`Pattern`];
    /// - its unit is perfect, typical or poor ([`LidarErrors`]); units with patterns are perfect;
    /// - one of four has no rings.
    Random,
    /// A perfect unit, upright on a roof.
    Roof {
        /// Its model.
        model: Model,
        /// Height above the road, m.
        height_m: f64,
        /// Whether its driver numbers the rings.
        has_rings: bool,
    },
    /// A perfect unit with a pattern, not a Velodyne, upright on a roof 1.73 m above the road.
    Pattern(Pattern),
}

/// A lidar without its mounting.
pub(crate) enum Unit {
    Rotating { model: Model, errors: LidarErrors },
    Pattern(Pattern),
}

/// A lidar on a vehicle.
pub(crate) struct MountedLidar {
    pub unit: Unit,
    pub body_from_lidar: Pose,
    /// Whether its driver numbers the rings.
    pub has_rings: bool,
}

/// Height of the body frame above the road, m.
const BODY_M: f64 = 1.0;
/// Height of KITTI's lidar above the road, m.
pub(crate) const KITTI_M: f64 = 1.73;

impl Mount {
    /// The HDL-64E of KITTI, 1.73 m above the road.
    pub const KITTI: Self = Self::Roof { model: Model::Hdl64e, height_m: KITTI_M, has_rings: true };

    /// The lidar of this mount, which may be random.
    pub(crate) fn lidar(self, random: &mut Random) -> MountedLidar {
        // Drawn for every mount, so that the following random numbers, which give the noise, stay the same.
        let mut near = |degrees: f32| f64::from(random.range(-degrees, degrees)).to_radians();
        let jitter = UnitQuaternion::from_euler_angles(near(3.0), near(3.0), near(3.0));
        let rig = RigSpec::l3d2().lidar.body_from_lidar;
        let perfect = |model| Unit::Rotating { model, errors: LidarErrors::NONE };
        let roof = |height_m: f64| Isometry3::translation(0.0, 0.0, height_m - BODY_M);
        match self {
            Self::Rig => MountedLidar { unit: perfect(Model::Hdl32e), body_from_lidar: rig, has_rings: true },
            Self::Roof { model, height_m, has_rings } => {
                MountedLidar { unit: perfect(model), body_from_lidar: roof(height_m), has_rings }
            }
            Self::Pattern(pattern) => MountedLidar {
                unit: Unit::Pattern(pattern),
                body_from_lidar: roof(KITTI_M),
                has_rings: pattern.n_rings() > 0,
            },
            Self::Random => random_lidar(rig, jitter, random),
        }
    }
}

/// Kinds of lidar of a random vehicle.
#[derive(Clone, Copy)]
enum Kind {
    Rotating(Model),
    Pattern(Pattern),
}

fn random_lidar(rig: Pose, jitter: UnitQuaternion<f64>, random: &mut Random) -> MountedLidar {
    let (lidar, body_from_lidar) = if random.chance(0.3) {
        let moved = Vector3::from_fn(|_, _| f64::from(random.range(-0.2, 0.2)));
        (
            Kind::Rotating(Model::Hdl32e),
            Isometry3::from_parts((rig.translation.vector + moved).into(), rig.rotation * jitter),
        )
    } else {
        // Half of the vehicles are cars.
        let height_m = if random.chance(0.5) { random.range(1.5, 2.1) } else { random.range(1.0, 3.0) };
        let along_m = random.range(-1.0, 0.5);
        let position = Vector3::new(f64::from(along_m), 0.0, f64::from(height_m) - BODY_M);
        let hdl64e = Kind::Rotating(Model::Hdl64e);
        let others = [Model::Hdl32e, Model::Vlp32c, Model::Vlp16].map(Kind::Rotating);
        let patterns = [Pattern::Rings128, Pattern::Rosette].map(Kind::Pattern);
        let kinds = [&[hdl64e; 3], &others[..], &patterns].concat();
        (*random.pick(&kinds), Isometry3::from_parts(position.into(), jitter))
    };
    let grade = *random.pick(&[LidarErrors::NONE, LidarErrors::TYPICAL, LidarErrors::POOR]);
    let errors = LidarErrors { unit_seed: random.bits(), ..grade };
    let unit = match lidar {
        Kind::Rotating(model) => Unit::Rotating { model, errors },
        Kind::Pattern(pattern) => Unit::Pattern(pattern),
    };
    let has_rings = random.chance(0.75) && !matches!(lidar, Kind::Pattern(pattern) if pattern.n_rings() == 0);
    MountedLidar { unit, body_from_lidar, has_rings }
}
