//! The material of a spectrum.

use crate::gaussian::{BandModel, Whitened, log_reflectance};
use crate::model::Model;
use crate::spectra::{Spectra, Spectrum};
use messages::MaterialId;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Number of materials, including unknown.
pub const N_MATERIALS: usize = MaterialId::ALL.len();

/// Probability of each material, by its id. The sum is 1, or 0 for a spectrum with too few bands.
pub type Probabilities = [f32; N_MATERIALS];

/// Smallest number of measured bands of a spectrum that gets a material.
const MIN_BANDS: u32 = 8;

/// Method of comparing a spectrum with the references.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Spectral angle (Kruse et al. 1993): the reference at the smallest angle. It does not depend on brightness.
    Angle,
    /// The nearest reference by the logarithms of the ratios of all bands to their geometric mean. It does not depend on
    /// brightness, and dark bands count as much as bright ones.
    Ratios,
    /// Gaussians around the references with the covariance of the model.
    #[default]
    Learned,
}

impl Method {
    /// All methods, in the order of tables.
    pub const ALL: [Self; 3] = [Self::Angle, Self::Ratios, Self::Learned];

    /// Name in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Angle => "angle",
            Self::Ratios => "ratios",
            Self::Learned => "learned",
        }
    }
}

/// The Gaussians in each light for sets of bands.
type Gaussians = BTreeMap<u64, Vec<Whitened>>;

/// Compares spectra with the references of a model.
pub struct Classifier {
    method: Method,
    /// Bands in each light.
    bands: Vec<BandModel>,
    /// Material and logarithm of the share of each reference.
    references: Vec<(MaterialId, f64)>,
    max_distance: f64,
}

impl Classifier {
    /// A classifier for spectra with these bands.
    pub fn new(model: &Model, wavelengths_nm: &[f32], method: Method) -> Self {
        let references = model.references.iter().enumerate();
        Self {
            method,
            bands: (0..model.lights.len()).map(|light| BandModel::new(model, light, wavelengths_nm)).collect(),
            references: references.map(|(i, reference)| (model.material(i), reference.share.ln())).collect(),
            max_distance: model.max_distance,
        }
    }

    /// Probabilities of the materials of each spectrum.
    pub fn classify(&self, spectra: &Spectra) -> Vec<Probabilities> {
        // Nearly all spectra have all bands: the Gaussians of incomplete spectra are computed once for each set of bands
        // that occurs.
        let known = self.bands[0].known;
        let of_bands: Gaussians = if self.method == Method::Learned {
            let mut sets: Vec<u64> = spectra.valid.iter().map(|valid| valid & known).collect();
            sets.par_sort_unstable();
            sets.dedup();
            sets.into_par_iter().filter_map(|bands| Some((bands, self.whitened(bands)?))).collect()
        } else {
            BTreeMap::new()
        };
        (0..spectra.len()).into_par_iter().map(|i| self.probabilities(spectra.get(i), &of_bands)).collect()
    }

    /// The Gaussians of these bands in each light; `None` if there are too few bands.
    fn whitened(&self, bands: u64) -> Option<Vec<Whitened>> {
        (bands.count_ones() >= MIN_BANDS).then(|| self.bands.iter().map(|light| light.marginal(bands)).collect())
    }

    /// Squared distance per band to the nearest reference of each spectrum with enough bands.
    pub(crate) fn nearest(&self, spectra: &Spectra) -> Vec<f64> {
        let of = |spectrum: Spectrum<'_>| {
            let lights = self.whitened(spectrum.valid & self.bands[0].known)?;
            let distances = lights.iter().flat_map(|light| light.distances(spectrum.values));
            Some(distances.fold(f64::INFINITY, f64::min) / lights[0].bands.len() as f64)
        };
        (0..spectra.len()).into_par_iter().filter_map(|i| of(spectra.get(i))).collect()
    }

    fn probabilities(&self, spectrum: Spectrum<'_>, of_bands: &Gaussians) -> Probabilities {
        let bands = spectrum.valid & self.bands[0].known;
        if bands.count_ones() < MIN_BANDS {
            return [0.0; N_MATERIALS];
        }
        match self.method {
            Method::Angle => self.classify_nearest(|mean| angle(spectrum, bands, mean)),
            Method::Ratios => self.classify_nearest(|mean| ratio_distance(spectrum, bands, mean)),
            Method::Learned => {
                of_bands.get(&bands).map_or([0.0; N_MATERIALS], |lights| self.posterior(lights, spectrum.values))
            }
        }
    }

    /// Full probability for the material of the nearest reference.
    fn classify_nearest(&self, distance: impl Fn(&[f64]) -> f64) -> Probabilities {
        let mut probabilities = [0.0; N_MATERIALS];
        let distances = (0..self.references.len()).map(|reference| distance(self.bands[0].mean(reference)));
        if let Some((nearest, _)) = distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)) {
            probabilities[self.references[nearest].0 as usize] = 1.0;
        }
        probabilities
    }

    fn posterior(&self, lights: &[Whitened], values: &[f32]) -> Probabilities {
        let mut probabilities = [0.0; N_MATERIALS];
        let mut nearest = f64::INFINITY;
        let mut largest = f64::NEG_INFINITY;
        let mut logs = Vec::with_capacity(lights.len() * self.references.len());
        for light in lights {
            for (distance, (material, log_share)) in light.distances(values).zip(&self.references) {
                let log_density = light.log_density - 0.5 * distance;
                let log = light.log_share + log_share + log_density;
                nearest = nearest.min(distance);
                largest = largest.max(log);
                logs.push((*material, log));
            }
        }
        if nearest > self.max_distance * lights[0].bands.len() as f64 {
            probabilities[MaterialId::Unknown as usize] = 1.0;
            return probabilities;
        }
        let sum: f64 = logs.iter().map(|(_, log)| (log - largest).exp()).sum();
        for (material, log) in logs {
            probabilities[material as usize] += ((log - largest).exp() / sum) as f32;
        }
        probabilities
    }
}

/// The positions of the set bits.
fn places(bands: u64) -> impl Iterator<Item = usize> {
    (0..64).filter(move |band| bands >> band & 1 == 1)
}

/// Spectral angle to a reference given by its logarithms, rad.
fn angle(spectrum: Spectrum<'_>, bands: u64, mean: &[f64]) -> f64 {
    let mut ab = 0.0;
    let mut aa = 0.0;
    let mut bb = 0.0;
    for band in places(bands) {
        let a = f64::from(spectrum.values[band]);
        let b = mean[band].exp();
        ab += a * b;
        aa += a * a;
        bb += b * b;
    }
    (ab / (aa * bb).sqrt().max(1e-12)).clamp(-1.0, 1.0).acos()
}

/// Squared distance of the logarithms after subtracting their means.
fn ratio_distance(spectrum: Spectrum<'_>, bands: u64, mean: &[f64]) -> f64 {
    let difference = |band: usize| f64::from(log_reflectance(spectrum.values[band])) - mean[band];
    let n = f64::from(bands.count_ones());
    let (sum, squares) = places(bands).map(difference).fold((0.0, 0.0), |(s, q), d| (s + d, q + d * d));
    squares - sum * sum / n
}
