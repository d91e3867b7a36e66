//! Makes a model from labeled spectra.

use crate::classifier::{Classifier, Method};
use crate::gaussian::log_reflectance;
use crate::model::{Model, Reference};
use crate::spectra::{Spectra, Spectrum};
use messages::MaterialId;
use std::collections::BTreeMap;

/// Fewest spectra of a reference.
const MIN_SPECTRA: usize = 20;
/// Share of the training spectra that fit a reference.
const FITTING_SHARE: f64 = 0.995;
/// Temperatures that are tried.
const TEMPERATURES: [f64; 9] = [1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0];

/// Labeled spectra of the same bands, ascending.
#[derive(Clone, Debug, Default)]
pub struct Fit {
    wavelengths_nm: Vec<f32>,
    /// By name of the reference: its material and its spectra, as logarithms.
    measured: BTreeMap<String, (MaterialId, Vec<Vec<f32>>)>,
    /// References that are known without measurements: their reflectances.
    known: Vec<(String, MaterialId, Vec<f32>)>,
}

impl Fit {
    /// For spectra of these bands, nm, ascending.
    pub fn new(wavelengths_nm: &[f32]) -> Self {
        Self { wavelengths_nm: wavelengths_nm.to_vec(), ..Self::default() }
    }

    /// Adds a measured spectrum. Those that lack a band are ignored.
    pub fn add(&mut self, name: &str, material: MaterialId, spectrum: Spectrum<'_>) {
        if spectrum.measured().count() == self.wavelengths_nm.len() {
            let logs = spectrum.values.iter().map(|value| log_reflectance(*value)).collect();
            self.measured.entry(name.to_owned()).or_insert((material, Vec::new())).1.push(logs);
        }
    }

    /// Adds the spectrum of a library.
    pub fn add_known(&mut self, name: &str, material: MaterialId, reflectances: &[f32]) {
        self.known.push((name.to_owned(), material, reflectances.to_vec()));
    }

    /// The model. Materials are as frequent as the square root of their spectra; references of a material are equally frequent. `None`
    /// without enough spectra.
    pub fn model(&self, about: String) -> Option<Model> {
        let measured = || self.measured.iter().filter(|(_, (_, spectra))| spectra.len() >= MIN_SPECTRA);
        let n = self.wavelengths_nm.len();
        let mut references: Vec<Reference> = Vec::new();
        let mut covariance = vec![0.0; n * (n + 1) / 2];
        // Of each material: its spectra, and its references.
        let mut counts: BTreeMap<MaterialId, [usize; 2]> = BTreeMap::new();
        let mut n_references = 0.0;
        for (name, (material, spectra)) in measured() {
            let of = |band: usize| spectra.iter().map(move |spectrum| f64::from(spectrum[band])).sum::<f64>();
            let mean: Vec<f64> = (0..n).map(|band| of(band) / spectra.len() as f64).collect();
            // Every reference has the same weight: the most frequent wall must not decide what noise is.
            let weight = 1.0 / spectra.len() as f64;
            for spectrum in spectra {
                let off: Vec<f64> = spectrum.iter().zip(&mean).map(|(value, mean)| f64::from(*value) - mean).collect();
                let pairs = (0..n).flat_map(|i| (i..n).map(move |k| (i, k)));
                covariance.iter_mut().zip(pairs).for_each(|(sum, (i, k))| *sum += weight * off[i] * off[k]);
            }
            n_references += 1.0;
            let [n_spectra, n_of] = counts.entry(*material).or_default();
            (*n_spectra, *n_of) = (*n_spectra + spectra.len(), *n_of + 1);
            let log_reflectance = mean.iter().map(|log| *log as f32).collect();
            references.push(reference(name, *material, log_reflectance));
        }
        if references.is_empty() {
            return None;
        }
        for sum in &mut covariance {
            *sum = rounded(*sum / n_references, 1e6);
        }
        for (name, material, reflectances) in &self.known {
            let [n_spectra, n_of] = counts.entry(*material).or_default();
            (*n_spectra, *n_of) = ((*n_spectra).max(MIN_SPECTRA), *n_of + 1);
            let logs = reflectances.iter().map(|value| log_reflectance(*value)).collect();
            references.push(reference(name, *material, logs));
        }
        let total: f64 = counts.values().map(|[n_spectra, _]| (*n_spectra as f64).sqrt()).sum();
        for reference in &mut references {
            let material = MaterialId::from_name(&reference.material).unwrap_or(MaterialId::Unknown);
            let [n_spectra, n_of] = counts[&material];
            reference.share = rounded((n_spectra as f64).sqrt() / total / n_of as f64, 1e6).max(1e-6);
        }
        let wavelengths_nm = self.wavelengths_nm.clone();
        let mut model =
            Model { about, wavelengths_nm, references, covariance, temperature: 1.0, max_distance: f64::MAX };
        self.calibrate(&mut model);
        Some(model)
    }

    /// Sets the temperature with the largest mean logarithm of the true material's probability, and the largest distance.
    fn calibrate(&self, model: &mut Model) {
        let mut spectra = Spectra::new(&self.wavelengths_nm);
        let mut truth = Vec::new();
        for (material, of_reference) in self.measured.values() {
            // As many of each reference, as far as there are.
            for logs in of_reference.iter().step_by(of_reference.len().div_ceil(200)) {
                let values: Vec<f32> = logs.iter().map(|log| log.exp()).collect();
                spectra.push(u64::MAX >> (64 - values.len()), &values);
                truth.push(*material as usize);
            }
        }
        let gain = |model: &Model| {
            let found = Classifier::new(model, &self.wavelengths_nm, Method::Learned).classify(&spectra);
            found.iter().zip(&truth).map(|(p, truth)| f64::from(p[*truth].max(1e-6)).ln()).sum::<f64>()
        };
        let tried = TEMPERATURES.map(|temperature| (temperature, gain(&Model { temperature, ..model.clone() })));
        let best = tried.into_iter().max_by(|a, b| a.1.total_cmp(&b.1));
        model.temperature = best.map_or(1.0, |(temperature, _)| temperature);
        let mut distances = Classifier::new(model, &self.wavelengths_nm, Method::Learned).nearest(&spectra);
        distances.sort_by(f64::total_cmp);
        let last = (distances.len() as f64 * FITTING_SHARE) as usize;
        model.max_distance = rounded(distances[last.min(distances.len() - 1)], 1e3).max(1e-3);
    }
}

fn reference(name: &str, material: MaterialId, log_reflectance: Vec<f32>) -> Reference {
    let log_reflectance = log_reflectance.into_iter().map(|log| rounded(f64::from(log), 1e4) as f32).collect();
    Reference { name: name.to_owned(), material: material.name().to_owned(), share: 0.0, log_reflectance }
}

/// To a multiple of 1 / `parts`: the file stays small.
fn rounded(value: f64, parts: f64) -> f64 {
    (value * parts).round() / parts
}
