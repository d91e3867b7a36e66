//! `WaffleIron` (Puy et al., ICCV 2023): residual blocks that mix channels at each point, and space by 2D convolutions on one of three
//! coordinate planes. Names of parameters follow the published code.

use super::batch::PointBatch;
use super::ops::{
    Activation, Lists, PlaneShape, add_activated, concatenate, depth_wise_convolution, linear, maximum,
    plane_convolution, weighted_sum,
};
use super::parameters::{ParameterList, Start};
use super::pass::Pass;
use super::search::Clouds;
use crate::SegmentationError;
use candle_core::Tensor;
use serde::{Deserialize, Serialize};
use std::ops::Range;
use std::sync::Arc;

/// Cells of the planes of a batch at most.
const MOST_CELLS: usize = 1 << 25;

/// First value of the scales of residuals.
const LAYER_SCALE: f32 = 1e-5;

/// `WaffleIron`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WaffleIron {
    /// Features of a point.
    pub inputs: usize,
    /// Classes.
    pub outputs: usize,
    /// Channels.
    pub width: usize,
    /// Blocks. They use the planes xy, xz and yz in turn.
    pub depth: usize,
    /// Neighbors of the embedding.
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
    /// Each channel by itself, as published.
    DepthWise,
    /// All channels.
    Dense,
}

/// Neighbors and cells of a batch.
pub struct WaffleIronPlan {
    neighbors: Neighbors,
    planes: Vec<Plane>,
}

/// Neighbors of points.
#[derive(Clone)]
struct Neighbors {
    /// Each neighbor and its point, with weights 1 and -1.
    differences: Arc<Lists>,
    signs: Arc<Vec<f32>>,
    /// The differences of each point.
    of_point: Arc<Lists>,
}

impl Neighbors {
    /// Pairs of neighbor and point, and the number of pairs of each point.
    fn new(pairs: &[[u32; 2]], n_of_point: &[usize], n_points: usize) -> Self {
        Self {
            differences: Arc::new(Lists::new(pairs.iter().copied(), n_points)),
            signs: Arc::new([1.0, -1.0].repeat(pairs.len())),
            of_point: Arc::new(Lists::consecutive(n_of_point)),
        }
    }
    /// Those of some of the points.
    fn of(&self, points: Range<usize>) -> Self {
        let lists = || points.clone().map(|point| self.of_point.of(point));
        let pair = |difference: &u32| {
            let pair = self.differences.of(*difference as usize);
            [pair[0], pair[1]]
        };
        let pairs: Vec<[u32; 2]> = lists().flatten().map(pair).collect();
        Self::new(&pairs, &lists().map(<[u32]>::len).collect::<Vec<_>>(), self.differences.n_rows())
    }
}

struct Plane {
    shape: PlaneShape,
    /// Points of each cell, with weights for their mean.
    points: Arc<Lists>,
    weights: Arc<Vec<f32>>,
    /// Cell of each point.
    cells: Arc<Lists>,
}

const NONE: Activation = Activation::NONE;
const RELU: Activation = Activation::RELU;

impl WaffleIron {
    /// Cells along each axis.
    pub(super) fn n_cells(&self) -> [usize; 3] {
        std::array::from_fn(|axis| ((self.high_m[axis] - self.low_m[axis]) / self.cell_m).ceil() as usize)
    }
    pub(super) fn parameters(&self, list: &mut ParameterList) {
        let (w, inputs) = (self.width, self.inputs);
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
        let nearest = clouds.nearest(&clouds, self.neighbors + 1, |_| true);
        let (mut pairs, mut of_point) = (Vec::new(), Vec::new());
        for (point, (near, _)) in nearest.iter().enumerate() {
            // The first is the point itself, or a copy of it.
            pairs.extend(near.iter().skip(1).map(|neighbor| [*neighbor, point as u32]));
            of_point.push(near.len() - 1);
        }
        if let Some(point) = of_point.iter().position(|n| *n == 0) {
            return Err(SegmentationError::Settings(format!(
                "the cloud of point {point} has one point; a neighborhood needs two"
            )));
        }
        let planes = [[0, 1], [0, 2], [1, 2]].into_iter().map(|axes| self.plane(batch, axes)).collect();
        Ok(WaffleIronPlan { neighbors: Neighbors::new(&pairs, &of_point, batch.positions().len()), planes })
    }
    fn plane(&self, batch: &PointBatch, axes: [usize; 2]) -> Plane {
        let n_cells = self.n_cells();
        let [height, width] = axes.map(|axis| n_cells[axis]);
        let shape = PlaneShape { planes: batch.lengths().len(), height, width };
        let cell_of = |position: [f32; 3]| {
            let [y, x] = axes.map(|axis| {
                let cell = ((position[axis] - self.low_m[axis]) / self.cell_m).floor();
                // A conversion to an integer saturates.
                (cell as usize).min(n_cells[axis] - 1)
            });
            y * width + x
        };
        let mut cells = Vec::with_capacity(batch.positions().len());
        for (cloud, range) in batch.clouds().enumerate() {
            let start = cloud * height * width;
            cells.extend(batch.positions()[range].iter().map(|position| (start + cell_of(*position)) as u32));
        }
        let mut points = vec![Vec::new(); shape.n_cells()];
        cells.iter().enumerate().for_each(|(point, cell)| points[*cell as usize].push(point as u32));
        let weights = points.iter().flat_map(|points| vec![1.0 / points.len() as f32; points.len()]).collect();
        Plane {
            shape,
            cells: Arc::new(Lists::single(cells, shape.n_cells())),
            points: Arc::new(Lists::new(points, batch.positions().len())),
            weights: Arc::new(weights),
        }
    }
    pub(super) fn run(
        &self,
        pass: &mut Pass<'_>,
        plan: &WaffleIronPlan,
        features: &Tensor,
    ) -> Result<Tensor, SegmentationError> {
        let mut x = embedding(pass, plan, features)?;
        for block in 0..self.depth {
            x = self.spatial_mix(pass, &x, block, &plan.planes[block % plan.planes.len()])?;
            x = self.channel_mix(pass, &x, block)?;
        }
        pass.linear(&x, "classif", NONE)
    }
    fn spatial_mix(
        &self,
        pass: &mut Pass<'_>,
        x: &Tensor,
        block: usize,
        plane: &Plane,
    ) -> Result<Tensor, SegmentationError> {
        let name = format!("waffleiron.spatial_mix.{block}");
        let y = pass.norm(x, &format!("{name}.norm"), NONE)?;
        let mut y = weighted_sum(&y, &plane.points, Some(&plane.weights))?;
        let scale = pass.matrix(&format!("{name}.scale"))?.flatten_all()?;
        for (layer, activation) in [("ffn.0", RELU), ("ffn.2", NONE)] {
            let mut weight = pass.get(&format!("{name}.{layer}.weight"))?.clone();
            let mut bias = pass.bias(&format!("{name}.{layer}"), self.width)?;
            if layer == "ffn.2" {
                // The scale of the residual, here instead of at each point.
                weight = weight.broadcast_mul(&scale.reshape((self.width, 1, 1, 1))?)?;
                bias = (bias * &scale)?;
            }
            y = match self.convolution {
                PlaneConvolution::DepthWise => depth_wise_convolution(&y, &weight, &bias, plane.shape, activation)?,
                PlaneConvolution::Dense => plane_convolution(&y, &weight, &bias, plane.shape, activation)?,
            };
        }
        Ok(add_activated(x, &weighted_sum(&y, &plane.cells, None)?, NONE)?)
    }
    fn channel_mix(&self, pass: &mut Pass<'_>, x: &Tensor, block: usize) -> Result<Tensor, SegmentationError> {
        let name = format!("waffleiron.channel_mix.{block}");
        let y = pass.norm(x, &format!("{name}.norm"), NONE)?;
        let y = pass.linear(&y, &format!("{name}.mlp.0"), RELU)?;
        let scale = pass.matrix(&format!("{name}.scale"))?;
        let weight = pass.matrix(&format!("{name}.mlp.2"))?.broadcast_mul(&scale)?;
        let bias = (pass.bias(&format!("{name}.mlp.2"), self.width)? * scale.flatten_all()?)?;
        Ok(add_activated(x, &linear(&y, &weight, &bias, NONE)?, NONE)?)
    }
}

/// Points of a part of the embedding in evaluation: it has a row for each neighbor of a point.
const PART: usize = 4096;

fn embedding(pass: &mut Pass<'_>, plan: &WaffleIronPlan, features: &Tensor) -> Result<Tensor, SegmentationError> {
    let x = pass.norm(features, "embed.norm", NONE)?;
    let of_point = pass.linear(&x, "embed.conv1", NONE)?;
    // Training needs the rows of all neighbors: those of the statistics.
    let n = plan.neighbors.of_point.len();
    let is_whole = pass.is_training() || n <= PART;
    let mut of_neighbors = Vec::new();
    for first in (0..n).step_by(if is_whole { n } else { PART }) {
        let part = if is_whole { plan.neighbors.clone() } else { plan.neighbors.of(first..n.min(first + PART)) };
        let differences = weighted_sum(&x, &part.differences, Some(&part.signs))?;
        let y = pass.norm(&differences, "embed.conv2.0", NONE)?;
        let y = pass.linear_norm(&y, "embed.conv2.1", "embed.conv2.2", RELU)?;
        let y = pass.linear(&y, "embed.conv2.4", NONE)?;
        of_neighbors.push(maximum(&y, &part.of_point, 0)?);
    }
    let of_neighbors = if of_neighbors.len() == 1 { of_neighbors.remove(0) } else { Tensor::cat(&of_neighbors, 0)? };
    pass.linear(&concatenate(&of_point, &[&of_neighbors])?, "embed.final", NONE)
}
