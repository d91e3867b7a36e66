//! Lenses prepared for fast projection in f32. The exact models are [`geometry::CameraModel`] in f64; the two agree
//! within 0.02 px.

mod fisheye;
mod pinhole;
mod spline_warp;

pub use fisheye::FisheyeLens;
pub use pinhole::PinholeLens;
pub use spline_warp::SplineWarpLens;

use geometry::CameraModel;

/// Pixel of a point outside the field of view of the lens. NaN is in no image, and a loop that writes it has no branches.
const NOWHERE: [f32; 2] = [f32::NAN; 2];

/// A camera model, prepared.
#[derive(Clone, Debug)]
pub enum Lens {
    /// See [`geometry::Pinhole`].
    Pinhole(PinholeLens),
    /// See [`geometry::KannalaBrandt`].
    Fisheye(FisheyeLens),
    /// See [`geometry::SplineWarp`].
    SplineWarp(SplineWarpLens),
}

impl From<&CameraModel> for Lens {
    fn from(model: &CameraModel) -> Self {
        match model {
            CameraModel::Pinhole(model) => Lens::Pinhole(model.into()),
            CameraModel::KannalaBrandt(model) => Lens::Fisheye(model.into()),
            CameraModel::SplineWarp(model) => Lens::SplineWarp(model.into()),
        }
    }
}

impl Lens {
    /// Tangent of the largest visible angle to the axis. `None` if the field of view reaches 90 degrees from the axis.
    pub fn widest_slope(&self) -> Option<f64> {
        match self {
            Lens::Pinhole(lens) => Some(lens.widest_slope()),
            Lens::Fisheye(lens) => lens.widest_slope(),
            Lens::SplineWarp(lens) => Some(lens.widest_slope()),
        }
    }

    /// Resolution on the axis, px/rad.
    #[inline]
    pub fn px_per_rad(&self) -> f32 {
        match self {
            Lens::Pinhole(lens) => lens.px_per_rad(),
            Lens::Fisheye(lens) => lens.px_per_rad(),
            Lens::SplineWarp(lens) => lens.px_per_rad(),
        }
    }

    /// Pixel of a point of the camera frame (x right, y down, z forward, m); NaN if the point is outside the field of
    /// view.
    #[inline]
    pub fn pixel(&self, p_in_camera: [f32; 3]) -> [f32; 2] {
        match self {
            Lens::Pinhole(lens) => lens.pixel(p_in_camera),
            Lens::Fisheye(lens) => lens.pixel(p_in_camera),
            Lens::SplineWarp(lens) => lens.pixel(p_in_camera),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use geometry::{KannalaBrandt, Pinhole, Point3};

    fn compare(model: &CameraModel) -> usize {
        let lens = Lens::from(model);
        let mut n_seen = 0;
        for i in 0..200_u32 {
            for j in 0..200_u32 {
                // All directions, some on the axes, at different distances.
                let azimuth = f64::from(i) * 0.0314;
                let polar = f64::from(j) * 0.0157;
                let direction = [polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos()];
                let p = direction.map(|v| v * (0.5 + f64::from(j % 50)));
                let p_in_camera = p.map(|v| v as f32);
                let fast = lens.pixel(p_in_camera);
                let Some(exact) = model.pixel_from_camera(&Point3::from(p)) else { continue };
                let error = (f64::from(fast[0]) - exact.x).hypot(f64::from(fast[1]) - exact.y);
                // The fast lens projects every point that the exact model projects: NaN fails this comparison.
                assert!(error < 0.02, "{p:?}: {fast:?} instead of {exact}");
                n_seen += 1;
            }
        }
        n_seen
    }

    fn pinhole(distortion: [f64; 5]) -> CameraModel {
        let width = 1600;
        let height = 900;
        let fx = 1266.4;
        let fy = 1260.0;
        let cx = 816.3;
        let cy = 491.5;
        CameraModel::Pinhole(Pinhole { width, height, fx, fy, cx, cy, distortion })
    }

    fn fisheye(max_angle: f64) -> CameraModel {
        let width = 2048;
        let height = 2448;
        let fx = 1236.0;
        let fy = 1240.0;
        let cx = 1020.0;
        let cy = 1230.0;
        let distortion = [-0.02, 0.004, -0.001, 0.0001];
        CameraModel::KannalaBrandt(KannalaBrandt { width, height, fx, fy, cx, cy, distortion, max_angle })
    }

    /// A lens whose splines map a pinhole image to a fisheye image.
    fn spline_warp() -> CameraModel {
        let width = 2448;
        let height = 2048;
        let fx = 460.0;
        let fy = 459.0;
        let cx = 1216.0;
        let cy = 1040.0;
        let surface = |along: usize| {
            let n = 23_i32;
            // Mean of the knots of a coefficient, as a share of the image.
            let place = |i: i32| f64::from((0..3).map(|k| (i + k - 2).clamp(0, n - 3)).sum::<i32>()) / 60.0;
            let bent = |i: i32, j: i32| {
                let x = 2.0 * place(i) - 1.0;
                let y = 2.0 * place(j) - 1.0;
                let x = x * 2.66;
                let y = y * 2.23;
                let r = x.hypot(y).max(1e-9);
                let angle = r.atan() * (1.0 + 0.01 * x);
                0.5 + if along == 0 { 0.5066 * x } else { 0.605 * y } * angle / r
            };
            (0..n).map(|i| (0..n).map(|j| bent(i, j)).collect()).collect::<Vec<Vec<f64>>>()
        };
        let [warp_u, warp_v] = [0, 1].map(|along| surface(along).try_into().expect("a grid"));
        CameraModel::SplineWarp(geometry::SplineWarp { width, height, fx, fy, cx, cy, warp_u, warp_v })
    }

    #[test]
    fn lens_projects_like_its_exact_model() {
        assert!(compare(&spline_warp()) > 1000);
        assert!(compare(&pinhole([0.0; 5])) > 1000);
        assert!(compare(&pinhole([-0.25, 0.08, 0.001, -0.0007, -0.01])) > 1000);
        assert!(compare(&fisheye(1.2)) > 1000);
        assert!(compare(&fisheye(2.0)) > 1000);
    }

    #[real_data::test("ladybug5/ladybug16146039-20m.cal")]
    fn real_ladybug_lens_projects_like_its_exact_model() {
        let path = real_data::path("ladybug5/ladybug16146039-20m.cal");
        let text = std::fs::read_to_string(path).expect("readable");
        let calibration: formats::ladybug::LadybugCalibration = text.parse().expect("the manufacturer's own file");
        for camera in calibration.cameras {
            assert!(compare(&CameraModel::SplineWarp(camera.lens)) > 1000);
        }
    }

    #[test]
    fn invalid_point_projects_to_nan() {
        for lens in [Lens::from(&pinhole([0.0; 5])), Lens::from(&fisheye(1.5)), Lens::from(&spline_warp())] {
            for p in [[0.0, 0.0, -2.0], [0.0, 0.0, 0.0], [f32::NAN, 0.0, 1.0], [0.0, 0.0, f32::NAN], [5.0, 0.0, -1.0]] {
                assert!(lens.pixel(p)[0].is_nan(), "{p:?}");
            }
        }
    }
}
