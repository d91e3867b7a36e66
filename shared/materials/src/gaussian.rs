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
        let bands: Vec<usize> = (0..self.covariance.nrows()).filter(|band| bands >> band & 1 == 1).collect();
        let part = self.covariance.select_rows(&bands).select_columns(&bands);
        let n = bands.len();
        // The floor on the diagonal keeps the matrix positive definite. With a damaged model, distances are Euclidean.
        let root = Cholesky::new(part).map_or_else(|| DMatrix::identity(n, n), |cholesky| cholesky.l());
        let log_root_determinant: f64 = root.diagonal().iter().map(|value| value.ln()).sum();
        let n_references = self.means.len() / self.covariance.nrows().max(1);
        let white = (0..n_references).flat_map(|reference| {
            let mean = self.mean(reference);
            whiten(&root, bands.iter().map(|band| mean[*band] + self.offset[*band])).data.as_vec().clone()
        });
        Whitened { white: white.collect(), log_density: -log_root_determinant, log_share: self.log_share, bands, root }
    }
}

/// Bands, root of the covariance, and references in the space in which the covariance is the identity.
pub struct Whitened {
    pub bands: Vec<usize>,
    /// Logarithm of the density at a reference, without the factor that all Gaussians of these bands share.
    pub log_density: f64,
    /// Logarithm of the share of the light.
    pub log_share: f64,
    root: DMatrix<f64>,
    white: Vec<f64>,
}

impl Whitened {
    /// Squared Mahalanobis distance to each reference.
    pub fn distances(&self, values: &[f32]) -> impl Iterator<Item = f64> {
        let point = whiten(&self.root, self.bands.iter().map(|band| f64::from(log_reflectance(values[*band]))));
        let references = self.white.chunks_exact(self.bands.len().max(1));
        references.map(move |reference| reference.iter().zip(point.iter()).map(|(a, b)| (a - b) * (a - b)).sum())
    }
}

fn whiten(root: &DMatrix<f64>, values: impl Iterator<Item = f64>) -> DVector<f64> {
    let mut point = DVector::from_iterator(root.nrows(), values);
    root.solve_lower_triangular_mut(&mut point);
    point
}
