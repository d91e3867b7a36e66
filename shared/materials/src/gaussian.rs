//! Distances to the references in the measured bands.

use crate::band_place::BandPlace;
use crate::model::Model;
use nalgebra::{Cholesky, DMatrix, DVector};

/// Variance added to every band, so that bands that were nearly equal in training do not dominate: 2 % of the
/// reflectance.
const FLOOR: f64 = 4e-4;

/// Smallest reflectance: darker values are noise. Its logarithm is finite.
const DARKEST: f32 = 0.002;

/// Logarithm of a reflectance.
pub fn log_reflectance(value: f32) -> f32 {
    value.max(DARKEST).ln()
}

/// References and covariance at the bands of a camera, in one light. They are interpolated between the bands of the
/// model.
pub struct BandModel {
    /// Bands within the wavelengths of the model, one bit each.
    pub known: u64,
    /// Logarithms in the sun, one reference after the other.
    means: Vec<f64>,
    /// Mean difference to the references in this light.
    offset: Vec<f64>,
    covariance: DMatrix<f64>,
    /// Logarithm of the share of the light.
    log_share: f64,
}

impl BandModel {
    /// The bands in the light with this number.
    pub fn new(model: &Model, light: usize, wavelengths_nm: &[f32]) -> Self {
        let place = |nm: &f32| BandPlace::find(&model.wavelengths_nm, *nm);
        let places: Vec<Option<BandPlace>> = wavelengths_nm.iter().map(place).collect();
        let n = wavelengths_nm.len();
        let covariance = DMatrix::from_fn(n, n, |row, column| {
            let (Some(row_place), Some(column_place)) = (&places[row], &places[column]) else {
                return f64::from(u8::from(row == column));
            };
            let of_row = |i: usize| column_place.value(|k| model.covariance(light, i, k));
            row_place.value(of_row) + if row == column { FLOOR } else { 0.0 }
        });
        let mean = |logs: &[f32]| -> Vec<f64> {
            let of =
                |place: &Option<BandPlace>| place.as_ref().map_or(0.0, |place| place.value(|k| f64::from(logs[k])));
            places.iter().map(of).collect()
        };
        Self {
            known: places.iter().enumerate().fold(0, |bits, (band, place)| bits | u64::from(place.is_some()) << band),
            means: model.references.iter().flat_map(|reference| mean(&reference.log_reflectance)).collect(),
            offset: mean(&model.lights[light].offset),
            covariance,
            log_share: model.lights[light].share.ln(),
        }
    }

    /// Logarithms of a reference in the sun.
    pub fn mean(&self, reference: usize) -> &[f64] {
        let n = self.covariance.nrows();
        &self.means[reference * n..][..n]
    }

    /// The Gaussians of only these bands.
    pub fn marginal(&self, bands: u64) -> Whitened {
        let bands: Vec<usize> = places(bands & self.known).collect();
        let part = self.covariance.select_rows(&bands).select_columns(&bands);
        let n = bands.len();
        // The floor on the diagonal keeps the matrix positive definite. With a damaged model, distances are Euclidean.
        let root = Cholesky::new(part).map_or_else(|| DMatrix::identity(n, n), |cholesky| cholesky.l());
        let log_root_determinant: f64 = root.diagonal().iter().map(|value| value.ln()).sum();
        let n_references = self.means.len() / self.covariance.nrows().max(1);
        let mut references = Vec::with_capacity(n_references * n);
        for reference in 0..n_references {
            let mean = self.mean(reference);
            let mut white = DVector::from_iterator(n, bands.iter().map(|band| mean[*band] + self.offset[*band]));
            root.solve_lower_triangular_mut(&mut white);
            references.extend(white.iter().map(|value| *value as f32));
        }
        let rows = (0..n).flat_map(|row| (0..=row).map(move |column| (row, column)));
        Whitened {
            log_weight: (self.log_share - log_root_determinant) as f32,
            root: rows.map(|at| if at.0 == at.1 { 1.0 / root[at] } else { root[at] } as f32).collect(),
            references,
            bands,
        }
    }
}

/// Number of spectra that are compared with a reference together: their sums fill four registers of AVX2.
pub const LANES: usize = 32;

/// A value of each spectrum of a block.
pub type Lanes = [f32; LANES];

/// Bands, root of the covariance, and references in the space in which the covariance is the identity.
pub struct Whitened {
    pub bands: Vec<usize>,
    /// Logarithm of the share of the light and of the density at a reference, without the factor that all Gaussians of these
    /// bands share.
    pub log_weight: f32,
    /// Lower triangle of the root, row by row, with the inverse of the diagonal.
    root: Vec<f32>,
    references: Vec<f32>,
}

impl Whitened {
    /// Transforms the logarithms of the reflectances of a block, one row per band, to the space of the references.
    #[inline(always)]
    pub fn whiten(&self, logs: &[Lanes], white: &mut Vec<Lanes>) {
        white.clear();
        let mut root = self.root.as_slice();
        for (row, log) in logs.iter().enumerate() {
            let (factors, rest) = root.split_at(row);
            let mut value = *log;
            for (factor, earlier) in factors.iter().zip(white.iter()) {
                for (value, earlier) in value.iter_mut().zip(earlier) {
                    *value -= factor * earlier;
                }
            }
            for value in &mut value {
                *value *= rest[0];
            }
            root = &rest[1..];
            white.push(value);
        }
    }

    /// The references in the space of [`Self::whiten`].
    pub fn references(&self) -> impl Iterator<Item = &[f32]> {
        self.references.chunks_exact(self.bands.len().max(1))
    }
}

/// Squared Mahalanobis distances of a block to a reference.
#[inline(always)]
pub fn squared_distances(reference: &[f32], white: &[Lanes]) -> Lanes {
    let mut sum = [0.0; LANES];
    for (value, row) in reference.iter().zip(white) {
        for (sum, row) in sum.iter_mut().zip(row) {
            let difference = row - value;
            *sum += difference * difference;
        }
    }
    sum
}

/// The positions of the set bits.
pub fn places(bands: u64) -> impl Iterator<Item = usize> {
    (0..64).filter(move |band| bands >> band & 1 == 1)
}
