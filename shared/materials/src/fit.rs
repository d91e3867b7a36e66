//! Makes a model from labeled spectra.

use crate::classifier::{Classifier, Method};
use crate::gaussian::log_reflectance;
use crate::model::{Light, Model, Reference};
use crate::spectra::{Spectra, Spectrum};
use messages::MaterialId;
use std::collections::BTreeMap;

/// Fewest spectra of a surface in a light whose mean is used. Others get their true spectrum as it would be measured.
const MIN_SPECTRA: usize = 20;
/// Share of the training spectra that fit a reference.
const FITTING_SHARE: f64 = 0.995;
/// Temperatures that are tried.
const TEMPERATURES: [f64; 9] = [1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0];
/// Most spectra of a surface in a light that choose the temperature.
const N_CHOOSING: usize = 200;

/// Labeled spectra of the same bands, ascending.
#[derive(Clone, Debug, Default)]
pub struct Fit {
    wavelengths_nm: Vec<f32>,
    surfaces: BTreeMap<String, Surface>,
}

/// What is known of a surface. All spectra are logarithms.
#[derive(Clone, Debug)]
struct Surface {
    material: MaterialId,
    true_logs: Vec<f32>,
    /// Measured in the sun, in the shade.
    measured: [Vec<Vec<f32>>; 2],
}

impl Fit {
    /// For spectra of these bands, nm, ascending.
    pub fn new(wavelengths_nm: &[f32]) -> Self {
        Self { wavelengths_nm: wavelengths_nm.to_vec(), surfaces: BTreeMap::new() }
    }

    /// Adds a surface with its true reflectances. Spectra of libraries are surfaces without measurements.
    pub fn add_surface(&mut self, name: &str, material: MaterialId, reflectances: &[f32]) {
        let true_logs = reflectances.iter().map(|value| log_reflectance(*value)).collect();
        self.surfaces.insert(name.to_owned(), Surface { material, true_logs, measured: [Vec::new(), Vec::new()] });
    }

    /// Adds a measured spectrum of a surface that was added. Those that lack a band are ignored.
    pub fn add(&mut self, name: &str, is_sunlit: bool, spectrum: Spectrum<'_>) {
        let is_whole = spectrum.measured().count() == self.wavelengths_nm.len();
        if let Some(surface) = self.surfaces.get_mut(name).filter(|_| is_whole) {
            let logs = spectrum.values.iter().map(|value| log_reflectance(*value)).collect();
            surface.measured[usize::from(!is_sunlit)].push(logs);
        }
    }

    /// The model. Materials are as frequent as the square root of their spectra; references of a material are equally frequent. `None`
    /// unless a surface was measured in the sun and one in the shade.
    pub fn model(&self, about: String) -> Option<Model> {
        let counts = |light: usize| self.surfaces.values().map(move |surface| surface.measured[light].len());
        let [n_sun, n_shade] = [0, 1].map(|light| counts(light).sum::<usize>() as f64);
        let offsets = [self.offset(0)?, self.offset(1)?];
        let lights = [(0, n_sun), (1, n_shade)].map(|(light, n)| Light {
            share: rounded(n / (n_sun + n_shade), 1e4),
            covariance: self.covariance(light, &offsets[light]),
        });
        let shares = self.shares();
        let reference = |(name, surface): (&String, &Surface)| Reference {
            name: name.clone(),
            material: surface.material.name().to_owned(),
            share: shares[&surface.material],
            log_reflectance: [0, 1].map(|light| {
                let logs = surface.mean(light, &offsets[light]);
                logs.iter().map(|log| rounded(*log, 1e3) as f32).collect()
            }),
        };
        let references = self.surfaces.iter().map(reference).collect();
        let wavelengths_nm = self.wavelengths_nm.clone();
        let mut model = Model { about, wavelengths_nm, references, lights, temperature: 1.0, max_distance: f64::MAX };
        self.calibrate(&mut model);
        Some(model)
    }

    /// Mean difference between measured and true logarithms in a light, band by band: oblique surfaces, and the color of the light.
    fn offset(&self, light: usize) -> Option<Vec<f64>> {
        let measured: Vec<(Vec<f64>, &Surface)> =
            (self.surfaces.values()).filter_map(|surface| Some((surface.measured_mean(light)?, surface))).collect();
        let of =
            |band: usize| measured.iter().map(move |(mean, surface)| mean[band] - f64::from(surface.true_logs[band]));
        let n = measured.len() as f64;
        (!measured.is_empty()).then(|| (0..self.wavelengths_nm.len()).map(|band| of(band).sum::<f64>() / n).collect())
    }

    /// Covariance around the references in a light. All surfaces have the same weight: the most frequent wall must not decide alone.
    fn covariance(&self, light: usize, offset: &[f64]) -> Vec<f64> {
        let n = self.wavelengths_nm.len();
        let mut covariance = vec![0.0; n * (n + 1) / 2];
        let mut n_surfaces = 0.0;
        for surface in self.surfaces.values().filter(|surface| surface.measured_mean(light).is_some()) {
            let (mean, spectra) = (surface.mean(light, offset), &surface.measured[light]);
            n_surfaces += 1.0;
            for spectrum in spectra {
                let off: Vec<f64> = spectrum.iter().zip(&mean).map(|(value, mean)| f64::from(*value) - mean).collect();
                let pairs = (0..n).flat_map(|i| (i..n).map(move |k| (i, k)));
                for (sum, (i, k)) in covariance.iter_mut().zip(pairs) {
                    *sum += off[i] * off[k] / spectra.len() as f64;
                }
            }
        }
        covariance.into_iter().map(|sum| rounded(sum / n_surfaces, 1e5)).collect()
    }

    /// Share of each reference of a material.
    fn shares(&self) -> BTreeMap<MaterialId, f64> {
        let mut counts: BTreeMap<MaterialId, [usize; 2]> = BTreeMap::new();
        for surface in self.surfaces.values() {
            let [n_spectra, n_surfaces] = counts.entry(surface.material).or_default();
            *n_spectra += surface.measured.iter().map(Vec::len).sum::<usize>();
            *n_surfaces += 1;
        }
        let weight = |n_spectra: usize| (n_spectra.max(MIN_SPECTRA) as f64).sqrt();
        let total: f64 = counts.values().map(|[n_spectra, _]| weight(*n_spectra)).sum();
        let share = |[n_spectra, n_surfaces]: [usize; 2]| weight(n_spectra) / total / n_surfaces as f64;
        counts.into_iter().map(|(material, counts)| (material, rounded(share(counts), 1e6).max(1e-6))).collect()
    }

    /// Sets the temperature with the largest mean logarithm of the true material's probability, and the largest distance.
    fn calibrate(&self, model: &mut Model) {
        let mut spectra = Spectra::new(&self.wavelengths_nm);
        let mut truth = Vec::new();
        for surface in self.surfaces.values() {
            for measured in &surface.measured {
                for logs in measured.iter().step_by(measured.len().div_ceil(N_CHOOSING).max(1)) {
                    let values: Vec<f32> = logs.iter().map(|log| log.exp()).collect();
                    spectra.push(u64::MAX >> (64 - values.len()), &values);
                    truth.push(surface.material as usize);
                }
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
        let last = ((distances.len() as f64 * FITTING_SHARE) as usize).min(distances.len().saturating_sub(1));
        model.max_distance = distances.get(last).map_or(f64::MAX, |distance| rounded(*distance, 1e3).max(1e-3));
    }
}

impl Surface {
    /// Mean of the measured logarithms in a light, if they are enough.
    fn measured_mean(&self, light: usize) -> Option<Vec<f64>> {
        let spectra = &self.measured[light];
        let sum = |band: usize| spectra.iter().map(|spectrum| f64::from(spectrum[band])).sum::<f64>();
        let mean = |band: usize| sum(band) / spectra.len() as f64;
        (spectra.len() >= MIN_SPECTRA).then(|| (0..self.true_logs.len()).map(mean).collect())
    }

    /// As it is measured in a light, or would be.
    fn mean(&self, light: usize, offset: &[f64]) -> Vec<f64> {
        let expected = || self.true_logs.iter().zip(offset).map(|(log, offset)| f64::from(*log) + offset).collect();
        self.measured_mean(light).unwrap_or_else(expected)
    }
}

/// To a multiple of 1 / `parts`: the file stays small.
fn rounded(value: f64, parts: f64) -> f64 {
    (value * parts).round() / parts
}
