//! Ways of vehicles and people: smooth curves over the terrain, and coordinates along them.

use crate::scene::Terrain;
use crate::spline::Spline;
use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, Vector2, Vector3};

/// A curve on the ground in the world frame. Places along it are lengths in m, within 1 % of the arc's on straights and
/// within 5 % in the turns of junctions, which the curve cuts.
#[derive(Clone, Debug)]
pub struct Way {
    line: Spline<3>,
    spacing_m: f64,
    terrain: Terrain,
}

impl Way {
    /// A way near points `spacing_m` apart that ends at the last one; `None` without points.
    pub fn open(points: Vec<Vector3<f64>>, spacing_m: f64, terrain: Terrain) -> Option<Self> {
        Some(Self { line: Spline::open(points)?, spacing_m, terrain })
    }
    /// The same, but leading round and round; the last point is `spacing_m` before the first one.
    pub fn closed(points: Vec<Vector3<f64>>, spacing_m: f64, terrain: Terrain) -> Option<Self> {
        Some(Self { line: Spline::closed(points)?, spacing_m, terrain })
    }
    /// Length of one round, m.
    pub const fn length_m(&self) -> f64 {
        self.line.len() as f64 * self.spacing_m
    }
    /// The place after `s` m.
    pub fn point(&self, s: f64) -> Vector3<f64> {
        self.line.at(s / self.spacing_m)
    }
    /// Direction there, per m; not quite of unit length.
    pub fn direction(&self, s: f64) -> Vector3<f64> {
        self.line.slope(s / self.spacing_m) / self.spacing_m
    }
    /// How fast the direction turns in the plane, rad/m, positive to the left.
    pub fn curvature(&self, s: f64) -> f64 {
        let h = 0.1;
        let (before, after) = (self.direction(s - h).xy(), self.direction(s + h).xy());
        before.perp(&after).atan2(before.dot(&after)) / (2.0 * h)
    }
    /// The frame of something on wheels, `left_m` beside the way: x along it, leaning with the ground, turned by `yaw` (rad).
    pub fn frame(&self, s: f64, left_m: f64, yaw: f64) -> Isometry3<f64> {
        let (direction, left, at) = self.beside(s, left_m);
        let pitch = -direction.z.atan2(direction.xy().norm());
        let roll = self.terrain.gradient(&at.xy()).dot(&left).atan();
        let rotation = Rotation3::from_axis_angle(&Vector3::z_axis(), direction.y.atan2(direction.x))
            * Rotation3::from_axis_angle(&Vector3::y_axis(), pitch)
            * Rotation3::from_axis_angle(&Vector3::x_axis(), roll)
            * Rotation3::from_axis_angle(&Vector3::z_axis(), yaw);
        Isometry3::from_parts(Translation3::from(at), UnitQuaternion::from_rotation_matrix(&rotation))
    }
    /// As [`Way::frame`], but upright: people do not lean with the road.
    pub fn upright(&self, s: f64, left_m: f64, yaw: f64) -> Isometry3<f64> {
        let (direction, _, at) = self.beside(s, left_m);
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), direction.y.atan2(direction.x) + yaw);
        Isometry3::from_parts(Translation3::from(at), rotation)
    }
    /// Direction, the unit vector to the left, and the place.
    fn beside(&self, s: f64, left_m: f64) -> (Vector3<f64>, Vector2<f64>, Vector3<f64>) {
        let direction = self.direction(s);
        let left = Vector2::new(-direction.y, direction.x) / direction.xy().norm().max(1e-9);
        let on_way = self.point(s);
        let step = left * left_m;
        let rise = self.terrain.height(&(on_way.xy() + step)) - self.terrain.height(&on_way.xy());
        (direction, left, on_way + Vector3::new(step.x, step.y, rise))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ring() -> Way {
        let terrain = Terrain::new(3);
        let n = 200;
        let points = (0..n).map(|i| {
            let angle = f64::from(i) * std::f64::consts::TAU / f64::from(n);
            let p = Vector2::new(angle.cos(), angle.sin()) * 64.0;
            Vector3::new(p.x, p.y, terrain.height(&p))
        });
        Way::closed(points.collect(), 64.0 * std::f64::consts::TAU / f64::from(n), terrain).expect("points")
    }

    #[test]
    fn frames_look_along_the_way_and_lean_with_the_ground() {
        let way = ring();
        for i in 0..50 {
            let s = f64::from(i) * 9.1;
            let frame = way.frame(s, 2.0, 0.0);
            let step = (way.frame(s + 1e-3, 2.0, 0.0).translation.vector - frame.translation.vector).normalize();
            assert!((frame.rotation * Vector3::x() - step).norm() < 2e-3);
            let up = frame.rotation * Vector3::z();
            let gradient = way.terrain.gradient(&frame.translation.vector.xy());
            assert!((up - Vector3::new(-gradient.x, -gradient.y, 1.0).normalize()).norm() < 3e-3);
        }
    }

    #[test]
    fn lengths_and_curvature_are_those_of_the_ring() {
        let way = ring();
        assert!((way.length_m() - 64.0 * std::f64::consts::TAU).abs() < 1e-9);
        assert!((way.curvature(17.0) - 1.0 / 64.0).abs() < 1e-4);
        assert!((way.point(3.0) - way.point(3.0 + way.length_m())).norm() < 1e-6);
    }
}
