//! Smoothing over neighbors in space.

use crate::classifier::{N_MATERIALS, Probabilities};
use crate::spectra::Spectra;
use neighbors::{Neighbor, SpatialIndex, VoxelGrid};
use rayon::prelude::*;

/// Limits of the neighbors that are combined with a point.
#[derive(Clone, Copy)]
struct Reach {
    n: usize,
    squared_m2: f32,
}

/// Neighbors whose probabilities are averaged. Chosen on separate towns (lab/notebook/materials.md).
const VOTERS: Reach = Reach { n: 64, squared_m2: 1.0 };
/// Edge of the cells whose points share their votes, m: cameras see no smaller ones beyond 20 m. On the towns of lab/notebook/materials.md,
/// 0.1 m scores like single points, 0.2 m less.
const CELL_M: f32 = 0.1;
/// Neighbors that share a mean spectrum or, if in the same region, a part: 0.3 m is twice the width of a camera cell at
/// 30 m.
const NEAR: Reach = Reach { n: 16, squared_m2: 0.09 };

/// Method of combining the materials of neighboring points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Smoothing {
    /// No smoothing.
    Off,
    /// The mean of the probabilities of the neighbors.
    #[default]
    Votes,
    /// The mean spectrum of the neighbors is classified.
    Mean,
    /// Both methods: the mean of the probabilities of the neighbors' mean spectra.
    Both,
    /// The mean of the probabilities of the connected points of a region.
    Regions,
    /// Votes of the neighbors, then the mean over the connected points of a region.
    VotesInRegions,
}

impl Smoothing {
    /// All methods, in the order of tables.
    pub const ALL: [Self; 6] = [Self::Off, Self::Votes, Self::Mean, Self::Both, Self::Regions, Self::VotesInRegions];

    /// Name in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Votes => "votes",
            Self::Mean => "mean spectrum",
            Self::Both => "mean spectrum, votes",
            Self::Regions => "regions",
            Self::VotesInRegions => "votes, regions",
        }
    }
}

impl Reach {
    /// Numbers of the neighbors within reach of neighbors in the order of their distance.
    fn select(self, neighbors: &[Neighbor]) -> impl Iterator<Item = usize> {
        let near = neighbors.iter().take_while(move |neighbor| neighbor.squared_m2 <= self.squared_m2);
        near.map(|neighbor| neighbor.index as usize)
    }
}

/// The mean of the measured reflectances of at most 16 neighbors within 0.3 m, band by band.
pub fn mean_spectra(spectra: &Spectra, positions: &[[f32; 3]]) -> Spectra {
    let neighborhoods = SpatialIndex::new(positions).nearest_of_own(NEAR.n);
    let n_bands = spectra.wavelengths_nm.len();
    let mut mean = Spectra { values: vec![0.0; spectra.values.len()], ..spectra.clone() };
    if n_bands == 0 {
        return mean;
    }
    let rows = mean.values.par_chunks_exact_mut(n_bands).zip(&mut mean.valid).enumerate();
    rows.for_each(|(i, (row, valid))| {
        let mut n = [0_u32; 64];
        for neighbor in NEAR.select(neighborhoods.get(i)) {
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

/// The mean of the probabilities of at most 64 neighbors within 1 m, the same for all points of a cell of 0.1 m.
pub fn votes(probabilities: &[Probabilities], positions: &[[f32; 3]]) -> Vec<Probabilities> {
    let cells = VoxelGrid::new(positions, CELL_M).expect("the cell is not empty");
    let first: Vec<[f32; 3]> = cells.first_points().into_iter().map(|point| positions[point as usize]).collect();
    let means = SpatialIndex::new(positions).map_nearest_of_each(
        &first,
        VOTERS.n,
        #[inline(always)]
        |_, neighbors| {
            let mut sum = [0.0; N_MATERIALS];
            for neighbor in VOTERS.select(neighbors) {
                add(&mut sum, &probabilities[neighbor]);
            }
            normalized(sum)
        },
    );
    let mut votes = vec![[0.0; N_MATERIALS]; positions.len()];
    for (cell, mean) in means.iter().enumerate() {
        for point in cells.points_of(cell) {
            votes[*point as usize] = *mean;
        }
    }
    votes
}

/// The mean of the probabilities of the connected points of each region: neighbors in the same region are connected.
/// Points without a region (0) keep their probabilities.
pub fn region_means(probabilities: &[Probabilities], regions: &[u32], positions: &[[f32; 3]]) -> Vec<Probabilities> {
    let neighborhoods = SpatialIndex::new(positions).nearest_of_own(NEAR.n);
    let mut parts = Parts((0..regions.len()).collect());
    for (i, region) in regions.iter().enumerate().filter(|(_, region)| **region != 0) {
        for neighbor in NEAR.select(neighborhoods.get(i)).filter(|neighbor| regions[*neighbor] == *region) {
            parts.join(i, neighbor);
        }
    }
    let part_of: Vec<usize> = (0..regions.len()).map(|i| parts.first_of(i)).collect();
    let mut sums = vec![[0.0; N_MATERIALS]; regions.len()];
    part_of.iter().zip(probabilities).for_each(|(part, probabilities)| add(&mut sums[*part], probabilities));
    part_of.iter().map(|part| normalized(sums[*part])).collect()
}

#[inline(always)]
fn add(sum: &mut Probabilities, probabilities: &Probabilities) {
    for (sum, p) in sum.iter_mut().zip(probabilities) {
        *sum += p;
    }
}

/// Probabilities scaled to a sum of 1; all 0 if the sum is 0.
#[inline(always)]
fn normalized(sum: Probabilities) -> Probabilities {
    let total: f32 = sum.iter().sum();
    sum.map(|p| if total > 0.0 { p / total } else { 0.0 })
}

/// Connected parts as a forest: each point refers to another point of its part that is nearer to the first one, which
/// refers to itself.
struct Parts(Vec<usize>);

impl Parts {
    /// The first point of a part.
    fn first_of(&mut self, mut i: usize) -> usize {
        while self.0[i] != i {
            // Path halving shortens the next search.
            self.0[i] = self.0[self.0[i]];
            i = self.0[i];
        }
        i
    }

    fn join(&mut self, a: usize, b: usize) {
        let a = self.first_of(a);
        let b = self.first_of(b);
        self.0[a.max(b)] = a.min(b);
    }
}
