//! Decoding of packets to returns.

use super::packet::{Column, Echo};
use super::{Metadata, Profile};
use crate::maker::{Cut, MAX_RETURNS_PER_PACKET, MakerDecoder};
use crate::{Blocks, Scratch, TURN, rings};
use messages::SweepPoint;
use std::f64::consts::TAU;
use std::ops::Range;

/// Decoder of one sensor, with its tables.
#[derive(Clone, Debug)]
pub struct Decoder {
    metadata: Metadata,
    beams: Vec<Beam>,
    /// Sine and cosine of the encoder angle by column, counterclockwise.
    columns: Vec<[f32; 2]>,
    /// Encoder angles by column in the sensor frame, clockwise, 0.01 deg.
    azimuths: Vec<u16>,
    rotation: [[f32; 3]; 3],
    translation: [f32; 3],
    origin_m: [f32; 2],
    /// Distance of the origin of the beams from the origin of the lidar, m.
    origin_range_m: f32,
}

/// Direction of a beam relative to the encoder angle.
#[derive(Clone, Copy, Debug)]
struct Beam {
    /// Cosine of the elevation times cosine and sine of the azimuth, counterclockwise.
    ahead: f32,
    left: f32,
    up: f32,
    ring: u8,
}

impl Decoder {
    /// Computes the tables of a sensor.
    pub(crate) fn new(metadata: &Metadata) -> Self {
        let rings = rings(metadata.elevations_deg.iter().copied());
        let beam = |((elevation_deg, azimuth_deg), ring): ((&f64, &f64), u8)| {
            let (sin_elevation, cos_elevation) = elevation_deg.to_radians().sin_cos();
            // Azimuths of beams are clockwise.
            let (sin_azimuth, cos_azimuth) = (-azimuth_deg.to_radians()).sin_cos();
            Beam {
                ahead: (cos_elevation * cos_azimuth) as f32,
                left: (cos_elevation * sin_azimuth) as f32,
                up: sin_elevation as f32,
                ring,
            }
        };
        let n = f64::from(metadata.columns_per_turn);
        let columns = 0..metadata.columns_per_turn;
        let (rotation, translation) = metadata.sensor_from_lidar;
        // Rotation stored by columns: the direction of the first column of the revolution in the sensor frame.
        let yaw = rotation[0][1].atan2(rotation[0][0]);
        let azimuth = |column: u16| {
            let clockwise = f64::from(column) / n - yaw / TAU;
            (clockwise.rem_euclid(1.0) * f64::from(TURN)).round() as u16 % TURN
        };
        let angle = |column: u16| (TAU * (1.0 - f64::from(column) / n)).sin_cos();
        Self {
            beams: metadata.elevations_deg.iter().zip(&metadata.azimuths_deg).zip(rings).map(beam).collect(),
            columns: columns.clone().map(angle).map(|(sin, cos)| [sin as f32, cos as f32]).collect(),
            azimuths: columns.map(azimuth).collect(),
            rotation: rotation.map(|column| column.map(|v| v as f32)),
            translation: translation.map(|v| v as f32),
            origin_m: metadata.origin_m.map(|v| v as f32),
            origin_range_m: metadata.origin_m[0].hypot(metadata.origin_m[1]) as f32,
            metadata: metadata.clone(),
        }
    }

    /// Encoder counts of the part of a revolution that is measured.
    fn full_turn(&self) -> u16 {
        let [first, last] = self.metadata.window.map(u32::from);
        let n = u32::from(self.metadata.columns_per_turn);
        let measured = (last + n - first) % n + 1;
        (measured * u32::from(TURN) / n) as u16
    }

    #[inline(always)]
    fn decode_column<const N: usize>(
        &self,
        column: Column<'_>,
        offset_nanos: u32,
        profile: Profile,
        scratch: &mut Scratch<N>,
    ) {
        let number = usize::from(column.number());
        let sin_cos = self.columns[number];
        let azimuth = self.azimuths[number];
        for (pixel, beam) in column.pixels().zip(&self.beams) {
            let [first, second] = profile.echoes(pixel);
            let mut add = |echo: Echo| {
                let [x, y, z] = self.point(beam, echo.range_mm as f32 * 1e-3, sin_cos);
                let intensity = echo.reflectivity.min(255) as u8;
                scratch.push(SweepPoint { x, y, z, offset_nanos, azimuth, intensity, ring: beam.ring })
            };
            if first.range_mm > 0 && !add(first) {
                return;
            }
            if profile == Profile::Dual && second.range_mm > 0 && second != first && !add(second) {
                return;
            }
        }
    }

    /// The point at a range, in the sensor frame (Ouster's Firmware User Manual, "Lidar Range to XYZ").
    #[inline(always)]
    fn point(&self, beam: &Beam, range_m: f32, [sin, cos]: [f32; 2]) -> [f32; 3] {
        let from_beam_m = range_m - self.origin_range_m;
        let x = from_beam_m * (beam.ahead * cos - beam.left * sin) + self.origin_m[0] * cos;
        let y = from_beam_m * (beam.ahead * sin + beam.left * cos) + self.origin_m[0] * sin;
        let z = from_beam_m * beam.up + self.origin_m[1];
        let [a, b, c] = self.rotation;
        std::array::from_fn(|i| a[i] * x + b[i] * y + c[i] * z + self.translation[i])
    }

    /// A column with data.
    fn column<'a>(&self, payload: &'a [u8], index: usize) -> Option<Column<'a>> {
        let column = Column::from_payload(payload, self.metadata.profile, self.metadata.n_beams(), index)?;
        (column.is_valid() && column.number() < self.metadata.columns_per_turn).then_some(column)
    }
}

impl MakerDecoder for Decoder {
    /// Times of the columns of a data packet, and the angle covered since the start of the revolution.
    fn blocks(&self, payload: &[u8]) -> Blocks {
        let metadata = &self.metadata;
        let n = u32::from(metadata.columns_per_turn);
        let column_nanos = (1e9 / metadata.turns_per_second / f64::from(n)).round() as i64;
        let begin = metadata.first_nanos(payload);
        let mut blocks = Blocks::new(column_nanos * metadata.n_columns as i64, column_nanos);
        for index in 0..metadata.n_columns {
            match self.column(payload, index) {
                Some(column) => {
                    let nanos = to_i64(column.nanos()).saturating_sub(begin);
                    let after_first = (u32::from(column.number()) + n - u32::from(metadata.window[0])) % n;
                    // Times of a packet span milliseconds.
                    let is_near = nanos.abs() < 1_000_000_000;
                    blocks.push(nanos as i32, is_near.then_some((after_first * u32::from(TURN) / n) as u16));
                }
                None => blocks.push_empty(),
            }
        }
        blocks
    }

    /// Appends the returns of some columns of a data packet. Of two equal echoes, the second is skipped.
    fn decode(
        &self,
        payload: &[u8],
        range: Range<usize>,
        packet_nanos: i64,
        scratch: &mut Scratch<MAX_RETURNS_PER_PACKET>,
    ) {
        let begin = self.metadata.first_nanos(payload);
        for index in range {
            let Some(column) = self.column(payload, index) else { continue };
            let nanos = packet_nanos.saturating_add(to_i64(column.nanos()).saturating_sub(begin));
            let offset_nanos = nanos.clamp(0, i64::from(u32::MAX)) as u32;
            match self.metadata.profile {
                // The compiler makes one loop for each profile.
                Profile::Legacy => self.decode_column(column, offset_nanos, Profile::Legacy, scratch),
                Profile::LowData => self.decode_column(column, offset_nanos, Profile::LowData, scratch),
                Profile::Single => self.decode_column(column, offset_nanos, Profile::Single, scratch),
                Profile::Dual => self.decode_column(column, offset_nanos, Profile::Dual, scratch),
            }
        }
    }

    fn cut(&self) -> Cut {
        Cut::Turn { full: self.full_turn() }
    }

    fn is_regular(&self) -> bool {
        self.full_turn() == TURN
    }
}

impl Metadata {
    /// Time of a data packet, ns, by the clock of the sensor; converted to UTC if the network clock is TAI.
    pub(crate) fn packet_nanos(&self, payload: &[u8]) -> i64 {
        self.first_nanos(payload).saturating_sub(self.tai_offset_nanos)
    }

    /// Time of the first column with data by the clock of the sensor, ns.
    fn first_nanos(&self, payload: &[u8]) -> i64 {
        let mut columns =
            (0..self.n_columns).filter_map(|index| Column::from_payload(payload, self.profile, self.n_beams(), index));
        let valid = columns.find(|column| column.is_valid() && column.number() < self.columns_per_turn);
        valid.map_or(0, |column| to_i64(column.nanos()))
    }
}

fn to_i64(nanos: u64) -> i64 {
    i64::try_from(nanos).unwrap_or(i64::MAX)
}
