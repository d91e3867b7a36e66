//! Decoding of packets to returns.

use super::Model;
use super::model::Timing;
use crate::maker::{MAX_RETURNS_PER_PACKET, MakerDecoder};
use crate::{BeamAngles, Blocks, Scratch, TurnTable, rings};
use messages::SweepPoint;
use std::ops::Range;

/// Decoder of one unit, with its tables.
#[derive(Clone, Debug)]
pub struct Decoder {
    model: Model,
    beams: Vec<Beam>,
    turns: TurnTable,
    /// Firing of the earliest beam of a block, ns.
    earliest_nanos: i32,
}

/// Direction and firing time of a beam.
#[derive(Clone, Copy, Debug)]
struct Beam {
    cos_elevation: f32,
    sin_elevation: f32,
    cos_azimuth: f32,
    sin_azimuth: f32,
    nanos: i32,
    ring: u8,
}

impl Timing {
    /// Time of a block of a packet with `n_blocks`, ns after the time in the packet.
    fn nanos(&self, index: usize, n_blocks: usize, n_echoes: usize) -> i32 {
        let shots = if self.counts_back { (n_blocks - 1 - index) / n_echoes } else { index / n_echoes } as i32;
        self.first_nanos + if self.counts_back { -shots } else { shots } * self.block_nanos
    }
}

impl Decoder {
    /// Computes the tables of a unit.
    pub(crate) fn new(model: Model, angles: &[BeamAngles]) -> Self {
        let rings = rings(angles.iter().map(|beam| beam.elevation_deg));
        let nanos = model.timing().beam_nanos;
        let beam = |((angles, ring), nanos): ((&BeamAngles, u8), &i32)| {
            let (sin_elevation, cos_elevation) = angles.elevation_deg.to_radians().sin_cos();
            let (sin_azimuth, cos_azimuth) = angles.azimuth_deg.to_radians().sin_cos();
            Beam {
                cos_elevation: cos_elevation as f32,
                sin_elevation: sin_elevation as f32,
                cos_azimuth: cos_azimuth as f32,
                sin_azimuth: sin_azimuth as f32,
                nanos: *nanos,
                ring,
            }
        };
        Self {
            model,
            beams: angles.iter().zip(rings).zip(nanos).map(beam).collect(),
            turns: TurnTable::new(),
            earliest_nanos: nanos.iter().copied().min().unwrap_or(0),
        }
    }
}

impl MakerDecoder for Decoder {
    fn blocks(&self, payload: &[u8]) -> Blocks {
        let layout = self.model.layout();
        let timing = self.model.timing();
        let n_echoes = layout.n_echoes(payload);
        let n_shots = layout.n_blocks.div_ceil(n_echoes) as i64;
        let block_nanos = i64::from(timing.block_nanos);
        let mut blocks = Blocks::new(n_shots * block_nanos, block_nanos);
        for index in 0..layout.n_blocks {
            let nanos = timing.nanos(index, layout.n_blocks, n_echoes) + self.earliest_nanos;
            blocks.push(nanos, layout.block(payload, index).map(|(angle, _)| angle));
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
        let layout = self.model.layout();
        let timing = self.model.timing();
        let n_echoes = layout.n_echoes(payload);
        let unit_m = layout.unit_m(payload);
        for index in range {
            let Some((angle, returns)) = layout.block(payload, index) else { continue };
            let is_second = n_echoes == 2 && index % 2 == 1;
            let first = if is_second { layout.block(payload, index - 1) } else { None };
            let first = first.filter(|(of_first, _)| *of_first == angle).map_or(&[][..], |(_, returns)| returns);
            let block_nanos = packet_nanos + i64::from(timing.nanos(index, layout.n_blocks, n_echoes));
            let sin_cos = self.turns.sin_cos(angle);
            let size = layout.return_bytes;
            for (number, (raw, beam)) in returns.chunks_exact(size).zip(&self.beams).enumerate() {
                let range = u16::from_le_bytes([raw[0], raw[1]]);
                let is_equal = || first.get(number * size..number * size + 3) == raw.get(..3);
                if range == 0 || is_second && is_equal() {
                    continue;
                }
                let [x, y, z] = beam.point(f32::from(range) * unit_m, sin_cos);
                let offset_nanos = (block_nanos + i64::from(beam.nanos)).clamp(0, i64::from(u32::MAX)) as u32;
                let point = SweepPoint { x, y, z, offset_nanos, azimuth: angle, intensity: raw[2], ring: beam.ring };
                if !scratch.push(point) {
                    return;
                }
            }
        }
    }
}

impl Beam {
    /// The point at a range. `sin` and `cos` belong to the encoder angle.
    #[inline]
    fn point(&self, range_m: f32, [sin, cos]: [f32; 2]) -> [f32; 3] {
        let sin_a = sin * self.cos_azimuth + cos * self.sin_azimuth;
        let cos_a = cos * self.cos_azimuth - sin * self.sin_azimuth;
        let ahead_m = range_m * self.cos_elevation;
        [ahead_m * cos_a, -ahead_m * sin_a, range_m * self.sin_elevation]
    }
}
