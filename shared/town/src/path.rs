//! Paths of vehicles and people: smooth curves on the terrain, and coordinates along them.

use crate::spline::Spline;
use crate::terrain::Terrain;
use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, Vector2, Vector3};

/// A curve on the ground in the world frame. Distances along it (m) equal arc length within 1 % on straights, and within 5 %
/// in the turns of junctions.
#[derive(Clone, Debug)]
pub struct GroundPath {
    line: Spline<3>,
    spacing_m: f64,
    terrain: Terrain,
}

impl GroundPath {
    /// An open path near points `spacing_m` apart; `None` without points.
    pub fn open(points: Vec<Vector3<f64>>, spacing_m: f64, terrain: Terrain) -> Option<Self> {
        Some(Self { line: Spline::open(points)?, spacing_m, terrain })
    }
    /// A closed path; the last point is `spacing_m` before the first one. `None` without points.
    pub fn closed(points: Vec<Vector3<f64>>, spacing_m: f64, terrain: Terrain) -> Option<Self> {
        Some(Self { line: Spline::closed(points)?, spacing_m, terrain })
    }
    /// A closed path around a polygon, with points about `spacing_m` apart on the terrain; `None` without corners.
    pub fn around(corners: &[Vector2<f64>], spacing_m: f64, terrain: Terrain) -> Option<Self> {
        let mut points = Vec::new();
        for (i, corner) in corners.iter().enumerate() {
            let side = corners[(i + 1) % corners.len()] - corner;
            let n = (side.norm() / spacing_m) as usize;
            points.extend((0..n).map(|k| corner + side * (k as f64 / n as f64)));
        }
        let points = points.iter().map(|p| Vector3::new(p.x, p.y, terrain.height(p))).collect();
        Self::closed(points, spacing_m, terrain)
    }
    /// Length of an open path or of one round of a closed one, m.
    pub const fn length_m(&self) -> f64 {
        self.line.len() as f64 * self.spacing_m
    }
    /// The distance along the path at which it is nearest to a point in the plane, m.
    pub fn nearest_m(&self, point: &Vector3<f64>) -> f64 {
        const STEP_M: f64 = 0.1;
        let steps = (0..(self.length_m() / STEP_M) as usize).map(|step| step as f64 * STEP_M);
        let distance = |s: f64| (self.point(s) - point).xy().norm_squared();
        steps.min_by(|a, b| distance(*a).total_cmp(&distance(*b))).unwrap_or(0.0)
    }
    /// The point at distance `s` m.
    pub fn point(&self, s: f64) -> Vector3<f64> {
        self.line.at(s / self.spacing_m)
    }
    /// Derivative of the point with respect to `s`; nearly of unit length.
    pub fn direction(&self, s: f64) -> Vector3<f64> {
        self.line.slope(s / self.spacing_m) / self.spacing_m
    }
    /// Curvature in the plane, rad/m, positive to the left.
    pub fn curvature(&self, s: f64) -> f64 {
        let h = 0.1;
        let before = self.direction(s - h).xy();
        let after = self.direction(s + h).xy();
        before.perp(&after).atan2(before.dot(&after)) / (2.0 * h)
    }
    /// Frame of a vehicle `left_m` to the left of the path: x along the path, tilted with the ground, rotated by `yaw`
    /// (rad).
    pub fn frame(&self, s: f64, left_m: f64, yaw: f64) -> Isometry3<f64> {
        let (direction, left, at) = self.offset_point(s, left_m);
        let pitch = -direction.z.atan2(direction.xy().norm());
        let roll = self.terrain.gradient(&at.xy()).dot(&left).atan();
        let rotation = Rotation3::from_axis_angle(&Vector3::z_axis(), direction.y.atan2(direction.x))
            * Rotation3::from_axis_angle(&Vector3::y_axis(), pitch)
            * Rotation3::from_axis_angle(&Vector3::x_axis(), roll)
            * Rotation3::from_axis_angle(&Vector3::z_axis(), yaw);
        Isometry3::from_parts(Translation3::from(at), UnitQuaternion::from_rotation_matrix(&rotation))
    }
    /// Frame as in [`GroundPath::frame`], but upright, for people.
    pub fn upright(&self, s: f64, left_m: f64, yaw: f64) -> Isometry3<f64> {
        let (direction, _, at) = self.offset_point(s, left_m);
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), direction.y.atan2(direction.x) + yaw);
        Isometry3::from_parts(Translation3::from(at), rotation)
    }
    /// Direction, the unit vector to the left, and the position.
    fn offset_point(&self, s: f64, left_m: f64) -> (Vector3<f64>, Vector2<f64>, Vector3<f64>) {
        let direction = self.direction(s);
        let left = Vector2::new(-direction.y, direction.x) / direction.xy().norm().max(1e-9);
        let on_path = self.point(s);
        let step = left * left_m;
        let rise = self.terrain.height(&(on_path.xy() + step)) - self.terrain.height(&on_path.xy());
        (direction, left, on_path + Vector3::new(step.x, step.y, rise))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ring() -> GroundPath {
        let terrain = Terrain::new(3);
        let n = 200;
        let points = (0..n).map(|i| {
            let angle = f64::from(i) * std::f64::consts::TAU / f64::from(n);
            let p = Vector2::new(angle.cos(), angle.sin()) * 64.0;
            Vector3::new(p.x, p.y, terrain.height(&p))
        });
        GroundPath::closed(points.collect(), 64.0 * std::f64::consts::TAU / f64::from(n), terrain).expect("points")
    }

    #[test]
    fn frame_follows_path_and_terrain_slope() {
        let path = ring();
        for i in 0..50 {
            let s = f64::from(i) * 9.1;
            let frame = path.frame(s, 2.0, 0.0);
            let step = (path.frame(s + 1e-3, 2.0, 0.0).translation.vector - frame.translation.vector).normalize();
            assert!((frame.rotation * Vector3::x() - step).norm() < 2e-3);
            let up = frame.rotation * Vector3::z();
            let gradient = path.terrain.gradient(&frame.translation.vector.xy());
            assert!((up - Vector3::new(-gradient.x, -gradient.y, 1.0).normalize()).norm() < 3e-3);
        }
    }

    #[test]
    fn ring_path_has_length_and_curvature_of_circle() {
        let path = ring();
        assert!((path.length_m() - 64.0 * std::f64::consts::TAU).abs() < 1e-9);
        assert!((path.curvature(17.0) - 1.0 / 64.0).abs() < 1e-4);
        assert!((path.point(3.0) - path.point(3.0 + path.length_m())).norm() < 1e-6);
    }
}
