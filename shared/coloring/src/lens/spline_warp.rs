//! Lens given by splines: an equidistant fisheye approximation plus a table of residuals.

use super::FisheyeLens;
use geometry::{CameraModel, KannalaBrandt, Point3, SplineWarp, Vector2};
use std::sync::Arc;

/// Nodes of the table along each side of the image: a Ladybug's residual curves by 0.01 px at most between two nodes.
const N_NODES: usize = 257;

/// The table extends beyond the image by this share, because the pixel of the fisheye may lie outside.
const MARGIN: f64 = 0.05;

/// [`SplineWarp`], prepared.
#[derive(Clone, Debug)]
pub struct SplineWarpLens {
    base: FisheyeLens,
    /// Resolution on the axis, px/rad.
    px_per_rad: f32,
    widest_slope: f64,
    /// Position of the first node, px of the fisheye.
    first: [f32; 2],
    nodes_per_px: [f32; 2],
    /// Residual at each node, row by row: added to the pixel of the fisheye. NaN outside the field of view.
    residuals: Arc<[[f32; 2]]>,
}

impl From<&SplineWarp> for SplineWarpLens {
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
            // Slightly beyond the field of view, for the nodes around its border. Below a right angle, where the ideal
            // image of the splines is infinite.
            max_angle: (widest_slope.atan() + 0.1).min(1.5),
        };
        let size = [f64::from(model.width), f64::from(model.height)];
        let first = size.map(|size| -0.5 - MARGIN * size);
        let px_per_node = size.map(|size| (1.0 + 2.0 * MARGIN) * size / (N_NODES - 1) as f64);
        let exact_base = CameraModel::KannalaBrandt(base.clone());
        let residual = |row: usize, column: usize| {
            let at = Vector2::new(first[0] + px_per_node[0] * column as f64, first[1] + px_per_node[1] * row as f64);
            // Interpolation up to the border of the field of view needs one node beyond it.
            let seen = exact_base.ray_from_pixel(&at).and_then(|ray| model.project(&Point3::from(ray), 0.1));
            seen.map_or([f32::NAN; 2], |seen| [(seen.x - at.x) as f32, (seen.y - at.y) as f32])
        };
        Self {
            base: FisheyeLens::from(&base),
            px_per_rad: fx as f32,
            widest_slope,
            first: first.map(|v| v as f32),
            nodes_per_px: px_per_node.map(|v| (1.0 / v) as f32),
            residuals: (0..N_NODES * N_NODES).map(|i| residual(i / N_NODES, i % N_NODES)).collect(),
        }
    }
}

impl SplineWarpLens {
    /// See [`super::Lens::px_per_rad`].
    #[inline]
    pub fn px_per_rad(&self) -> f32 {
        self.px_per_rad
    }

    /// See [`super::Lens::widest_slope`].
    pub fn widest_slope(&self) -> f64 {
        self.widest_slope
    }

    /// See [`super::Lens::pixel`].
    #[inline(always)]
    pub fn pixel(&self, p_in_camera: [f32; 3]) -> [f32; 2] {
        let at = self.base.pixel(p_in_camera);
        let [x, y] = [0, 1].map(|axis| (at[axis] - self.first[axis]) * self.nodes_per_px[axis]);
        // NaN outside the table and outside the field of view of the fisheye.
        let last = (N_NODES - 1) as f32;
        if !((x >= 0.0) & (y >= 0.0) & (x < last) & (y < last)) {
            return super::NOWHERE;
        }
        let column = x as usize;
        let row = y as usize;
        let x = x - column as f32;
        let y = y - row as f32;
        let node = row * N_NODES + column;
        let [a, b, c, d] = [node, node + 1, node + N_NODES, node + N_NODES + 1].map(|node| self.residuals[node]);
        [0, 1].map(|axis| {
            let above = a[axis] + x * (b[axis] - a[axis]);
            let below = c[axis] + x * (d[axis] - c[axis]);
            at[axis] + above + y * (below - above)
        })
    }
}
