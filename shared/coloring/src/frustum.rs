//! The field of view of a camera as planes, used to skip chunks of points outside it.

use crate::lens::Lens;
use geometry::{CameraModel, Vector2};

/// Spacing of sampled pixels along the image border, px. Between samples the border is straight within the margin.
const RIM_STEP_PX: u32 = 16;

/// Added to the slopes on every side: half a degree, more than the f32 error of the lens and the curvature between samples.
const MARGIN: f64 = 0.01;

/// Range of x/z and y/z (camera frame) that falls on the image: smallest x, largest x, smallest y, largest y.
pub type Slopes = [f64; 4];

/// The slopes of the rays of the image border. `None` if the camera sees sideways or backward, where slopes are infinite.
pub fn slopes(model: &CameraModel, lens: &Lens) -> Option<Slopes> {
    let widest = lens.widest_slope()?;
    let (width, height) = model.size();
    // The corners of the outermost pixels.
    let along = |len: u32| (0..len).step_by(RIM_STEP_PX as usize).chain([len]).map(|at| f64::from(at) - 0.5);
    let right = f64::from(width) - 0.5;
    let bottom = f64::from(height) - 0.5;
    let rows = along(width).flat_map(|u| [Vector2::new(u, -0.5), Vector2::new(u, bottom)]);
    let columns = along(height).flat_map(|v| [Vector2::new(-0.5, v), Vector2::new(right, v)]);
    let mut slopes = [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY];
    for pixel in rows.chain(columns) {
        // A border pixel without a ray: the field of view of the lens ends inside the image.
        let ray = model.ray_from_pixel(&pixel).filter(|ray| ray.z > 0.1);
        let reach = ray.map_or([-widest, widest, -widest, widest], |ray| {
            let [x, y] = [ray.x / ray.z, ray.y / ray.z];
            [x, x, y, y]
        });
        slopes = [slopes[0].min(reach[0]), slopes[1].max(reach[1]), slopes[2].min(reach[2]), slopes[3].max(reach[3])];
    }
    Some([slopes[0] - MARGIN, slopes[1] + MARGIN, slopes[2] - MARGIN, slopes[3] + MARGIN])
}

/// Planes in the submap frame with the visible points on their positive side. `None` for a camera with an unlimited field
/// of view.
#[derive(Clone, Copy, Debug)]
pub struct Frustum(Option<[[f32; 4]; 5]>);

impl Frustum {
    /// The field of view of a camera with these slopes. It is unlimited if `slopes` is `None`.
    pub fn new(slopes: Option<Slopes>, camera_from_submap: &[[f32; 4]; 3]) -> Self {
        let [x, y, z] = *camera_from_submap;
        let plane = |a: [f32; 4], sign: f32, slope: f64| [0, 1, 2, 3].map(|i| sign * (a[i] - slope as f32 * z[i]));
        Self(
            slopes.map(|[x0, x1, y0, y1]| {
                [z, plane(x, 1.0, x0), plane(x, -1.0, x1), plane(y, 1.0, y0), plane(y, -1.0, y1)]
            }),
        )
    }

    /// Whether a part of the box may be visible.
    pub fn intersects(&self, [min, max]: &[[f32; 3]; 2]) -> bool {
        let reaches = |[a, b, c, d]: &[f32; 4]| {
            let farthest = |n: f32, axis: usize| n * if n > 0.0 { max[axis] } else { min[axis] };
            farthest(*a, 0) + farthest(*b, 1) + farthest(*c, 2) + d > 0.0
        };
        self.0.as_ref().is_none_or(|planes| planes.iter().all(reaches))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{KannalaBrandt, Pinhole, Point3};

    const IDENTITY: [[f32; 4]; 3] = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];

    fn frustum(model: &CameraModel) -> Frustum {
        Frustum::new(slopes(model, &model.into()), &IDENTITY)
    }

    fn models() -> [CameraModel; 2] {
        let width = 640;
        let height = 480;
        let cx = 320.0;
        let cy = 240.0;
        let barrel = [-0.2, 0.05, 0.001, -0.0005, 0.0];
        [
            CameraModel::Pinhole(Pinhole { width, height, fx: 500.0, fy: 500.0, cx, cy, distortion: barrel }),
            CameraModel::KannalaBrandt(KannalaBrandt {
                width,
                height,
                fx: 260.0,
                fy: 260.0,
                cx,
                cy,
                distortion: [-0.01, 0.0, 0.0, 0.0],
                max_angle: 1.2,
            }),
        ]
    }

    #[test]
    fn frustum_contains_all_visible_points_and_few_others() {
        for model in models() {
            let frustum = frustum(&model);
            let mut n_visible = 0;
            let mut n_inside = 0;
            let mut n_all = 0;
            for i in 0..40_000_u32 {
                // Fibonacci sphere: uniform in all directions.
                let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / 40_000.0;
                let across = (1.0 - z * z).sqrt();
                let angle = f64::from(i) * 2.399_963_229_728_653;
                let p = [across * angle.cos(), across * angle.sin(), z].map(|v| 7.0 * v);
                let is_inside = frustum.intersects(&[p.map(|v| v as f32); 2]);
                let is_visible = model.pixel_from_camera(&Point3::from(p)).is_some();
                assert!(is_inside || !is_visible, "{p:?} is visible and outside the frustum");
                n_visible += usize::from(is_visible);
                n_inside += usize::from(is_inside);
                n_all += 1;
            }
            assert!(
                n_visible * 10 > n_inside * 7 && n_inside * 3 < n_all * 2,
                "{n_visible} visible, {n_inside} inside of {n_all}"
            );
        }
    }

    #[test]
    fn a_box_around_the_camera_is_inside_and_one_behind_is_not() {
        let [narrow, _] = models();
        let frustum = frustum(&narrow);
        assert!(frustum.intersects(&[[-1.0; 3], [1.0; 3]]));
        assert!(!frustum.intersects(&[[-9.0, -9.0, -9.0], [9.0, 9.0, -0.1]]));
        assert!(!frustum.intersects(&[[20.0, -1.0, 1.0], [30.0, 1.0, 9.0]]));
    }

    #[test]
    fn frustum_of_backward_seeing_camera_contains_everything() {
        let [_, CameraModel::KannalaBrandt(wide)] = models() else { panic!("the second is a fisheye") };
        let model = CameraModel::KannalaBrandt(KannalaBrandt { max_angle: 2.0, ..wide });
        assert!(frustum(&model).intersects(&[[0.0, 0.0, -9.0], [0.1, 0.1, -8.0]]));
    }
}
