//! Batch normalization: with the statistics of the rows in training, with running statistics in evaluation.

#![allow(
    clippy::needless_range_loop,
    reason = "loops over indices of slices of one length are what the compiler makes vectors of; calls in between are not"
)]

use super::activation::Activation;
use super::rows::{column_sums, for_each_block, read, tensor, values};
use candle_core::{CpuStorage, CustomOp3, Layout, Result, Shape, Tensor, bail};

/// Rows of a task.
const BLOCK: usize = 256;

/// Source of the statistics of a normalization.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The statistics of the rows themselves: the gradient of the rows also flows through the statistics.
    Rows,
    /// Given statistics, which are constants.
    Constant,
}

/// Mean and variance of each column.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnStatistics {
    /// Number of rows.
    pub n_rows: usize,
    /// Means.
    pub means: Vec<f64>,
    /// Variances, as means of squares (divided by the number of rows).
    pub variances: Vec<f64>,
}

impl ColumnStatistics {
    /// The statistics of rows.
    pub fn from_rows(rows: &Tensor) -> Result<Self> {
        let (n_rows, n_columns) = rows.dims2()?;
        let per_row = 1.0 / n_rows.max(1) as f64;
        let statistics = |values: &[f32]| {
            let mut means = column_sums(
                n_rows,
                n_columns,
                #[inline(always)]
                |i, sums| {
                    let row = &values[i * n_columns..(i + 1) * n_columns];
                    for c in 0..n_columns {
                        sums[c] += f64::from(row[c]);
                    }
                },
            );
            for mean in &mut means {
                *mean *= per_row;
            }
            let mut variances = column_sums(
                n_rows,
                n_columns,
                #[inline(always)]
                |i, sums| {
                    let row = &values[i * n_columns..(i + 1) * n_columns];
                    let means = &means[..n_columns];
                    for c in 0..n_columns {
                        let difference = f64::from(row[c]) - means[c];
                        sums[c] += difference * difference;
                    }
                },
            );
            for variance in &mut variances {
                *variance *= per_row;
            }
            Self { n_rows, means, variances }
        };
        read(rows, statistics)
    }
}

/// Parameters of the normalization of rows.
#[derive(Clone, Copy, Debug)]
pub struct Normalization<'a> {
    /// Mean and variance of each column.
    pub statistics: &'a ColumnStatistics,
    /// Source of the statistics.
    pub source: Source,
    /// Added to variances.
    pub epsilon: f64,
}

/// `activation((rows - mean) / sqrt(variance + epsilon) * weight + bias)` by column.
pub fn normalize(
    rows: &Tensor,
    by: Normalization<'_>,
    weight: &Tensor,
    bias: &Tensor,
    activation: Activation,
) -> Result<Tensor> {
    let Normalization { statistics, source, epsilon } = by;
    let inverse = |variance: &f64| (1.0 / (variance + epsilon).sqrt()) as f32;
    let op = Normalize {
        means: statistics.means.iter().map(|mean| *mean as f32).collect(),
        inverses: statistics.variances.iter().map(inverse).collect(),
        source,
        activation,
    };
    rows.contiguous()?.apply_op3(&weight.contiguous()?, &bias.contiguous()?, op)
}

struct Normalize {
    means: Vec<f32>,
    /// Inverse standard deviation of each column.
    inverses: Vec<f32>,
    source: Source,
    activation: Activation,
}

impl CustomOp3 for Normalize {
    fn name(&self) -> &'static str {
        "normalize-rows"
    }
    fn cpu_fwd(
        &self,
        rows: &CpuStorage,
        rows_layout: &Layout,
        weight: &CpuStorage,
        weight_layout: &Layout,
        bias: &CpuStorage,
        bias_layout: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        let (n, n_columns) = rows_layout.shape().dims2()?;
        if [weight_layout.dims(), bias_layout.dims(), &[self.means.len()]] != [[n_columns]; 3] {
            bail!("normalization of {n_columns} columns: weight {:?}, bias {:?}", weight_layout, bias_layout);
        }
        let rows = values(rows, rows_layout)?;
        let weight = values(weight, weight_layout)?;
        let bias = values(bias, bias_layout)?;
        let mut out = vec![0.0; n * n_columns];
        for_each_block(&mut out, n_columns, BLOCK, |first, out| {
            wide_loops::run(
                #[inline(always)]
                || {
                    let rows = rows[first * n_columns..].chunks_exact(n_columns);
                    let means = &self.means[..n_columns];
                    let inverses = &self.inverses[..n_columns];
                    let weight = &weight[..n_columns];
                    let bias = &bias[..n_columns];
                    for (out, row) in out.chunks_exact_mut(n_columns).zip(rows) {
                        for c in 0..n_columns {
                            let standard = (row[c] - means[c]) * inverses[c];
                            out[c] = self.activation.value(standard * weight[c] + bias[c]);
                        }
                    }
                },
            );
        });
        Ok((CpuStorage::F32(out), rows_layout.shape().clone()))
    }
    fn bwd(
        &self,
        rows: &Tensor,
        weight: &Tensor,
        _: &Tensor,
        result: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>, Option<Tensor>)> {
        let (n, n_columns) = rows.dims2()?;
        let (sums, of_rows) = read(rows, |rows| {
            let with = |result: &[f32], gradient: &[f32], weight: &[f32]| {
                self.gradients(Values { rows, result, gradient, n, n_columns }, weight)
            };
            read(result, |result| read(gradient, |gradient| read(weight, |weight| with(result, gradient, weight))))
        })????;
        let to_f32 = |sums: &[f64]| sums.iter().map(|sum| *sum as f32).collect::<Vec<_>>();
        let (of_bias, of_weight) = sums.split_at(n_columns);
        Ok((
            Some(tensor(of_rows, (n, n_columns))?),
            Some(tensor(to_f32(of_weight), n_columns)?),
            Some(tensor(to_f32(of_bias), n_columns)?),
        ))
    }
}

/// Inputs of the gradients.
#[derive(Clone, Copy)]
struct Values<'a> {
    rows: &'a [f32],
    result: &'a [f32],
    gradient: &'a [f32],
    n: usize,
    n_columns: usize,
}

impl Normalize {
    /// Gradients of bias and weight, one after another, and of the rows.
    fn gradients(&self, values: Values<'_>, weight: &[f32]) -> (Vec<f64>, Vec<f32>) {
        let Values { n, n_columns, .. } = values;
        let sums = column_sums(
            n,
            2 * n_columns,
            #[inline(always)]
            |i, sums| {
                let (of_bias, of_weight) = sums.split_at_mut(n_columns);
                self.each(
                    values,
                    i,
                    #[inline(always)]
                    |c, gradient, standard| {
                        of_bias[c] += f64::from(gradient);
                        of_weight[c] += f64::from(gradient) * f64::from(standard);
                    },
                );
            },
        );
        let per_row = if self.source == Source::Rows { 1.0 / n.max(1) as f64 } else { 0.0 };
        let means: Vec<f32> = sums.iter().map(|sum| (sum * per_row) as f32).collect();
        let (of_bias, of_weight) = means.split_at(n_columns);
        let factors: Vec<f32> = weight.iter().zip(&self.inverses).map(|(weight, inverse)| weight * inverse).collect();
        let mut out = vec![0.0; n * n_columns];
        for_each_block(&mut out, n_columns, BLOCK, |first, out| {
            wide_loops::run(
                #[inline(always)]
                || {
                    for (i, out) in out.chunks_exact_mut(n_columns).enumerate() {
                        self.each(
                            values,
                            first + i,
                            #[inline(always)]
                            |c, gradient, standard| {
                                out[c] = factors[c] * (gradient - of_bias[c] - standard * of_weight[c]);
                            },
                        );
                    }
                },
            );
        });
        (sums, out)
    }
    /// Calls `use_column` with the gradient before the activation and the normalized value of each column of a row.
    #[inline(always)]
    fn each(&self, values: Values<'_>, row: usize, mut use_column: impl FnMut(usize, f32, f32)) {
        let range = row * values.n_columns..(row + 1) * values.n_columns;
        let rows = &values.rows[range.clone()];
        let result = &values.result[range.clone()];
        let gradient = &values.gradient[range];
        let means = &self.means[..rows.len()];
        let inverses = &self.inverses[..rows.len()];
        for c in 0..rows.len() {
            let slope = if result[c] > 0.0 { 1.0 } else { self.activation.slope };
            use_column(c, slope * gradient[c], (rows[c] - means[c]) * inverses[c]);
        }
    }
}
