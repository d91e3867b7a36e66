//! Decoding of packets to returns.

use super::model::Format;
use super::{Model, SWEEP_NANOS};
use crate::maker::{Cut, MAX_RETURNS_PER_PACKET, MakerDecoder};
use crate::{Blocks, Scratch, azimuth_of};
use messages::SweepPoint;
use std::ops::Range;

/// Decoder of one model.
#[derive(Clone, Debug)]
pub struct Decoder {
    model: Model,
}

impl Decoder {
    pub(crate) fn new(model: Model) -> Self {
        Self { model }
    }
}

impl MakerDecoder for Decoder {
    /// A data packet is one block.
    fn blocks(&self, payload: &[u8]) -> Blocks {
        let Some(points) = self.model.points(payload) else { return Blocks::default() };
        let n_shots = (points.bytes.len() / points.format.point_bytes() / points.n_echoes).max(1) as i64;
        let packet_nanos = points.span_nanos * n_shots / (n_shots - 1).max(1);
        let mut blocks = Blocks::new(packet_nanos, packet_nanos);
        blocks.push(0, Some(0));
        blocks
    }

    /// Appends the returns of a data packet. Of equal echoes, one is kept.
    fn decode(
        &self,
        payload: &[u8],
        blocks: Range<usize>,
        packet_nanos: i64,
        scratch: &mut Scratch<MAX_RETURNS_PER_PACKET>,
    ) {
        // The packet is one block.
        if blocks.is_empty() {
            return;
        }
        let Some(points) = self.model.points(payload) else { return };
        let shot_bytes = points.format.point_bytes() * points.n_echoes;
        let n_shots = points.bytes.len() / shot_bytes;
        for (number, shot) in points.bytes.chunks_exact(shot_bytes).enumerate() {
            let nanos = points.span_nanos * number as i64 / (n_shots as i64 - 1).max(1);
            let offset_nanos = packet_nanos.saturating_add(nanos).clamp(0, i64::from(u32::MAX)) as u32;
            let mut last: &[u8] = &[];
            for raw in shot.chunks_exact(points.format.point_bytes()) {
                let ([x, y, z], intensity) = point(points.format, raw);
                if [x, y, z] == [0.0; 3] || raw == last {
                    continue;
                }
                last = raw;
                let azimuth = azimuth_of(x, y);
                if !scratch.push(SweepPoint { x, y, z, offset_nanos, azimuth, intensity, ring: 0 }) {
                    return;
                }
            }
        }
    }

    fn cut(&self) -> Cut {
        Cut::Time { nanos: SWEEP_NANOS }
    }
}

/// Position, m, and reflectivity.
#[inline]
fn point(format: Format, raw: &[u8]) -> ([f32; 3], u8) {
    let i32_at = |at: usize| i32::from_le_bytes([raw[at], raw[at + 1], raw[at + 2], raw[at + 3]]) as f32;
    let u16_at = |at: usize| u16::from_le_bytes([raw[at], raw[at + 1]]);
    match format {
        Format::Millimeters => ([0, 4, 8].map(|at| i32_at(at) / 1e3), raw[12]),
        Format::Centimeters => ([0, 2, 4].map(|at| f32::from(u16_at(at) as i16) / 1e2), raw[6]),
        Format::Spherical => {
            let range_m = u32::from_le_bytes([raw[0], raw[1], raw[2], raw[3]]) as f32 * 1e-3;
            let angle = |at: usize| (f32::from(u16_at(at)) * 0.01).to_radians().sin_cos();
            let (sin_zenith, cos_zenith) = angle(4);
            let (sin_azimuth, cos_azimuth) = angle(6);
            let across_m = range_m * sin_zenith;
            ([across_m * cos_azimuth, across_m * sin_azimuth, range_m * cos_zenith], raw[8])
        }
    }
}
