//! The lidar of a drive, and the returns of its turns.

use crate::mount::{MountedLidar, Unit};
use geometry::Stamp;
use lidar::velodyne::Model;
use messages::ClassId;
use simulation::Simulation;
use simulation::sensors::lidar::{Block, Firing, FiringReturn, Lidar, LidarModel, LidarReturn, PatternLidar};

/// Duration of a revolution, s, or of a sweep for a pattern without revolutions.
const TURN_SECONDS: f64 = 0.1;
const TURN_NANOS: i64 = 100_000_000;

/// A lidar that moves through a simulated town.
pub(crate) enum Source<'a> {
    Rotating(Lidar<'a>),
    Pattern(PatternLidar<'a>),
}

/// One return.
pub(crate) struct Return {
    /// Time of its pose, ns since the start of the turn.
    pub nanos: i64,
    /// Scan angle, degrees, 0 to 360.
    pub azimuth_deg: f64,
    /// Vertical angle of the beam, degrees.
    pub elevation_deg: f64,
    pub ring: u8,
    /// Range without noise, m.
    pub range_m: f32,
    pub intensity: u8,
    pub class: ClassId,
}

impl<'a> Source<'a> {
    pub fn new(simulation: &'a Simulation, mounted: &MountedLidar, seed: u64) -> Self {
        match mounted.unit {
            Unit::Rotating { model, errors } => {
                let model = LidarModel::for_model(model);
                Self::Rotating(simulation.lidar_unit(model, &errors, mounted.body_from_lidar, seed))
            }
            Unit::Pattern(pattern) => Self::Pattern(simulation.pattern_lidar(pattern, mounted.body_from_lidar, seed)),
        }
    }

    pub fn n_rings(&self) -> usize {
        match self {
            Self::Rotating(lidar) => lidar.model().model.n_rings(),
            Self::Pattern(lidar) => lidar.pattern().n_rings(),
        }
    }

    /// Time of the first shot of a turn.
    pub fn begin_of(&self, turn: u64) -> Stamp {
        match self {
            Self::Rotating(lidar) => lidar.packet_stamp(turn * lidar.model().n_packets(TURN_SECONDS)),
            Self::Pattern(lidar) => lidar.begin().plus_nanos(turn as i64 * TURN_NANOS),
        }
    }

    /// Duration of a turn, ns.
    pub fn turn_nanos(&self) -> u32 {
        match self {
            Self::Rotating(lidar) => lidar.model().n_packets(TURN_SECONDS) as u32 * lidar.model().model.packet_nanos(),
            Self::Pattern(_) => TURN_NANOS as u32,
        }
    }

    /// The returns of a turn, in the order of their shots.
    pub fn turn(&self, turn: u64) -> Vec<Return> {
        match self {
            Self::Rotating(lidar) => rotating_turn(lidar, turn),
            Self::Pattern(lidar) => {
                let begin = turn as i64 * TURN_NANOS;
                let returned = |FiringReturn { firing, received }: FiringReturn| {
                    let LidarReturn { range_m, intensity, class, .. } = received;
                    let Firing { nanos, azimuth_deg, elevation_deg, ring } = firing;
                    Return { nanos: nanos - begin, azimuth_deg, elevation_deg, ring, range_m, intensity, class }
                };
                lidar.sweep(begin..begin + TURN_NANOS).into_iter().map(returned).collect()
            }
        }
    }
}

fn rotating_turn(lidar: &Lidar<'_>, turn: u64) -> Vec<Return> {
    let model = lidar.model().model;
    let rings = model.rings();
    let n_packets = lidar.model().n_packets(TURN_SECONDS);
    let mut returns = Vec::new();
    for (packet, blocks) in (0..).zip(lidar.packets(turn * n_packets..(turn + 1) * n_packets)) {
        for (number, block) in blocks.iter().enumerate() {
            let block_nanos = model.firing_nanos(number, 0);
            let nanos = packet * i64::from(model.packet_nanos()) + i64::from(block_nanos);
            for (index, found) in block.returns.iter().enumerate() {
                let Some(found) = found else { continue };
                let laser = laser_of(model, block, index);
                let of_laser = &model.lasers()[laser];
                let turned_nanos = model.firing_nanos(number, index) - block_nanos;
                let carried = if model.carries_azimuth() { f64::from(turned_nanos) } else { 0.0 };
                let turned_deg = carried * 1e-9 / TURN_SECONDS * 360.0;
                returns.push(Return {
                    nanos,
                    azimuth_deg: (f64::from(block.azimuth) * 0.01 + turned_deg - of_laser.azimuth_deg)
                        .rem_euclid(360.0),
                    elevation_deg: of_laser.elevation_deg,
                    ring: rings[laser],
                    range_m: found.range_m,
                    intensity: found.intensity,
                    class: found.class,
                });
            }
        }
    }
    returns
}

/// The laser of a return.
fn laser_of(model: Model, block: &Block, index: usize) -> usize {
    index % model.n_rings() + if block.is_lower { 32 } else { 0 }
}
