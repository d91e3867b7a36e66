//! `WaffleIron` (Puy et al., ICCV 2023): residual blocks that mix channels at each point, and positions by 2D
//! convolutions on one of three coordinate planes. Names of parameters follow the published code.

mod evaluation;
mod training;

use super::batch::PointBatch;
use super::parameters::{ParameterList, Start};
use super::pass::{LinearLayer, Pass};
use super::search::Clouds;
use crate::SegmentationError;
use candle_core::Tensor;
use kernels::points::{Activation, Lists, PlaneShape, depth_wise_convolution, plane_convolution};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Largest number of cells of the planes of a batch.
const MOST_CELLS: usize = 1 << 25;

/// Initial value of the scales of residuals.
const LAYER_SCALE: f32 = 1e-5;

/// `WaffleIron`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WaffleIron {
    /// Number of features of a point.
    pub inputs: usize,
    /// Number of classes.
    pub outputs: usize,
    /// Number of channels.
    pub width: usize,
    /// Number of blocks. They use the planes xy, xz and yz in turn.
    pub depth: usize,
    /// Number of neighbors in the embedding.
    pub neighbors: usize,
    /// Side of a cell of the planes, m.
    pub cell_m: f32,
    /// Smallest coordinates of the planes, m. Points outside are in the cells at the border.
    pub low_m: [f32; 3],
    /// Largest coordinates of the planes, m.
    pub high_m: [f32; 3],
    /// Convolutions on the planes.
    pub convolution: PlaneConvolution,
}

/// Convolutions on planes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlaneConvolution {
    /// Separate convolution of each channel, as published.
    DepthWise,
    /// Convolution over all channels.
    Dense,
}

/// Neighbors and cells of a batch.
pub struct WaffleIronPlan {
    /// Neighbors of each point.
    neighbors: Arc<Lists>,
    planes: Vec<Plane>,
}

impl WaffleIronPlan {
    /// The plane of a block; blocks use the planes in turn.
    fn plane_of(&self, block: usize) -> &Plane {
        &self.planes[block % self.planes.len()]
    }
}

struct Plane {
    shape: PlaneShape,
    /// Cell of each point.
    cells: Arc<Lists>,
    /// Points of each cell.
    points: Arc<Lists>,
}

const NONE: Activation = Activation::NONE;
const RELU: Activation = Activation::RELU;

impl WaffleIron {
    /// Number of cells along each axis.
    pub(super) fn n_cells(&self) -> [usize; 3] {
        std::array::from_fn(|axis| ((self.high_m[axis] - self.low_m[axis]) / self.cell_m).ceil() as usize)
    }
    pub(super) fn parameters(&self, list: &mut ParameterList) {
        let w = self.width;
        let inputs = self.inputs;
        list.norm("embed.norm", inputs);
        list.layer("embed.conv1", &[w, inputs, 1], true);
        list.norm("embed.conv2.0", inputs);
        list.layer("embed.conv2.1", &[w, inputs, 1, 1], false);
        list.norm("embed.conv2.2", w);
        list.layer("embed.conv2.4", &[w, w, 1, 1], false);
        list.layer("embed.final", &[w, 2 * w, 1], true);
        let channels = if self.convolution == PlaneConvolution::Dense { w } else { 1 };
        for block in 0..self.depth {
            for (mix, layers, shape) in [("spatial", "ffn", &[w, channels, 3, 3][..]), ("channel", "mlp", &[w, w, 1])] {
                let name = format!("waffleiron.{mix}_mix.{block}");
                list.norm(&format!("{name}.norm"), w);
                list.layer(&format!("{name}.{layers}.0"), shape, true);
                list.layer(&format!("{name}.{layers}.2"), shape, true);
                list.add(format!("{name}.scale.weight"), &[w, 1, 1], Start::Value(LAYER_SCALE));
            }
        }
        list.layer("classif", &[self.outputs, w, 1], true);
    }
    pub(super) fn plan(&self, batch: &PointBatch) -> Result<WaffleIronPlan, SegmentationError> {
        let [x, y, z] = self.n_cells();
        let largest = [x * y, x * z, y * z].into_iter().max().unwrap_or(0);
        if largest.saturating_mul(batch.lengths().len()) > MOST_CELLS {
            return Err(SegmentationError::Settings(format!(
                "{} clouds with planes of {largest} cells; a batch has planes of at most {MOST_CELLS} cells",
                batch.lengths().len()
            )));
        }
        let clouds = Clouds::new(batch.positions().to_vec(), batch.lengths().to_vec());
        let neighbors = clouds.neighbors(self.neighbors);
        if let Some(point) = (0..neighbors.len()).find(|point| neighbors.get(*point).is_empty()) {
            return Err(SegmentationError::Settings(format!(
                "the cloud of point {point} has one point; a neighborhood needs two"
            )));
        }
        let planes = [[0, 1], [0, 2], [1, 2]].into_iter().map(|axes| self.plane(batch, axes)).collect();
        Ok(WaffleIronPlan { neighbors: Arc::new(neighbors), planes })
    }
    fn plane(&self, batch: &PointBatch, axes: [usize; 2]) -> Plane {
        let n_cells = self.n_cells();
        let [height, width] = axes.map(|axis| n_cells[axis]);
        let shape = PlaneShape { planes: batch.lengths().len(), height, width };
        let cell_of = |position: [f32; 3]| {
            let [y, x] = axes.map(|axis| {
                let cell = ((position[axis] - self.low_m[axis]) / self.cell_m).floor();
                // The conversion to an integer saturates.
                (cell as usize).min(n_cells[axis] - 1)
            });
            y * width + x
        };
        let mut cells = Vec::with_capacity(batch.positions().len());
        for (cloud, range) in batch.clouds().enumerate() {
            let start = cloud * height * width;
            cells.extend(batch.positions()[range].iter().map(|position| (start + cell_of(*position)) as u32));
        }
        let cells = Lists::single(cells, shape.n_cells());
        Plane { shape, points: Arc::new(cells.inverse()), cells: Arc::new(cells) }
    }
    pub(super) fn run(
        &self,
        pass: &mut Pass<'_>,
        plan: &WaffleIronPlan,
        features: &Tensor,
    ) -> Result<Tensor, SegmentationError> {
        let x =
            if pass.is_training() { self.train(pass, plan, features)? } else { self.evaluate(pass, plan, features)? };
        pass.linear(&x, "classif", NONE)
    }
    /// The convolutions of a block.
    fn convolved(
        &self,
        pass: &Pass<'_>,
        mut cells: Tensor,
        block: usize,
        shape: PlaneShape,
    ) -> Result<Tensor, SegmentationError> {
        let name = format!("waffleiron.spatial_mix.{block}");
        let scale = pass.matrix(&format!("{name}.scale"))?.flatten_all()?;
        for (layer, activation) in [("ffn.0", RELU), ("ffn.2", NONE)] {
            let mut weight = pass.get(&format!("{name}.{layer}.weight"))?.clone();
            let mut bias = pass.bias(&format!("{name}.{layer}"), self.width)?;
            if layer == "ffn.2" {
                // The scale of the residual, applied here instead of at each point.
                weight = weight.broadcast_mul(&scale.reshape((self.width, 1, 1, 1))?)?;
                bias = (bias * &scale)?;
            }
            cells = match self.convolution {
                PlaneConvolution::DepthWise => depth_wise_convolution(&cells, &weight, &bias, shape, activation)?,
                PlaneConvolution::Dense => plane_convolution(&cells, &weight, &bias, shape, activation)?,
            };
        }
        Ok(cells)
    }
    /// The second layer of a block at each point, with the scale of the residual.
    fn scaled_layer(&self, pass: &Pass<'_>, block: usize) -> Result<LinearLayer, SegmentationError> {
        let name = format!("waffleiron.channel_mix.{block}");
        let scale = pass.matrix(&format!("{name}.scale"))?;
        let weight = pass.matrix(&format!("{name}.mlp.2"))?.broadcast_mul(&scale)?;
        let bias = (pass.bias(&format!("{name}.mlp.2"), self.width)? * scale.flatten_all()?)?;
        Ok(LinearLayer { weight, bias })
    }
}
