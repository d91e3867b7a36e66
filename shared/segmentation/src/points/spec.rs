//! Architectures of networks on points.

use super::batch::PointBatch;
use super::parameters::{Parameter, ParameterList};
use super::pass::Pass;
use super::published::{KpConv, KpConvPlan, PointNet, PointNet2, PointNet2Plan};
use super::waffle_iron::{WaffleIron, WaffleIronPlan};
use crate::SegmentationError;
use candle_core::Tensor;
use serde::{Deserialize, Serialize};

/// Architecture of a network on points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum PointNetworkSpec {
    /// `PointNet`.
    Pointnet(PointNet),
    /// `PointNet++` with multi-scale grouping.
    Pointnet2(PointNet2),
    /// KP-FCNN with rigid kernel point convolutions.
    Kpconv(KpConv),
    /// `WaffleIron`.
    WaffleIron(WaffleIron),
}

/// The neighborhoods of a batch that a network uses. They depend on positions only: one plan serves many passes.
pub struct PointPlan {
    batch: PointBatch,
    neighborhoods: Neighborhoods,
}

enum Neighborhoods {
    Pointnet,
    Pointnet2(PointNet2Plan),
    Kpconv(KpConvPlan),
    WaffleIron(WaffleIronPlan),
}

/// Limit of channels and other counts: a larger network would be too slow alongside the other stages.
const MOST_CHANNELS: usize = 4096;
const MOST_NEIGHBORS: usize = 256;
/// Largest number of cells of a plane.
const MOST_CELLS: usize = 1 << 22;

impl PointPlan {
    /// Number of points of the batch.
    pub fn n_points(&self) -> usize {
        self.batch.positions().len()
    }
}

impl PointNetworkSpec {
    /// Number of features of a point.
    pub fn inputs(&self) -> usize {
        match self {
            Self::Pointnet(net) => net.inputs,
            Self::Pointnet2(net) => net.inputs,
            Self::Kpconv(net) => net.inputs,
            Self::WaffleIron(net) => net.inputs,
        }
    }
    /// Number of classes.
    pub fn outputs(&self) -> usize {
        match self {
            Self::Pointnet(net) => net.outputs,
            Self::Pointnet2(net) => net.outputs,
            Self::Kpconv(net) => net.outputs,
            Self::WaffleIron(net) => net.outputs,
        }
    }
    /// The first violated rule, if any.
    pub fn problem(&self) -> Option<String> {
        let mut channels = vec![self.inputs(), self.outputs()];
        let mut counts = Vec::new();
        let mut lengths_m = Vec::new();
        match self {
            Self::Pointnet(net) => channels.extend([net.width, 17 * net.width.min(MOST_CHANNELS)]),
            Self::Pointnet2(net) => {
                let layers = net.abstractions.iter().map(|of| of.scales.len());
                counts.extend(layers.chain([net.abstractions.len(), net.propagations.len()]));
                if net.abstractions.len() != net.propagations.len() {
                    return Some(format!(
                        "{} propagations for {} abstractions; the numbers must be equal",
                        net.propagations.len(),
                        net.abstractions.len()
                    ));
                }
                for abstraction in &net.abstractions {
                    channels.push(abstraction.centers);
                    for scale in &abstraction.scales {
                        counts.extend([scale.neighbors, scale.widths.len()]);
                        channels.extend(&scale.widths);
                        lengths_m.push(scale.radius_m);
                    }
                }
                counts.extend(net.propagations.iter().map(Vec::len));
                channels.extend(net.propagations.iter().flatten());
                if !(0.0..1.0).contains(&net.dropout) {
                    return Some(format!("dropout = {}; must be at least 0 and less than 1", net.dropout));
                }
            }
            Self::Kpconv(net) => {
                if !(1..=7).contains(&net.levels) {
                    return Some(format!("{} levels, must be 1 to 7", net.levels));
                }
                if net.width == 0 || !net.width.is_multiple_of(4) {
                    return Some(format!("width = {}; must be a multiple of 4", net.width));
                }
                channels.push(net.width.min(MOST_CHANNELS + 1) << (net.levels - 1));
                counts.extend([net.blocks, net.neighbors]);
                if !(2..=64).contains(&net.kernel_points) {
                    return Some(format!("{} kernel points, must be 2 to 64", net.kernel_points));
                }
                lengths_m.push(net.cell_m);
            }
            Self::WaffleIron(net) => {
                channels.push(net.width);
                counts.extend([net.depth, net.neighbors]);
                lengths_m.push(net.cell_m);
                lengths_m.extend((0..3).map(|axis| net.high_m[axis] - net.low_m[axis]));
                let [x, y, z] = net.n_cells();
                if [(x, y), (x, z), (y, z)].iter().any(|(a, b)| a.saturating_mul(*b) > MOST_CELLS) {
                    return Some(format!("planes of {x} x {y} x {z} cells; a plane has at most {MOST_CELLS}"));
                }
            }
        }
        if let Some(n) = channels.iter().find(|n| !(1..=MOST_CHANNELS).contains(n)) {
            return Some(format!("{n} channels or centers, must be 1 to {MOST_CHANNELS}"));
        }
        if let Some(n) = counts.iter().find(|n| !(1..=MOST_NEIGHBORS).contains(n)) {
            return Some(format!("{n} neighbors, blocks or layers, must be 1 to {MOST_NEIGHBORS}"));
        }
        // False for NaN.
        let is_length = |length: &&f32| !(1e-4..=1e4).contains(*length);
        lengths_m.iter().find(is_length).map(|length| format!("a length of {length} m, must be 0.0001 to 10000"))
    }
    /// Names, shapes and initial values of all parameters.
    pub fn parameters(&self) -> Vec<Parameter> {
        let mut list = ParameterList::default();
        match self {
            Self::Pointnet(net) => net.parameters(&mut list),
            Self::Pointnet2(net) => net.parameters(&mut list),
            Self::Kpconv(net) => net.parameters(&mut list),
            Self::WaffleIron(net) => net.parameters(&mut list),
        }
        list.0
    }
    /// Names of the tensors of the last layer: weights and biases, both with one row per class.
    pub fn class_tensors(&self) -> [&'static str; 2] {
        match self {
            Self::Pointnet(_) => ["conv4.weight", "conv4.bias"],
            Self::Pointnet2(_) => ["conv2.weight", "conv2.bias"],
            Self::Kpconv(_) => ["head_softmax.mlp.weight", "head_softmax.batch_norm.bias"],
            Self::WaffleIron(_) => ["classif.weight", "classif.bias"],
        }
    }
    /// Searches the neighborhoods of a batch. The seed determines the first centers of `PointNet++`.
    ///
    /// # Errors
    /// If the network is invalid, or a cloud is too small for it.
    pub fn plan(&self, batch: PointBatch, seed: u64) -> Result<PointPlan, SegmentationError> {
        if let Some(problem) = self.problem() {
            return Err(SegmentationError::Settings(problem));
        }
        let neighborhoods = match self {
            Self::Pointnet(_) => Neighborhoods::Pointnet,
            Self::Pointnet2(net) => Neighborhoods::Pointnet2(net.plan(&batch, seed)?),
            Self::Kpconv(net) => Neighborhoods::Kpconv(net.plan(&batch)?),
            Self::WaffleIron(net) => Neighborhoods::WaffleIron(net.plan(&batch)?),
        };
        Ok(PointPlan { batch, neighborhoods })
    }
    /// Runs the network: features `(points, inputs)`, scores of classes `(points, outputs)`, both in batch order.
    ///
    /// # Errors
    /// If features, plan or parameters belong to another network or batch.
    pub fn run(&self, pass: &mut Pass<'_>, plan: &PointPlan, features: &Tensor) -> Result<Tensor, SegmentationError> {
        let expected = vec![plan.batch.positions().len(), self.inputs()];
        if features.dims() != expected {
            let found = Some(features.dims().to_vec());
            return Err(SegmentationError::WeightShape { name: "features".to_owned(), found, expected });
        }
        match (self, &plan.neighborhoods) {
            (Self::Pointnet(net), Neighborhoods::Pointnet) => net.run(pass, &plan.batch, features),
            (Self::Pointnet2(net), Neighborhoods::Pointnet2(plan)) => net.run(pass, plan, features),
            (Self::Kpconv(net), Neighborhoods::Kpconv(plan)) => net.run(pass, plan, features),
            (Self::WaffleIron(net), Neighborhoods::WaffleIron(plan)) => net.run(pass, plan, features),
            _ => Err(SegmentationError::Settings("the plan belongs to another network".to_owned())),
        }
    }
}
