//! The material of a spectrum.

use crate::gaussian::{BandModel, LANES, Lanes, Whitened, log_reflectance, places, squared_distances};
use crate::model::Model;
use crate::spectra::{Spectra, Spectrum};
use messages::MaterialId;
use rayon::prelude::*;

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

/// Difference of the logarithms of two densities above which the smaller one adds nothing to a sum of 32-bit numbers.
const NEGLIGIBLE: f32 = 20.0;

/// Material of a reference, and the logarithm of its share.
struct WeightedMaterial {
    material: MaterialId,
    log_share: f32,
}

/// Compares spectra with the references of a model.
pub struct Classifier {
    method: Method,
    /// Bands in each light.
    bands: Vec<BandModel>,
    /// Each reference.
    references: Vec<WeightedMaterial>,
    /// Largest squared distance per band.
    max_distance: f32,
}

impl Classifier {
    /// A classifier for spectra with these bands.
    pub fn new(model: &Model, wavelengths_nm: &[f32], method: Method) -> Self {
        let references = model.references.iter().enumerate();
        Self {
            method,
            bands: (0..model.lights.len()).map(|light| BandModel::new(model, light, wavelengths_nm)).collect(),
            references: references
                .map(|(i, reference)| WeightedMaterial {
                    material: model.material(i),
                    log_share: reference.share.ln() as f32,
                })
                .collect(),
            max_distance: model.max_distance as f32,
        }
    }

    /// Probabilities of the materials of each spectrum.
    pub fn classify(&self, spectra: &Spectra) -> Vec<Probabilities> {
        match self.method {
            Method::Angle => self.classify_each(spectra, angle),
            Method::Ratios => self.classify_each(spectra, ratio_distance),
            Method::Learned => {
                let mut probabilities = vec![[0.0; N_MATERIALS]; spectra.len()];
                for found in self.compare_blocks(spectra, |block| self.posterior(block)) {
                    for (index, found) in found.indices.iter().zip(found.values) {
                        probabilities[*index as usize] = found;
                    }
                }
                probabilities
            }
        }
    }

    /// Squared distance per band to the nearest reference of each spectrum with enough bands.
    pub(crate) fn nearest(&self, spectra: &Spectra) -> Vec<f64> {
        let mut distances = vec![None; spectra.len()];
        for found in self.compare_blocks(spectra, |block| self.densities(block).nearest) {
            for (index, found) in found.indices.iter().zip(found.values) {
                let n_bands = (spectra.valid[*index as usize] & self.bands[0].known).count_ones();
                distances[*index as usize] = Some(f64::from(found) / f64::from(n_bands));
            }
        }
        distances.into_iter().flatten().collect()
    }

    /// Compares the spectra with enough bands, in blocks of equal bands.
    fn compare_blocks<T: Send>(
        &self,
        spectra: &Spectra,
        compare: impl Fn(&Block<'_>) -> [T; LANES] + Sync,
    ) -> Vec<Compared<T>> {
        // Nearly all spectra have all bands: the Gaussians are computed once for each set of bands that occurs.
        let known = self.bands[0].known;
        let mut order: Vec<u32> = (0..spectra.len() as u32)
            .filter(|i| (spectra.valid[*i as usize] & known).count_ones() >= MIN_BANDS)
            .collect();
        let bands_of = |i: &u32| spectra.valid[*i as usize] & known;
        order.par_sort_unstable_by_key(|i| (bands_of(i), *i));
        let sets: Vec<&[u32]> = order.chunk_by(|a, b| bands_of(a) == bands_of(b)).collect();
        let of_set = |set: &&[u32]| {
            let bands = bands_of(&set[0]);
            let lights: Vec<Whitened> = self.bands.iter().map(|light| light.marginal(bands)).collect();
            let compared = |indices: &[u32]| {
                let mut logs = vec![[0.0; LANES]; lights[0].bands.len()];
                for (lane, index) in indices.iter().enumerate() {
                    let values = spectra.get(*index as usize).values;
                    for (row, band) in logs.iter_mut().zip(&lights[0].bands) {
                        row[lane] = log_reflectance(values[*band]);
                    }
                }
                Compared { indices: indices.to_vec(), values: compare(&Block { lights: &lights, logs: &logs }) }
            };
            set.par_chunks(LANES).map(compared).collect::<Vec<_>>()
        };
        sets.par_iter().flat_map(of_set).collect()
    }

    /// Full probability for the material of the nearest reference, by the distance of a spectrum in these bands from the
    /// logarithms of a reference.
    fn classify_each(
        &self,
        spectra: &Spectra,
        distance: impl Fn(Spectrum<'_>, u64, &[f64]) -> f64 + Sync,
    ) -> Vec<Probabilities> {
        let of = |i: usize| {
            let mut probabilities = [0.0; N_MATERIALS];
            let spectrum = spectra.get(i);
            let bands = spectrum.valid & self.bands[0].known;
            if bands.count_ones() >= MIN_BANDS {
                let distances = self.references.iter().enumerate().map(|(reference, known)| {
                    (known.material, distance(spectrum, bands, self.bands[0].mean(reference)))
                });
                if let Some((material, _)) = distances.min_by(|a, b| a.1.total_cmp(&b.1)) {
                    probabilities[material as usize] = 1.0;
                }
            }
            probabilities
        };
        (0..spectra.len()).into_par_iter().map(of).collect()
    }

    fn densities(&self, block: &Block<'_>) -> Densities {
        let mut densities = Densities::default();
        wide_loops::run(
            #[inline(always)]
            || densities.measure(block, &self.references),
        );
        densities
    }

    fn posterior(&self, block: &Block<'_>) -> [Probabilities; LANES] {
        let densities = self.densities(block);
        let mut sums = [[0.0; N_MATERIALS]; LANES];
        for density in &densities.of_references {
            for ((log, largest), sum) in density.logs.iter().zip(&densities.largest).zip(&mut sums) {
                let below = log - largest;
                if below > -NEGLIGIBLE {
                    sum[density.material as usize] += below.exp();
                }
            }
        }
        let limit = self.max_distance * block.logs.len() as f32;
        for (sum, nearest) in sums.iter_mut().zip(densities.nearest) {
            if nearest > limit {
                *sum = [0.0; N_MATERIALS];
                sum[MaterialId::Unknown as usize] = 1.0;
            }
            let total: f32 = sum.iter().sum();
            *sum = sum.map(|p| p / total);
        }
        sums
    }
}

/// Spectra of the same bands: the logarithms of their reflectances, one row per band, and the Gaussians of these bands in each
/// light.
struct Block<'a> {
    lights: &'a [Whitened],
    logs: &'a [Lanes],
}

/// Numbers of the spectra of a block, and what was found for each. Further values have no meaning.
struct Compared<T> {
    indices: Vec<u32>,
    values: [T; LANES],
}

/// Logarithms of the densities of a block at a reference in a light.
struct Density {
    material: MaterialId,
    logs: Lanes,
}

/// Densities of a block at all references in all lights.
struct Densities {
    of_references: Vec<Density>,
    largest: Lanes,
    /// Squared distance to the nearest reference.
    nearest: Lanes,
}

impl Default for Densities {
    fn default() -> Self {
        Self { of_references: Vec::new(), largest: [f32::NEG_INFINITY; LANES], nearest: [f32::INFINITY; LANES] }
    }
}

impl Densities {
    #[inline(always)]
    fn measure(&mut self, block: &Block<'_>, references: &[WeightedMaterial]) {
        let mut white = Vec::with_capacity(block.logs.len());
        self.of_references.reserve(block.lights.len() * references.len());
        for light in block.lights {
            light.whiten(block.logs, &mut white);
            for (values, reference) in light.references().zip(references) {
                let distances = squared_distances(values, &white);
                let log_weight = light.log_weight + reference.log_share;
                let mut logs = [0.0; LANES];
                for lane in 0..LANES {
                    logs[lane] = log_weight - 0.5 * distances[lane];
                    self.largest[lane] = self.largest[lane].max(logs[lane]);
                    self.nearest[lane] = self.nearest[lane].min(distances[lane]);
                }
                self.of_references.push(Density { material: reference.material, logs });
            }
        }
    }
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Model;
    use nalgebra::{Cholesky, DMatrix, DVector};
    use random::Random;

    /// Probabilities in 64-bit arithmetic, reference by reference.
    fn expected(model: &Model, values: &[f32]) -> [f64; N_MATERIALS] {
        let n = values.len();
        let mut densities = [0.0; N_MATERIALS];
        let logs: Vec<f64> = values.iter().map(|value| f64::from(log_reflectance(*value))).collect();
        let mut found = Vec::new();
        for (light, of_light) in model.lights.iter().enumerate() {
            let floor = |row, column| if row == column { 4e-4 } else { 0.0 };
            let covariance =
                DMatrix::from_fn(n, n, |row, column| model.covariance(light, row, column) + floor(row, column));
            let root = Cholesky::new(covariance).expect("positive definite").l();
            let log_root_determinant: f64 = root.diagonal().iter().map(|value| value.ln()).sum();
            for (number, reference) in model.references.iter().enumerate() {
                let mut difference = DVector::from_fn(n, |band, _| {
                    logs[band] - f64::from(reference.log_reflectance[band]) - f64::from(of_light.offset[band])
                });
                root.solve_lower_triangular_mut(&mut difference);
                let log =
                    (of_light.share * reference.share).ln() - log_root_determinant - 0.5 * difference.norm_squared();
                found.push((model.material(number), log));
            }
        }
        let largest = found.iter().fold(f64::NEG_INFINITY, |largest, (_, log)| largest.max(*log));
        for (material, log) in found {
            densities[material as usize] += (log - largest).exp();
        }
        let sum: f64 = densities.iter().sum();
        densities.map(|density| density / sum)
    }

    #[test]
    fn blocks_equal_single_spectra_in_double_precision() {
        let model = Model::built_in().expect("the built-in model");
        let mut random = Random::new(7);
        let mut spectra = Spectra::new(&model.wavelengths_nm);
        // More than a block, and a last one that is not full.
        for _ in 0..3 * LANES + 5 {
            let reference = random.pick(&model.references);
            let gain = 0.3 * random.gauss();
            let values: Vec<f32> =
                reference.log_reflectance.iter().map(|log| (log + gain + 0.02 * random.gauss()).exp()).collect();
            spectra.push(u64::MAX, &values);
        }
        let found = Classifier::new(&model, &model.wavelengths_nm, Method::Learned).classify(&spectra);
        let mut n_known = 0;
        for (i, found) in found.iter().enumerate().filter(|(_, found)| found[MaterialId::Unknown as usize] == 0.0) {
            n_known += 1;
            for (found, expected) in found.iter().zip(expected(&model, spectra.get(i).values)) {
                assert!((f64::from(*found) - expected).abs() < 1e-3, "spectrum {i}: {found}, expected {expected}");
            }
        }
        assert!(n_known > 2 * LANES, "{n_known} of {} spectra have a material", spectra.len());
    }
}
