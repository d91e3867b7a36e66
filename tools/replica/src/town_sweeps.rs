//! Sweeps of simulated towns with their truth, cast on the fly, as submaps: what models learn from and are scored on.

use anyhow::Context;
use formats::velodyne::Model;
use geometry::{Isometry3, Point3, Pose, UnitQuaternion, Vector3};
use learning::Random;
use messages::{MAX_SWEEPS_PER_SUBMAP, SubmapHeader, SubmapPoint, SubmapSweep};
use simulation::rig::RigSpec;
use simulation::sensors::lidar::{Block, Lidar, LidarModel};
use simulation::{DriveSpec, Simulation, Town};

/// Length of a revolution, s.
const TURN_SECONDS: f64 = 0.1;
/// Noise of the ranges, m: one sigma of the makers' data sheets.
const RANGE_SIGMA_M: f32 = 0.02;

/// Which lidar, and how it is mounted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mount {
    /// The HDL-32E of the L3D2 vehicle.
    Rig,
    /// That within 3 degrees and 20 cm; or upright on a roof, 1.6 to 2.4 m above the road, an HDL-64E, HDL-32E or VLP-16:
    /// the one like the other, by chance.
    Random,
    /// An HDL-64E upright 1.73 m above the road, as KITTI's.
    Kitti,
}

/// A submap with the class of every point.
pub struct TownSubmap {
    /// As `slam_aggregate` would write it, with true poses.
    pub header: Box<SubmapHeader>,
    /// Frame of the body at the first shot.
    pub points: Vec<SubmapPoint>,
    /// Class id by point.
    pub truth: Vec<u8>,
}

/// Which sweeps of which drive.
#[derive(Clone, Debug)]
pub struct TownDrive {
    /// Kind of town.
    pub town: Town,
    /// Of the drive.
    pub seed: u64,
    /// Length of the drive, s.
    pub seconds: f64,
}

impl TownDrive {
    /// The town, and the way through it.
    ///
    /// # Errors
    /// If the drive cannot be made.
    pub fn simulation(&self) -> anyhow::Result<Simulation> {
        let spec = DriveSpec { town: self.town, ..DriveSpec::urban(self.seed, self.seconds) };
        Simulation::new(&spec).with_context(|| format!("town of seed {}", self.seed))
    }

    /// Submaps of `n_sweeps` sweeps, each `stride` revolutions after the one before, at even places of the drive.
    ///
    /// # Errors
    /// If the drive cannot be made.
    pub fn submaps(&self, n: usize, n_sweeps: usize, stride: u64, mount: Mount) -> anyhow::Result<Vec<TownSubmap>> {
        self.submaps_in(&self.simulation()?, n, n_sweeps, stride, mount)
    }

    /// [`Self::submaps`] in this drive's [`Self::simulation`].
    ///
    /// # Errors
    /// If the drive is shorter than the submaps.
    pub fn submaps_in(
        &self,
        simulation: &Simulation,
        n: usize,
        n_sweeps: usize,
        stride: u64,
        mount: Mount,
    ) -> anyhow::Result<Vec<TownSubmap>> {
        let n_turns = (self.seconds * 10.0).floor() as u64;
        let span = n_sweeps as u64 * stride;
        anyhow::ensure!(span <= n_turns, "{n_sweeps} sweeps at {stride} revolutions need more than {} s", self.seconds);
        let first = |i: usize| (n_turns - span) * i as u64 / (n.max(2) - 1) as u64;
        Ok((0..n).map(|i| self.submap(simulation, first(i), n_sweeps, stride, i, mount)).collect())
    }

    fn submap(
        &self,
        simulation: &Simulation,
        first_turn: u64,
        n_sweeps: usize,
        stride: u64,
        index: usize,
        mount: Mount,
    ) -> TownSubmap {
        let mut random = Random::new(self.seed, index as u64);
        let (model, body_from_lidar) = mount.lidar(&mut random);
        let seed = self.seed ^ (index as u64) << 32;
        let lidar = simulation.lidar_of(LidarModel::of(model), body_from_lidar, seed);
        let packets_per_turn = lidar.model().n_packets(TURN_SECONDS);
        let begin = lidar.packet_stamp(first_turn * packets_per_turn);
        let submap_from_world = simulation.motion.pose_at(begin).inverse();
        let pose_at =
            |nanos: i64| submap_from_world * simulation.motion.pose_at(begin.plus_nanos(nanos)) * body_from_lidar;
        let mut submap = TownSubmap { header: Box::default(), points: Vec::new(), truth: Vec::new() };
        submap.header.n_rings = model.n_rings() as u32;
        for sweep in 0..n_sweeps.min(MAX_SWEEPS_PER_SUBMAP) {
            let turn = first_turn + sweep as u64 * stride;
            let stamp = lidar.packet_stamp(turn * packets_per_turn);
            let since_begin = stamp.0 - begin.0;
            let duration_nanos = packets_per_turn as u32 * model.packet_nanos();
            let first_point = submap.points.len();
            submap.push_turn(
                &lidar,
                turn * packets_per_turn..(turn + 1) * packets_per_turn,
                sweep,
                &mut random,
                |nanos| pose_at(since_begin + nanos),
            );
            submap.header.sweeps[sweep] = SubmapSweep {
                stamp: stamp.0,
                seq: turn,
                duration_nanos,
                first_point: first_point as u32,
                n_points: (submap.points.len() - first_point) as u32,
                reserved: 0,
                submap_from_lidar_begin: row(&pose_at(since_begin)),
                submap_from_lidar_end: row(&pose_at(since_begin + i64::from(duration_nanos))),
            };
        }
        submap.header.n_sweeps = n_sweeps as u32;
        submap
    }
}

impl TownSubmap {
    /// The returns of one revolution. `submap_from_lidar` takes ns after its begin.
    fn push_turn(
        &mut self,
        lidar: &Lidar<'_>,
        packets: std::ops::Range<u64>,
        sweep: usize,
        random: &mut Random,
        submap_from_lidar: impl Fn(i64) -> Pose,
    ) {
        let model = lidar.model().model;
        let rings = model.rings();
        for (packet, blocks) in (0..).zip(lidar.packets(packets)) {
            for (number, block) in blocks.iter().enumerate() {
                let block_nanos = model.firing_nanos(number, 0);
                let nanos = packet * i64::from(model.packet_nanos()) + i64::from(block_nanos);
                let submap_from_lidar = submap_from_lidar(nanos);
                for (index, found) in block.returns.iter().enumerate() {
                    let Some(found) = found else { continue };
                    let laser = laser_of(model, block, index);
                    let turned_nanos = model.firing_nanos(number, index) - block_nanos;
                    let carried = if model.carries_azimuth() { f64::from(turned_nanos) } else { 0.0 };
                    let turned_deg = carried * 1e-9 / TURN_SECONDS * 360.0;
                    let of_laser = &model.lasers()[laser];
                    let azimuth_deg =
                        (f64::from(block.azimuth) * 0.01 + turned_deg - of_laser.azimuth_deg).rem_euclid(360.0);
                    let (azimuth, up) = (azimuth_deg.to_radians(), of_laser.elevation_deg.to_radians());
                    let range_m = f64::from(found.range_m + RANGE_SIGMA_M * random.gauss());
                    let ray = Vector3::new(up.cos() * azimuth.cos(), -up.cos() * azimuth.sin(), up.sin());
                    let at = submap_from_lidar * Point3::from(ray * range_m);
                    self.points.push(SubmapPoint {
                        x: at.x as f32,
                        y: at.y as f32,
                        z: at.z as f32,
                        offset_nanos: nanos as u32,
                        azimuth: ((azimuth_deg * 100.0) as u16).min(35_999),
                        elevation: (of_laser.elevation_deg * 100.0).round() as i16,
                        sweep_idx: sweep as u16,
                        intensity: found.intensity,
                        ring: rings[laser],
                        ..SubmapPoint::default()
                    });
                    self.truth.push(found.class as u8);
                }
            }
        }
    }
}

/// Laser of a return of a block.
fn laser_of(model: Model, block: &Block, index: usize) -> usize {
    index % model.n_rings() + if block.is_lower { 32 } else { 0 }
}

/// x y z, qx qy qz qw.
fn row(pose: &Pose) -> [f32; 7] {
    let (t, q) = (pose.translation.vector, pose.rotation.coords);
    [t.x, t.y, t.z, q.x, q.y, q.z, q.w].map(|v| v as f32)
}

impl Mount {
    fn lidar(self, random: &mut Random) -> (Model, Pose) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{Quaternion, Translation3};
    use messages::{ClassId, GROUND_CLASSES};

    fn pose(row: &[f32; 7]) -> Isometry3<f32> {
        let [x, y, z, i, j, k, w] = *row;
        Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_quaternion(Quaternion::new(w, i, j, k)))
    }

    #[test]
    fn points_lie_where_their_laser_and_encoder_say() {
        for mount in [Mount::Rig, Mount::Random] {
            let drive = TownDrive { town: Town::Urban, seed: 9100, seconds: 2.0 };
            let submap = &drive.submaps(1, 2, 1, mount).expect("makes a town")[0];
            assert_eq!(submap.points.len(), submap.truth.len());
            assert_eq!(submap.header.n_sweeps, 2);
            for sweep in &submap.header.sweeps[..2] {
                let range = sweep.first_point as usize..(sweep.first_point + sweep.n_points) as usize;
                assert!(range.len() > 20_000, "{} returns", range.len());
                // A quarter of the turn, where the lidar of the rig looks at the houses; in 2 ms the vehicle moves by less than 2 cm.
                let [begin, end] = [&sweep.submap_from_lidar_begin, &sweep.submap_from_lidar_end].map(pose);
                let lidar_from_submap = begin.lerp_slerp(&end, 0.25).inverse();
                let is_sideward = |point: &&SubmapPoint| (24_000_000..26_000_000).contains(&point.offset_nanos);
                let mut n = 0;
                for point in submap.points[range].iter().filter(is_sideward) {
                    let seen = lidar_from_submap * Point3::new(point.x, point.y, point.z);
                    let range_m = seen.coords.norm();
                    if range_m < 4.0 {
                        continue;
                    }
                    let elevation_deg = (seen.z / range_m).asin().to_degrees();
                    assert!((elevation_deg - f32::from(point.elevation) * 0.01).abs() < 0.4, "{point:?}");
                    let azimuth_deg = (-seen.y).atan2(seen.x).to_degrees();
                    let off = (azimuth_deg - f32::from(point.azimuth) * 0.01 + 540.0).rem_euclid(360.0) - 180.0;
                    assert!(off.abs() < 0.5, "{off} at {point:?}");
                    n += 1;
                }
                assert!(n > 50, "{n} points looked at");
            }
        }
    }

    #[test]
    fn truth_stands_on_the_ground_and_repeats() {
        let drive = TownDrive { town: Town::Urban, seed: 9100, seconds: 2.0 };
        let make = || drive.submaps(1, 1, 1, Mount::Rig).expect("makes a town").remove(0);
        let submap = make();
        let mean_z = |is: &dyn Fn(u8) -> bool| {
            let of: Vec<f32> =
                submap.points.iter().zip(&submap.truth).filter(|(_, c)| is(**c)).map(|(p, _)| p.z).collect();
            of.iter().sum::<f32>() / of.len() as f32
        };
        // The body frame is 1 m above the road.
        let ground = mean_z(&|class| GROUND_CLASSES.iter().any(|of| *of as u8 == class));
        let building = mean_z(&|class| class == ClassId::Building as u8);
        assert!((ground + 1.0).abs() < 0.5 && building > ground + 1.5, "{ground} {building}");
        let again = make();
        assert!(again.points == submap.points && again.truth == submap.truth);
    }
}
