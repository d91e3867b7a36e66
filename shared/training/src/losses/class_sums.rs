//! Sums of the set losses over all pixels as one candle operation: a chain of candle's built-in operations reads the
//! probabilities six times, column by column.

use super::real::Real;
use super::rows::rows;
use candle_core::{CpuStorage, CustomOp2, CustomOp3, D, Layout, Result, Shape, Tensor, bail};
use rayon::prelude::*;

/// Rows per task: fixed, so that the sums do not depend on the number of threads.
const ROWS: usize = 256;

/// Number of sums per class.
const N_SUMS: usize = 3;

/// Sums over pixels, one number for each class.
pub struct ClassSums {
    /// Sums of the probabilities of pixels that are labeled with the class.
    pub both: Tensor,
    /// Sums of the powers of the probabilities of labeled pixels.
    pub raised: Tensor,
    /// Sums of the labels: the number of pixels of the class.
    pub labels: Tensor,
}

impl ClassSums {
    /// Sums probabilities and one-hot labels, pixels x classes. The derivative with respect to the labels is not defined.
    pub fn new(p: &Tensor, y: &Tensor, power: f64) -> Result<Self> {
        if !p.device().is_cpu() {
            let p = p.broadcast_mul(&y.sum_keepdim(D::Minus1)?)?;
            let raised = if power == 2.0 { p.sqr()? } else { p.powf(power)? };
            return Ok(Self { both: (&p * y)?.sum(0)?, raised: raised.sum(0)?, labels: y.sum(0)? });
        }
        let sums = p.contiguous()?.apply_op2(&y.detach().contiguous()?, Sums { power })?;
        Ok(Self { both: sums.get(0)?, raised: sums.get(1)?, labels: sums.get(2)?.detach() })
    }
}

/// The power of a probability, and its derivative. The usual powers 1 and 2 are much faster without `powf`.
fn raised<T: Real>(p: T, power: f64) -> T {
    match power {
        1.0 => p,
        2.0 => p * p,
        _ => p.powf(power),
    }
}

fn raised_derivative<T: Real>(p: T, power: f64) -> T {
    match power {
        1.0 => T::from_f64(1.0),
        2.0 => p + p,
        _ => T::from_f64(power) * p.powf(power - 1.0),
    }
}

/// The sums, 3 x classes.
struct Sums {
    power: f64,
}

/// Derivative with respect to the probabilities, from the probabilities, the labels and the derivative with respect to
/// the sums.
struct SumsGradient {
    power: f64,
}

impl CustomOp2 for Sums {
    fn name(&self) -> &'static str {
        "class_sums"
    }
    fn cpu_fwd(&self, p: &CpuStorage, of_p: &Layout, y: &CpuStorage, of_y: &Layout) -> Result<(CpuStorage, Shape)> {
        if of_p.shape() != of_y.shape() {
            bail!("class_sums: shapes {:?} and {:?} must be equal", of_p.shape(), of_y.shape());
        }
        let (p_range, n_classes) = rows(of_p)?;
        let (y_range, _) = rows(of_y)?;
        let out = match (p, y) {
            (CpuStorage::F32(p), CpuStorage::F32(y)) => {
                CpuStorage::F32(sums(&p[p_range], &y[y_range], n_classes, self.power))
            }
            (CpuStorage::F64(p), CpuStorage::F64(y)) => {
                CpuStorage::F64(sums(&p[p_range], &y[y_range], n_classes, self.power))
            }
            _ => bail!("class_sums: must be f32 or f64"),
        };
        Ok((out, (N_SUMS, n_classes).into()))
    }
    fn bwd(&self, p: &Tensor, y: &Tensor, _: &Tensor, by: &Tensor) -> Result<(Option<Tensor>, Option<Tensor>)> {
        let gradient = SumsGradient { power: self.power };
        Ok((Some(p.apply_op3_no_bwd(y, &by.contiguous()?, &gradient)?), None))
    }
}

impl CustomOp3 for SumsGradient {
    fn name(&self) -> &'static str {
        "class_sums_gradient"
    }
    fn cpu_fwd(
        &self,
        p: &CpuStorage,
        of_p: &Layout,
        y: &CpuStorage,
        of_y: &Layout,
        by: &CpuStorage,
        of_by: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        let (p_range, _) = rows(of_p)?;
        let (y_range, _) = rows(of_y)?;
        let (by_range, _) = rows(of_by)?;
        let out = match (p, y, by) {
            (CpuStorage::F32(p), CpuStorage::F32(y), CpuStorage::F32(by)) => {
                CpuStorage::F32(gradient(&p[p_range], &y[y_range], &by[by_range], self.power))
            }
            (CpuStorage::F64(p), CpuStorage::F64(y), CpuStorage::F64(by)) => {
                CpuStorage::F64(gradient(&p[p_range], &y[y_range], &by[by_range], self.power))
            }
            _ => bail!("class_sums_gradient: must be f32 or f64"),
        };
        Ok((out, of_p.shape().clone()))
    }
}

fn sums<T: Real>(p: &[T], y: &[T], n_classes: usize, power: f64) -> Vec<T> {
    let n = ROWS * n_classes;
    let of_task = |(p, y): (&[T], &[T])| {
        let mut sums = vec![T::default(); N_SUMS * n_classes];
        let (both, others) = sums.split_at_mut(n_classes);
        let (of_powers, labels) = others.split_at_mut(n_classes);
        for (p, y) in p.chunks_exact(n_classes).zip(y.chunks_exact(n_classes)) {
            let labeled: T = y.iter().copied().sum();
            labels.iter_mut().zip(y).for_each(|(sum, y)| *sum += *y);
            for (((both, of_powers), p), y) in both.iter_mut().zip(of_powers.iter_mut()).zip(p).zip(y) {
                let p = *p * labeled;
                *both += p * *y;
                *of_powers += raised(p, power);
            }
        }
        sums
    };
    let of_tasks: Vec<Vec<T>> = p.par_chunks(n).zip(y.par_chunks(n)).map(of_task).collect();
    let mut total = vec![T::default(); N_SUMS * n_classes];
    for sums in of_tasks {
        total.iter_mut().zip(sums).for_each(|(total, sum)| *total += sum);
    }
    total
}

fn gradient<T: Real>(p: &[T], y: &[T], by: &[T], power: f64) -> Vec<T> {
    let n_classes = by.len() / N_SUMS;
    let by_both = &by[..n_classes];
    let by_powers = &by[n_classes..2 * n_classes];
    let n = ROWS * n_classes;
    let mut out = vec![T::default(); p.len()];
    out.par_chunks_mut(n).zip(p.par_chunks(n)).zip(y.par_chunks(n)).for_each(|((out, p), y)| {
        let rows = out.chunks_exact_mut(n_classes).zip(p.chunks_exact(n_classes)).zip(y.chunks_exact(n_classes));
        for ((out, p), y) in rows {
            let labeled: T = y.iter().copied().sum();
            for ((((out, p), y), by_both), by_powers) in out.iter_mut().zip(p).zip(y).zip(by_both).zip(by_powers) {
                let of_power = raised_derivative(*p * labeled, power);
                *out = labeled * (*by_both * *y + *by_powers * of_power);
            }
        }
    });
    out
}
