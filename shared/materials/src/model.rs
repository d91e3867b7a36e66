//! Reference spectra, and the distribution of measured spectra around them.

use crate::band_place::BandPlace;
use messages::MaterialId;
use serde::{Deserialize, Serialize};

/// The built-in model: fitted by `replica-lab fit-materials`, which names its sources.
const BUILT_IN: &str = include_str!("../../../models/materials.json");

/// Largest number of bands of a model: the limit of a spectrum.
const MAX_BANDS: usize = 64;

/// Reference spectra of materials, and their measurements in lights of several levels, from full sun to deep shade.
///
/// All values are natural logarithms of reflectances. An oblique surface adds the same number to all bands, so the
/// covariance has a large variance in this direction. The darker the light, the stronger the noise and the color of the
/// skylight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Model {
    /// Source of the spectra.
    pub about: String,
    /// Bands of the references, nm, ascending.
    pub wavelengths_nm: Vec<f32>,
    /// The references.
    pub references: Vec<Reference>,
    /// The lights.
    pub lights: Vec<Light>,
    /// Largest squared distance per band at which a spectrum fits a reference.
    pub max_distance: f64,
}

/// Distribution of measured spectra in a light of one level.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Light {
    /// Share of the points in this light, 0 to 1.
    pub share: f64,
    /// Mean difference to the reference, by band.
    pub offset: Vec<f32>,
    /// Covariance of the logarithms around reference and offset: upper triangle, row by row.
    pub covariance: Vec<f64>,
}

/// A reference spectrum.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Reference {
    /// Its name in its source.
    pub name: String,
    /// Name of its [`MaterialId`].
    pub material: String,
    /// Expected frequency, 0 to 1.
    pub share: f64,
    /// Logarithm of the measured reflectance in each band, in the sun.
    pub log_reflectance: Vec<f32>,
}

/// Reason why a model cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// The text is not a model.
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    /// A value violates a rule.
    #[error("{what}: value {value} {rule}")]
    Rule {
        /// Position of the value.
        what: String,
        /// The value.
        value: String,
        /// The rule.
        rule: &'static str,
    },
}

impl Model {
    /// The built-in model.
    ///
    /// # Errors
    /// If the built-in file is damaged.
    pub fn built_in() -> Result<Self, ModelError> {
        Self::from_json(BUILT_IN)
    }

    /// Reads the text of a model file.
    ///
    /// # Errors
    /// If it is not a model.
    pub fn from_json(text: &str) -> Result<Self, ModelError> {
        let model: Self = serde_json::from_str(text)?;
        model.check()?;
        Ok(model)
    }

    /// The text of a model file: one line for each reference.
    pub fn to_json(&self) -> String {
        let text = serde_json::to_string(self).expect("strings and numbers always encode");
        text.replace("},{", "},\n{")
            .replace("\"references\":[", "\"references\":[\n")
            .replace("],\"lights", "],\n\"lights")
            + "\n"
    }

    /// The material of a reference.
    pub fn material(&self, reference: usize) -> MaterialId {
        MaterialId::from_name(&self.references[reference].material).unwrap_or(MaterialId::Unknown)
    }

    /// Reflectance of a reference in the sun at a wavelength, interpolated in its logarithm; `None` outside the bands of
    /// the model.
    pub fn reflectance(&self, reference: usize, nm: f32) -> Option<f64> {
        let logs = &self.references[reference].log_reflectance;
        BandPlace::find(&self.wavelengths_nm, nm).map(|place| place.value(|band| f64::from(logs[band])).exp())
    }

    /// Entry of the covariance in a light.
    pub(crate) fn covariance(&self, light: usize, row: usize, column: usize) -> f64 {
        let low = row.min(column);
        let high = row.max(column);
        let n = self.wavelengths_nm.len();
        self.lights[light].covariance[low * n - low * (low + 1) / 2 + high]
    }

    fn check(&self) -> Result<(), ModelError> {
        let rule = |what: String, value: String, rule: &'static str, holds: bool| {
            if holds { Ok(()) } else { Err(ModelError::Rule { what, value, rule }) }
        };
        let n = self.wavelengths_nm.len();
        let is_ascending = self.wavelengths_nm.windows(2).all(|pair| pair[0] < pair[1]);
        let bands = "must be 2 to 64 ascending wavelengths";
        rule("wavelengths_nm".to_owned(), format!("{n} bands"), bands, (2..=MAX_BANDS).contains(&n) && is_ascending)?;
        let is_share = |share: f64| share > 0.0 && share <= 1.0;
        rule("lights".to_owned(), "0".to_owned(), "must be at least one", !self.lights.is_empty())?;
        for light in &self.lights {
            let n_offsets = light.offset.len();
            rule("offset of a light".to_owned(), n_offsets.to_string(), "must be one number per band", n_offsets == n)?;
            let n_covariances = light.covariance.len();
            let triangle = "must be the upper triangle: n (n + 1) / 2 numbers of n bands";
            rule("covariance".to_owned(), n_covariances.to_string(), triangle, n_covariances == n * (n + 1) / 2)?;
            let share = light.share;
            rule("share of a light".to_owned(), share.to_string(), "must be above 0, at most 1", is_share(share))?;
        }
        rule(
            "references".to_owned(),
            self.references.len().to_string(),
            "must be at least one",
            !self.references.is_empty(),
        )?;
        for reference in &self.references {
            let what = |key: &str| format!("{key} of reference {:?}", reference.name);
            let is_known = MaterialId::from_name(&reference.material).is_some_and(|id| id != MaterialId::Unknown);
            rule(what("material"), reference.material.clone(), "must be the name of a material", is_known)?;
            let n_values = reference.log_reflectance.len();
            rule(what("log_reflectance"), n_values.to_string(), "must be one number per band", n_values == n)?;
            let share = reference.share;
            rule(what("share"), share.to_string(), "must be above 0, at most 1", is_share(share))?;
        }
        let value = self.max_distance;
        rule("max_distance".to_owned(), value.to_string(), "must be positive", value > 0.0)
    }
}
