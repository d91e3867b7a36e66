//! Smoothing over neighbors in space.

use crate::classifier::{N_MATERIALS, Probabilities};
use crate::spectra::Spectra;
use neighbors::{Neighbor, Neighborhoods, SpatialIndex};
use rayon::prelude::*;

/// Neighbors of a point, with itself.
const N_NEIGHBORS: usize = 16;
/// Farthest neighbor, m. Twice the width of a cell of the cameras at 30 m, and less than most surfaces of one material.
const REACH_M: f32 = 0.3;

/// How the materials of neighboring points are combined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Smoothing {
    /// Every point on its own.
    Off,
    /// The mean of the probabilities of the neighbors.
    #[default]
    Votes,
    /// The mean spectrum of the neighbors is classified.
    Mean,
    /// Both: the mean of the probabilities of the neighbors' mean spectra.
    Both,
}

impl Smoothing {
    /// All, in the order of tables.
    pub const ALL: [Self; 4] = [Self::Off, Self::Votes, Self::Mean, Self::Both];

    /// In tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Votes => "votes",
            Self::Mean => "mean spectrum",
            Self::Both => "mean spectrum, votes",
        }
    }
}

/// The neighbors of each position: at most 16 within 0.3 m, with itself.
pub fn neighborhoods(positions: &[[f32; 3]]) -> Neighborhoods<Neighbor> {
    SpatialIndex::new(positions).nearest_of_own(N_NEIGHBORS)
}

/// Numbers of the neighbors of a position within reach.
fn near(neighborhoods: &Neighborhoods<Neighbor>, i: usize) -> impl Iterator<Item = usize> {
    let found = neighborhoods.of(i).iter();
    found.filter(|neighbor| neighbor.squared_m2 <= REACH_M * REACH_M).map(|neighbor| neighbor.index as usize)
}

/// The mean of the measured reflectances of the neighbors, band by band.
pub fn mean_spectra(spectra: &Spectra, neighborhoods: &Neighborhoods<Neighbor>) -> Spectra {
    let n_bands = spectra.wavelengths_nm.len();
    let mut mean = Spectra { values: vec![0.0; spectra.values.len()], ..spectra.clone() };
    if n_bands == 0 {
        return mean;
    }
    let rows = mean.values.par_chunks_exact_mut(n_bands).zip(&mut mean.valid).enumerate();
    rows.for_each(|(i, (row, valid))| {
        let mut n = [0_u32; 64];
        for neighbor in near(neighborhoods, i) {
            let spectrum = spectra.get(neighbor);
            for (band, value) in row.iter_mut().enumerate().filter(|(band, _)| spectrum.valid >> band & 1 == 1) {
                *value += spectrum.values[band];
                n[band] += 1;
            }
        }
        *valid = 0;
        for (band, value) in row.iter_mut().enumerate().filter(|(band, _)| n[*band] > 0) {
            *value /= n[band] as f32;
            *valid |= 1 << band;
        }
    });
    mean
}

/// The mean of the probabilities of the neighbors.
pub fn votes(probabilities: &[Probabilities], neighborhoods: &Neighborhoods<Neighbor>) -> Vec<Probabilities> {
    let mean = |i: usize| {
        let mut sum = [0.0; N_MATERIALS];
        for neighbor in near(neighborhoods, i) {
            sum.iter_mut().zip(&probabilities[neighbor]).for_each(|(sum, p)| *sum += p);
        }
        let total: f32 = sum.iter().sum();
        sum.map(|p| if total > 0.0 { p / total } else { 0.0 })
    };
    (0..probabilities.len()).into_par_iter().map(mean).collect()
}
