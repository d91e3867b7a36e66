//! Topics `color`, `spectra`, `material`, `region`, `class` and `instance`: columns of a submap. Same length and order as its points; the
//! envelope's seq is the submap's.

use crate::{Message, SubmapTopic, pod, pod::cast_slice};

/// Columns that may be published in one tick: the last tick has those of the held submap and of the submaps that arrive.
const COLUMN_QUEUE: usize = SubmapTopic::QUEUE + 1;

/// [`ColorRow::camera`] of a point that no exposure saw.
pub const UNSEEN: u8 = 255;

pod! {
    /// Color of one point, 4 bytes.
    pub struct ColorRow {
        /// sRGB red.
        pub r: u8,
        /// sRGB green.
        pub g: u8,
        /// sRGB blue.
        pub b: u8,
        /// Camera of the rig that saw the point; [`UNSEEN`] if none did, then r g b are 0.
        pub camera: u8,
    }
}
pod! {
    /// How many points of the submap have a color.
    pub struct ColorHeader { /// Points with a color.
        pub n_seen: u64 }
}

/// Color of every point.
pub struct ColorTopic;
impl Message for ColorTopic {
    const TOPIC: &'static str = "color";
    const VERSION: u32 = 1;
    const QUEUE: usize = COLUMN_QUEUE;
    const BORROWED: usize = 2;
    const MAX_ROWS: usize = crate::SubmapTopic::MAX_ROWS;
    type Header = ColorHeader;
    type Row = ColorRow;
}

/// Bands of all mosaic cameras together: 25 of HS02 and 16 of HS03, and room for a third.
pub const MAX_BANDS: usize = 64;

/// Index word of a point without a spectrum.
pub const NO_SPECTRUM: u32 = u32::MAX;

pod! {
    /// The bands of the spectra.
    pub struct SpectraHeader {
        /// Points of the submap.
        pub n_points: u32,
        /// Points with a spectrum.
        pub n_spectra: u32,
        /// Bands of one spectrum.
        pub n_bands: u32,
        /// Zero.
        pub reserved: u32,
        /// Center of each band in nm.
        pub wavelengths_nm: [f32; MAX_BANDS],
        /// Mosaic camera of each band.
        pub cameras: [u8; MAX_BANDS],
    }
}

/// Spectra of the points that a mosaic camera saw: most points have none, so the column is an index and a table.
/// Rows are 4-byte words: `n_points` indices into the table ([`NO_SPECTRUM`] = unseen), then per spectrum
/// two words of validity (bit b of the 64: band b was measured) and `n_bands` reflectances (f32). See [`SpectraView`].
pub struct SpectraTopic;
impl Message for SpectraTopic {
    const TOPIC: &'static str = "spectra";
    const VERSION: u32 = 1;
    const QUEUE: usize = COLUMN_QUEUE;
    const BORROWED: usize = 2;
    // An index for every point, and 43 words of spectrum for a third of the points of the largest submap.
    const MAX_ROWS: usize = 1 << 27;
    type Header = SpectraHeader;
    type Row = u32;
}

/// A spectra column's payload, read in place.
#[derive(Clone, Copy)]
pub struct SpectraView<'a> {
    indices: &'a [u32],
    table: &'a [u32],
    n_bands: usize,
}

impl<'a> SpectraView<'a> {
    /// `None` if the number of rows does not fit the header.
    pub fn new(header: &SpectraHeader, rows: &'a [u32]) -> Option<Self> {
        let n_bands = header.n_bands as usize;
        let n_points = header.n_points as usize;
        if n_bands > MAX_BANDS || rows.len() != n_points + header.n_spectra as usize * (n_bands + 2) {
            return None;
        }
        let (indices, table) = rows.split_at(n_points);
        Some(Self { indices, table, n_bands })
    }
    /// Validity bits and reflectances of a point, `None` if no mosaic camera saw it.
    pub fn spectrum(&self, point_idx: usize) -> Option<(u64, &'a [f32])> {
        let index = self.indices[point_idx];
        if index == NO_SPECTRUM {
            return None;
        }
        let words = self.table.get(index as usize * (self.n_bands + 2)..)?.get(..self.n_bands + 2)?;
        Some((u64::from(words[0]) | u64::from(words[1]) << 32, cast_slice(&words[2..])))
    }
}

pod! {
    /// Material of one point, 2 bytes.
    pub struct MaterialRow {
        /// [`crate::MaterialId`] code, 0 to 13.
        pub material_id: u8,
        /// Confidence, 0 to 255 for 0 to 1.
        pub score: u8,
    }
}
pod! {
    /// How many points of the submap have a material.
    pub struct MaterialHeader {
        /// [`crate::MATERIAL_TABLE_VERSION`].
        pub material_table_version: u64,
        /// Points with a material other than unknown.
        pub n_known: u64,
    }
}

/// Material of every point, by its spectrum; unknown for points without a spectrum.
pub struct MaterialTopic;
impl Message for MaterialTopic {
    const TOPIC: &'static str = "material";
    const VERSION: u32 = 1;
    const QUEUE: usize = COLUMN_QUEUE;
    const BORROWED: usize = 2;
    const MAX_ROWS: usize = crate::SubmapTopic::MAX_ROWS;
    type Header = MaterialHeader;
    type Row = MaterialRow;
}

pod! {
    /// How many points of the submap have a region.
    pub struct RegionHeader { /// Points with a region.
        pub n_points: u64 }
}

/// Region of the cell in which a mosaic camera saw each point: 0 = none. A region is the cells of a Gaussian of a model of the camera's
/// cubes; its number occurs in no other model of the run. Of several cameras, the first that has a region counts.
pub struct RegionTopic;
impl Message for RegionTopic {
    const TOPIC: &'static str = "region";
    const VERSION: u32 = 1;
    const QUEUE: usize = COLUMN_QUEUE;
    const BORROWED: usize = 2;
    const MAX_ROWS: usize = crate::SubmapTopic::MAX_ROWS;
    type Header = RegionHeader;
    type Row = u32;
}

pod! {
    /// Class of one point, 2 bytes.
    pub struct ClassRow {
        /// [`crate::ClassId`] code, 0 to 22.
        pub class_id: u8,
        /// Confidence, 0 to 255 for 0 to 1.
        pub score: u8,
    }
}
pod! {
    /// Source of the classes.
    pub struct ClassHeader {
        /// [`crate::CLASS_TABLE_VERSION`].
        pub class_table_version: u64,
        /// First 8 bytes of the model file's digest.
        pub model_digest: u64,
    }
}

/// Class of every point.
pub struct ClassTopic;
impl Message for ClassTopic {
    const TOPIC: &'static str = "class";
    const VERSION: u32 = 1;
    const QUEUE: usize = COLUMN_QUEUE;
    const BORROWED: usize = 2;
    const MAX_ROWS: usize = crate::SubmapTopic::MAX_ROWS;
    type Header = ClassHeader;
    type Row = ClassRow;
}

pod! {
    /// Number of instances.
    pub struct InstanceHeader {
        /// Instances with at least one point in this submap.
        pub n_instances: u32,
        /// Points with an instance.
        pub n_points: u32,
    }
}

/// Instance of every point: 0 = none; an id names the same object in every submap.
pub struct InstanceTopic;
impl Message for InstanceTopic {
    const TOPIC: &'static str = "instance";
    const VERSION: u32 = 1;
    const QUEUE: usize = COLUMN_QUEUE;
    const BORROWED: usize = 2;
    const MAX_ROWS: usize = crate::SubmapTopic::MAX_ROWS;
    type Header = InstanceHeader;
    type Row = u32;
}
