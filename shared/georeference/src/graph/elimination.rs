//! Sparse normal equations over poses, solved by block elimination.
//!
//! Submaps form a chain with some loops. The minimum degree order (Tinney and Walker 1967: eliminate the pose with the
//! fewest neighbors first) keeps the factor sparse. The code does not use a sparse solver because the blocks are 6 x 6
//! and dense, and the covariances need only the blocks of the factor.

use nalgebra::{Cholesky, Const, Matrix6, Vector6};
use std::collections::{BTreeMap, BTreeSet};

/// The order in which unknowns are eliminated.
#[derive(Clone, Debug)]
pub struct Order(Vec<usize>);

impl Order {
    /// Computes the order for `n` unknowns; each pair shares a measurement.
    pub fn new(n: usize, pairs: impl Iterator<Item = (usize, usize)>) -> Self {
        let mut neighbors = vec![BTreeSet::new(); n];
        for (a, b) in pairs.filter(|(a, b)| a != b) {
            neighbors[a].insert(b);
            neighbors[b].insert(a);
        }
        // Sorted by degree, then by number.
        let mut remaining: BTreeSet<(usize, usize)> = (0..n).map(|k| (neighbors[k].len(), k)).collect();
        let mut order = Vec::with_capacity(n);
        while let Some((_, pivot)) = remaining.pop_first() {
            order.push(pivot);
            let adjacent: Vec<usize> = std::mem::take(&mut neighbors[pivot]).into_iter().collect();
            for &a in &adjacent {
                remaining.remove(&(neighbors[a].len(), a));
                neighbors[a].remove(&pivot);
                neighbors[a].extend(adjacent.iter().copied().filter(|b| *b != a));
                remaining.insert((neighbors[a].len(), a));
            }
        }
        Self(order)
    }
}

/// The system `H x = g` in blocks of six.
#[derive(Clone, Debug)]
pub struct BlockSystem {
    diagonal: Vec<Matrix6<f64>>,
    /// Off-diagonal blocks by row, then column; both triangles of the matrix.
    off_diagonal: Vec<BTreeMap<usize, Matrix6<f64>>>,
    gradient: Vec<Vector6<f64>>,
}

/// An eliminated unknown, conditional on its neighbors.
struct Pivot {
    k: usize,
    inverse: Matrix6<f64>,
    off_diagonal: Vec<(usize, Matrix6<f64>)>,
}

/// Factorization of a [`BlockSystem`].
pub struct Factored {
    /// Pivots in elimination order.
    pivots: Vec<Pivot>,
}

impl BlockSystem {
    pub fn new(n: usize) -> Self {
        Self {
            diagonal: vec![Matrix6::zeros(); n],
            off_diagonal: vec![BTreeMap::new(); n],
            gradient: vec![Vector6::zeros(); n],
        }
    }
    pub fn add_diagonal(&mut self, k: usize, block: &Matrix6<f64>) {
        self.diagonal[k] += block;
    }
    pub fn add_off_diagonal(&mut self, row: usize, col: usize, block: &Matrix6<f64>) {
        *self.off_diagonal[row].entry(col).or_insert_with(Matrix6::zeros) += block;
        *self.off_diagonal[col].entry(row).or_insert_with(Matrix6::zeros) += block.transpose();
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
    /// Factors the matrix; `None` if it is not positive definite, which means that a pose is undetermined.
    pub fn factor(mut self, order: &Order) -> Option<Factored> {
        let mut pivots = Vec::with_capacity(order.0.len());
        for &k in &order.0 {
            let inverse = Cholesky::<f64, Const<6>>::new(self.diagonal[k])?.inverse();
            let off_diagonal: Vec<(usize, Matrix6<f64>)> =
                std::mem::take(&mut self.off_diagonal[k]).into_iter().collect();
            for (a, block_a) in &off_diagonal {
                self.off_diagonal[*a].remove(&k);
                let product = block_a.transpose() * inverse;
                for (b, block_b) in &off_diagonal {
                    let fill = product * block_b;
                    if a == b {
                        self.diagonal[*a] -= fill;
                    } else {
                        *self.off_diagonal[*a].entry(*b).or_insert_with(Matrix6::zeros) -= fill;
                    }
                }
            }
            pivots.push(Pivot { k, inverse, off_diagonal });
        }
        Some(Factored { pivots })
    }
}

impl Factored {
    /// Solves `H x = g` for x.
    pub fn solve(&self, g: &[Vector6<f64>]) -> Vec<Vector6<f64>> {
        let mut x = g.to_vec();
        for pivot in &self.pivots {
            let product = pivot.inverse * x[pivot.k];
            for (a, block) in &pivot.off_diagonal {
                x[*a] -= block.transpose() * product;
            }
        }
        for pivot in self.pivots.iter().rev() {
            let rest = pivot.off_diagonal.iter().fold(x[pivot.k], |rest, (a, block)| rest - block * x[*a]);
            x[pivot.k] = pivot.inverse * rest;
        }
        x
    }
    /// The diagonal blocks of the inverse of H: the covariance of each unknown. Only the blocks in the sparsity pattern
    /// of the factor are computed (Takahashi, Fagan and Chin 1973).
    pub fn covariances(&self) -> Vec<Matrix6<f64>> {
        let n = self.pivots.len();
        let mut diagonal = vec![Matrix6::zeros(); n];
        // Both triangles.
        let mut off_diagonal: Vec<BTreeMap<usize, Matrix6<f64>>> = vec![BTreeMap::new(); n];
        for pivot in self.pivots.iter().rev() {
            let k = pivot.k;
            let of = |a: usize, b: usize| if a == b { diagonal[a] } else { off_diagonal[a][&b] };
            let row: Vec<(usize, Matrix6<f64>)> = pivot
                .off_diagonal
                .iter()
                .map(|(b, _)| {
                    let sum =
                        pivot.off_diagonal.iter().fold(Matrix6::zeros(), |sum, (a, block)| sum + block * of(*a, *b));
                    (*b, -pivot.inverse * sum)
                })
                .collect();
            let back = pivot
                .off_diagonal
                .iter()
                .zip(&row)
                .fold(Matrix6::zeros(), |sum, ((_, block), (_, found))| sum + block * found.transpose());
            diagonal[k] = pivot.inverse - pivot.inverse * back;
            for (b, block) in row {
                off_diagonal[b].insert(k, block.transpose());
                off_diagonal[k].insert(b, block);
            }
        }
        diagonal
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};

    /// One system in blocks and as a dense matrix.
    struct TestSystem {
        system: BlockSystem,
        dense: DMatrix<f64>,
        /// Right-hand side of the dense matrix.
        right: DVector<f64>,
    }

    /// A chain of poses with three loops and quasi-random blocks. Each pair shares a measurement.
    fn test_system(pairs: &[(usize, usize)]) -> TestSystem {
        let n = 12;
        let drawn = |seed: usize| (seed as f64 * 0.618_033_988_749).fract() - 0.5;
        let mut system = BlockSystem::new(n);
        let mut dense = DMatrix::zeros(6 * n, 6 * n);
        let mut right = DVector::zeros(6 * n);
        for (number, (a, b)) in pairs.iter().enumerate() {
            let block = |which: usize| Matrix6::from_fn(|r, c| drawn(1 + number * 173 + which * 91 + r * 13 + c * 7));
            let j_a = block(0) + Matrix6::identity();
            let j_b = block(1) - Matrix6::identity();
            for (row, left) in [(*a, j_a), (*b, j_b)] {
                for (col, other) in [(*a, j_a), (*b, j_b)] {
                    let product = left.transpose() * other;
                    let mut view = dense.fixed_view_mut::<6, 6>(6 * row, 6 * col);
                    view += product;
                    if row == col {
                        system.add_diagonal(row, &product);
                    } else if row < col {
                        system.add_off_diagonal(row, col, &product);
                    }
                }
            }
        }
        for k in 0..n {
            let g = Vector6::from_fn(|r, _| drawn(5000 + k * 6 + r));
            system.add_gradient(k, &g);
            right.fixed_rows_mut::<6>(6 * k).copy_from(&g);
        }
        // Fixes the gauge.
        system.add_diagonal(0, &Matrix6::identity());
        let mut corner = dense.fixed_view_mut::<6, 6>(0, 0);
        corner += Matrix6::identity();
        TestSystem { system, dense, right }
    }

    #[test]
    fn block_elimination_equals_the_dense_inverse() {
        let chain = (1..12).map(|k| (k - 1, k));
        let pairs: Vec<(usize, usize)> = chain.chain([(0, 9), (3, 11), (2, 7)]).collect();
        let TestSystem { system, dense, right } = test_system(&pairs);
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
    fn singular_system_has_no_factor() {
        let mut system = BlockSystem::new(2);
        system.add_diagonal(0, &Matrix6::identity());
        assert!(system.factor(&Order::new(2, std::iter::empty())).is_none());
    }

    #[test]
    fn factor_of_a_chain_with_a_second_round_stays_sparse() {
        let n = 400;
        let pairs = (1..n).map(|k| (k - 1, k)).chain((0..n / 2).map(|k| (k, k + n / 2)));
        let mut system = BlockSystem::new(n);
        for k in 0..n {
            system.add_diagonal(k, &(Matrix6::identity() * 10.0));
        }
        pairs.clone().for_each(|(a, b)| system.add_off_diagonal(a, b, &Matrix6::identity()));
        let factored = system.factor(&Order::new(n, pairs)).expect("diagonally dominant");
        let n_blocks: usize = factored.pivots.iter().map(|pivot| pivot.off_diagonal.len()).sum();
        assert!(n_blocks < 6 * n, "{n_blocks} blocks");
    }
}
