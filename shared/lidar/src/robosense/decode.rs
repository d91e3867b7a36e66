//! Decoding of packets to returns.

use super::Model;
use crate::maker::{MAX_RETURNS_PER_PACKET, MakerDecoder};
use crate::{BeamAngles, Blocks, Scratch, TURN, TurnTable, rings};
use messages::SweepPoint;
use std::ops::Range;

const N_BLOCKS: usize = 12;
const N_RETURNS: usize = 32;
const BLOCKS_AT: usize = 42;
const BLOCK_BYTES: usize = 100;
/// Resolution of ranges, m.
const RANGE_UNIT_M: f32 = 0.005;
/// A larger step of the encoder from block to block is damage or a gap.
const MAX_STEP: u32 = 1000;

/// Decoder of one unit, with its tables.
#[derive(Clone, Debug)]
pub struct Decoder {
    model: Model,
    beams: Vec<Beam>,
    turns: TurnTable,
}

/// Geometry of a laser.
#[derive(Clone, Copy, Debug)]
struct Beam {
    cos_elevation: f32,
    sin_elevation: f32,
    cos_azimuth: f32,
    sin_azimuth: f32,
    ring: u8,
}

/// How the blocks of a packet follow each other.
#[derive(Clone, Copy, Debug)]
struct Sequence {
    /// Time from one block to the next, or from one pair to the next, ns.
    block_nanos: i32,
    /// Whether a pair of blocks has two echoes of the same shots.
    in_pairs: bool,
    /// Whether both halves of a block have two echoes of the same shots.
    in_halves: bool,
}

impl Decoder {
    /// Computes the tables of a unit.
    pub(crate) fn new(model: Model, angles: &[BeamAngles]) -> Self {
        let rings = rings(angles.iter().map(|beam| beam.elevation_deg));
        let beam = |(angles, ring): (&BeamAngles, u8)| {
            let (sin_elevation, cos_elevation) = angles.elevation_deg.to_radians().sin_cos();
            let (sin_azimuth, cos_azimuth) = angles.azimuth_deg.to_radians().sin_cos();
            Beam {
                cos_elevation: cos_elevation as f32,
                sin_elevation: sin_elevation as f32,
                cos_azimuth: cos_azimuth as f32,
                sin_azimuth: sin_azimuth as f32,
                ring,
            }
        };
        Self { model, beams: angles.iter().zip(rings).map(beam).collect(), turns: TurnTable::new() }
    }

    /// Packets do not name the return mode; it is determined from their content.
    fn sequence(&self, payload: &[u8]) -> Sequence {
        let n_beams = self.model.n_beams();
        let round_nanos = self.model.round_nanos();
        if n_beams == N_RETURNS {
            let angle = |index: usize| block(payload, index).map(|(angle, _)| angle);
            let in_pairs = (0..N_BLOCKS).step_by(2).all(|index| angle(index) == angle(index + 1));
            return Sequence { block_nanos: round_nanos, in_pairs, in_halves: false };
        }
        // Most shots have one echo, which is in both halves. Two shots hardly ever have equal ranges and intensities.
        let mut n_returns = 0;
        let mut n_equal = 0;
        for (_, returns) in (0..N_BLOCKS).filter_map(|index| block(payload, index)) {
            let (upper, lower) = returns.split_at(n_beams * 3);
            for (one, other) in upper.chunks_exact(3).zip(lower.chunks_exact(3)).filter(|(one, _)| one[..2] != [0, 0]) {
                n_returns += 1;
                n_equal += usize::from(one == other);
            }
        }
        let in_halves = n_returns > 0 && 2 * n_equal > n_returns;
        Sequence { block_nanos: if in_halves { round_nanos } else { 2 * round_nanos }, in_pairs: false, in_halves }
    }

    /// The point at a range.
    #[inline]
    fn point(&self, beam: &Beam, range_m: f32, azimuth: u16) -> [f32; 3] {
        let [sin, cos] = self.turns.sin_cos(azimuth);
        let sin_a = sin * beam.cos_azimuth + cos * beam.sin_azimuth;
        let cos_a = cos * beam.cos_azimuth - sin * beam.sin_azimuth;
        let ahead_m = range_m * beam.cos_elevation;
        let radius_m = self.model.radius_m();
        [ahead_m * cos_a + radius_m * cos, -ahead_m * sin_a - radius_m * sin, range_m * beam.sin_elevation]
    }
}

impl MakerDecoder for Decoder {
    fn blocks(&self, payload: &[u8]) -> Blocks {
        let sequence = self.sequence(payload);
        let n_shots = if sequence.in_pairs { N_BLOCKS / 2 } else { N_BLOCKS };
        let block_nanos = i64::from(sequence.block_nanos);
        let mut blocks = Blocks::new(n_shots as i64 * block_nanos, block_nanos);
        for index in 0..N_BLOCKS {
            blocks.push(sequence.nanos(index), block(payload, index).map(|(angle, _)| angle));
        }
        blocks
    }

    /// Appends the returns of some blocks of a data packet. Of two equal echoes, the second is skipped.
    fn decode(
        &self,
        payload: &[u8],
        range: Range<usize>,
        packet_nanos: i64,
        scratch: &mut Scratch<MAX_RETURNS_PER_PACKET>,
    ) {
        let sequence = self.sequence(payload);
        let step = step(payload, sequence.in_pairs);
        let n_beams = self.model.n_beams();
        for index in range {
            let Some((angle, returns)) = block(payload, index) else { continue };
            let first = if sequence.in_pairs && index % 2 == 1 { block(payload, index - 1) } else { None };
            let first = first.map_or(&[][..], |(_, returns)| returns);
            let block_nanos = packet_nanos + i64::from(sequence.nanos(index));
            for (number, raw) in returns.chunks_exact(3).enumerate().take(N_RETURNS) {
                let laser = number % n_beams;
                let round = number / n_beams;
                let Some(beam) = self.beams.get(laser) else { continue };
                let of_first = if sequence.in_halves && round == 1 {
                    returns.get(laser * 3..laser * 3 + 3)
                } else {
                    first.get(number * 3..number * 3 + 3)
                };
                let range = u16::from_be_bytes([raw[0], raw[1]]);
                if range == 0 || of_first == Some(raw) {
                    continue;
                }
                let round = if sequence.in_halves { 0 } else { round as i32 };
                let nanos = self.model.laser_nanos(laser) + round * self.model.round_nanos();
                let turned = (step * f64::from(nanos) / f64::from(sequence.block_nanos)).round() as u16;
                let azimuth = (angle + turned) % TURN;
                let [x, y, z] = self.point(beam, f32::from(range) * RANGE_UNIT_M, azimuth);
                let offset_nanos = (block_nanos + i64::from(nanos)).clamp(0, i64::from(u32::MAX)) as u32;
                if !scratch.push(SweepPoint { x, y, z, offset_nanos, azimuth, intensity: raw[2], ring: beam.ring }) {
                    return;
                }
            }
        }
    }
}

impl Sequence {
    /// Time of a block after the time of the packet, ns.
    fn nanos(self, index: usize) -> i32 {
        (if self.in_pairs { index / 2 } else { index }) as i32 * self.block_nanos
    }
}

/// Angle and returns of a block; `None` for an invalid flag or angle.
fn block(payload: &[u8], index: usize) -> Option<(u16, &[u8])> {
    let block = payload.get(BLOCKS_AT + index * BLOCK_BYTES..)?.get(..BLOCK_BYTES)?;
    let angle = u16::from_be_bytes([block[2], block[3]]);
    (block.starts_with(&[0xff, 0xee]) && angle < TURN).then(|| (angle, &block[4..]))
}

/// Median step of the encoder from block to block, or from pair to pair; 0 if it is unknown.
fn step(payload: &[u8], in_pairs: bool) -> f64 {
    let stride = if in_pairs { 2 } else { 1 };
    let angle = |index: usize| block(payload, index).map(|(angle, _)| u32::from(angle));
    let between = |index: usize| Some((angle(index + stride)? + u32::from(TURN) - angle(index)?) % u32::from(TURN));
    let mut steps: Vec<u32> = (0..N_BLOCKS - stride).filter_map(between).collect();
    steps.sort_unstable();
    steps.get(steps.len() / 2).filter(|step| **step < MAX_STEP).map_or(0.0, |step| f64::from(*step))
}
