//! Leaky rectifier, and sums followed by it.

#![allow(
    clippy::needless_range_loop,
    reason = "loops over indices of slices of one length are what the compiler makes vectors of; calls in between are not"
)]

use super::rows::{for_each_block, read, tensor, values};
use candle_core::{CpuStorage, CustomOp2, Layout, Result, Shape, Tensor, bail};

/// `max(x, slope * x)` with a slope of 0 to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Activation {
    /// Slope of negative values: 1 is the identity, 0 is the rectifier (`ReLU`).
    pub slope: f32,
}

impl Activation {
    /// Identity.
    pub const NONE: Self = Self { slope: 1.0 };
    /// Rectifier.
    pub const RELU: Self = Self { slope: 0.0 };
    /// Leaky rectifier of `KPConv`.
    pub const LEAKY: Self = Self { slope: 0.1 };

    #[inline(always)]
    pub(super) fn value(self, x: f32) -> f32 {
        // Outside the branch: both values are then vectors, and random signs cost no mispredicted jumps.
        let scaled = self.slope * x;
        if x > 0.0 { x } else { scaled }
    }
    /// Applies the activation to values.
    pub(super) fn apply(self, values: &mut [f32]) {
        if self != Self::NONE {
            wide_loops::run(
                #[inline(always)]
                || {
                    for value in values {
                        *value = self.value(*value);
                    }
                },
            );
        }
    }
    /// The gradient of the argument, from the result and its gradient. At 0 the derivative is the slope, as in `PyTorch`.
    pub(super) fn gradient(self, result: &Tensor, gradient: &Tensor) -> Result<Tensor> {
        if self == Self::NONE {
            return gradient.contiguous();
        }
        let of_values = |result: &[f32], gradient: &[f32]| {
            let mut out = vec![0.0; gradient.len()];
            for_each_block(&mut out, 1, BLOCK, |start, out| {
                let result = &result[start..];
                let gradient = &gradient[start..];
                wide_loops::run(
                    #[inline(always)]
                    || {
                        let n = out.len();
                        let result = &result[..n];
                        let gradient = &gradient[..n];
                        for i in 0..n {
                            out[i] = if result[i] > 0.0 { gradient[i] } else { self.slope * gradient[i] };
                        }
                    },
                );
            });
            out
        };
        let out = read(result, |result| read(gradient, |gradient| of_values(result, gradient)))??;
        tensor(out, result.shape().clone())
    }
}

/// Number of values of a task.
const BLOCK: usize = 1 << 14;

/// The activation of a sum of two tensors of one shape.
pub fn add_activated(a: &Tensor, b: &Tensor, activation: Activation) -> Result<Tensor> {
    a.contiguous()?.apply_op2(&b.contiguous()?, AddActivated(activation))
}

struct AddActivated(Activation);

impl CustomOp2 for AddActivated {
    fn name(&self) -> &'static str {
        "add-activated"
    }
    fn cpu_fwd(&self, a: &CpuStorage, la: &Layout, b: &CpuStorage, lb: &Layout) -> Result<(CpuStorage, Shape)> {
        if la.shape() != lb.shape() {
            bail!("sum of shapes {:?} and {:?}", la.shape(), lb.shape());
        }
        let a = values(a, la)?;
        let b = values(b, lb)?;
        let mut out = vec![0.0; a.len()];
        for_each_block(&mut out, 1, BLOCK, |start, out| {
            let a = &a[start..];
            let b = &b[start..];
            wide_loops::run(
                #[inline(always)]
                || {
                    let n = out.len();
                    let a = &a[..n];
                    let b = &b[..n];
                    for i in 0..n {
                        out[i] = self.0.value(a[i] + b[i]);
                    }
                },
            );
        });
        Ok((CpuStorage::F32(out), la.shape().clone()))
    }
    fn bwd(
        &self,
        _: &Tensor,
        _: &Tensor,
        result: &Tensor,
        gradient: &Tensor,
    ) -> Result<(Option<Tensor>, Option<Tensor>)> {
        let gradient = self.0.gradient(result, gradient)?;
        Ok((Some(gradient.clone()), Some(gradient)))
    }
}
