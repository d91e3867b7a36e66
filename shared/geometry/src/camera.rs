//! Camera models: projection of points in the camera frame (x right, y down, z forward, m) to image pixels (u right, v down, px,
//! pixel centers at integers), and back.

use crate::SplineWarp;
use nalgebra::{Point3, Vector2, Vector3};
use serde::{Deserialize, Serialize};

/// Intrinsics of one camera (`K` and `D` in the literature).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum CameraModel {
    /// Perspective lens.
    Pinhole(Pinhole),
    /// Fisheye lens.
    KannalaBrandt(KannalaBrandt),
    /// Lens of a Ladybug panoramic camera.
    SplineWarp(SplineWarp),
}

/// Pinhole with Brown-Conrady distortion (radial k1 k2 k3, tangential p1 p2), as in OpenCV.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pinhole {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Focal length along u, px.
    pub fx: f64,
    /// Focal length along v, px.
    pub fy: f64,
    /// Principal point, px.
    pub cx: f64,
    /// Principal point, px.
    pub cy: f64,
    /// k1 k2 p1 p2 k3.
    #[serde(default)]
    pub distortion: [f64; 5],
}

/// Equidistant fisheye: radius = f (t + k1 t^3 + k2 t^5 + k3 t^7 + k4 t^9) at angle t from the axis (Kannala and
/// Brandt, PAMI 2006; OpenCV's fisheye).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct KannalaBrandt {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Focal length along u, px per rad.
    pub fx: f64,
    /// Focal length along v, px per rad.
    pub fy: f64,
    /// Principal point, px.
    pub cx: f64,
    /// Principal point, px.
    pub cy: f64,
    /// k1 to k4.
    #[serde(default)]
    pub distortion: [f64; 4],
    /// Largest usable angle from the axis, rad.
    pub max_angle: f64,
}

impl CameraModel {
    /// Columns and rows.
    pub fn size(&self) -> (u32, u32) {
        match self {
            CameraModel::Pinhole(m) => (m.width, m.height),
            CameraModel::KannalaBrandt(m) => (m.width, m.height),
            CameraModel::SplineWarp(m) => (m.width, m.height),
        }
    }

    /// Pixel of a point; `None` behind the camera or outside the image.
    pub fn pixel_from_camera(&self, p_in_camera: &Point3<f64>) -> Option<Vector2<f64>> {
        let pixel = match self {
            CameraModel::Pinhole(m) => m.project(p_in_camera)?,
            CameraModel::KannalaBrandt(m) => m.project(p_in_camera)?,
            CameraModel::SplineWarp(m) => m.project(p_in_camera, 0.0)?,
        };
        let (width, height) = self.size();
        let inside =
            pixel.x >= -0.5 && pixel.y >= -0.5 && pixel.x < width as f64 - 0.5 && pixel.y < height as f64 - 0.5;
        inside.then_some(pixel)
    }

    /// Unit direction of a pixel in the camera frame; `None` outside the range of the lens model.
    pub fn ray_from_pixel(&self, pixel: &Vector2<f64>) -> Option<Vector3<f64>> {
        match self {
            CameraModel::Pinhole(m) => m.unproject(pixel),
            CameraModel::KannalaBrandt(m) => m.unproject(pixel),
            CameraModel::SplineWarp(m) => m.unproject(pixel),
        }
    }
}

impl Pinhole {
    fn distort(&self, x: f64, y: f64) -> (f64, f64) {
        let [k1, k2, p1, p2, k3] = self.distortion;
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (k1 + r2 * (k2 + r2 * k3));
        (
            x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x),
            y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y,
        )
    }
    /// Whether the radial distortion is monotone from the optical axis to the squared radius `r2` (of x/z, y/z). Beyond
    /// the first extremum the polynomial folds off-axis directions back into the image, although they are outside the
    /// view of the real lens.
    pub fn is_monotone_to(&self, r2: f64) -> bool {
        let [k1, k2, _, _, k3] = self.distortion;
        let slope = |s: f64| 1.0 + s * (3.0 * k1 + s * (5.0 * k2 + s * 7.0 * k3));
        // A cubic is positive on [0, r2] if it is positive at the ends and at its extrema inside.
        let a = 21.0 * k3;
        let b = 10.0 * k2;
        let c = 3.0 * k1;
        let discriminant = b * b - 4.0 * a * c;
        let turning_points = if discriminant < 0.0 {
            [0.0; 2]
        } else {
            // The cancellation-free form of the quadratic formula; a zero divisor gives a point outside.
            let q = -0.5 * (b + discriminant.sqrt().copysign(b));
            [q / a, c / q]
        };
        slope(r2) > 0.0 && turning_points.iter().all(|s| !(*s > 0.0 && *s < r2) || slope(*s) > 0.0)
    }
    fn project(&self, p: &Point3<f64>) -> Option<Vector2<f64>> {
        // A point closer than a nanometre in front of the lens counts as behind it.
        if p.z <= 1e-9 {
            return None;
        }
        let x = p.x / p.z;
        let y = p.y / p.z;
        if self.distortion != [0.0; 5] && !self.is_monotone_to(x * x + y * y) {
            return None;
        }
        let (x, y) = self.distort(x, y);
        Some(Vector2::new(self.fx * x + self.cx, self.fy * y + self.cy))
    }
    fn unproject(&self, pixel: &Vector2<f64>) -> Option<Vector3<f64>> {
        let xd = (pixel.x - self.cx) / self.fx;
        let yd = (pixel.y - self.cy) / self.fy;
        let mut x = xd;
        let mut y = yd;
        // Fixed-point iteration as OpenCV's undistortPoints; 20 rounds leave less than 1e-6 px for real lenses.
        for _ in 0..20 {
            let (dx, dy) = self.distort(x, y);
            x += xd - dx;
            y += yd - dy;
        }
        let (dx, dy) = self.distort(x, y);
        let converged = (dx - xd).abs() * self.fx < 0.01 && (dy - yd).abs() * self.fy < 0.01;
        converged.then(|| Vector3::new(x, y, 1.0).normalize())
    }
}

impl KannalaBrandt {
    fn radius(&self, t: f64) -> f64 {
        let [k1, k2, k3, k4] = self.distortion;
        let t2 = t * t;
        t * (1.0 + t2 * (k1 + t2 * (k2 + t2 * (k3 + t2 * k4))))
    }
    fn project(&self, p: &Point3<f64>) -> Option<Vector2<f64>> {
        let r = p.x.hypot(p.y);
        let angle = r.atan2(p.z);
        if angle > self.max_angle || (r == 0.0 && p.z <= 0.0) {
            return None;
        }
        // On the axis radius/r tends to 1/z.
        let scale = if r > 1e-12 { self.radius(angle) / r } else { 1.0 / p.z };
        Some(Vector2::new(self.fx * p.x * scale + self.cx, self.fy * p.y * scale + self.cy))
    }
    fn unproject(&self, pixel: &Vector2<f64>) -> Option<Vector3<f64>> {
        let x = (pixel.x - self.cx) / self.fx;
        let y = (pixel.y - self.cy) / self.fy;
        let radius = x.hypot(y);
        let mut angle = radius;
        // Newton's method; the radius is nearly linear in the angle, so a few rounds reach machine precision.
        for _ in 0..10 {
            let [k1, k2, k3, k4] = self.distortion;
            let t2 = angle * angle;
            let slope = 1.0 + t2 * (3.0 * k1 + t2 * (5.0 * k2 + t2 * (7.0 * k3 + t2 * 9.0 * k4)));
            angle -= (self.radius(angle) - radius) / slope;
        }
        if !(0.0..=self.max_angle).contains(&angle) {
            return None;
        }
        let lateral = if radius > 1e-12 { angle.sin() / radius } else { 1.0 };
        Some(Vector3::new(x * lateral, y * lateral, angle.cos()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;

    fn models() -> [CameraModel; 2] {
        [
            CameraModel::Pinhole(Pinhole {
                width: 640,
                height: 480,
                fx: 500.0,
                fy: 510.0,
                cx: 320.5,
                cy: 239.0,
                distortion: [-0.2, 0.05, 0.001, -0.0005, 0.01],
            }),
            CameraModel::KannalaBrandt(KannalaBrandt {
                width: 800,
                height: 600,
                fx: 260.0,
                fy: 261.0,
                cx: 400.0,
                cy: 300.0,
                distortion: [-0.01, 0.002, 0.0, 0.0],
                max_angle: 1.5,
            }),
        ]
    }

    #[test]
    fn pixel_maps_to_ray_and_back() {
        for model in models() {
            let (width, height) = model.size();
            for u in (5..width).step_by(37) {
                for v in (5..height).step_by(41) {
                    let pixel = Vector2::new(u as f64 + 0.25, v as f64 - 0.25);
                    let Some(ray) = model.ray_from_pixel(&pixel) else { continue };
                    let back = model.pixel_from_camera(&Point3::from(ray * 7.0)).expect("inside");
                    assert!((back - pixel).norm() < 0.05, "{pixel} came back as {back}");
                }
            }
        }
    }

    /// With k1 = -0.3 the bare polynomial puts a point 61 degrees off the axis 25 px from the image center.
    #[test]
    fn directions_beyond_the_extremum_of_the_distortion_are_not_projected() {
        let barrel = Pinhole {
            width: 640,
            height: 480,
            fx: 500.0,
            fy: 500.0,
            cx: 320.0,
            cy: 240.0,
            distortion: [-0.3, 0.0, 0.0, 0.0, 0.0],
        };
        // The slope 1 - 0.9 r2 turns at r2 = 1.11.
        assert!(barrel.is_monotone_to(1.1) && !barrel.is_monotone_to(1.12));
        let model = CameraModel::Pinhole(barrel.clone());
        assert!(model.pixel_from_camera(&Point3::new(0.5, 0.0, 1.0)).is_some());
        for r in [1.2, 1.8, 1.9, 3.7] {
            assert_eq!(model.pixel_from_camera(&Point3::new(r, 0.0, 1.0)), None, "r = {r}");
        }
        // Down and up again: the slope 1 - 3 r2 + 2.1 r2^2 is negative from 0.54 to 0.89 only.
        let wavy = Pinhole { distortion: [-1.0, 0.42, 0.0, 0.0, 0.0], ..barrel };
        assert!(wavy.is_monotone_to(0.5) && !wavy.is_monotone_to(0.7) && !wavy.is_monotone_to(2.0));
    }

    /// Cube layout of a panorama: six images of 90 degrees. Pixels reach half a pixel beyond their centers, so no direction falls
    /// between two faces.
    #[test]
    fn six_cameras_of_a_cube_project_every_direction_once() {
        let side = 256;
        let half = 127.5;
        let width = side;
        let height = side;
        let fx = 128.0;
        let fy = 128.0;
        let cx = half;
        let cy = half;
        let face = CameraModel::Pinhole(Pinhole { width, height, fx, fy, cx, cy, distortion: [0.0; 5] });
        let quarter = std::f64::consts::FRAC_PI_2;
        let around = (0..4).map(|i| UnitQuaternion::from_scaled_axis(Vector3::y() * quarter * f64::from(i)));
        let poles = [-quarter, quarter].map(|angle| UnitQuaternion::from_scaled_axis(Vector3::x() * angle));
        let faces: Vec<UnitQuaternion<f64>> = around.chain(poles).collect();
        for i in 0..10_000 {
            // Fibonacci sphere: uniform over all directions.
            let z = 1.0 - 2.0 * (f64::from(i) + 0.5) / 10_000.0;
            let across = (1.0 - z * z).sqrt();
            let angle = f64::from(i) * 2.399_963_229_728_653;
            let direction = Point3::new(across * angle.cos(), across * angle.sin(), z);
            let n_seen =
                faces.iter().filter(|face_from_cube| face.pixel_from_camera(&(*face_from_cube * direction)).is_some());
            assert_eq!(n_seen.count(), 1, "{direction}");
        }
    }

    #[test]
    fn points_behind_the_camera_are_not_projected() {
        for model in models() {
            assert_eq!(model.pixel_from_camera(&Point3::new(0.0, 0.0, -3.0)), None);
            assert!(model.pixel_from_camera(&Point3::new(0.0, 0.0, 3.0)).is_some());
        }
    }
}
