//! Lenses given by splines, fast: an equidistant fisheye, which is nearly what they are, and a table of what is left.

use crate::lens::FisheyeLens;
use geometry::{CameraModel, KannalaBrandt, Point3, SplineWarp, Vector2};
use std::sync::Arc;

/// Nodes of the table along each side of the image: what is left bends by 0.01 px at most between two of a Ladybug's.
const N_NODES: usize = 257;

/// The table reaches beyond the image by this share of it, because the fisheye may be so far off.
const MARGIN: f64 = 0.05;

/// [`SplineWarp`], prepared.
#[derive(Clone, Debug)]
pub struct WarpLens {
    base: FisheyeLens,
    /// On the axis.
    px_per_rad: f32,
    widest_slope: f64,
    /// Of the first node, px of the fisheye.
    first: [f32; 2],
    nodes_per_px: [f32; 2],
    /// What is added to the fisheye's px at each node, row by row; NaN where the lens does not see.
    rest: Arc<[[f32; 2]]>,
}

impl From<&SplineWarp> for WarpLens {
    fn from(model: &SplineWarp) -> Self {
        let [left, right, top, bottom] = model.ends().map(f64::abs);
        let widest_slope = left.max(right).hypot(top.max(bottom));
        let center = model.project(&Point3::new(0.0, 0.0, 1.0), 0.0).unwrap_or_default();
        let [fx, fy] = model.px_per_rad();
        let base = KannalaBrandt {
            width: model.width,
            height: model.height,
            fx,
            fy,
            cx: center.x,
            cy: center.y,
            distortion: [0.0; 4],
            // Beyond the end of the lens, for the nodes around it; below a right angle, where the splines' ideal image would be infinite.
            max_angle: (widest_slope.atan() + 0.1).min(1.5),
        };
        let size = [f64::from(model.width), f64::from(model.height)];
        let first = size.map(|size| -0.5 - MARGIN * size);
        let px_per_node = size.map(|size| (1.0 + 2.0 * MARGIN) * size / (N_NODES - 1) as f64);
        let exact_base = CameraModel::KannalaBrandt(base.clone());
        let rest = |row: usize, column: usize| {
            let at = Vector2::new(first[0] + px_per_node[0] * column as f64, first[1] + px_per_node[1] * row as f64);
            // One node beyond the end of the lens is needed to come up to it.
            let seen = exact_base.ray_from_pixel(&at).and_then(|ray| model.project(&Point3::from(ray), 0.1));
            seen.map_or([f32::NAN; 2], |seen| [(seen.x - at.x) as f32, (seen.y - at.y) as f32])
        };
        Self {
            base: FisheyeLens::from(&base),
            px_per_rad: fx as f32,
            widest_slope,
            first: first.map(|v| v as f32),
            nodes_per_px: px_per_node.map(|v| (1.0 / v) as f32),
            rest: (0..N_NODES * N_NODES).map(|i| rest(i / N_NODES, i % N_NODES)).collect(),
        }
    }
}

impl WarpLens {
    /// See [`crate::lens::Lens::px_per_rad`].
    pub fn px_per_rad(&self) -> f32 {
        self.px_per_rad
    }

    /// See [`crate::lens::Lens::widest_slope`].
    pub fn widest_slope(&self) -> f64 {
        self.widest_slope
    }

    /// See [`crate::lens::Lens::pixel`].
    #[inline(always)]
    pub fn pixel(&self, p_in_camera: [f32; 3]) -> [f32; 2] {
        let at = self.base.pixel(p_in_camera);
        let [x, y] = [0, 1].map(|axis| (at[axis] - self.first[axis]) * self.nodes_per_px[axis]);
        // Beyond the table and where the base sees nothing: not a number, which is in no image.
        let last = (N_NODES - 1) as f32;
        if !((x >= 0.0) & (y >= 0.0) & (x < last) & (y < last)) {
            return [f32::NAN; 2];
        }
        let (column, row) = (x as usize, y as usize);
        let (x, y) = (x - column as f32, y - row as f32);
        let node = row * N_NODES + column;
        let [a, b, c, d] = [node, node + 1, node + N_NODES, node + N_NODES + 1].map(|node| self.rest[node]);
        [0, 1].map(|axis| {
            let (above, below) = (a[axis] + x * (b[axis] - a[axis]), c[axis] + x * (d[axis] - c[axis]));
            at[axis] + above + y * (below - above)
        })
    }
}
