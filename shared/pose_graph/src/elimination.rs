//! Normal equations over poses, solved by eliminating one pose after the other.
//!
//! Submaps hang together as a chain with some loops. Eliminating first what has fewest neighbors (minimum degree, Tinney and
//! Walker 1967) keeps that so: a chain with a second round over it stays as sparse as a ladder.

use nalgebra::{Cholesky, Const, Matrix6, Vector6};
use std::collections::{BTreeMap, BTreeSet};

/// In which order unknowns are eliminated.
#[derive(Clone, Debug)]
pub struct Order(Vec<usize>);

impl Order {
    /// Of `n` unknowns of which those of each pair occur in one measurement.
    pub fn new(n: usize, pairs: impl Iterator<Item = (usize, usize)>) -> Self {
        let mut neighbors = vec![BTreeSet::new(); n];
        for (a, b) in pairs.filter(|(a, b)| a != b) {
            neighbors[a].insert(b);
            neighbors[b].insert(a);
        }
        // By degree, then by number.
        let mut waiting: BTreeSet<(usize, usize)> = (0..n).map(|k| (neighbors[k].len(), k)).collect();
        let mut order = Vec::with_capacity(n);
        while let Some((_, pivot)) = waiting.pop_first() {
            order.push(pivot);
            let around: Vec<usize> = std::mem::take(&mut neighbors[pivot]).into_iter().collect();
            for &a in &around {
                waiting.remove(&(neighbors[a].len(), a));
                neighbors[a].remove(&pivot);
                neighbors[a].extend(around.iter().copied().filter(|b| *b != a));
                waiting.insert((neighbors[a].len(), a));
            }
        }
        Self(order)
    }
}

/// `H x = g` in blocks of six.
#[derive(Clone, Debug)]
pub struct BlockSystem {
    diagonal: Vec<Matrix6<f64>>,
    /// By row, then column; both halves of the matrix.
    beside: Vec<BTreeMap<usize, Matrix6<f64>>>,
    gradient: Vec<Vector6<f64>>,
}

/// An eliminated unknown: what it is, given its neighbors.
struct Pivot {
    k: usize,
    inverse: Matrix6<f64>,
    beside: Vec<(usize, Matrix6<f64>)>,
}

/// See [`BlockSystem::factor`].
pub struct Factored {
    /// In the order of elimination.
    pivots: Vec<Pivot>,
}

impl BlockSystem {
    pub fn new(n: usize) -> Self {
        Self {
            diagonal: vec![Matrix6::zeros(); n],
            beside: vec![BTreeMap::new(); n],
            gradient: vec![Vector6::zeros(); n],
        }
    }
    pub fn add_diagonal(&mut self, k: usize, block: &Matrix6<f64>) {
        self.diagonal[k] += block;
    }
    pub fn add_beside(&mut self, row: usize, col: usize, block: &Matrix6<f64>) {
        *self.beside[row].entry(col).or_insert_with(Matrix6::zeros) += block;
        *self.beside[col].entry(row).or_insert_with(Matrix6::zeros) += block.transpose();
    }
    pub fn add_gradient(&mut self, k: usize, part: &Vector6<f64>) {
        self.gradient[k] += part;
    }
    pub fn gradient(&self) -> &[Vector6<f64>] {
        &self.gradient
    }
    /// Multiplies the diagonal by `1 + damping` (Levenberg and Marquardt).
    #[must_use]
    pub fn damped(mut self, damping: f64) -> Self {
        for block in &mut self.diagonal {
            for axis in 0..6 {
                block[(axis, axis)] *= 1.0 + damping;
            }
        }
        self
    }
    /// `None` if the matrix is not positive definite: something is not determined.
    pub fn factor(mut self, order: &Order) -> Option<Factored> {
        let mut pivots = Vec::with_capacity(order.0.len());
        for &k in &order.0 {
            let inverse = Cholesky::<f64, Const<6>>::new(self.diagonal[k])?.inverse();
            let beside: Vec<(usize, Matrix6<f64>)> = std::mem::take(&mut self.beside[k]).into_iter().collect();
            for (a, block_a) in &beside {
                self.beside[*a].remove(&k);
                let pulled = block_a.transpose() * inverse;
                for (b, block_b) in &beside {
                    let fill = pulled * block_b;
                    if a == b {
                        self.diagonal[*a] -= fill;
                    } else {
                        *self.beside[*a].entry(*b).or_insert_with(Matrix6::zeros) -= fill;
                    }
                }
            }
            pivots.push(Pivot { k, inverse, beside });
        }
        Some(Factored { pivots })
    }
}

impl Factored {
    /// x of `H x = g`.
    pub fn solve(&self, g: &[Vector6<f64>]) -> Vec<Vector6<f64>> {
        let mut x = g.to_vec();
        for pivot in &self.pivots {
            let pulled = pivot.inverse * x[pivot.k];
            for (a, block) in &pivot.beside {
                x[*a] -= block.transpose() * pulled;
            }
        }
        for pivot in self.pivots.iter().rev() {
            let rest = pivot.beside.iter().fold(x[pivot.k], |rest, (a, block)| rest - block * x[*a]);
            x[pivot.k] = pivot.inverse * rest;
        }
        x
    }
    /// The diagonal blocks of the inverse of H: each unknown's covariance. Only blocks where the factor has any are found
    /// (Takahashi, Fagan and Chin 1973).
    pub fn covariances(&self) -> Vec<Matrix6<f64>> {
        let n = self.pivots.len();
        let mut diagonal = vec![Matrix6::zeros(); n];
        // Both halves.
        let mut beside: Vec<BTreeMap<usize, Matrix6<f64>>> = vec![BTreeMap::new(); n];
        for pivot in self.pivots.iter().rev() {
            let k = pivot.k;
            let of = |a: usize, b: usize| if a == b { diagonal[a] } else { beside[a][&b] };
            let row: Vec<(usize, Matrix6<f64>)> = pivot
                .beside
                .iter()
                .map(|(b, _)| {
                    let sum = pivot.beside.iter().fold(Matrix6::zeros(), |sum, (a, block)| sum + block * of(*a, *b));
                    (*b, -pivot.inverse * sum)
                })
                .collect();
            let back = pivot
                .beside
                .iter()
                .zip(&row)
                .fold(Matrix6::zeros(), |sum, ((_, block), (_, found))| sum + block * found.transpose());
            diagonal[k] = pivot.inverse - pivot.inverse * back;
            for (b, block) in row {
                beside[b].insert(k, block.transpose());
                beside[k].insert(b, block);
            }
        }
        diagonal
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// A chain of poses with three loops, numbers as if drawn; the same as a dense matrix with its right side.
    fn system(pairs: &[(usize, usize)]) -> (BlockSystem, DMatrix<f64>, DVector<f64>) {
        let n = 12;
        let drawn = |seed: usize| (seed as f64 * 0.618_033_988_749).fract() - 0.5;
        let mut system = BlockSystem::new(n);
        let mut dense = DMatrix::zeros(6 * n, 6 * n);
        let mut right = DVector::zeros(6 * n);
        for (number, (a, b)) in pairs.iter().enumerate() {
            let block = |which: usize| Matrix6::from_fn(|r, c| drawn(1 + number * 173 + which * 91 + r * 13 + c * 7));
            let (j_a, j_b) = (block(0) + Matrix6::identity(), block(1) - Matrix6::identity());
            for (row, left) in [(*a, j_a), (*b, j_b)] {
                for (col, other) in [(*a, j_a), (*b, j_b)] {
                    let product = left.transpose() * other;
                    let mut view = dense.fixed_view_mut::<6, 6>(6 * row, 6 * col);
                    view += product;
                    if row == col {
                        system.add_diagonal(row, &product);
                    } else if row < col {
                        system.add_beside(row, col, &product);
                    }
                }
            }
        }
        for k in 0..n {
            let g = Vector6::from_fn(|r, _| drawn(5000 + k * 6 + r));
            system.add_gradient(k, &g);
            right.fixed_rows_mut::<6>(6 * k).copy_from(&g);
        }
        // Something must hold the whole.
        system.add_diagonal(0, &Matrix6::identity());
        let mut corner = dense.fixed_view_mut::<6, 6>(0, 0);
        corner += Matrix6::identity();
        (system, dense, right)
    }

    #[test]
    fn the_solution_and_the_covariances_are_those_of_the_dense_matrix() {
        let chain = (1..12).map(|k| (k - 1, k));
        let pairs: Vec<(usize, usize)> = chain.chain([(0, 9), (3, 11), (2, 7)]).collect();
        let (system, dense, right) = system(&pairs);
        let order = Order::new(12, pairs.into_iter());
        let gradient = system.gradient().to_vec();
        let factored = system.factor(&order).expect("positive definite");
        let inverse = dense.try_inverse().expect("regular");
        let expected = &inverse * right;
        for (k, found) in factored.solve(&gradient).iter().enumerate() {
            assert!((found - expected.fixed_rows::<6>(6 * k)).norm() < 1e-9, "x of {k}");
        }
        for (k, found) in factored.covariances().iter().enumerate() {
            assert!((found - inverse.fixed_view::<6, 6>(6 * k, 6 * k)).norm() < 1e-9, "covariance of {k}");
        }
    }

    #[test]
    fn what_nothing_holds_is_not_solved() {
        let mut system = BlockSystem::new(2);
        system.add_diagonal(0, &Matrix6::identity());
        assert!(system.factor(&Order::new(2, std::iter::empty())).is_none());
    }

    #[test]
    fn a_second_round_over_a_chain_stays_sparse() {
        let n = 400;
        let pairs = (1..n).map(|k| (k - 1, k)).chain((0..n / 2).map(|k| (k, k + n / 2)));
        let mut system = BlockSystem::new(n);
        for k in 0..n {
            system.add_diagonal(k, &(Matrix6::identity() * 10.0));
        }
        pairs.clone().for_each(|(a, b)| system.add_beside(a, b, &Matrix6::identity()));
        let factored = system.factor(&Order::new(n, pairs)).expect("diagonally dominant");
        let n_blocks: usize = factored.pivots.iter().map(|pivot| pivot.beside.len()).sum();
        assert!(n_blocks < 6 * n, "{n_blocks} blocks");
    }
}
