//! The sum of the products of two tensors as one candle operation, without a tensor of the products.

use super::real::Real;
use candle_core::{CpuStorage, CustomOp2, Layout, Result, Shape, Tensor, bail};
use rayon::prelude::*;

/// Products summed by one task: fixed, so that the sum does not depend on the number of threads.
const PER_TASK: usize = 1 << 13;

/// Sum of `values * factors`; its derivative with respect to the factors is not defined.
pub fn dot(values: &Tensor, factors: &Tensor) -> Result<Tensor> {
    if !values.device().is_cpu() {
        return (values * factors.detach())?.sum_all();
    }
    values.contiguous()?.apply_op2(&factors.detach().contiguous()?, Dot)
}

struct Dot;

impl CustomOp2 for Dot {
    fn name(&self) -> &'static str {
        "dot"
    }
    fn cpu_fwd(&self, a: &CpuStorage, of_a: &Layout, b: &CpuStorage, of_b: &Layout) -> Result<(CpuStorage, Shape)> {
        let (Some((a0, a1)), Some((b0, b1))) = (of_a.contiguous_offsets(), of_b.contiguous_offsets()) else {
            bail!("dot: must be contiguous");
        };
        if of_a.shape() != of_b.shape() {
            bail!("dot: shapes {:?} and {:?} must be equal", of_a.shape(), of_b.shape());
        }
        let sum = match (a, b) {
            (CpuStorage::F32(a), CpuStorage::F32(b)) => CpuStorage::F32(vec![sum(&a[a0..a1], &b[b0..b1])]),
            (CpuStorage::F64(a), CpuStorage::F64(b)) => CpuStorage::F64(vec![sum(&a[a0..a1], &b[b0..b1])]),
            _ => bail!("dot: must be f32 or f64"),
        };
        Ok((sum, Shape::from(())))
    }
    fn bwd(&self, _: &Tensor, b: &Tensor, _: &Tensor, by: &Tensor) -> Result<(Option<Tensor>, Option<Tensor>)> {
        Ok((Some(b.broadcast_mul(by)?), None))
    }
}

fn sum<T: Real>(a: &[T], b: &[T]) -> T {
    let of_task = |(a, b): (&[T], &[T])| a.iter().zip(b).map(|(a, b)| *a * *b).sum::<T>();
    let sums: Vec<T> = a.par_chunks(PER_TASK).zip(b.par_chunks(PER_TASK)).map(of_task).collect();
    sums.into_iter().sum()
}
