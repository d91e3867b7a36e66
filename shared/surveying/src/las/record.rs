//! Records of point format 7 with extra bytes.
//!
//! ```text
//!  0  3 x i32 coordinates      17  u8 user data, 0
//! 12  u16 intensity            18  i16 scan angle, 0.006 degrees
//! 14  u8 return 1 of 1         20  u16 point source: number of the submap, or of the drive in a survey, + 1
//! 15  u8 scanner channel       22  f64 GPS time
//! 16  u8 class                 30  3 x u16 red, green, blue
//!                              36  extra bytes
//! ```

use super::{ExtraBytes, ExtraField, FORMAT_7_BYTES};
use crate::asprs::{NEVER_CLASSIFIED, asprs_table, ground_as_2_table};
use crate::cloud::{CloudPoint, Columns, Present};
use formats::gps_time::adjusted_gps_from_unix;

/// Step of the coordinates, m.
pub(crate) const SCALE_M: f64 = 0.001;
/// Steps per metre: exact, unlike [`SCALE_M`].
const STEPS_PER_M: f64 = 1000.0;
/// 16 bits from 8 for intensities: 255 becomes 65535, the full scale, as the specification requires.
const WIDE_INTENSITY: u16 = 257;
/// 16 bits from 8 for colors: the specification multiplies by 256. Low bytes of 0 also compress faster.
const WIDE_COLOR: u16 = 256;
/// Steps of the scan angle per radian.
const ANGLE_STEPS: f64 = 180.0 / std::f64::consts::PI / 0.006;
/// Return number 1 of 1.
const ONE_OF_ONE: u8 = 0b0001_0001;
/// Number of LiDARs that the two bits of the scanner channel distinguish.
const N_CHANNELS: u8 = 4;

/// Encodes points as records.
pub(crate) struct RecordLayout {
    pub(crate) extra: ExtraBytes,
    has_classes: bool,
    asprs: [u8; 256],
    /// Coordinates that are stored as 0, m.
    offset_m: [f64; 3],
}

/// The source of a record.
#[derive(Clone, Copy)]
pub(crate) struct RecordSource<'a> {
    pub(crate) point: &'a CloudPoint,
    /// Columns of its cloud.
    pub(crate) columns: &'a Columns,
    /// Its row in the cloud.
    pub(crate) row: &'a [u8],
    /// Its coordinates, steps of [`SCALE_M`].
    pub(crate) stored: [i32; 3],
    /// Number of the submap, or of the drive in a survey, + 1; 0 means that the source is unknown.
    pub(crate) source: u16,
    /// Direction of travel in the frame of the cloud.
    pub(crate) forward: [f64; 2],
    /// A reflectance for each band. `None` if no camera recorded the point.
    pub(crate) spectrum: Option<&'a [f32]>,
}

/// Stored coordinates of a record.
#[inline]
pub(crate) fn position_of(record: &[u8]) -> [i32; 3] {
    std::array::from_fn(|axis| i32::from_le_bytes(record[4 * axis..4 * axis + 4].try_into().expect("4 bytes")))
}

/// Point source of a record.
#[inline]
pub(crate) fn source_of(record: &[u8]) -> u16 {
    u16::from_le_bytes([record[20], record[21]])
}

/// The bit of the classification flags for points that are withheld.
const WITHHELD: u8 = 1 << 2;

/// Marks a record as withheld.
#[inline]
pub(crate) fn withhold(record: &mut [u8]) {
    record[15] |= WITHHELD;
}

/// Whether a record is marked as withheld.
#[inline]
pub(crate) fn is_withheld(record: &[u8]) -> bool {
    record[15] & WITHHELD != 0
}

/// GPS time of a record, s.
#[inline]
pub(crate) fn gps_time_of(record: &[u8]) -> f64 {
    f64::from_le_bytes(record[22..30].try_into().expect("8 bytes"))
}

/// Color of a record, 8 bits.
#[inline]
pub(crate) fn color_of(record: &[u8]) -> [u8; 3] {
    [31, 33, 35].map(|high_byte| record[high_byte])
}

impl RecordLayout {
    pub(crate) fn new(present: &Present, bands: &[String], offset_m: [f64; 3]) -> Self {
        let extra = ExtraBytes::new(present, bands);
        Self { extra, has_classes: present.has("class"), asprs: asprs_table(), offset_m }
    }

    /// Changes the numbers so that all kinds of ground are ground.
    pub(crate) fn with_ground_as_2(self) -> Self {
        Self { asprs: ground_as_2_table(), ..self }
    }

    /// Bytes of a record.
    pub(crate) fn n_bytes(&self) -> usize {
        FORMAT_7_BYTES + self.extra.n_bytes()
    }

    /// Stored coordinates, steps of [`SCALE_M`]. `None` beyond 2147 km from the offset, and for NaN.
    #[inline]
    pub(crate) fn stored(&self, xyz: [f64; 3]) -> Option<[i32; 3]> {
        let mut stored = [0; 3];
        for axis in 0..3 {
            let steps = ((xyz[axis] - self.offset_m[axis]) * STEPS_PER_M).round();
            if !(f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&steps) {
                return None;
            }
            stored[axis] = steps as i32;
        }
        Some(stored)
    }

    /// Writes a record.
    #[inline]
    pub(crate) fn encode(&self, source: &RecordSource<'_>, record: &mut [u8]) {
        let RecordSource { point, columns, row, stored, source: number, forward, spectrum } = *source;
        let mut at = 0;
        let mut put = |bytes: &[u8]| {
            record[at..at + bytes.len()].copy_from_slice(bytes);
            at += bytes.len();
        };
        for value in stored {
            put(&value.to_le_bytes());
        }
        put(&(u16::from(point.intensity) * WIDE_INTENSITY).to_le_bytes());
        let class = if self.has_classes { self.asprs[usize::from(point.class)] } else { NEVER_CLASSIFIED };
        put(&[ONE_OF_ONE, point.lidar.min(N_CHANNELS - 1) << 4, class, 0]);
        put(&scan_angle(point, forward).to_le_bytes());
        put(&number.to_le_bytes());
        put(&adjusted_gps_from_unix(point.time_s).to_le_bytes());
        for channel in point.rgb {
            put(&(u16::from(channel) * WIDE_COLOR).to_le_bytes());
        }
        for field in &self.extra.fields {
            match field {
                ExtraField::Column(place, _) => columns.put_extra(*place, row, &mut put),
                ExtraField::Band(band) => put(&reflectance(spectrum, *band).to_le_bytes()),
            }
        }
    }
}

/// Angle of the beam about the direction of travel: 0 = down, positive to the right of the vehicle, 180 degrees = up.
#[inline]
fn scan_angle(point: &CloudPoint, forward: [f64; 2]) -> i16 {
    let [x, y, z] = std::array::from_fn(|axis| point.xyz[axis] - point.lidar_xyz[axis]);
    let right = x * forward[1] - y * forward[0];
    (right.atan2(-z) * ANGLE_STEPS).round() as i16
}

/// Bits of a reflectance that are not stored. Zeros compress; 14 bits of the fraction remain, so a value changes by at most 3.1e-5 of itself.
const ROUNDED_BITS: u32 = 9;

/// Reflectance of a band, NaN if it was not measured.
#[inline]
fn reflectance(spectrum: Option<&[f32]>, band: usize) -> f32 {
    match spectrum.and_then(|spectrum| spectrum.get(band)) {
        Some(value) if value.is_finite() => {
            let half = 1 << (ROUNDED_BITS - 1);
            f32::from_bits((value.to_bits() + half) >> ROUNDED_BITS << ROUNDED_BITS)
        }
        _ => f32::NAN,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use formats::ply::{Header, Kind, Property};
    use messages::columns::COLUMNS;

    fn point(off: [f64; 3]) -> CloudPoint {
        CloudPoint {
            xyz: off.map(|value| value + 100.0),
            lidar_xyz: [100.0; 3],
            time_s: 1_726_230_400.5,
            frame: 70_000,
            intensity: 255,
            ring: 31,
            is_moving: true,
            lidar: 0,
            instance: 100_000,
            class: 10,
            rgb: [255, 1, 0],
        }
    }

    #[test]
    fn scan_angle_is_zero_down_and_positive_to_the_right() {
        // North: right is east.
        let degrees = |off: [f64; 3], forward: [f64; 2]| f64::from(scan_angle(&point(off), forward)) * 0.006;
        for (off, forward, expected) in [
            ([0.0, 0.0, -2.0], [0.0, 1.0], 0.0),
            ([3.0, 9.0, 0.0], [0.0, 1.0], 90.0),
            ([-3.0, 0.0, 0.0], [0.0, 1.0], -90.0),
            ([0.0, -3.0, -3.0], [1.0, 0.0], 45.0),
            ([0.0, 0.0, 5.0], [1.0, 0.0], 180.0),
        ] {
            assert!((degrees(off, forward) - expected).abs() < 0.006, "{off:?}: {}", degrees(off, forward));
        }
    }

    #[test]
    fn record_has_wide_colors_gps_time_and_extra_bytes() {
        let point = point([1.0, 2.0, -3.0005]);
        let floats = ["x", "y", "z", "x_lidar_position", "y_lidar_position", "z_lidar_position"];
        let header = Header::new(floats.map(|name| (name, Kind::Float)));
        let row = vec![0; 24];
        let uchar = Kind::UChar;
        let fields: [(&str, Kind, &[u8]); 12] = [
            ("timestamp", Kind::Double, &point.time_s.to_le_bytes()),
            ("index_frame", Kind::Int, &point.frame.to_le_bytes()),
            ("intensity", uchar, &[point.intensity]),
            ("ring", uchar, &[point.ring]),
            ("dynamic", uchar, &[1]),
            ("instance", Kind::Int, &point.instance.to_le_bytes()),
            ("semantic", uchar, &[point.class]),
            ("score", Kind::Float, &(128.0_f32 / 255.0).to_le_bytes()),
            ("red", uchar, &point.rgb[..1]),
            ("green", uchar, &point.rgb[1..2]),
            ("blue", uchar, &point.rgb[2..]),
            ("camera", uchar, &[3]),
        ];
        let (header, row) = fields.into_iter().fold((header, row), |(mut header, row), (name, kind, bytes)| {
            header.properties.push(Property::new(name, kind));
            (header, [&row[..], bytes].concat())
        });
        let columns = Columns::from_header(&header, COLUMNS).expect("is complete");
        let layout = RecordLayout::new(&columns.present(), &["band_0700nm".to_owned()], [0.0; 3]);
        let stored = layout.stored(point.xyz).expect("fits");
        assert_eq!(stored, [101_000, 102_000, 97_000]);
        let mut record = vec![0; layout.n_bytes()];
        let spectrum = Some(&[0.25][..]);
        let source = RecordSource {
            point: &point,
            columns: &columns,
            row: &row,
            stored,
            source: 5,
            forward: [1.0, 0.0],
            spectrum,
        };
        layout.encode(&source, &mut record);
        assert_eq!(record.len(), 36 + 5 + 4 + 4 + 4);
        assert_eq!(position_of(&record), stored);
        assert_eq!(record[12..18], [255, 255, 0x11, 0, 74, 0]);
        assert_eq!(f64::from_le_bytes(record[22..30].try_into().expect("8 bytes")), 410_265_618.5);
        assert_eq!(record[30..36], [0, 255, 0, 1, 0, 0]);
        assert_eq!(color_of(&record), [255, 1, 0]);
        assert_eq!(record[36..41], [10, 128, 31, 1, 3]);
        assert_eq!(record[41..45], 100_000_u32.to_le_bytes());
        assert_eq!(record[45..49], 70_000_u32.to_le_bytes());
        assert_eq!(record[49..53], 0.25_f32.to_le_bytes());
        assert_eq!(layout.stored([f64::NAN, 0.0, 0.0]), None);
        assert_eq!(layout.stored([3e6, 0.0, 0.0]), None);
    }

    #[test]
    fn reflectance_that_was_not_measured_is_nan_and_others_are_rounded() {
        for spectrum in [None, Some(&[f32::NAN][..]), Some(&[f32::INFINITY]), Some(&[])] {
            assert_eq!(reflectance(spectrum, 0).to_bits(), f32::NAN.to_bits(), "{spectrum:?}");
        }
        for value in [0.0, 0.123_456_7, -0.02, 0.999_999_9, 3.5] {
            let found = reflectance(Some(&[9.0, value]), 1);
            assert!((found - value).abs() <= 3.1e-5 * value.abs(), "{value}: {found}");
            assert_eq!(found.to_bits() % 512, 0, "{value}");
        }
    }
}
