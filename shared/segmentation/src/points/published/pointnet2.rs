//! `PointNet++` with multi-scale grouping (Qi et al., NIPS 2017): set abstractions around farthest points, feature propagation by
//! the 3 nearest points. Names of parameters follow `pointnet2_sem_seg_msg`.

use crate::SegmentationError;
use crate::points::batch::PointBatch;
use crate::points::parameters::ParameterList;
use crate::points::pass::Pass;
use crate::points::search::{Clouds, Interpolation, interpolation};
use candle_core::Tensor;
use kernels::points::{Activation, Lists, concatenate, maximum, tensor, weighted_sum};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// `PointNet++`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PointNet2 {
    /// Number of features of a point in addition to its position.
    pub inputs: usize,
    /// Number of classes.
    pub outputs: usize,
    /// Set abstractions, finest first.
    pub abstractions: Vec<Abstraction>,
    /// Channels of the layers of each feature propagation, finest first, one list per abstraction.
    pub propagations: Vec<Vec<usize>>,
    /// Dropout before the last layer.
    pub dropout: f32,
}

/// A set abstraction.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Abstraction {
    /// Number of centers of each cloud.
    pub centers: usize,
    /// Groups of different sizes around each center.
    pub scales: Vec<Scale>,
}

/// The groups of one scale.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scale {
    /// Radius of a group, m.
    pub radius_m: f32,
    /// Points of a group: the nearest ones; if there are fewer, the nearest one is repeated.
    pub neighbors: usize,
    /// Channels of the layers.
    pub widths: Vec<usize>,
}

/// Centers and groups of a batch.
pub struct PointNet2Plan {
    levels: Vec<Level>,
}

struct Level {
    groups: Vec<Group>,
    /// The 3 nearest centers of each point before this level.
    nearest: Arc<Lists>,
    weights: Arc<Vec<f32>>,
}

struct Group {
    /// The point of each row.
    points: Arc<Lists>,
    /// Position of the point relative to its center, `(rows, 3)`.
    offsets: Tensor,
    /// The rows of each center.
    rows: Arc<Lists>,
}

const RELU: Activation = Activation::RELU;

impl PointNet2 {
    /// Channels after each abstraction.
    fn abstracted(&self) -> Vec<usize> {
        let last = |scale: &Scale| scale.widths.last().copied().unwrap_or(0);
        self.abstractions.iter().map(|abstraction| abstraction.scales.iter().map(last).sum()).collect()
    }
    pub(in crate::points) fn parameters(&self, list: &mut ParameterList) {
        let abstracted = self.abstracted();
        let mut inputs = self.inputs;
        for (level, abstraction) in self.abstractions.iter().enumerate() {
            for (i, scale) in abstraction.scales.iter().enumerate() {
                let mut channels = inputs + 3;
                for (j, width) in scale.widths.iter().enumerate() {
                    list.layer(&format!("sa{}.conv_blocks.{i}.{j}", level + 1), &[*width, channels, 1, 1], true);
                    list.norm(&format!("sa{}.bn_blocks.{i}.{j}", level + 1), *width);
                    channels = *width;
                }
            }
            inputs = abstracted[level];
        }
        for (level, widths) in self.propagations.iter().enumerate().rev() {
            let mut channels = inputs + if level == 0 { 0 } else { abstracted[level - 1] };
            for (j, width) in widths.iter().enumerate() {
                list.layer(&format!("fp{}.mlp_convs.{j}", level + 1), &[*width, channels, 1], true);
                list.norm(&format!("fp{}.mlp_bns.{j}", level + 1), *width);
                channels = *width;
            }
            inputs = channels;
        }
        list.layer("conv1", &[inputs, inputs, 1], true);
        list.norm("bn1", inputs);
        list.layer("conv2", &[self.outputs, inputs, 1], true);
    }
    /// Groups around farthest points; the seed determines the first center of each cloud.
    pub(in crate::points) fn plan(&self, batch: &PointBatch, seed: u64) -> Result<PointNet2Plan, SegmentationError> {
        let mut fine = Clouds::new(batch.positions().to_vec(), batch.lengths().to_vec());
        let mut levels = Vec::new();
        for abstraction in &self.abstractions {
            let coarse = fine.chosen(&fine.farthest(abstraction.centers, seed));
            let groups =
                abstraction.scales.iter().map(|scale| scale.group(&fine, &coarse)).collect::<Result<_, _>>()?;
            let Interpolation { nearest, weights } = interpolation(&fine, &coarse);
            levels.push(Level { groups, nearest: Arc::new(nearest), weights: Arc::new(weights) });
            fine = coarse;
        }
        Ok(PointNet2Plan { levels })
    }
    pub(in crate::points) fn run(
        &self,
        pass: &mut Pass<'_>,
        plan: &PointNet2Plan,
        features: &Tensor,
    ) -> Result<Tensor, SegmentationError> {
        let mut levels: Vec<Tensor> = Vec::new();
        let mut x = features.clone();
        for (l, (level, abstraction)) in plan.levels.iter().zip(&self.abstractions).enumerate() {
            let mut of_scales = Vec::new();
            for (i, (group, scale)) in level.groups.iter().zip(&abstraction.scales).enumerate() {
                let mut rows = concatenate(&weighted_sum(&x, &group.points, None)?, &[&group.offsets])?;
                for j in 0..scale.widths.len() {
                    let names = [format!("sa{}.conv_blocks.{i}.{j}", l + 1), format!("sa{}.bn_blocks.{i}.{j}", l + 1)];
                    rows = pass.linear_norm(&rows, &names[0], &names[1], RELU)?;
                }
                of_scales.push(maximum(&rows, &group.rows, 0)?);
            }
            levels.push(std::mem::replace(
                &mut x,
                concatenate(&of_scales[0], &of_scales[1..].iter().collect::<Vec<_>>())?,
            ));
        }
        for (l, (level, widths)) in plan.levels.iter().zip(&self.propagations).enumerate().rev() {
            x = weighted_sum(&x, &level.nearest, Some(&level.weights))?;
            if l > 0 {
                x = concatenate(&levels[l], &[&x])?;
            }
            for j in 0..widths.len() {
                let names = [format!("fp{}.mlp_convs.{j}", l + 1), format!("fp{}.mlp_bns.{j}", l + 1)];
                x = pass.linear_norm(&x, &names[0], &names[1], RELU)?;
            }
        }
        x = pass.linear_norm(&x, "conv1", "bn1", RELU)?;
        x = pass.dropout(x, self.dropout)?;
        pass.linear(&x, "conv2", Activation::NONE)
    }
}

impl Scale {
    fn group(&self, fine: &Clouds, coarse: &Clouds) -> Result<Group, SegmentationError> {
        let found = fine.near(coarse, self.radius_m, self.neighbors);
        let mut points = Vec::new();
        let mut offsets = Vec::new();
        for (center, near) in coarse.positions.iter().zip(&found) {
            for i in 0..self.neighbors {
                // Never empty: the center is a point of the finer cloud.
                let point = near.get(i).or(near.first()).copied().unwrap_or(0);
                let position = fine.positions[point as usize];
                points.push(point);
                offsets.extend((0..3).map(|axis| position[axis] - center[axis]));
            }
        }
        Ok(Group {
            offsets: tensor(offsets, (points.len(), 3))?,
            rows: Arc::new(Lists::consecutive(&vec![self.neighbors; coarse.len()])),
            points: Arc::new(Lists::single(points, fine.len())),
        })
    }
}
