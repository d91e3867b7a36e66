//! Colors and spectra: needs of the features of a recipe, and columns of a source.

use messages::{ColorRow, SpectraHeader, SubmapHeader, SubmapPoint};
use segmentation::points::PointFeature;
use segmentation::spherical::{BAND_REACH_NM, CameraBand, Features};
use segmentation::{ModelInput, SpectraColumn};

/// The measurements of cameras that the features of a recipe need.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CameraNeeds {
    /// The first feature that needs colors.
    pub color: Option<String>,
    /// Wavelengths at which reflectances are needed, nm, and the first feature that needs each.
    pub bands: Vec<(u16, String)>,
}

impl CameraNeeds {
    /// Needs of a network on images.
    pub fn for_images(features: &Features) -> Self {
        let mut needs = Self::default();
        for feature in features.as_slice() {
            match feature.camera_band() {
                None => {}
                Some(CameraBand::Nm(nm)) if needs.bands.iter().any(|(known, _)| *known == nm) => {}
                Some(CameraBand::Nm(nm)) => needs.bands.push((nm, feature.to_string())),
                Some(_) => {
                    needs.color.get_or_insert_with(|| feature.to_string());
                }
            }
        }
        needs
    }
    /// Needs of a network on points.
    pub fn for_points(features: &[PointFeature]) -> Self {
        let color = features.contains(&PointFeature::ColorHeight).then(|| "color_height".to_owned());
        Self { color, bands: Vec::new() }
    }
    /// The first feature that needs spectra.
    pub fn spectra(&self) -> Option<&str> {
        self.bands.first().map(|(_, feature)| feature.as_str())
    }
    /// Wavelengths of [`Self::bands`], nm.
    pub fn wavelengths_nm(&self) -> Vec<u16> {
        self.bands.iter().map(|(nm, _)| *nm).collect()
    }
    /// The first feature for which spectra have no band.
    pub fn without_band(&self, header: &SpectraHeader) -> Option<&str> {
        let measured = header.wavelengths_nm.iter().take(header.n_bands as usize);
        let is_near = |nm: u16| measured.clone().any(|of| (of - f32::from(nm)).abs() < BAND_REACH_NM);
        self.bands.iter().find(|(nm, _)| !is_near(*nm)).map(|(_, feature)| feature.as_str())
    }
}

/// Colors and spectra of a submap, if its source has them.
#[derive(Default)]
pub struct CameraColumns {
    pub colors: Option<Vec<ColorRow>>,
    /// Header and rows of the topic.
    pub spectra: Option<(Box<SpectraHeader>, Vec<u32>)>,
}

impl CameraColumns {
    /// The input of a model, as in `infer`.
    pub fn input<'a>(&'a self, header: &'a SubmapHeader, points: &'a [SubmapPoint]) -> ModelInput<'a> {
        let spectra = self.spectra.as_ref().map(|(header, rows)| SpectraColumn { header, rows });
        ModelInput { colors: self.colors.as_deref(), spectra, ..ModelInput::new(header, points) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn needs_name_the_first_feature_of_each_column() {
        let features: Vec<_> = ["valid", "green", "has_color", "has_band_650", "band_650", "band_800"]
            .map(|name| name.to_owned().try_into().expect("a feature"))
            .into();
        let needs = CameraNeeds::for_images(&Features::new(features));
        assert_eq!(needs.color.as_deref(), Some("green"));
        assert_eq!(needs.bands, [(650, "has_band_650".to_owned()), (800, "band_800".to_owned())]);
        assert_eq!(CameraNeeds::for_images(&Features::default()), CameraNeeds::default());
        let mut header = SpectraHeader { n_bands: 2, ..SpectraHeader::default() };
        header.wavelengths_nm[..3].copy_from_slice(&[660.0, 780.0, 900.0]);
        assert_eq!(needs.without_band(&header), None);
        header.n_bands = 1;
        assert_eq!(needs.without_band(&header), Some("band_800"));
    }
}
