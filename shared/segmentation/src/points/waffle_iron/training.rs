//! The network operation by operation, with gradients and statistics of the batch.

use super::{NONE, Plane, RELU, WaffleIron, WaffleIronPlan};
use crate::SegmentationError;
use crate::points::pass::{LinearLayer, Pass};
use candle_core::Tensor;
use kernels::points::{Lists, add_activated, concatenate, linear, maximum, weighted_sum};
use std::sync::Arc;

impl WaffleIron {
    /// The channels of each point after all blocks.
    pub(super) fn train(
        &self,
        pass: &mut Pass<'_>,
        plan: &WaffleIronPlan,
        features: &Tensor,
    ) -> Result<Tensor, SegmentationError> {
        let mut x = embedding(pass, &plan.neighbors, features)?;
        for block in 0..self.depth {
            x = self.spatial_mix(pass, &x, block, plan.plane_of(block))?;
            x = self.channel_mix(pass, &x, block)?;
        }
        Ok(x)
    }
    fn spatial_mix(
        &self,
        pass: &mut Pass<'_>,
        x: &Tensor,
        block: usize,
        plane: &Plane,
    ) -> Result<Tensor, SegmentationError> {
        let y = pass.norm(x, &format!("waffleiron.spatial_mix.{block}.norm"), NONE)?;
        let lists = (0..plane.points.len()).map(|cell| plane.points.get(cell));
        let weights: Vec<f32> = lists.flat_map(|points| vec![1.0 / points.len() as f32; points.len()]).collect();
        let means = weighted_sum(&y, &plane.points, Some(&Arc::new(weights)))?;
        let cells = self.convolved(pass, means, block, plane.shape)?;
        Ok(add_activated(x, &weighted_sum(&cells, &plane.cells, None)?, NONE)?)
    }
    fn channel_mix(&self, pass: &mut Pass<'_>, x: &Tensor, block: usize) -> Result<Tensor, SegmentationError> {
        let name = format!("waffleiron.channel_mix.{block}");
        let y = pass.norm(x, &format!("{name}.norm"), NONE)?;
        let y = pass.linear(&y, &format!("{name}.mlp.0"), RELU)?;
        let LinearLayer { weight, bias } = self.scaled_layer(pass, block)?;
        Ok(add_activated(x, &linear(&y, &weight, &bias, NONE)?, NONE)?)
    }
}

fn embedding(pass: &mut Pass<'_>, neighbors: &Lists, features: &Tensor) -> Result<Tensor, SegmentationError> {
    let x = pass.norm(features, "embed.norm", NONE)?;
    let of_point = pass.linear(&x, "embed.conv1", NONE)?;
    // Each neighbor and its point, with weights 1 and -1: a row for each pair, all at once because of the batch
    // statistics.
    let pairs =
        (0..neighbors.len()).flat_map(|point| neighbors.get(point).iter().map(move |near| [*near, point as u32]));
    let pairs = Arc::new(Lists::new(pairs, neighbors.n_rows()));
    let signs = Arc::new([1.0, -1.0].repeat(pairs.len()));
    let lengths: Vec<usize> = (0..neighbors.len()).map(|point| neighbors.get(point).len()).collect();
    let differences = weighted_sum(&x, &pairs, Some(&signs))?;
    let y = pass.norm(&differences, "embed.conv2.0", NONE)?;
    let y = pass.linear_norm(&y, "embed.conv2.1", "embed.conv2.2", RELU)?;
    let y = pass.linear(&y, "embed.conv2.4", NONE)?;
    let of_neighbors = maximum(&y, &Arc::new(Lists::consecutive(&lengths)), 0)?;
    pass.linear(&concatenate(&of_point, &[&of_neighbors])?, "embed.final", NONE)
}
