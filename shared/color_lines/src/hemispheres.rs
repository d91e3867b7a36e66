//! The division of the space into hemispheres: shells of equal width around the origin.

use crate::space::Points;
use serde::{Deserialize, Serialize};

/// Shells of equal width around the origin. Colors are positive, so their shells are parts of hemispheres.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Hemispheres {
    /// Number of shells.
    pub n: usize,
    /// Width of a shell, in units of the space. The last one has no outer limit.
    pub width: f64,
}

impl Hemispheres {
    /// `n` shells up to the point farthest from the origin.
    pub(crate) fn new(points: &Points, n: usize) -> Self {
        let farthest = (0..points.len()).map(|index| norm(points.at(index))).fold(0.0, f64::max);
        Self { n, width: farthest / n as f64 }
    }

    /// Numbers of the points in each shell.
    pub(crate) fn sorted(&self, points: &Points) -> Vec<Vec<u32>> {
        let mut numbers = vec![Vec::new(); self.n];
        for index in 0..points.len() {
            let shell = if self.width > 0.0 { (norm(points.at(index)) / self.width) as usize } else { 0 };
            numbers[shell.min(self.n - 1)].push(index as u32);
        }
        numbers
    }
}

fn norm(point: [f64; 3]) -> f64 {
    point.iter().map(|value| value * value).sum::<f64>().sqrt()
}
