//! Names of the input features.

use serde::{Deserialize, Serialize};
use std::fmt;
use std::ops::RangeInclusive;

/// Wavelengths of bands, nm: the sensitivity range of silicon detectors.
const WAVELENGTHS_NM: RangeInclusive<u16> = 300..=1100;

/// Number of default features, for a model that names no features.
pub const N_FEATURES: usize = 10;

/// Largest number of features of a model.
const MAX_FEATURES: usize = 64;

/// One input feature. All values are about -1 to 3; without a point, they are 0.
///
/// | feature | value |
/// |---|---|
/// | `valid` | 1 with a point |
/// | `range` | ln(1 + range / m) - 2 |
/// | `height_fine` | tanh(height above the ground / 0.3 m): resolves curbs |
/// | `height_coarse` | height above the ground / 4 m, -1 to 3 |
/// | `normal_up` | z of the unit normal; 0 without one |
/// | `incidence` | cosine of ray and normal, 0 to 1; 0 without a normal |
/// | `elevation` | sine of the ray's elevation |
/// | `roughness` | tanh(distance from the line between the neighbors in the row / 0.1 m) |
/// | `intensity` | return strength / 50; 0 if unknown |
/// | `has_intensity` | 1 if intensities are known |
/// | `normal_x` | of the unit normal, the component along the horizontal direction of the ray; 0 without a normal |
/// | `normal_y` | of the unit normal, the component to the left of that direction; 0 without a normal |
/// | `depth` | range / 50 m, at most 3 |
/// | `z` | height above the LiDAR / 10 m, -3 to 3 |
/// | `red`, `green`, `blue` | sRGB / 255; 0 if no camera saw the point |
/// | `has_color` | 1 if a camera saw the point |
/// | `band_<nm>` | reflectance at this wavelength, 0 to 2; 0 if no band near it was measured |
/// | `has_band_<nm>` | 1 if a band near this wavelength was measured |
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
#[allow(missing_docs, reason = "the table describes them")]
pub enum Feature {
    Valid,
    Range,
    HeightFine,
    HeightCoarse,
    NormalUp,
    Incidence,
    Elevation,
    Roughness,
    Intensity,
    HasIntensity,
    NormalX,
    NormalY,
    Depth,
    Z,
    Red,
    Green,
    Blue,
    HasColor,
    Band(u16),
    HasBand(u16),
}

/// Features without a wavelength, and their names. The first ten are the default features.
const NAMED: [(Feature, &str); 18] = [
    (Feature::Valid, "valid"),
    (Feature::Range, "range"),
    (Feature::HeightFine, "height_fine"),
    (Feature::HeightCoarse, "height_coarse"),
    (Feature::NormalUp, "normal_up"),
    (Feature::Incidence, "incidence"),
    (Feature::Elevation, "elevation"),
    (Feature::Roughness, "roughness"),
    (Feature::Intensity, "intensity"),
    (Feature::HasIntensity, "has_intensity"),
    (Feature::NormalX, "normal_x"),
    (Feature::NormalY, "normal_y"),
    (Feature::Depth, "depth"),
    (Feature::Z, "z"),
    (Feature::Red, "red"),
    (Feature::Green, "green"),
    (Feature::Blue, "blue"),
    (Feature::HasColor, "has_color"),
];

/// A camera measurement that a feature shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CameraBand {
    /// sRGB red, 0 to 1.
    Red,
    /// sRGB green, 0 to 1.
    Green,
    /// sRGB blue, 0 to 1.
    Blue,
    /// Reflectance at a wavelength, nm.
    Nm(u16),
}

impl Feature {
    /// The camera measurement that the feature contains or whose presence it states; `None` for LiDAR features.
    pub fn camera_band(self) -> Option<CameraBand> {
        match self {
            Self::Red | Self::HasColor => Some(CameraBand::Red),
            Self::Green => Some(CameraBand::Green),
            Self::Blue => Some(CameraBand::Blue),
            Self::Band(nm) | Self::HasBand(nm) => Some(CameraBand::Nm(nm)),
            _ => None,
        }
    }
}

impl fmt::Display for Feature {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Band(nm) => write!(f, "band_{nm}"),
            Self::HasBand(nm) => write!(f, "has_band_{nm}"),
            _ => f.write_str(NAMED.iter().find(|(feature, _)| feature == self).map_or("", |(_, name)| name)),
        }
    }
}

impl From<Feature> for String {
    fn from(feature: Feature) -> Self {
        feature.to_string()
    }
}

impl TryFrom<String> for Feature {
    type Error = String;

    fn try_from(name: String) -> Result<Self, String> {
        if let Some((feature, _)) = NAMED.iter().find(|(_, known)| *known == name) {
            return Ok(*feature);
        }
        let wavelength = |prefix: &str| name.strip_prefix(prefix).and_then(|text| text.parse::<u16>().ok());
        let band = wavelength("band_").map(Self::Band).or_else(|| wavelength("has_band_").map(Self::HasBand));
        let in_range = |feature: &Self| {
            let (Self::Band(nm) | Self::HasBand(nm)) = feature else { return false };
            // `band_0650` would be a second name.
            WAVELENGTHS_NM.contains(nm) && feature.to_string() == name
        };
        band.filter(in_range).ok_or_else(|| {
            let names: Vec<&str> = NAMED.iter().map(|(_, name)| *name).collect();
            let [first, last] = [WAVELENGTHS_NM.start(), WAVELENGTHS_NM.end()];
            format!(
                "unknown feature {name:?}; known are {}, band_<nm> and has_band_<nm> of {first} to {last} nm",
                names.join(", ")
            )
        })
    }
}

/// The input features of a model, in order.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Features(Vec<Feature>);

impl Default for Features {
    /// The default features, for a model that names no features.
    fn default() -> Self {
        Self(NAMED[..N_FEATURES].iter().map(|(feature, _)| *feature).collect())
    }
}

impl Features {
    /// Creates a list of features in this order.
    pub fn new(features: Vec<Feature>) -> Self {
        Self(features)
    }
    /// The features in order.
    pub fn as_slice(&self) -> &[Feature] {
        &self.0
    }
    /// Number of features.
    #[allow(clippy::len_without_is_empty, reason = "a valid model has at least one")]
    pub fn len(&self) -> usize {
        self.0.len()
    }
    /// Whether these are the default features.
    pub fn is_default(&self) -> bool {
        self.0.len() == N_FEATURES && self.0.iter().zip(&NAMED).all(|(feature, (known, _))| feature == known)
    }
    /// The first violated rule, if any.
    pub fn problem(&self) -> Option<String> {
        let n = self.0.len();
        if !(1..=MAX_FEATURES).contains(&n) {
            return Some(format!("{n} features, must be 1 to {MAX_FEATURES}"));
        }
        let twice = (1..n).find(|&i| self.0[..i].contains(&self.0[i]));
        twice.map(|i| format!("features: {} is listed twice", self.0[i]))
    }
    /// The distinct camera measurements, in the order of the features.
    pub fn camera_bands(&self) -> Vec<CameraBand> {
        let mut bands = Vec::new();
        for band in self.0.iter().filter_map(|feature| feature.camera_band()) {
            if !bands.contains(&band) {
                bands.push(band);
            }
        }
        bands
    }
    /// The columns that the features need in addition to the points.
    pub fn columns(&self) -> AskedColumns {
        let bands = self.camera_bands();
        let wavelength = |band: &CameraBand| if let CameraBand::Nm(nm) = band { Some(*nm) } else { None };
        let wavelengths_nm: Vec<u16> = bands.iter().filter_map(wavelength).collect();
        AskedColumns { color: bands.len() > wavelengths_nm.len(), wavelengths_nm }
    }
}

/// Columns of a submap that a model reads in addition to its points.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct AskedColumns {
    /// Whether the model reads colors.
    pub color: bool,
    /// Wavelengths of the spectra that the model reads, nm.
    pub wavelengths_nm: Vec<u16>,
}

impl AskedColumns {
    /// The columns of two models.
    #[must_use]
    pub fn and(mut self, other: Self) -> Self {
        self.color |= other.color;
        self.wavelengths_nm.extend(other.wavelengths_nm);
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_is_read_as_it_is_written() {
        let bands = [Feature::Band(650), Feature::HasBand(1100)];
        for feature in NAMED.into_iter().map(|(feature, _)| feature).chain(bands) {
            assert_eq!(Feature::try_from(feature.to_string()), Ok(feature));
        }
        assert_eq!(Feature::Band(650).to_string(), "band_650");
        for wrong in ["", "Red", "band_", "band_0650", "band_299", "has_band_1101", "band_-1", "band_65536"] {
            let error = Feature::try_from(wrong.to_owned()).expect_err("is refused");
            assert!(error.contains(&format!("unknown feature {wrong:?}; known are valid, range")), "{error}");
        }
    }

    #[test]
    fn columns_follow_from_features() {
        let asked = |features: &[Feature]| Features::new(features.to_vec()).columns();
        assert_eq!(Features::default().columns(), AskedColumns::default());
        assert!(Features::default().is_default());
        let color = AskedColumns { color: true, ..AskedColumns::default() };
        assert_eq!(asked(&[Feature::Valid, Feature::Blue]), color);
        assert_eq!(asked(&[Feature::HasColor]), color);
        let spectra = AskedColumns { color: false, wavelengths_nm: vec![650, 800] };
        assert_eq!(asked(&[Feature::Band(650), Feature::HasBand(650), Feature::HasBand(800)]), spectra);
        let few = Features::new(vec![Feature::Valid, Feature::Red, Feature::Valid]);
        assert_eq!(few.problem().expect("a problem"), "features: valid is listed twice");
        assert_eq!(Features::new(Vec::new()).problem().expect("a problem"), "0 features, must be 1 to 64");
    }
}
