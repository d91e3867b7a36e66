//! Fits a model to labeled spectra.

use crate::classifier::{Classifier, Method};
use crate::gaussian::log_reflectance;
use crate::model::{Light, Model, Reference};
use crate::spectra::{Spectra, Spectrum};
use messages::MaterialId;
use std::collections::BTreeMap;

/// Least number of spectra of a surface in a light whose mean is used. Other surfaces get their true spectrum as it would
/// be measured.
const MIN_SPECTRA: usize = 20;
/// Share of the training spectra that fit a reference.
const FITTING_SHARE: f64 = 0.995;
/// Number of brightness levels in the sun and in the shade: noise and color depend on the amount of light, not only on
/// direct sunlight. Chosen on separate towns (lab/notebook/materials.md).
const LEVELS: [usize; 2] = [2, 4];
/// Largest number of spectra of a surface in the sun or in the shade that determine the largest distance.
const N_CHOOSING: usize = 200;

/// Labeled spectra with the same bands, ascending.
#[derive(Clone, Debug, Default)]
pub struct Fit {
    wavelengths_nm: Vec<f32>,
    surfaces: BTreeMap<String, Surface>,
}

/// Spectra of a surface. All are logarithms.
#[derive(Clone, Debug)]
struct Surface {
    material: MaterialId,
    true_logs: Vec<f32>,
    /// Measured spectra in the sun, and in the shade.
    measured: [Vec<Vec<f32>>; 2],
}

impl Fit {
    /// A fit for spectra with these bands, nm, ascending.
    pub fn new(wavelengths_nm: &[f32]) -> Self {
        Self { wavelengths_nm: wavelengths_nm.to_vec(), surfaces: BTreeMap::new() }
    }

    /// Adds a surface with its true reflectances. Library spectra are surfaces without measurements.
    pub fn add_surface(&mut self, name: &str, material: MaterialId, reflectances: &[f32]) {
        let true_logs = reflectances.iter().map(|value| log_reflectance(*value)).collect();
        self.surfaces.insert(name.to_owned(), Surface { material, true_logs, measured: [Vec::new(), Vec::new()] });
    }

    /// Adds a measured spectrum of a surface that was added before. Spectra without one of the bands are ignored.
    pub fn add(&mut self, name: &str, is_sunlit: bool, spectrum: Spectrum<'_>) {
        let is_whole = spectrum.measured().count() == self.wavelengths_nm.len();
        if let Some(surface) = self.surfaces.get_mut(name).filter(|_| is_whole) {
            let logs = spectrum.values.iter().map(|value| log_reflectance(*value)).collect();
            surface.measured[usize::from(!is_sunlit)].push(logs);
        }
    }

    /// The model. The frequency of a material is the square root of its number of spectra; references of a material are
    /// equally frequent. `None` unless at least one surface was measured in the sun and one in the shade.
    pub fn model(&self, about: String) -> Option<Model> {
        let counts = |light: usize| self.surfaces.values().map(move |surface| surface.measured[light].len());
        let [n_sun, n_shade] = [0, 1].map(|light| counts(light).sum::<usize>() as f64);
        let offset = self.offset()?;
        self.surfaces.values().find_map(|surface| surface.measured_mean(1))?;
        let shares = self.shares();
        let reference = |(name, surface): (&String, &Surface)| Reference {
            name: name.clone(),
            material: surface.material.name().to_owned(),
            share: shares[&surface.material],
            log_reflectance: surface.reference(&offset).iter().map(|log| rounded(*log, 1e3) as f32).collect(),
        };
        let references: Vec<Reference> = self.surfaces.iter().map(reference).collect();
        let lights = [(0, n_sun), (1, n_shade)].into_iter();
        let lights = lights.flat_map(|(light, n)| self.levels(light, n / (n_sun + n_shade), &references)).collect();
        let wavelengths_nm = self.wavelengths_nm.clone();
        let mut model = Model { about, wavelengths_nm, references, lights, max_distance: f64::MAX };
        model.max_distance = self.max_distance(&model);
        Some(model)
    }

    /// Mean difference between measured and true logarithms in the sun, band by band: oblique surfaces, and the color of the light.
    fn offset(&self) -> Option<Vec<f64>> {
        let measured: Vec<(Vec<f64>, &Surface)> =
            (self.surfaces.values()).filter_map(|surface| Some((surface.measured_mean(0)?, surface))).collect();
        let of =
            |band: usize| measured.iter().map(move |(mean, surface)| mean[band] - f64::from(surface.true_logs[band]));
        let n = measured.len() as f64;
        (!measured.is_empty()).then(|| (0..self.wavelengths_nm.len()).map(|band| of(band).sum::<f64>() / n).collect())
    }

    /// The brightness levels in the sun or in the shade. All surfaces have the same weight: the most frequent wall must
    /// not dominate.
    fn levels(&self, light: usize, share: f64, references: &[Reference]) -> Vec<Light> {
        let known =
            self.surfaces.values().zip(references).map(|(surface, reference)| (&surface.measured[light], reference));
        let mut spectra: Vec<WeightedSpectrum> = Vec::new();
        for (measured, reference) in known.filter(|(measured, _)| measured.len() >= MIN_SPECTRA) {
            let weight = 1.0 / measured.len() as f64;
            spectra.extend(measured.iter().map(|logs| WeightedSpectrum::new(logs, &reference.log_reflectance, weight)));
        }
        spectra.sort_by(|a, b| a.brightness.total_cmp(&b.brightness));
        let total: f64 = spectra.iter().map(|spectrum| spectrum.weight).sum();
        let n_levels = LEVELS[light];
        let mut sum = 0.0;
        let level_of = |spectrum: &WeightedSpectrum| {
            sum += spectrum.weight / total;
            ((sum * n_levels as f64) as usize).min(n_levels - 1)
        };
        let level_of: Vec<usize> = spectra.iter().map(level_of).collect();
        let level = |level: usize| {
            let first = level_of.partition_point(|other| *other < level);
            let end = level_of.partition_point(|other| *other <= level);
            let (offset, covariance) = moments(&spectra[first..end], self.wavelengths_nm.len());
            Light { share: rounded(share / n_levels as f64, 1e4), offset, covariance }
        };
        (0..n_levels).map(level).collect()
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

    /// Squared distance per band within which nearly all training spectra have a reference.
    fn max_distance(&self, model: &Model) -> f64 {
        let mut spectra = Spectra::new(&self.wavelengths_nm);
        for measured in self.surfaces.values().flat_map(|surface| &surface.measured) {
            for logs in measured.iter().step_by(measured.len().div_ceil(N_CHOOSING).max(1)) {
                let values: Vec<f32> = logs.iter().map(|log| log.exp()).collect();
                spectra.push(u64::MAX >> (64 - values.len()), &values);
            }
        }
        let mut distances = Classifier::new(model, &self.wavelengths_nm, Method::Learned).nearest(&spectra);
        distances.sort_by(f64::total_cmp);
        let last = ((distances.len() as f64 * FITTING_SHARE) as usize).min(distances.len().saturating_sub(1));
        distances.get(last).map_or(f64::MAX, |distance| rounded(*distance, 1e3).max(1e-3))
    }
}

impl Surface {
    /// Mean of the measured logarithms in a light; `None` if there are too few.
    fn measured_mean(&self, light: usize) -> Option<Vec<f64>> {
        let spectra = &self.measured[light];
        let sum = |band: usize| spectra.iter().map(|spectrum| f64::from(spectrum[band])).sum::<f64>();
        let mean = |band: usize| sum(band) / spectra.len() as f64;
        (spectra.len() >= MIN_SPECTRA).then(|| (0..self.true_logs.len()).map(mean).collect())
    }

    /// The spectrum in the sun, measured or predicted.
    fn reference(&self, offset: &[f64]) -> Vec<f64> {
        let expected = || self.true_logs.iter().zip(offset).map(|(log, offset)| f64::from(*log) + offset).collect();
        self.measured_mean(0).unwrap_or_else(expected)
    }
}

/// A measured spectrum and its reference.
struct WeightedSpectrum<'a> {
    logs: &'a [f32],
    reference: &'a [f32],
    weight: f64,
    /// Mean difference to the reference.
    brightness: f64,
}

impl<'a> WeightedSpectrum<'a> {
    fn new(logs: &'a [f32], reference: &'a [f32], weight: f64) -> Self {
        let mut spectrum = Self { logs, reference, weight, brightness: 0.0 };
        spectrum.brightness = spectrum.differences().sum::<f64>() / logs.len() as f64;
        spectrum
    }

    fn differences(&self) -> impl Iterator<Item = f64> {
        self.logs.iter().zip(self.reference).map(|(log, reference)| f64::from(*log) - f64::from(*reference))
    }
}

/// Mean of the differences to the references, and the upper triangle of their covariance.
fn moments(spectra: &[WeightedSpectrum<'_>], n_bands: usize) -> (Vec<f32>, Vec<f64>) {
    let total: f64 = spectra.iter().map(|spectrum| spectrum.weight).sum();
    let mut mean = vec![0.0; n_bands];
    for spectrum in spectra {
        let weight = spectrum.weight / total;
        mean.iter_mut().zip(spectrum.differences()).for_each(|(mean, difference)| *mean += weight * difference);
    }
    let pairs = || (0..n_bands).flat_map(|i| (i..n_bands).map(move |k| (i, k)));
    let mut covariance = vec![0.0; n_bands * (n_bands + 1) / 2];
    for spectrum in spectra {
        let weight = spectrum.weight / total;
        let off: Vec<f64> = spectrum.differences().zip(&mean).map(|(difference, mean)| difference - mean).collect();
        for (sum, (i, k)) in covariance.iter_mut().zip(pairs()) {
            *sum += weight * off[i] * off[k];
        }
    }
    let offset = mean.iter().map(|value| rounded(*value, 1e3) as f32).collect();
    (offset, covariance.into_iter().map(|value| rounded(value, 1e5)).collect())
}

/// A value rounded to a multiple of 1 / `parts`, which keeps the file small.
fn rounded(value: f64, parts: f64) -> f64 {
    (value * parts).round() / parts
}
