//! The material of a spectrum.

use crate::gaussian::{BandModel, Whitened, log_reflectance};
use crate::model::Model;
use crate::spectra::{Spectra, Spectrum};
use messages::MaterialId;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Number of materials, with unknown.
pub const N_MATERIALS: usize = MaterialId::ALL.len();

/// Probability of each material, by its id. Their sum is 1, or 0 for a spectrum with too few bands.
pub type Probabilities = [f32; N_MATERIALS];

/// Fewest measured bands of a spectrum with a material.
const MIN_BANDS: u32 = 8;

/// How a spectrum is compared with the references.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Spectral angle (Kruse et al. 1993): the reference at the smallest angle. It does not depend on brightness.
    Angle,
    /// Logarithms of the ratios of all bands to their geometric mean: the nearest reference. It does not depend on brightness, and dark
    /// bands count as much as bright ones.
    Ratios,
    /// Gaussians around the references with the covariance of the model.
    #[default]
    Learned,
}

impl Method {
    /// All, in the order of tables.
    pub const ALL: [Self; 3] = [Self::Angle, Self::Ratios, Self::Learned];

    /// In tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Angle => "angle",
            Self::Ratios => "ratios",
            Self::Learned => "learned",
        }
    }
}

/// Compares spectra with the references of a model.
pub struct Classifier {
    method: Method,
    bands: BandModel,
    /// Material, logarithm of the share.
    references: Vec<(MaterialId, f64)>,
    temperature: f64,
    max_distance: f64,
}

impl Classifier {
    /// For spectra of these bands.
    pub fn new(model: &Model, wavelengths_nm: &[f32], method: Method) -> Self {
        let references = model.references.iter().enumerate();
        Self {
            method,
            bands: BandModel::new(model, wavelengths_nm),
            references: references.map(|(i, reference)| (model.material(i), reference.share.ln())).collect(),
            temperature: model.temperature,
            max_distance: model.max_distance,
        }
    }

    /// Probabilities of the materials of each spectrum.
    pub fn classify(&self, spectra: &Spectra) -> Vec<Probabilities> {
        // Nearly all spectra have all bands: the Gaussians of some bands are made once for each set of bands that occurs.
        let of_bands: BTreeMap<u64, Option<Whitened>> = if self.method == Method::Learned {
            let mut sets: Vec<u64> = spectra.valid.iter().map(|valid| valid & self.bands.known).collect();
            sets.par_sort_unstable();
            sets.dedup();
            let whitened = |bands: u64| (bands.count_ones() >= MIN_BANDS).then(|| self.bands.of_bands(bands));
            sets.into_par_iter().map(|bands| (bands, whitened(bands))).collect()
        } else {
            BTreeMap::new()
        };
        (0..spectra.len()).into_par_iter().map(|i| self.probabilities(spectra.get(i), &of_bands)).collect()
    }

    /// Squared distance per band to the nearest reference of each spectrum with enough bands.
    pub(crate) fn nearest(&self, spectra: &Spectra) -> Vec<f64> {
        let of = |spectrum: Spectrum<'_>| {
            let bands = spectrum.valid & self.bands.known;
            let whitened = (bands.count_ones() >= MIN_BANDS).then(|| self.bands.of_bands(bands))?;
            let nearest = whitened.distances(spectrum.values).fold(f64::INFINITY, f64::min);
            Some(nearest / whitened.bands.len() as f64)
        };
        (0..spectra.len()).into_par_iter().filter_map(|i| of(spectra.get(i))).collect()
    }

    fn probabilities(&self, spectrum: Spectrum<'_>, of_bands: &BTreeMap<u64, Option<Whitened>>) -> Probabilities {
        let bands = spectrum.valid & self.bands.known;
        if bands.count_ones() < MIN_BANDS {
            return [0.0; N_MATERIALS];
        }
        match self.method {
            Method::Angle => self.of_nearest(|mean| angle(spectrum, bands, mean)),
            Method::Ratios => self.of_nearest(|mean| ratio_distance(spectrum, bands, mean)),
            Method::Learned => of_bands.get(&bands).and_then(Option::as_ref).map_or([0.0; N_MATERIALS], |whitened| {
                self.posterior(whitened.distances(spectrum.values), whitened.bands.len())
            }),
        }
    }

    /// All on the material of the nearest reference.
    fn of_nearest(&self, distance: impl Fn(&[f64]) -> f64) -> Probabilities {
        let mut probabilities = [0.0; N_MATERIALS];
        let distances = (0..self.references.len()).map(|reference| distance(self.bands.mean(reference)));
        if let Some((nearest, _)) = distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1)) {
            probabilities[self.references[nearest].0 as usize] = 1.0;
        }
        probabilities
    }

    fn posterior(&self, distances: impl Iterator<Item = f64>, n_bands: usize) -> Probabilities {
        let distances: Vec<f64> = distances.collect();
        let nearest = distances.iter().copied().fold(f64::INFINITY, f64::min);
        let mut probabilities = [0.0; N_MATERIALS];
        if nearest > self.max_distance * n_bands as f64 {
            probabilities[MaterialId::Unknown as usize] = 1.0;
            return probabilities;
        }
        let logs = || distances.iter().zip(&self.references).map(|(d, (_, share))| share - 0.5 * d / self.temperature);
        let largest = logs().fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<f64> = logs().map(|log| (log - largest).exp()).collect();
        let sum: f64 = weights.iter().sum();
        for (weight, (material, _)) in weights.iter().zip(&self.references) {
            probabilities[*material as usize] += (weight / sum) as f32;
        }
        probabilities
    }
}

/// The places of the bits.
fn places(bands: u64) -> impl Iterator<Item = usize> {
    (0..64).filter(move |band| bands >> band & 1 == 1)
}

/// Spectral angle to a reference given by its logarithms, rad.
fn angle(spectrum: Spectrum<'_>, bands: u64, mean: &[f64]) -> f64 {
    let (mut ab, mut aa, mut bb) = (0.0, 0.0, 0.0);
    for band in places(bands) {
        let (a, b) = (f64::from(spectrum.values[band]), mean[band].exp());
        (ab, aa, bb) = (ab + a * b, aa + a * a, bb + b * b);
    }
    (ab / (aa * bb).sqrt().max(1e-12)).clamp(-1.0, 1.0).acos()
}

/// Squared distance of the logarithms after subtraction of their means.
fn ratio_distance(spectrum: Spectrum<'_>, bands: u64, mean: &[f64]) -> f64 {
    let difference = |band: usize| f64::from(log_reflectance(spectrum.values[band])) - mean[band];
    let n = f64::from(bands.count_ones());
    let (sum, squares) = places(bands).map(difference).fold((0.0, 0.0), |(s, q), d| (s + d, q + d * d));
    squares - sum * sum / n
}
