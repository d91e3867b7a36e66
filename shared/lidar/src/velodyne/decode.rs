//! Decoding of packets to returns.
//!
//! Values that depend only on the laser or only on the angle are tabulated, so that a return needs two table look-ups and a few
//! multiplications.

use super::packet::{BLOCKS_PER_PACKET, DataPacket, LASERS_PER_BLOCK, MAX_RETURNS_PER_PACKET, ReturnMode};
use super::{Laser, Model};
use crate::field_of_view::SilentSector;
use crate::{Blocks, Scratch, TURN, TurnTable, rings};
use messages::SweepPoint;
use std::ops::Range;

/// Decoder of one sensor model, with its tables.
#[derive(Clone, Debug)]
pub struct Decoder {
    model: Model,
    beams: Vec<Beam>,
    turns: TurnTable,
    range_unit_m: f32,
    /// Firing time of each return of a block, ns after the block.
    firing_nanos: [u32; LASERS_PER_BLOCK],
    /// Firing time of each return as a fraction of the duration of a block; zero if azimuths are not interpolated.
    azimuth_shares: [f64; LASERS_PER_BLOCK],
    /// Where the sensor is set to fire nothing. It fills a packet before the sector with blocks after it.
    silent_sector: Option<SilentSector>,
}

/// Geometry of a laser, precomputed.
#[derive(Clone, Copy, Debug)]
struct Beam {
    cos_elevation: f32,
    sin_elevation: f32,
    cos_azimuth: f32,
    sin_azimuth: f32,
    range_m: f32,
    across_m: f32,
    up_m: f32,
    left_m: f32,
    ring: u8,
}

impl Decoder {
    /// Computes the tables of a model.
    pub fn new(model: Model) -> Self {
        Self::with_lasers(model, model.lasers())
    }

    /// Computes the tables of a unit, whose lasers are in firing order.
    pub fn with_lasers(model: Model, lasers: &[Laser]) -> Self {
        let rings = rings(lasers.iter().map(|laser| laser.elevation_deg));
        let beam = |(laser, ring): (&Laser, &u8)| Beam::new(laser, *ring, model);
        let timing = model.timing();
        let share = |nanos: u32| {
            if timing.interpolate_azimuth { f64::from(nanos) / f64::from(timing.block_nanos) } else { 0.0 }
        };
        let firing_nanos = std::array::from_fn(|return_idx| model.firing_nanos(0, return_idx));
        Self {
            model,
            beams: lasers.iter().zip(&rings).map(beam).collect(),
            turns: TurnTable::new(),
            range_unit_m: model.range_unit_m(),
            firing_nanos,
            azimuth_shares: firing_nanos.map(share),
            silent_sector: None,
        }
    }

    /// The decoder of a stream in which the sensor fires nothing in a sector.
    pub(crate) fn across(&self, sector: SilentSector) -> Self {
        Self { silent_sector: Some(sector), ..self.clone() }
    }

    /// Model of the sensor.
    pub fn model(&self) -> Model {
        self.model
    }

    /// Appends the returns of some blocks. `packet_nanos` is the stamp of the packet minus the stamp of the sweep. The sweep must not
    /// begin after the first firing of the blocks.
    pub fn decode_into(
        &self,
        packet: DataPacket<'_>,
        blocks: Range<usize>,
        packet_nanos: i64,
        returns: &mut Vec<SweepPoint>,
    ) {
        let mut scratch = Scratch::<MAX_RETURNS_PER_PACKET>::default();
        self.decode(packet, blocks, packet_nanos, &mut scratch);
        returns.extend_from_slice(scratch.returns());
    }

    /// Like [`Decoder::decode_into`], but replaces the content of `scratch`.
    pub(crate) fn decode<const N: usize>(
        &self,
        packet: DataPacket<'_>,
        blocks: Range<usize>,
        packet_nanos: i64,
        scratch: &mut Scratch<N>,
    ) {
        scratch.len = 0;
        let slots = self.slots(packet);
        let step = self.azimuth_step(packet, slots);
        // Rounded to the nearest count, halves away from zero, like the viewer of the manufacturer.
        let steps = self.azimuth_shares.map(|share| (step * share).round() as u16);
        let times = self.times(packet, slots);
        let is_dual = self.is_dual(packet);
        for index in blocks {
            let Some(block) = packet.block(index) else { continue };
            let first = if block.is_lower() && self.beams.len() > LASERS_PER_BLOCK { LASERS_PER_BLOCK } else { 0 };
            let nanos = packet_nanos + i64::from(times[index]);
            let twin = if is_dual && index % 2 == 1 { packet.block(index - 1) } else { None };
            let twin = twin.map_or(&[][..], |twin| twin.returns());
            self.decode_block(block.returns(), twin, &self.beams[first..], block.azimuth(), nanos, &steps, scratch);
        }
    }

    /// `twin` contains the other echoes of the same shots. Returns equal to their twin are skipped.
    #[expect(clippy::too_many_arguments, reason = "the innermost loop; a struct would only group the arguments")]
    #[inline]
    fn decode_block<const N: usize>(
        &self,
        bytes: &[u8],
        twin: &[u8],
        beams: &[Beam],
        azimuth: u16,
        block_nanos: i64,
        steps: &[u16; LASERS_PER_BLOCK],
        scratch: &mut Scratch<N>,
    ) {
        // A power of two: 16 or 32.
        let mask = self.model.timing().round_lasers - 1;
        for (laser, raw) in bytes.chunks_exact(3).enumerate().take(LASERS_PER_BLOCK) {
            let range = u16::from_le_bytes([raw[0], raw[1]]);
            if range == 0 || twin.get(laser * 3..laser * 3 + 3) == Some(raw) {
                continue;
            }
            let (Some(beam), Some(slot)) = (beams.get(laser & mask), scratch.returns.get_mut(scratch.len)) else {
                break;
            };
            let turned = azimuth + steps[laser];
            let azimuth = if turned >= TURN { turned - TURN } else { turned };
            let [x, y, z] = beam.point(f32::from(range) * self.range_unit_m, self.turns.sin_cos(azimuth));
            let offset_nanos = (block_nanos + i64::from(self.firing_nanos[laser])).clamp(0, i64::from(u32::MAX)) as u32;
            *slot = SweepPoint { x, y, z, offset_nanos, azimuth, intensity: raw[2], ring: beam.ring };
            scratch.len += 1;
        }
    }

    /// Time slot of each block. Blocks fire one after the other, except pairs that fire together: two echoes of one shot, or upper and
    /// lower lasers of an HDL-64E.
    fn slots(&self, packet: DataPacket<'_>) -> [u8; BLOCKS_PER_PACKET] {
        let is_dual = self.is_dual(packet);
        let is_second = |index: usize| {
            let (Some(before), Some(block)) = (packet.block(index - 1), packet.block(index)) else { return false };
            let other_half = self.model == Model::Hdl64e && block.is_lower() && !before.is_lower();
            (is_dual || other_half) && index % 2 == 1 && before.azimuth() == block.azimuth()
        };
        // A pair of an HDL-64E takes as long as two single blocks.
        let pair = if self.model == Model::Hdl64e { 2 } else { 1 };
        let mut slots = [0; BLOCKS_PER_PACKET];
        for index in 1..BLOCKS_PER_PACKET {
            let step = if is_second(index) {
                0
            } else if index > 1 && is_second(index - 1) {
                pair
            } else {
                1
            };
            slots[index] = slots[index - 1] + step;
        }
        slots
    }

    /// Times and angles of the blocks of a packet.
    pub(crate) fn blocks(&self, packet: DataPacket<'_>) -> Blocks {
        let slots = self.slots(packet);
        let block_nanos = self.model.timing().block_nanos;
        let mut blocks = Blocks::new(i64::from(self.n_slots(slots)) * i64::from(block_nanos), i64::from(block_nanos));
        for (index, nanos) in self.times(packet, slots).into_iter().enumerate() {
            blocks.push(nanos, packet.azimuth(index));
        }
        blocks
    }

    /// Firing times of the blocks, ns after the first one: a slot after the other, and after the time of the silent sector if
    /// the packet spans it.
    fn times(&self, packet: DataPacket<'_>, slots: [u8; BLOCKS_PER_PACKET]) -> [i32; BLOCKS_PER_PACKET] {
        let block_nanos = self.model.timing().block_nanos as i32;
        let mut times = slots.map(|slot| i32::from(slot) * block_nanos);
        let Some(sector) = self.silent_sector else { return times };
        for index in 1..BLOCKS_PER_PACKET {
            let (Some(before), Some(block)) = (packet.azimuth(index - 1), packet.azimuth(index)) else { continue };
            if let Some(nanos) = sector.nanos_across(before, block) {
                let silent = nanos as i32 - (times[index] - times[index - 1]);
                times[index..].iter_mut().for_each(|time| *time += silent.max(0));
                break;
            }
        }
        times
    }

    /// Number of time slots of a packet.
    fn n_slots(&self, slots: [u8; BLOCKS_PER_PACKET]) -> u8 {
        let [.., before, last] = slots;
        last + if self.model == Model::Hdl64e && before == last { 2 } else { 1 }
    }

    fn is_dual(&self, packet: DataPacket<'_>) -> bool {
        self.model != Model::Hdl64e && packet.return_mode() == Some(ReturnMode::Dual)
    }

    /// Median step of the encoder from slot to slot; 0 if the motor stands still or the step is unknown.
    fn azimuth_step(&self, packet: DataPacket<'_>, slots: [u8; BLOCKS_PER_PACKET]) -> f64 {
        if !self.model.timing().interpolate_azimuth {
            return 0.0;
        }
        let mut steps = [0_u32; BLOCKS_PER_PACKET];
        let mut n = 0;
        for index in 1..BLOCKS_PER_PACKET {
            if slots[index] == slots[index - 1] {
                continue;
            }
            let (Some(before), Some(block)) = (packet.azimuth(index - 1), packet.azimuth(index)) else { continue };
            let turn = u32::from(TURN);
            steps[n] = (u32::from(block) + turn - u32::from(before)) % turn;
            n += 1;
        }
        let steps = &mut steps[..n];
        steps.sort_unstable();
        // The upper median, like the viewer of the manufacturer. A sensor at 20 Hz turns 80 counts per block; much larger steps are
        // damage.
        steps.get(n.div_ceil(2)).filter(|step| **step < 1000).map_or(0.0, |step| f64::from(*step))
    }
}

impl Beam {
    fn new(laser: &Laser, ring: u8, model: Model) -> Self {
        let (sin_elevation, cos_elevation) = laser.elevation_deg.to_radians().sin_cos();
        let (sin_azimuth, cos_azimuth) = laser.azimuth_deg.to_radians().sin_cos();
        let (across_m, up_m) = match model {
            // Perpendicular to the beam, as the viewer of the manufacturer applies db.xml.
            Model::Hdl64e => (-laser.up_m * sin_elevation, laser.up_m * cos_elevation),
            Model::Hdl32e | Model::Vlp16 | Model::Vlp32c => (0.0, laser.up_m),
        };
        Self {
            cos_elevation: cos_elevation as f32,
            sin_elevation: sin_elevation as f32,
            cos_azimuth: cos_azimuth as f32,
            sin_azimuth: sin_azimuth as f32,
            range_m: laser.range_m as f32,
            across_m: across_m as f32,
            up_m: up_m as f32,
            left_m: laser.left_m as f32,
            ring,
        }
    }

    /// The point at a measured range. `sin` and `cos` belong to the encoder angle.
    #[inline]
    fn point(&self, measured_m: f32, [sin, cos]: [f32; 2]) -> [f32; 3] {
        let range_m = measured_m + self.range_m;
        // The beam looks `azimuth_deg` to the left of the encoder angle.
        let sin_a = sin * self.cos_azimuth - cos * self.sin_azimuth;
        let cos_a = cos * self.cos_azimuth + sin * self.sin_azimuth;
        let ahead_m = range_m * self.cos_elevation + self.across_m;
        [
            ahead_m * cos_a + self.left_m * sin_a,
            self.left_m * cos_a - ahead_m * sin_a,
            range_m * self.sin_elevation + self.up_m,
        ]
    }
}
