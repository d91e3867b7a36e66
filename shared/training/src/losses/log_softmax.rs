//! Logarithms of class probabilities as one candle operation: a chain of candle's built-in operations reads and writes
//! the tensor six times, on one thread.

use super::real::Real;
use super::rows::rows;
use candle_core::{CpuStorage, CustomOp1, CustomOp2, D, Layout, Result, Shape, Tensor, bail};
use rayon::prelude::*;

/// Rows per task: they fill a part of the first-level cache.
const ROWS: usize = 256;

/// Logarithms of the probabilities (soft-max) of logits, pixels x classes.
pub fn log_softmax(logits: &Tensor) -> Result<Tensor> {
    if !logits.device().is_cpu() {
        let below_largest = logits.broadcast_sub(&logits.detach().max_keepdim(D::Minus1)?)?;
        return below_largest.broadcast_sub(&below_largest.exp()?.sum_keepdim(D::Minus1)?.log()?);
    }
    logits.contiguous()?.apply_op1(LogSoftmax)
}

struct LogSoftmax;

/// Derivative with respect to the logits, from the logarithms and the derivative with respect to the logarithms.
struct LogSoftmaxGradient;

impl CustomOp1 for LogSoftmax {
    fn name(&self) -> &'static str {
        "log_softmax"
    }
    fn cpu_fwd(&self, storage: &CpuStorage, layout: &Layout) -> Result<(CpuStorage, Shape)> {
        let (range, n_classes) = rows(layout)?;
        let out = match storage {
            CpuStorage::F32(logits) => CpuStorage::F32(logarithms(&logits[range], n_classes)),
            CpuStorage::F64(logits) => CpuStorage::F64(logarithms(&logits[range], n_classes)),
            _ => bail!("log_softmax: must be f32 or f64"),
        };
        Ok((out, layout.shape().clone()))
    }
    fn bwd(&self, _: &Tensor, log_p: &Tensor, by_log_p: &Tensor) -> Result<Option<Tensor>> {
        log_p.apply_op2_no_bwd(&by_log_p.contiguous()?, &LogSoftmaxGradient).map(Some)
    }
}

impl CustomOp2 for LogSoftmaxGradient {
    fn name(&self) -> &'static str {
        "log_softmax_gradient"
    }
    fn cpu_fwd(
        &self,
        log_p: &CpuStorage,
        layout: &Layout,
        by: &CpuStorage,
        of_by: &Layout,
    ) -> Result<(CpuStorage, Shape)> {
        let (range, n_classes) = rows(layout)?;
        let (of_by, _) = rows(of_by)?;
        let out = match (log_p, by) {
            (CpuStorage::F32(log_p), CpuStorage::F32(by)) => {
                CpuStorage::F32(gradient(&log_p[range], &by[of_by], n_classes))
            }
            (CpuStorage::F64(log_p), CpuStorage::F64(by)) => {
                CpuStorage::F64(gradient(&log_p[range], &by[of_by], n_classes))
            }
            _ => bail!("log_softmax_gradient: must be f32 or f64"),
        };
        Ok((out, layout.shape().clone()))
    }
}

fn logarithms<T: Real>(logits: &[T], n_classes: usize) -> Vec<T> {
    let mut out = vec![T::default(); logits.len()];
    let tasks = out.par_chunks_mut(ROWS * n_classes).zip(logits.par_chunks(ROWS * n_classes));
    tasks.for_each(|(out, logits)| {
        for (out, logits) in out.chunks_exact_mut(n_classes).zip(logits.chunks_exact(n_classes)) {
            // The largest logit is subtracted, so that no exponential overflows.
            let largest = logits.iter().copied().fold(T::LOWEST, T::max);
            let log_sum = logits.iter().map(|logit| (*logit - largest).exp()).sum::<T>().ln();
            out.iter_mut().zip(logits).for_each(|(out, logit)| *out = *logit - largest - log_sum);
        }
    });
    out
}

fn gradient<T: Real>(log_p: &[T], by_log_p: &[T], n_classes: usize) -> Vec<T> {
    let mut out = vec![T::default(); log_p.len()];
    let n = ROWS * n_classes;
    let tasks = out.par_chunks_mut(n).zip(log_p.par_chunks(n)).zip(by_log_p.par_chunks(n));
    tasks.for_each(|((out, log_p), by)| {
        let rows = out.chunks_exact_mut(n_classes).zip(log_p.chunks_exact(n_classes)).zip(by.chunks_exact(n_classes));
        for ((out, log_p), by) in rows {
            let sum: T = by.iter().copied().sum();
            let classes = out.iter_mut().zip(log_p).zip(by);
            classes.for_each(|((out, log_p), by)| *out = *by - log_p.exp() * sum);
        }
    });
    out
}
