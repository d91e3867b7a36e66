//! Extra bytes of the records and their descriptions.

use super::vlr::{Vlr, padded};
use crate::cloud::Present;

/// Reflectance of one step of a band: i16 covers -3.2767 to 3.2767.
pub(crate) const REFLECTANCE_STEP: f64 = 1e-4;
/// A band that was not measured.
pub(crate) const NO_REFLECTANCE: i16 = i16::MIN;

/// What an extra field contains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ExtraField {
    Class,
    Score,
    Laser,
    Moving,
    Camera,
    Lidar,
    Material,
    MaterialScore,
    Instance,
    Region,
    Frame,
    /// Reflectance of the band of this number.
    Band(usize),
}

/// Fields behind the point format, in order.
#[derive(Clone, Debug, Default)]
pub(crate) struct ExtraBytes {
    pub(crate) fields: Vec<ExtraField>,
    bands: Vec<String>,
}

impl ExtraBytes {
    /// Fields for the columns that the clouds have. `bands` are the names of the bands to write.
    pub(crate) fn new(present: Present, bands: &[String]) -> Self {
        use ExtraField::{
            Band, Camera, Class, Frame, Instance, Laser, Lidar, Material, MaterialScore, Moving, Region, Score,
        };
        let candidates = [
            (Class, present.class),
            (Score, present.class),
            (Laser, true),
            (Moving, true),
            (Camera, present.color),
            (Lidar, present.lidar),
            (Material, present.material),
            (MaterialScore, present.material),
            (Instance, present.instance),
            (Region, present.region),
            (Frame, true),
        ];
        let fields = candidates.into_iter().filter_map(|(field, is_present)| is_present.then_some(field));
        Self { fields: fields.chain((0..bands.len()).map(Band)).collect(), bands: bands.to_vec() }
    }

    /// Bytes of all fields.
    pub(crate) fn n_bytes(&self) -> usize {
        self.fields.iter().map(|field| field.n_bytes()).sum()
    }

    /// Bytes before a field. `None` if records lack it.
    pub(crate) fn offset(&self, field: ExtraField) -> Option<usize> {
        let k = self.fields.iter().position(|other| *other == field)?;
        Some(self.fields[..k].iter().map(|field| field.n_bytes()).sum())
    }

    /// The record that describes the fields.
    pub(crate) fn vlr(&self) -> Vlr {
        let data = self.fields.iter().flat_map(|field| field.description(&self.bands)).collect();
        Vlr { user: "LASF_Spec", id: 4, description: "extra bytes", data }
    }
}

impl ExtraField {
    const fn n_bytes(self) -> usize {
        match self {
            Self::Instance | Self::Region | Self::Frame => 4,
            Self::Band(_) => 2,
            _ => 1,
        }
    }

    /// The 192 bytes of the specification's table 24.
    fn description(self, bands: &[String]) -> Vec<u8> {
        let (name, text): (&str, &str) = match self {
            Self::Class => ("class", "class id, 0 = unlabeled"),
            Self::Score => ("score", "probability of the class"),
            Self::Laser => ("laser", "laser number, 0 = lowest"),
            Self::Moving => ("moving", "1 = on a moving object"),
            Self::Camera => ("camera", "camera of the color, 255 = none"),
            Self::Lidar => ("lidar", "index of the LiDAR"),
            Self::Material => ("material", "material id, 0 = unknown"),
            Self::MaterialScore => ("material_score", "probability of the material"),
            Self::Instance => ("instance", "number of the object, 0 = none"),
            Self::Region => ("region", "region of equal spectra, 0 = none"),
            Self::Frame => ("frame", "number of the sweep"),
            Self::Band(band) => (&bands[band], "reflectance, 1 = white diffuser"),
        };
        // Types: 1 = u8, 4 = i16, 5 = u32. Options: bit 0 = value for no data, bit 3 = scale.
        let (data_type, options, no_data, scale) = match self {
            Self::Instance | Self::Region | Self::Frame => (5, 0, 0, 0.0),
            Self::Band(_) => (4, 0b1001, i64::from(NO_REFLECTANCE), REFLECTANCE_STEP),
            Self::Score | Self::MaterialScore => (1, 0b1000, 0, 1.0 / 255.0),
            _ => (1, 0, 0, 0.0),
        };
        let mut bytes = vec![0, 0, data_type, options];
        bytes.extend(padded::<32>(name));
        bytes.extend([0; 4]);
        bytes.extend(no_data.to_le_bytes());
        // Two unused values of no data, then minima and maxima, which are not stated.
        bytes.extend([0; 16 + 24 + 24]);
        bytes.extend(scale.to_le_bytes());
        // Unused scales, and offsets.
        bytes.extend([0; 16 + 24]);
        bytes.extend(padded::<32>(text));
        bytes
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn description_has_the_layout_of_the_specification() {
        let bands = vec!["band_0623nm".to_owned()];
        let extra = ExtraBytes::new(Present { class: true, ..Present::default() }, &bands);
        assert_eq!(extra.fields.len(), 6);
        assert_eq!(extra.n_bytes(), 10);
        let Vlr { data, .. } = extra.vlr();
        assert_eq!(data.len(), 6 * 192);
        let band = &data[5 * 192..];
        assert_eq!((band[2], band[3]), (4, 9));
        assert!(band[4..].starts_with(b"band_0623nm\0"));
        assert_eq!(band[40..48], i64::from(i16::MIN).to_le_bytes());
        assert_eq!(band[112..120], 1e-4_f64.to_le_bytes());
        assert!(band[160..].starts_with(b"reflectance, 1 = white diffuser"));
    }
}
