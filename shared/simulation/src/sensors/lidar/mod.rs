//! Rotating multi-beam lidars such as the HDL-32E. [`LidarModel`] holds the parameters.
//!
//! Timing and layout of packets follow [`lidar::velodyne`]. The vehicle moves while the head rotates: every block is cast
//! from the current pose (it moves less than 0.6 mm within a block of an HDL-32E), movers are static during a packet
//! (0.55 ms; 4 mm at 15 m/s between its ends and its middle).
//!
//! A beam is some centimetres wide. Its center ray is always traced. If a neighboring beam hits a surface other than the
//! plane of the center hit, the side of the beam towards this neighbor is also traced. The light of both surfaces
//! returns: as one echo if they are closer than the pulse length, otherwise the strongest echo counts. About half of the
//! beams in a street need only the center ray.
//!
//! The beams of a real unit differ from its factory table: [`LidarErrors`]. They affect only the output of the unit,
//! never the ground truth.
//!
//! The ego vehicle is not modeled: the rig is above the roof, and surfaces below the minimum range are not measured.

mod beams;
mod errors;
mod model;
mod optics;
mod pattern;
mod receiver;
mod returns;

pub use errors::{LidarErrors, LidarGrade};
pub use model::LidarModel;
pub use optics::Optics;
pub use pattern::{Firing, FiringReturn, Pattern, PatternLidar};
pub use returns::{Block, LidarReturn, N_BLOCKS, N_LASERS};

use crate::motion::Motion;
use beams::{Beam, Beams};
use geometry::{Isometry3, Pose, Stamp};
use lidar::velodyne::{DATA_PACKET_BYTES, encode_data_packet};
use model::N_SLOTS;
use random::{gauss, hash};
use rayon::prelude::*;
use raytrace::{Ray, Vec3};
use receiver::{N_PARTS, Part, Receiver};
use std::ops::Range;
use town::{Scene, SceneHit};

/// Offset of the side rays from the center, as a share of the width and height of the beam: five rays of equal weight
/// then approximate a beam of uniform brightness.
const OFF_MIDDLE: f32 = 0.35;
/// Share of the beam per part.
const PART_WEIGHT: f32 = 1.0 / N_PARTS as f32;
/// A neighboring beam hits another surface if its hit is off the plane of this hit by more than this distance, m, plus a
/// share of the range: sideways, where beams touch, and upwards, where they are ten widths apart.
const JUMP_M: f32 = 0.1;
const JUMP_SHARES: [f32; 2] = [0.02, 0.15];
/// Upper bound of the speed of movers, m/s.
const MAX_SPEED_MPS: f64 = 60.0;

/// A lidar that moves through a scene.
#[derive(Debug)]
pub struct Lidar<'a> {
    scene: &'a Scene,
    motion: &'a Motion,
    model: LidarModel,
    beams: Beams,
    receiver: Receiver,
    body_from_lidar: Pose,
    seed: u64,
    step: u32,
}

/// Result of the rays of a packet.
struct TracedPacket {
    blocks: [Block; N_BLOCKS],
    n_rays: usize,
}

/// A firing and the hit of its center ray.
#[derive(Clone, Copy, Debug)]
struct Shot {
    beam: Beam,
    hit: Option<SceneHit>,
}

/// Side rays of a beam, as shares of its width and height.
const SIDES: [[f32; 2]; N_PARTS - 1] = [[-OFF_MIDDLE, 0.0], [OFF_MIDDLE, 0.0], [0.0, -OFF_MIDDLE], [0.0, OFF_MIDDLE]];

impl<'a> Lidar<'a> {
    /// A `step` of 3 leaves two of three blocks (pairs of an HDL-64E) without returns.
    pub fn new(
        scene: &'a Scene,
        motion: &'a Motion,
        model: LidarModel,
        errors: &LidarErrors,
        body_from_lidar: Pose,
        seed: u64,
        step: u32,
    ) -> Self {
        let errors = errors.per_laser(model.model);
        let beams = Beams::new(&model, &errors);
        let receiver = Receiver::new(&model, &errors);
        Self { scene, motion, model, beams, receiver, body_from_lidar, seed, step: step.max(1) }
    }

    /// The model.
    pub fn model(&self) -> &LidarModel {
        &self.model
    }

    /// Time of a packet's first firing.
    pub fn packet_stamp(&self, packet: u64) -> Stamp {
        self.motion.begin.plus_nanos(self.packet_nanos(packet))
    }

    /// The blocks of one packet.
    pub fn packet(&self, packet: u64) -> [Block; N_BLOCKS] {
        self.shoot(packet, &self.movers_in_reach(packet..packet + 1)).blocks
    }

    /// The blocks of several packets, computed in parallel.
    pub fn packets(&self, packets: Range<u64>) -> Vec<[Block; N_BLOCKS]> {
        let movers = self.movers_in_reach(packets.clone());
        packets.into_par_iter().map(|packet| self.shoot(packet, &movers).blocks).collect()
    }

    /// The payload of a packet with these blocks.
    pub fn payload(&self, packet: u64, blocks: &[Block; N_BLOCKS]) -> [u8; DATA_PACKET_BYTES] {
        encode_data_packet(self.model.model, self.packet_stamp(packet), &blocks.each_ref().map(Block::raw))
    }

    /// Center rays of one packet, in firing order; for benchmarks.
    pub fn rays(&self, packet: u64) -> Vec<Ray> {
        self.aim(packet).into_iter().flatten().map(|beam| beam.ray).collect()
    }

    /// The firings of a packet in the order of tracing, in which consecutive rays are coherent.
    pub fn order(&self) -> &[usize] {
        &self.beams.order
    }

    /// Number of rays of a packet, side rays included; for benchmarks.
    pub fn n_rays(&self, packet: u64) -> usize {
        self.shoot(packet, &self.movers_in_reach(packet..packet + 1)).n_rays
    }

    fn packet_nanos(&self, packet: u64) -> i64 {
        packet as i64 * self.model.packet_nanos()
    }

    /// Indices of the movers within range during some packets.
    fn movers_in_reach(&self, packets: Range<u64>) -> Vec<usize> {
        let [begin, end] = [packets.start, packets.end].map(|packet| self.packet_nanos(packet) as f64 * 1e-9);
        let middle = 0.5 * (begin + end);
        let eye = (self.motion.pose(middle) * self.body_from_lidar).translation.vector.cast();
        let margin_m = 1.0 + MAX_SPEED_MPS * (end - begin);
        self.scene.movers_near(&eye, self.model.optics.range_m[1] + margin_m as f32, middle)
    }

    /// Beams by slot; `None` for slots skipped by the step.
    fn aim(&self, packet: u64) -> Vec<Option<Beam>> {
        let begin = self.packet_nanos(packet);
        let mut beams = vec![None; N_SLOTS];
        let mut block_nanos = None;
        let mut world_from_lidar = Isometry3::<f32>::identity();
        for (slot, out) in beams.iter_mut().enumerate() {
            let nanos = self.beams.slots[slot].block_nanos;
            if block_nanos != Some(nanos) {
                block_nanos = Some(nanos);
                let middle = begin + i64::from(nanos + self.model.model.packet_nanos() / (2 * N_BLOCKS as u32));
                world_from_lidar = (self.motion.pose(middle as f64 * 1e-9) * self.body_from_lidar).cast();
            }
            // Blocks that fire simultaneously count as one.
            let number = packet * N_BLOCKS as u64 + (slot / N_LASERS) as u64;
            let number = number / self.model.model.n_rings().div_ceil(N_LASERS) as u64;
            if number.is_multiple_of(u64::from(self.step)) {
                let seed = hash(self.seed, packet * N_SLOTS as u64 + slot as u64);
                *out = Some(self.beams.beam(slot, begin, &world_from_lidar, seed));
            }
        }
        beams
    }

    fn shoot(&self, packet: u64, movers: &[usize]) -> TracedPacket {
        let begin = self.packet_nanos(packet);
        let middle = (begin + self.model.packet_nanos() / 2) as f64 * 1e-9;
        let snapshot = self.scene.some_at(movers, middle);
        let cast = |rays: &[Ray]| self.scene.cast_all(rays, self.model.optics.range_m[1], |_| &snapshot).into_iter();

        let beams = self.aim(packet);
        let fired: Vec<(usize, Beam)> =
            self.beams.order.iter().filter_map(|slot| beams[*slot].map(|beam| (*slot, beam))).collect();
        let middles: Vec<Ray> = fired.iter().map(|(_, beam)| beam.ray).collect();
        let mut shots: Vec<Option<Shot>> = vec![None; N_SLOTS];
        for ((slot, beam), hit) in fired.iter().zip(cast(&middles)) {
            shots[*slot] = Some(Shot { beam: *beam, hit });
        }

        let edges: Vec<[bool; 4]> = fired.iter().map(|(slot, _)| self.edges(&shots, *slot)).collect();
        let sides: Vec<Ray> =
            fired.iter().zip(&edges).flat_map(|((_, beam), edges)| self.sides(beam, *edges)).collect();
        let mut side_hits = sides.iter().zip(cast(&sides));
        let mut parts = Vec::with_capacity(N_PARTS);
        let mut returns = [None; N_SLOTS];
        for ((slot, _), edges) in fired.iter().zip(&edges) {
            let n_sides = edges.iter().filter(|is_edge| **is_edge).count();
            returns[*slot] = self.receive(&shots, *slot, side_hits.by_ref().take(n_sides), &mut parts);
        }
        let blocks = std::array::from_fn(|block| {
            let first = block * N_LASERS;
            Block {
                azimuth: self.azimuth(packet, first),
                is_lower: self.beams.slots[first].laser >= N_LASERS,
                returns: std::array::from_fn(|i| returns[first + i]),
            }
        });
        TracedPacket { blocks, n_rays: middles.len() + sides.len() }
    }

    /// Encoder reading of a block.
    fn azimuth(&self, packet: u64, slot: usize) -> u16 {
        let nanos = self.packet_nanos(packet) + i64::from(self.beams.slots[slot].block_nanos);
        let noise = gauss(hash(self.seed ^ 0xe2c0_de12, nanos as u64)) * self.model.encoder_sigma;
        // The encoder truncates to 0.01 deg. A recording starts at azimuth 0.
        let count = (self.beams.turns(nanos) * 36_000.0 + f64::from(noise)).max(0.0);
        (count % 36_000.0) as u16
    }

    /// For each side of a beam, whether it needs a side ray.
    fn edges(&self, shots: &[Option<Shot>], number: usize) -> [bool; 4] {
        let Some(shot) = &shots[number] else { return [false; 4] };
        let slot = &self.beams.slots[number];
        let neighbor = |other: Option<usize>| other.and_then(|other| shots[other].as_ref());
        // If the neighbor is in another packet, its hit is unknown and the side is traced.
        let row_neighbors =
            slot.row_neighbors.map(|other| neighbor(other).is_none_or(|other| shot.jumps_to(other, JUMP_SHARES[0])));
        let above = slot.above.map(|other| neighbor(other).is_some_and(|other| shot.jumps_to(other, JUMP_SHARES[1])));
        [row_neighbors[0], row_neighbors[1], above[0], above[1]]
    }

    /// Side rays of a beam.
    fn sides(&self, beam: &Beam, edges: [bool; 4]) -> impl Iterator<Item = Ray> {
        let beam = *beam;
        let Optics { aperture_m, divergence, .. } = self.model.optics;
        (0..SIDES.len()).filter(move |side| edges[*side]).map(move |side| {
            let [right, up] = SIDES[side];
            let across = |[width, height]: [f32; 2]| -> Vec3 { beam.right * (right * width) + beam.up * (up * height) };
            Ray {
                origin: beam.ray.origin + across(aperture_m),
                direction: (beam.ray.direction + across(divergence)).normalize(),
                seed: hash(beam.ray.seed, 8 + side as u64),
            }
        })
    }

    /// The return of a firing whose side rays hit `sides`; `parts` is scratch memory.
    fn receive<'r>(
        &self,
        shots: &[Option<Shot>],
        number: usize,
        sides: impl ExactSizeIterator<Item = (&'r Ray, Option<SceneHit>)>,
        parts: &mut Vec<Part>,
    ) -> Option<LidarReturn> {
        let shot = shots[number].as_ref()?;
        let middle_weight = (0..sides.len()).fold(1.0, |weight, _| weight - PART_WEIGHT);
        let part = |weight: f32, ray: &Ray, hit: Option<SceneHit>| self.receiver.part(weight, ray, &hit?);
        let ray = &shot.beam.ray;
        parts.clear();
        parts.extend(sides.filter_map(|(ray, hit)| part(PART_WEIGHT, ray, hit)));
        parts.extend(part(middle_weight, ray, shot.hit));
        self.receiver.strongest(parts, self.beams.slots[number].laser, ray.seed)
    }
}

impl Shot {
    /// Whether another beam hits a surface other than the plane of this hit.
    fn jumps_to(&self, other: &Self, share: f32) -> bool {
        match (&self.hit, &other.hit) {
            (None, None) => false,
            (Some(hit), Some(there)) => {
                let ahead = hit.normal.dot(&self.beam.ray.direction) / hit.normal.dot(&other.beam.ray.direction);
                let off = (hit.range_m * ahead - there.range_m).abs();
                // Also true if the other beam does not meet the plane.
                ahead <= 0.0 || off.is_nan() || off >= JUMP_M + share * hit.range_m
            }
            _ => true,
        }
    }
}
