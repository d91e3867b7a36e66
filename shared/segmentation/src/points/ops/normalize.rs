//! Batch normalization: by the statistics of the rows in training, by running statistics in evaluation.

use super::activation::Activation;
use super::rows::{column_sums, for_each_block, read, tensor, values};
use candle_core::{CpuStorage, CustomOp3, Layout, Result, Shape, Tensor, bail};

/// Rows of a task.
const BLOCK: usize = 256;

/// Where the statistics of a normalization come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// From the rows themselves: their gradient goes through the statistics, too.
    Rows,
    /// From elsewhere: they are constants.
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
    pub fn of(rows: &Tensor) -> Result<Self> {
        let (n_rows, n_columns) = rows.dims2()?;
        let per_row = 1.0 / n_rows.max(1) as f64;
        let statistics = |values: &[f32]| {
            let row = |row: usize| &values[row * n_columns..(row + 1) * n_columns];
            let mut means = column_sums(n_rows, n_columns, |i, sums| {
                sums.iter_mut().zip(row(i)).for_each(|(sum, value)| *sum += f64::from(*value));
            });
            for mean in &mut means {
                *mean *= per_row;
            }
            let mut variances = column_sums(n_rows, n_columns, |i, sums| {
                for ((sum, value), mean) in sums.iter_mut().zip(row(i)).zip(&means) {
                    *sum += (f64::from(*value) - mean).powi(2);
                }
            });
            for variance in &mut variances {
                *variance *= per_row;
            }
            Self { n_rows, means, variances }
        };
        read(rows, statistics)
    }
}

/// `activation((rows - mean) / sqrt(variance + epsilon) * weight + bias)` by column.
pub fn normalize(
    rows: &Tensor,
    (statistics, source): (&ColumnStatistics, Source),
    epsilon: f64,
    weight: &Tensor,
    bias: &Tensor,
    activation: Activation,
) -> Result<Tensor> {
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
    /// 1 / standard deviation of each column.
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
        let (weight, bias) = (values(weight, weight_layout)?, values(bias, bias_layout)?);
        let mut out = vec![0.0; n * n_columns];
        for_each_block(&mut out, n_columns, BLOCK, |first, out| {
            wide_loops::run(
                #[inline(always)]
                || {
                    let rows = rows[first * n_columns..].chunks_exact(n_columns);
                    for (out, row) in out.chunks_exact_mut(n_columns).zip(rows) {
                        for c in 0..n_columns {
                            let standard = (row[c] - self.means[c]) * self.inverses[c];
                            out[c] = self.activation.of(standard * weight[c] + bias[c]);
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
        let gradient = self.activation.gradient(result, gradient)?;
        let (n, n_columns) = rows.dims2()?;
        let (sums, of_rows) = read(rows, |rows| {
            read(&gradient, |gradient| read(weight, |weight| self.gradients(rows, gradient, weight, n, n_columns)))
        })???;
        let to_f32 = |sums: &[f64]| sums.iter().map(|sum| *sum as f32).collect::<Vec<_>>();
        let (of_bias, of_weight) = sums.split_at(n_columns);
        Ok((
            Some(tensor(of_rows, (n, n_columns))?),
            Some(tensor(to_f32(of_weight), n_columns)?),
            Some(tensor(to_f32(of_bias), n_columns)?),
        ))
    }
}

impl Normalize {
    /// Gradients of bias and weight, one after the other, and of the rows.
    fn gradients(
        &self,
        rows: &[f32],
        gradient: &[f32],
        weight: &[f32],
        n: usize,
        n_columns: usize,
    ) -> (Vec<f64>, Vec<f32>) {
        let standard = |row: &[f32], c: usize| (row[c] - self.means[c]) * self.inverses[c];
        let sums = column_sums(n, 2 * n_columns, |i, sums| {
            let range = i * n_columns..(i + 1) * n_columns;
            let (row, gradient) = (&rows[range.clone()], &gradient[range]);
            for c in 0..n_columns {
                sums[c] += f64::from(gradient[c]);
                sums[n_columns + c] += f64::from(gradient[c]) * f64::from(standard(row, c));
            }
        });
        let per_row = if self.source == Source::Rows { 1.0 / n.max(1) as f64 } else { 0.0 };
        let means: Vec<f32> = sums.iter().map(|sum| (sum * per_row) as f32).collect();
        let mut out = vec![0.0; n * n_columns];
        for_each_block(&mut out, n_columns, BLOCK, |first, out| {
            for (i, out) in out.chunks_exact_mut(n_columns).enumerate() {
                let range = (first + i) * n_columns..(first + i + 1) * n_columns;
                let (row, gradient) = (&rows[range.clone()], &gradient[range]);
                for c in 0..n_columns {
                    let centered = gradient[c] - means[c] - standard(row, c) * means[n_columns + c];
                    out[c] = weight[c] * self.inverses[c] * centered;
                }
            }
        });
        (sums, out)
    }
}
