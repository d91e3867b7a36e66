//! KP-FCNN with rigid kernels (Thomas et al., ICCV 2019): kernel point convolutions in bottleneck blocks, subsampling by grids whose
//! cells double, nearest upsampling and unary layers. Names of parameters follow KPConv-PyTorch.

use super::kernel_points::{kernel_points, turned};
use crate::SegmentationError;
use crate::points::batch::PointBatch;
use crate::points::parameters::{ParameterList, Start};
use crate::points::pass::{Pass, zeros};
use crate::points::search::Clouds;
use candle_core::Tensor;
use kernels::points::{
    Activation, KernelPoints, Lists, Neighborhood, add_activated, concatenate, kernel_point_convolution, linear,
    maximum, weighted_sum,
};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Radius of a neighborhood, and extent of the influence of a kernel point, in cells.
const RADIUS_CELLS: f32 = 2.5;
const EXTENT_CELLS: f32 = 1.2;

/// KP-FCNN.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KpConv {
    /// Number of features of a point.
    pub inputs: usize,
    /// Number of classes.
    pub outputs: usize,
    /// Channels of the first bottleneck block, a multiple of 4; they double with each level.
    pub width: usize,
    /// Number of levels.
    pub levels: usize,
    /// Bottleneck blocks of a level, after the block that leads to it.
    pub blocks: usize,
    /// Kernel points of a convolution.
    pub kernel_points: usize,
    /// Side of the grid cells from which the points come, m. It doubles with each level.
    pub cell_m: f32,
    /// Largest number of nearest neighbors in a convolution.
    pub neighbors: usize,
}

/// Neighborhoods of a batch on all levels.
pub struct KpConvPlan {
    /// Points of the batch in Morton order, and their indices in it.
    sorted: Arc<Lists>,
    unsorted: Arc<Lists>,
    levels: Vec<Level>,
}

struct Level {
    own: Neighborhood,
    coarser: Option<Coarser>,
}

/// The relation of a level to the next one, which is coarser.
struct Coarser {
    /// Neighbors of the points of the next level among the points of this one.
    pool: Neighborhood,
    /// The nearest point of the next level for each point of this one.
    nearest: Arc<Lists>,
}

/// A block of the encoder.
struct Block {
    name: String,
    level: usize,
    strided: bool,
    inputs: usize,
    outputs: usize,
}

const LEAKY: Activation = Activation::LEAKY;

impl KpConv {
    /// The bottleneck blocks in order. `encoder_blocks.0` is the first convolution.
    fn blocks(&self) -> Vec<Block> {
        let mut blocks = Vec::new();
        let mut inputs = self.width / 2;
        for level in 0..self.levels {
            let outputs = self.width << level;
            // The first level starts with a plain convolution in place of one of its blocks.
            let n = if level == 0 { self.blocks.max(2) - 1 } else { self.blocks };
            let strided = usize::from(level + 1 < self.levels);
            for block in 0..n + strided {
                let name = format!("encoder_blocks.{}", blocks.len() + 1);
                blocks.push(Block { name, level, strided: block == n, inputs, outputs });
                inputs = outputs;
            }
        }
        blocks
    }
    pub(in crate::points) fn parameters(&self, list: &mut ParameterList) {
        let points = kernel_points(self.kernel_points, 0);
        let convolution = |list: &mut ParameterList, name: &str, level: usize, inputs: usize, outputs: usize| {
            let radius = f64::from(RADIUS_CELLS * self.cell_m * (1 << level) as f32);
            let seed = list.0.len() as u64;
            let values = turned(&points, seed).iter().flat_map(|p| p.map(|v| (v * radius) as f32)).collect();
            let start = Start::Uniform { inputs: self.kernel_points * inputs };
            list.add(format!("{name}.KPConv.weights"), &[self.kernel_points, inputs, outputs], start);
            list.add(format!("{name}.KPConv.kernel_points"), &[self.kernel_points, 3], Start::Fixed(values));
        };
        let unary = |list: &mut ParameterList, name: &str, inputs: usize, outputs: usize| {
            list.layer(&format!("{name}.mlp"), &[outputs, inputs], false);
            list.norm(&format!("{name}.batch_norm.batch_norm"), outputs);
        };
        convolution(list, "encoder_blocks.0", 0, self.inputs, self.width / 2);
        list.norm("encoder_blocks.0.batch_norm.batch_norm", self.width / 2);
        for Block { name, level, inputs, outputs, .. } in self.blocks() {
            let middle = outputs / 4;
            if inputs != middle {
                unary(list, &format!("{name}.unary1"), inputs, middle);
            }
            convolution(list, &name, level, middle, middle);
            list.norm(&format!("{name}.batch_norm_conv.batch_norm"), middle);
            unary(list, &format!("{name}.unary2"), middle, outputs);
            if inputs != outputs {
                unary(list, &format!("{name}.unary_shortcut"), inputs, outputs);
            }
        }
        for level in (0..self.levels - 1).rev() {
            let name = format!("decoder_blocks.{}", 2 * (self.levels - 2 - level) + 1);
            unary(list, &name, 3 * (self.width << level), self.width << level);
        }
        for (name, outputs) in [("head_mlp", self.width), ("head_softmax", self.outputs)] {
            list.layer(&format!("{name}.mlp"), &[outputs, self.width], false);
            list.add(format!("{name}.batch_norm.bias"), &[outputs], Start::Value(0.0));
        }
    }
    pub(in crate::points) fn plan(&self, batch: &PointBatch) -> Result<KpConvPlan, SegmentationError> {
        let given = Clouds::new(batch.positions().to_vec(), batch.lengths().to_vec());
        let order = given.order();
        let mut place = vec![0; order.len()];
        order.iter().enumerate().for_each(|(i, point)| place[*point as usize] = i as u32);
        let mut fine = given.chosen(&order);
        let mut levels = Vec::new();
        for level in 0..self.levels {
            let cell_m = self.cell_m * (1 << level) as f32;
            let radius_m = RADIUS_CELLS * cell_m;
            let positions = Arc::new(fine.positions.clone());
            let near = |queries: &Clouds, positions: &Arc<Vec<[f32; 3]>>, support: &Arc<Vec<[f32; 3]>>| Neighborhood {
                queries: positions.clone(),
                support: support.clone(),
                lists: Arc::new(Lists::new(fine.near(queries, radius_m, self.neighbors), fine.len())),
            };
            let own = near(&fine, &positions, &positions);
            if level + 1 == self.levels {
                levels.push(Level { own, coarser: None });
                break;
            }
            let coarse = fine.subsampled(2.0 * cell_m)?;
            let pool = near(&coarse, &Arc::new(coarse.positions.clone()), &positions);
            let nearest = coarse.nearest(&fine, 1, |_| true);
            let nearest = nearest.iter().map(|of_point| of_point.iter().map(|neighbor| neighbor.index));
            let nearest = Arc::new(Lists::new(nearest, coarse.len()));
            levels.push(Level { own, coarser: Some(Coarser { pool, nearest }) });
            fine = coarse;
        }
        let n = order.len();
        Ok(KpConvPlan {
            sorted: Arc::new(Lists::single(order, n)),
            unsorted: Arc::new(Lists::single(place, n)),
            levels,
        })
    }
    pub(in crate::points) fn run(
        &self,
        pass: &mut Pass<'_>,
        plan: &KpConvPlan,
        features: &Tensor,
    ) -> Result<Tensor, SegmentationError> {
        let features = weighted_sum(features, &plan.sorted, None)?;
        let mut x = self.convolution(pass, &features, "encoder_blocks.0", "batch_norm", 0, &plan.levels[0].own)?;
        let mut skips = Vec::new();
        for block in self.blocks() {
            let next = self.bottleneck(pass, &x, &block, &plan.levels[block.level])?;
            let previous = std::mem::replace(&mut x, next);
            if block.strided {
                skips.push(previous);
            }
        }
        let mut level = self.levels - 1;
        while let Some(skip) = skips.pop() {
            level -= 1;
            let name = format!("decoder_blocks.{}", 2 * (self.levels - 2 - level) + 1);
            let Some(Coarser { nearest, .. }) = &plan.levels[level].coarser else { continue };
            x = concatenate(&weighted_sum(&x, nearest, None)?, &[&skip])?;
            x = unary(pass, &x, &name, LEAKY)?;
        }
        for (name, activation) in [("head_mlp", LEAKY), ("head_softmax", Activation::NONE)] {
            let weight = pass.matrix(&format!("{name}.mlp"))?;
            x = linear(&x, &weight, pass.get(&format!("{name}.batch_norm.bias"))?, activation)?;
        }
        Ok(weighted_sum(&x, &plan.unsorted, None)?)
    }
    fn bottleneck(
        &self,
        pass: &mut Pass<'_>,
        input: &Tensor,
        block: &Block,
        level: &Level,
    ) -> Result<Tensor, SegmentationError> {
        let Block { name, inputs, outputs, .. } = block;
        let at = match &level.coarser {
            Some(coarser) if block.strided => &coarser.pool,
            _ => &level.own,
        };
        let mut x = input.clone();
        if *inputs != outputs / 4 {
            x = unary(pass, &x, &format!("{name}.unary1"), LEAKY)?;
        }
        x = self.convolution(pass, &x, name, "batch_norm_conv", block.level, at)?;
        x = unary(pass, &x, &format!("{name}.unary2"), Activation::NONE)?;
        let mut shortcut = input.clone();
        if block.strided {
            shortcut = maximum(&shortcut, &at.lists, self.neighbors)?;
        }
        if inputs != outputs {
            shortcut = unary(pass, &shortcut, &format!("{name}.unary_shortcut"), Activation::NONE)?;
        }
        Ok(add_activated(&x, &shortcut, LEAKY)?)
    }
    /// A kernel point convolution, batch normalization and the activation.
    fn convolution(
        &self,
        pass: &mut Pass<'_>,
        input: &Tensor,
        name: &str,
        norm: &str,
        level: usize,
        at: &Neighborhood,
    ) -> Result<Tensor, SegmentationError> {
        let weights = pass.get(&format!("{name}.KPConv.weights"))?;
        let points = pass.get(&format!("{name}.KPConv.kernel_points"))?.to_vec2::<f32>()?;
        let points: Vec<[f32; 3]> = points.iter().map(|p| [p[0], p[1], p[2]]).collect();
        let kernel = KernelPoints::new(&points, EXTENT_CELLS * self.cell_m * (1 << level) as f32);
        let norm = format!("{name}.{norm}.batch_norm");
        if !pass.is_training() {
            let norm = pass.running(&norm)?;
            let weights = weights.broadcast_mul(&norm.scale)?;
            return Ok(kernel_point_convolution(input, &weights, &norm.shift, at, &kernel, LEAKY)?);
        }
        let bias = zeros(weights.dim(2)?)?;
        let x = kernel_point_convolution(input, weights, &bias, at, &kernel, Activation::NONE)?;
        pass.norm(&x, &norm, LEAKY)
    }
}

/// A linear layer, batch normalization and an activation.
fn unary(pass: &mut Pass<'_>, x: &Tensor, name: &str, activation: Activation) -> Result<Tensor, SegmentationError> {
    pass.linear_norm(x, &format!("{name}.mlp"), &format!("{name}.batch_norm.batch_norm"), activation)
}
