//! The space in which pixels are grouped: three axes.

use crate::image::Pixels;
use nalgebra::{DMatrix, DVector, SymmetricEigen};
use serde::{Deserialize, Serialize};

/// The axes of the space, from the channels of a pixel: its bands, and its coordinates times the spatial weight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Space {
    /// Band value that counts as 1.
    pub scale: f64,
    /// Weight of the coordinates; with 0 they are not channels. Coordinates are divided by the longer side of the image.
    pub spatial_weight: f64,
    /// Origin of the space, by channel.
    pub mean: Vec<f64>,
    /// Three axes of unit length, by channel. For up to three bands without coordinates, the axes are the bands.
    pub axes: [Vec<f64>; 3],
}

/// Points in the space, one array per axis.
#[derive(Clone, Debug, Default)]
pub struct Points(pub [Vec<f64>; 3]);

impl Points {
    pub(crate) fn len(&self) -> usize {
        self.0[0].len()
    }

    pub(crate) fn at(&self, index: usize) -> [f64; 3] {
        [0, 1, 2].map(|k| self.0[k][index])
    }

    /// These points in another order.
    pub(crate) fn selected(&self, order: &[u32]) -> Self {
        Self([0, 1, 2].map(|k| order.iter().map(|i| self.0[k][*i as usize]).collect()))
    }
}

impl Space {
    /// The bands themselves, or the principal components of all channels.
    pub(crate) fn new(pixels: &Pixels, scale: f64, spatial_weight: f64) -> Self {
        let n_bands = pixels.bands.len();
        if spatial_weight == 0.0 && n_bands <= 3 {
            let axis = |k: usize| (0..n_bands).map(|band| f64::from(u8::from(band == k))).collect();
            return Self { scale, spatial_weight, mean: vec![0.0; n_bands], axes: [0, 1, 2].map(axis) };
        }
        let channels = channels(pixels, scale, spatial_weight);
        let (mean, covariance) = moments(&channels);
        let eigen = SymmetricEigen::new(covariance);
        let mut order: Vec<usize> = (0..channels.len()).collect();
        order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        let axis = |k: usize| -> Vec<f64> {
            let Some(column) = order.get(k) else { return vec![0.0; channels.len()] };
            let axis = eigen.eigenvectors.column(*column);
            // The sign of an eigenvector is arbitrary; its largest component is made positive.
            let sign = axis[axis.icamax()].signum();
            axis.iter().map(|component| sign * component).collect()
        };
        Self { scale, spatial_weight, mean: mean.as_slice().to_vec(), axes: [0, 1, 2].map(axis) }
    }

    /// Pixels as points.
    pub(crate) fn points(&self, pixels: &Pixels) -> Points {
        let channels = channels(pixels, self.scale, self.spatial_weight);
        let project = |axis: &Vec<f64>| {
            let offset: f64 = axis.iter().zip(&self.mean).map(|(component, mean)| component * mean).sum();
            let mut values = vec![-offset; pixels.len()];
            for (channel, component) in channels.iter().zip(axis).filter(|(_, component)| **component != 0.0) {
                wide_loops::run(
                    #[inline(always)]
                    || values.iter_mut().zip(channel).for_each(|(sum, value)| *sum += component * f64::from(*value)),
                );
            }
            values
        };
        Points(self.axes.each_ref().map(project))
    }
}

/// The channels of the pixels: the scaled bands, and x and y if their weight is not 0.
fn channels(pixels: &Pixels, scale: f64, spatial_weight: f64) -> Vec<Vec<f32>> {
    let per_unit = 1.0 / scale as f32;
    let scaled = |band: &Vec<f32>| band.iter().map(|value| value * per_unit).collect();
    let mut channels: Vec<Vec<f32>> = pixels.bands.iter().map(scaled).collect();
    if spatial_weight > 0.0 {
        let columns = pixels.size[0] as u32;
        let per_pixel = spatial_weight as f32 / pixels.size[0].max(pixels.size[1]) as f32;
        let x = pixels.at.iter().map(|at| (at % columns) as f32 * per_pixel);
        channels.push(x.collect());
        channels.push(pixels.at.iter().map(|at| (at / columns) as f32 * per_pixel).collect());
    }
    channels
}

/// Mean and covariance of channels.
fn moments(channels: &[Vec<f32>]) -> (DVector<f64>, DMatrix<f64>) {
    let n = channels[0].len() as f64;
    let mean = DVector::from_iterator(
        channels.len(),
        channels.iter().map(|values| values.iter().map(|value| f64::from(*value)).sum::<f64>() / n),
    );
    let mut covariance = DMatrix::zeros(channels.len(), channels.len());
    // Blocks of some thousand pixels of all channels fit into the cache.
    let mut centered: Vec<Vec<f64>> = vec![Vec::new(); channels.len()];
    for start in (0..channels[0].len()).step_by(2048) {
        let end = (start + 2048).min(channels[0].len());
        for (channel, (values, mean)) in centered.iter_mut().zip(channels.iter().zip(&mean)) {
            channel.clear();
            channel.extend(values[start..end].iter().map(|value| f64::from(*value) - mean));
        }
        for i in 0..channels.len() {
            for j in 0..=i {
                covariance[(i, j)] += dot(&centered[i], &centered[j]);
            }
        }
    }
    for i in 0..channels.len() {
        for j in 0..=i {
            covariance[(i, j)] /= n;
            covariance[(j, i)] = covariance[(i, j)];
        }
    }
    (mean, covariance)
}

/// Sum of products, over eight partial sums.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    wide_loops::run(
        #[inline(always)]
        || {
            let a = a.chunks(8);
            let b = b.chunks(8);
            for (a, b) in a.zip(b) {
                sums.iter_mut().zip(a.iter().zip(b)).for_each(|(sum, (a, b))| *sum += a * b);
            }
        },
    );
    sums.iter().sum()
}
