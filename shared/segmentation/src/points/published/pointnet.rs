//! `PointNet` for segmentation (Qi et al., CVPR 2017): transforms of positions and features, a global maximum, and a head on local and
//! global features. Names of parameters follow pointnet.pytorch with features (`pointnet_sem_seg`).

use crate::SegmentationError;
use crate::points::batch::PointBatch;
use crate::points::parameters::ParameterList;
use crate::points::pass::{Pass, zeros};
use candle_core::{DType, Device, Tensor};
use kernels::points::{Activation, Lists, add_activated, concatenate, linear, maximum, weighted_sum};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// `PointNet`. Its inputs are the positions and `inputs` features.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PointNet {
    /// Number of features of a point in addition to its position.
    pub inputs: usize,
    /// Number of classes.
    pub outputs: usize,
    /// Channels of the first layer and side of the feature transform; 64 in the publication. The others are multiples.
    pub width: usize,
}

const RELU: Activation = Activation::RELU;

impl PointNet {
    pub(in crate::points) fn parameters(&self, list: &mut ParameterList) {
        let w = self.width;
        for (name, inputs, side) in [("feat.stn", 3 + self.inputs, 3), ("feat.fstn", w, w)] {
            let widths = [inputs, w, 2 * w, 16 * w, 8 * w, 4 * w, side * side];
            for layer in 0..6 {
                let name = format!("{name}.{}", TRANSFORM_LAYERS[layer]);
                let shape = [widths[layer + 1], widths[layer], 1];
                list.layer(&name, &shape[..if layer < 3 { 3 } else { 2 }], true);
            }
            for layer in 0..5 {
                list.norm(&format!("{name}.bn{}", layer + 1), widths[layer + 1]);
            }
        }
        let of_points = [3 + self.inputs, w, 2 * w, 16 * w];
        let of_head = [17 * w, 8 * w, 4 * w, 2 * w, self.outputs];
        for (prefix, widths) in [("feat.", &of_points[..]), ("", &of_head)] {
            for (layer, pair) in widths.windows(2).enumerate() {
                list.layer(&format!("{prefix}conv{}", layer + 1), &[pair[1], pair[0], 1], true);
                if layer < 3 {
                    list.norm(&format!("{prefix}bn{}", layer + 1), pair[1]);
                }
            }
        }
    }
    pub(in crate::points) fn run(
        &self,
        pass: &mut Pass<'_>,
        batch: &PointBatch,
        features: &Tensor,
    ) -> Result<Tensor, SegmentationError> {
        let positions = batch.positions_tensor()?;
        let clouds = Arc::new(Lists::consecutive(batch.lengths()));
        let input = concatenate(&positions, &[features])?;
        let transform = transform_of_clouds(pass, &input, &clouds, "feat.stn", 3)?;
        let turned = transformed(&positions, &transform, batch)?;
        let input = concatenate(&turned, &[features])?;
        let x = pass.linear_norm(&input, "feat.conv1", "feat.bn1", RELU)?;
        let transform = transform_of_clouds(pass, &x, &clouds, "feat.fstn", self.width)?;
        pass.regularize(distance_to_orthogonal(&transform)?)?;
        let local = transformed(&x, &transform, batch)?;
        let x = pass.linear_norm(&local, "feat.conv2", "feat.bn2", RELU)?;
        let x = pass.linear_norm(&x, "feat.conv3", "feat.bn3", Activation::NONE)?;
        let global = maximum(&x, &clouds, 0)?;
        let x = self.first_of_head(pass, &global, &local, batch)?;
        let x = pass.linear_norm(&x, "conv2", "bn2", RELU)?;
        let x = pass.linear_norm(&x, "conv3", "bn3", RELU)?;
        pass.linear(&x, "conv4", Activation::NONE)
    }
    /// The first layer of the head, on global and local features: the product with the global features is the same for
    /// all points of a cloud.
    fn first_of_head(
        &self,
        pass: &mut Pass<'_>,
        global: &Tensor,
        local: &Tensor,
        batch: &PointBatch,
    ) -> Result<Tensor, SegmentationError> {
        let weight = pass.matrix("conv1")?;
        let n_global = 16 * self.width;
        let bias = pass.bias("conv1", 8 * self.width)?;
        let of_global = weight.narrow(1, 0, n_global)?;
        let of_local = weight.narrow(1, n_global, self.width)?;
        let global = linear(global, &of_global, &bias, Activation::NONE)?;
        let local = linear(local, &of_local, &zeros(8 * self.width)?, Activation::NONE)?;
        let cloud_of = batch.lengths().iter().enumerate().flat_map(|(cloud, length)| vec![cloud as u32; *length]);
        let lists = Arc::new(Lists::single(cloud_of, batch.lengths().len()));
        let sum = add_activated(&weighted_sum(&global, &lists, None)?, &local, Activation::NONE)?;
        pass.norm(&sum, "bn1", RELU)
    }
}

/// Names of the layers of a transform.
const TRANSFORM_LAYERS: [&str; 6] = ["conv1", "conv2", "conv3", "fc1", "fc2", "fc3"];

/// The transform of each cloud, `(clouds, side, side)`.
fn transform_of_clouds(
    pass: &mut Pass<'_>,
    rows: &Tensor,
    clouds: &Arc<Lists>,
    name: &str,
    side: usize,
) -> Result<Tensor, SegmentationError> {
    let mut x = rows.clone();
    for (i, layer) in TRANSFORM_LAYERS[..5].iter().enumerate() {
        x = pass.linear_norm(&x, &format!("{name}.{layer}"), &format!("{name}.bn{}", i + 1), RELU)?;
        if i == 2 {
            x = maximum(&x, clouds, 0)?;
        }
    }
    let x = pass.linear(&x, &format!("{name}.fc3"), Activation::NONE)?;
    let identity = Tensor::eye(side, DType::F32, &Device::Cpu)?;
    Ok(x.reshape((clouds.len(), side, side))?.broadcast_add(&identity)?)
}

/// The rows of each cloud times its transform.
fn transformed(rows: &Tensor, transforms: &Tensor, batch: &PointBatch) -> Result<Tensor, SegmentationError> {
    let side = transforms.dim(1)?;
    let bias = zeros(side)?;
    let of_cloud = |(cloud, range): (usize, std::ops::Range<usize>)| {
        let rows = rows.narrow(0, range.start, range.len())?;
        linear(&rows, &transforms.get(cloud)?.t()?, &bias, Activation::NONE)
    };
    let clouds = batch.clouds().enumerate().map(of_cloud).collect::<Result<Vec<_>, _>>()?;
    Ok(Tensor::cat(&clouds, 0)?)
}

/// Mean over the clouds of the Frobenius norm of `A A^T - I`.
fn distance_to_orthogonal(transforms: &Tensor) -> Result<Tensor, SegmentationError> {
    let side = transforms.dim(1)?;
    let product = transforms.matmul(&transforms.transpose(1, 2)?.contiguous()?)?;
    let difference = product.broadcast_sub(&Tensor::eye(side, DType::F32, &Device::Cpu)?)?;
    let squares = difference.sqr()?.sum((1, 2))?;
    // The offset avoids 0, where the derivative of the square root is undefined.
    Ok((squares + 1e-12)?.sqrt()?.mean(0)?)
}
