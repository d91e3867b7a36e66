//! Matrix products whose results do not depend on the number of threads: each element is one chain of multiply-adds.

#![allow(
    clippy::needless_range_loop,
    clippy::manual_memcpy,
    reason = "loops over constant bounds are what the compiler unrolls into registers; iterators and calls in between are not"
)]

use pulp::{Simd, WithSimd};

/// Columns of a panel of the right factor.
const PANEL: usize = 32;
/// Inner elements of a block: a panel's block stays in the first-level cache.
const DEPTH: usize = 256;

/// A matrix in memory: element (r, c) is at `r * row_step + c * column_step`.
#[derive(Clone, Copy)]
pub(super) struct Matrix<'a> {
    pub values: &'a [f32],
    pub row_step: usize,
    pub column_step: usize,
}

impl<'a> Matrix<'a> {
    /// A matrix from rows of `n_columns` values.
    pub fn from_rows(values: &'a [f32], n_columns: usize) -> Self {
        Self { values, row_step: n_columns, column_step: 1 }
    }
    /// Rows and columns exchanged.
    pub fn transposed(self) -> Self {
        Self { values: self.values, row_step: self.column_step, column_step: self.row_step }
    }
}

/// The right factor of products, in panels of columns.
pub(super) struct Packed {
    depth: usize,
    n_columns: usize,
    panels: Vec<[f32; PANEL]>,
}

impl Packed {
    /// Packs a matrix of `depth` rows.
    pub fn new(matrix: Matrix<'_>, depth: usize, n_columns: usize) -> Self {
        let mut packed = Self { depth: 0, n_columns: 0, panels: Vec::new() };
        packed.pack(matrix, depth, n_columns);
        packed
    }
    /// Replaces the matrix.
    pub fn pack(&mut self, matrix: Matrix<'_>, depth: usize, n_columns: usize) {
        self.depth = depth;
        self.n_columns = n_columns;
        self.panels.clear();
        for first in (0..n_columns).step_by(PANEL) {
            let width = PANEL.min(n_columns - first);
            for k in 0..depth {
                let start = k * matrix.row_step + first * matrix.column_step;
                let mut row = [0.0; PANEL];
                if matrix.column_step == 1 {
                    row[..width].copy_from_slice(&matrix.values[start..start + width]);
                } else {
                    for (c, row) in row[..width].iter_mut().enumerate() {
                        *row = matrix.values[start + c * matrix.column_step];
                    }
                }
                self.panels.push(row);
            }
        }
    }
    /// Columns of the matrix.
    pub fn n_columns(&self) -> usize {
        self.n_columns
    }
    /// Adds the product of `left`, of `out.len() / n_columns` rows, to `out`.
    pub fn add_product(&self, left: Matrix<'_>, out: &mut [f32]) {
        if self.depth > 0 && !out.is_empty() {
            pulp::Arch::new().dispatch(Job { left, right: self, out });
        }
    }
}

struct Job<'a> {
    left: Matrix<'a>,
    right: &'a Packed,
    out: &'a mut [f32],
}

impl WithSimd for Job<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let n_columns = self.right.n_columns;
        for first_k in (0..self.right.depth).step_by(DEPTH) {
            for first_column in (0..n_columns).step_by(PANEL) {
                let width = PANEL.min(n_columns - first_column);
                let part = Part { first_k, first_column, width };
                // Rows x vectors whose sums fit into the registers: 16 of 32 (AVX-512), 12 of 16 (AVX2), 8 of 16 (SSE2).
                match (S::F32_LANES, width.div_ceil(S::F32_LANES)) {
                    (16, 1) => self.panel::<S, 16, 1>(simd, &part),
                    (16, _) => self.panel::<S, 8, 2>(simd, &part),
                    (8, 1) => self.panel::<S, 12, 1>(simd, &part),
                    (8, 2) => self.panel::<S, 6, 2>(simd, &part),
                    (8, 3) => self.panel::<S, 4, 3>(simd, &part),
                    (8, _) => self.panel::<S, 3, 4>(simd, &part),
                    (4, _) => self.panel::<S, 1, 8>(simd, &part),
                    _ => self.panel::<S, 1, 32>(simd, &part),
                }
            }
        }
    }
}

/// A part of a product: a block of inner elements, and a panel of columns.
struct Part {
    first_k: usize,
    first_column: usize,
    /// Columns of the panel that the matrix has.
    width: usize,
}

impl Job<'_> {
    #[inline(always)]
    fn panel<S: Simd, const R: usize, const V: usize>(&mut self, simd: S, part: &Part) {
        let n_rows = self.out.len() / self.right.n_columns;
        let start = part.first_column / PANEL * self.right.depth + part.first_k;
        let panels = &self.right.panels[start..start + DEPTH.min(self.right.depth - part.first_k)];
        let mut row = 0;
        while row + R <= n_rows {
            self.tile::<S, R, V>(simd, row, part, panels);
            row += R;
        }
        while row < n_rows {
            self.tile::<S, 1, V>(simd, row, part, panels);
            row += 1;
        }
    }
    /// Adds to `R` rows of a panel; `V` vectors hold its width.
    #[inline(always)]
    fn tile<S: Simd, const R: usize, const V: usize>(
        &mut self,
        simd: S,
        row: usize,
        part: &Part,
        panels: &[[f32; PANEL]],
    ) {
        let Matrix { values, row_step, column_step } = self.left;
        let lanes = V * S::F32_LANES;
        let is_full = part.width == lanes;
        let mut sums = [[simd.splat_f32s(0.0); V]; R];
        for r in 0..R {
            let start = (row + r) * self.right.n_columns + part.first_column;
            let mut padded = [0.0_f32; PANEL];
            let old = if is_full {
                &self.out[start..start + lanes]
            } else {
                padded[..part.width].copy_from_slice(&self.out[start..start + part.width]);
                &padded[..lanes]
            };
            let old = S::as_simd_f32s(old).0;
            for v in 0..V {
                sums[r][v] = old[v];
            }
        }
        let left: [&[f32]; R] = std::array::from_fn(|r| &values[(row + r) * row_step + part.first_k * column_step..]);
        for (k, panel_row) in panels.iter().enumerate() {
            let right = S::as_simd_f32s(panel_row).0;
            let mut of_row = [simd.splat_f32s(0.0); V];
            for v in 0..V {
                of_row[v] = right[v];
            }
            for r in 0..R {
                let value = simd.splat_f32s(left[r][k * column_step]);
                for v in 0..V {
                    sums[r][v] = simd.mul_add_f32s(value, of_row[v], sums[r][v]);
                }
            }
        }
        for r in 0..R {
            let start = (row + r) * self.right.n_columns + part.first_column;
            if is_full {
                let new = S::as_mut_simd_f32s(&mut self.out[start..start + lanes]).0;
                for v in 0..V {
                    new[v] = sums[r][v];
                }
            } else {
                let mut new = [0.0_f32; PANEL];
                let vectors = S::as_mut_simd_f32s(&mut new).0;
                for v in 0..V {
                    vectors[v] = sums[r][v];
                }
                self.out[start..start + part.width].copy_from_slice(&new[..part.width]);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use random::Random;

    #[test]
    fn products_equal_those_of_f64() {
        let mut random = Random::new(1);
        for (m, k, n) in [(1, 1, 1), (9, 300, 33), (17, 5, 64), (8, 513, 20)] {
            let mut matrix = |n: usize| (0..n).map(|_| random.gauss()).collect::<Vec<f32>>();
            let a = matrix(m * k);
            let b = matrix(k * n);
            let a_transposed: Vec<f32> = (0..k * m).map(|i| a[i % m * k + i / m]).collect();
            for left in [Matrix::from_rows(&a, k), Matrix::from_rows(&a_transposed, m).transposed()] {
                let mut out = vec![1.0; m * n];
                Packed::new(Matrix::from_rows(&b, n), k, n).add_product(left, &mut out);
                for (i, out) in out.into_iter().enumerate() {
                    let row = i / n;
                    let column = i % n;
                    let products = (0..k).map(|k_| f64::from(a[row * k + k_]) * f64::from(b[k_ * n + column]));
                    let expected = 1.0 + products.sum::<f64>();
                    assert!((f64::from(out) - expected).abs() < 1e-4, "{m} {k} {n}: {out} for {expected}");
                }
            }
        }
    }
}
