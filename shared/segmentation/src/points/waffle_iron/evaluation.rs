//! The network for prediction: normalizations are merged into the layers after them, and consecutive layers at a point
//! are one operation, so the rows of all points are read and written once for each block. The results equal the results
//! of [`super::training`] except for rounding.

use super::{NONE, WaffleIron, WaffleIronPlan};
use crate::SegmentationError;
use crate::points::pass::{LinearLayer, Pass, zeros};
use candle_core::Tensor;
use kernels::points::{Layer, add_residual_layers, concatenate, linear, neighbor_maximum, normalized_means};

impl WaffleIron {
    /// The channels of each point after all blocks.
    pub(super) fn evaluate(
        &self,
        pass: &mut Pass<'_>,
        plan: &WaffleIronPlan,
        features: &Tensor,
    ) -> Result<Tensor, SegmentationError> {
        let x = self.embedding(pass, plan, features)?;
        for block in 0..self.depth {
            let plane = plan.plane_of(block);
            let norm = pass.running(&format!("waffleiron.spatial_mix.{block}.norm"))?;
            let means = normalized_means(&x, &plane.points, &norm.scale, &norm.shift)?;
            let cells = self.convolved(pass, means, block, plane.shape)?;
            let name = format!("waffleiron.channel_mix.{block}");
            let norm = pass.running(&format!("{name}.norm"))?;
            let weight = pass.matrix(&format!("{name}.mlp.0"))?;
            let LinearLayer { weight, bias } =
                norm.before(&weight, &pass.bias(&format!("{name}.mlp.0"), self.width)?)?;
            let first = Layer::new(&weight, &bias)?;
            let LinearLayer { weight, bias } = self.scaled_layer(pass, block)?;
            add_residual_layers(&x, &cells, &plane.cells, [&first, &Layer::new(&weight, &bias)?])?;
        }
        Ok(x)
    }
    fn embedding(
        &self,
        pass: &mut Pass<'_>,
        plan: &WaffleIronPlan,
        features: &Tensor,
    ) -> Result<Tensor, SegmentationError> {
        let x = pass.norm(features, "embed.norm", NONE)?;
        // The first layer of a difference is the difference of its products with both points.
        let norm = pass.running("embed.conv2.0")?;
        let LinearLayer { weight, bias } = norm.before(&pass.matrix("embed.conv2.1")?, &zeros(self.width)?)?;
        let LinearLayer { weight, bias } = pass.running("embed.conv2.2")?.after(&weight, &bias)?;
        let products = linear(&x, &weight, &zeros(self.width)?, NONE)?;
        let layer = Layer::new(&pass.matrix("embed.conv2.4")?, &zeros(self.width)?)?;
        let of_neighbors = neighbor_maximum(&products, bias.to_vec1()?, &plan.neighbors, layer)?;
        // `embed.conv1` has no activation: it is merged into the last layer.
        let last = pass.matrix("embed.final")?;
        let of_point = last.narrow(1, 0, self.width)?;
        let rest = last.narrow(1, self.width, self.width)?;
        let bias = of_point.matmul(&pass.bias("embed.conv1", self.width)?.unsqueeze(1)?)?.flatten_all()?;
        let bias = (bias + pass.bias("embed.final", self.width)?)?;
        let weight = Tensor::cat(&[&of_point.matmul(&pass.matrix("embed.conv1")?)?, &rest], 1)?;
        Ok(linear(&concatenate(&x, &[&of_neighbors])?, &weight, &bias, NONE)?)
    }
}
