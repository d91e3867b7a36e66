//! Sweeps of simulated towns with their truth, cast on the fly, as submaps: what models learn from and are scored on.

use anyhow::Context;
use geometry::{Isometry3, Pose, UnitQuaternion, Vector3};
use learning::Random;
use messages::{MAX_SWEEPS_PER_SUBMAP, SubmapHeader, SubmapPoint, SubmapSweep};
use simulation::sensors::lidar::{BLOCK_NANOS, Lidar, N_LASERS, elevation};
use simulation::{DriveSpec, Simulation, Town, rig};

/// Lidar packets of one revolution.
const PACKETS_PER_TURN: u64 = 181;

/// How the lidar is mounted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mount {
    /// As on the L3D2 vehicle.
    Rig,
    /// As on the L3D2 vehicle within 3 degrees and 20 cm, or upright on a roof 1.6 to 2.4 m high, one like the other.
    Random,
}

/// A submap with the class of every point.
pub struct TownSubmap {
    /// As slam_aggregate would write it, with true poses.
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
    /// Submaps of `n_sweeps` sweeps, each `stride` revolutions after the one before, at even places of the drive.
    ///
    /// # Errors
    /// If the drive cannot be made.
    pub fn submaps(&self, n: usize, n_sweeps: usize, stride: u64, mount: Mount) -> anyhow::Result<Vec<TownSubmap>> {
        let spec = DriveSpec { town: self.town, ..DriveSpec::urban(self.seed, self.seconds) };
        let simulation = Simulation::new(&spec).with_context(|| format!("town of seed {}", self.seed))?;
        let n_turns = (self.seconds * 10.0).floor() as u64;
        let span = n_sweeps as u64 * stride;
        anyhow::ensure!(span <= n_turns, "{n_sweeps} sweeps at {stride} revolutions need more than {} s", self.seconds);
        let first = |i: usize| (n_turns - span) * i as u64 / (n.max(2) - 1) as u64;
        Ok((0..n).map(|i| self.submap(&simulation, first(i), n_sweeps, stride, i, mount)).collect())
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
        let body_from_lidar = mount.body_from_lidar(&mut random);
        let seed = self.seed ^ (index as u64) << 32;
        let lidar = Lidar::new(&simulation.scene, &simulation.motion, body_from_lidar, seed, 1);
        let begin = lidar.packet_stamp(first_turn * PACKETS_PER_TURN);
        let submap_from_world = simulation.motion.pose_at(begin).inverse();
        let pose_at =
            |nanos: i64| submap_from_world * simulation.motion.pose_at(begin.plus_nanos(nanos)) * body_from_lidar;
        let mut submap = TownSubmap { header: Box::default(), points: Vec::new(), truth: Vec::new() };
        submap.header.n_rings = N_LASERS as u32;
        let ring_of_laser = rings();
        for sweep in 0..n_sweeps.min(MAX_SWEEPS_PER_SUBMAP) {
            let turn = first_turn + sweep as u64 * stride;
            let stamp = lidar.packet_stamp(turn * PACKETS_PER_TURN);
            let since_begin = stamp.0 - begin.0;
            let duration_nanos = (PACKETS_PER_TURN as i64 * 12 * BLOCK_NANOS) as u32;
            let first_point = submap.points.len();
            for packet in 0..PACKETS_PER_TURN {
                for (i, block) in lidar.packet(turn * PACKETS_PER_TURN + packet).iter().enumerate() {
                    let nanos = (packet as i64 * 12 + i as i64) * BLOCK_NANOS;
                    let submap_from_lidar = pose_at(since_begin + nanos);
                    for (laser, found) in block.returns.iter().enumerate() {
                        let Some(found) = found else { continue };
                        let range_m = f64::from(found.range_2mm) * 0.002;
                        // Within a round of firings the head turns by up to 0.13 deg: a laser's own angle.
                        let turned = laser as f64 * 1_152.0 / 1e8 * std::f64::consts::TAU;
                        let azimuth = f64::from(block.azimuth) * 1e-2_f64.to_radians() + turned;
                        let up = f64::from(elevation(laser));
                        let ray = Vector3::new(up.cos() * azimuth.cos(), -up.cos() * azimuth.sin(), up.sin());
                        let at = submap_from_lidar * nalgebra_point(ray * range_m);
                        submap.points.push(SubmapPoint {
                            x: at.x as f32,
                            y: at.y as f32,
                            z: at.z as f32,
                            offset_nanos: nanos as u32,
                            azimuth: block.azimuth,
                            elevation: (f64::from(elevation(laser)).to_degrees() * 100.0).round() as i16,
                            sweep_idx: sweep as u16,
                            intensity: found.intensity,
                            ring: ring_of_laser[laser],
                            ..SubmapPoint::default()
                        });
                        submap.truth.push(found.class as u8);
                    }
                }
            }
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

fn nalgebra_point(v: Vector3<f64>) -> geometry::Point3<f64> {
    geometry::Point3::from(v)
}

/// x y z, qx qy qz qw.
fn row(pose: &Pose) -> [f32; 7] {
    let (t, q) = (pose.translation.vector, pose.rotation.coords);
    [t.x, t.y, t.z, q.x, q.y, q.z, q.w].map(|v| v as f32)
}

/// Rank of each laser by elevation, 0 = lowest.
fn rings() -> [u8; N_LASERS] {
    std::array::from_fn(|laser| (0..N_LASERS).filter(|&other| elevation(other) < elevation(laser)).count() as u8)
}

impl Mount {
    fn body_from_lidar(self, random: &mut Random) -> Pose {
        let mut near = |degrees: f32| f64::from(random.range(-degrees, degrees)).to_radians();
        let jitter = UnitQuaternion::from_euler_angles(near(3.0), near(3.0), near(3.0));
        let rig = rig::body_from_lidar();
        match self {
            Self::Rig => rig,
            Self::Random if random.chance(0.5) => {
                let moved = Vector3::from_fn(|_, _| f64::from(random.range(-0.2, 0.2)));
                Isometry3::from_parts((rig.translation.vector + moved).into(), rig.rotation * jitter)
            }
            // The body frame is 1 m above the road.
            Self::Random => {
                let height = f64::from(random.range(0.6, 1.4));
                let along = f64::from(random.range(-1.0, 0.5));
                Isometry3::from_parts(Vector3::new(along, 0.0, height).into(), jitter)
            }
        }
    }
}
