//! The street's course: a gently curved and sloped center line, and coordinates along it.
//!
//! `x` runs with the world's east, `t` to the left of the center line, `h` up from it, all in m. `x` is not the length of
//! the arc, but within 2 % of it.

use crate::trace::Vec3;
use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, Vector3};
use std::f64::consts::TAU;

/// The center line `y(x)`, `z(x)`: sines, so that every derivative exists and an IMU feels no kinks.
#[derive(Clone, Debug, PartialEq)]
pub struct Street {
    /// Where the built part begins and ends, m.
    pub ends: [f64; 2],
    sway_m: f64,
    sway_wave: f64,
    rise_m: f64,
    rise_wave: f64,
    phase: f64,
}

impl Street {
    /// A street of the given length from `x` = 0; the phase (rad) sets where its hills are.
    pub fn new(length_m: f64, phase: f64) -> Self {
        // 6 m in 220 m: at most 10 degrees off east and radii above 200 m. 1.2 m in 170 m: slopes up to 4.4 %.
        Self { ends: [0.0, length_m], sway_m: 6.0, sway_wave: TAU / 220.0, rise_m: 1.2, rise_wave: TAU / 170.0, phase }
    }
    /// The center line at `x`.
    pub fn center(&self, x: f64) -> Vector3<f64> {
        Vector3::new(x, self.sway_m * (self.sway_wave * x).sin(), self.rise_m * (self.rise_wave * x + self.phase).sin())
    }
    /// Direction of the street: rad from east, counterclockwise.
    pub fn heading(&self, x: f64) -> f64 {
        (self.sway_m * self.sway_wave * (self.sway_wave * x).cos()).atan()
    }
    /// Slope along the street: rad, positive uphill.
    pub fn slope(&self, x: f64) -> f64 {
        let rise = self.rise_m * self.rise_wave * (self.rise_wave * x + self.phase).cos();
        // Rise per metre of the way, not per metre of x.
        (rise * self.heading(x).cos()).atan()
    }
    /// World coordinates of a point beside and above the center line.
    pub fn point(&self, x: f64, t: f64, h: f64) -> Vector3<f64> {
        let heading = self.heading(x);
        self.center(x) + Vector3::new(-heading.sin() * t, heading.cos() * t, h)
    }
    /// The same for the tracer.
    pub fn vertex(&self, x: f32, t: f32, h: f32) -> Vec3 {
        self.point(f64::from(x), f64::from(t), f64::from(h)).cast()
    }
    /// The frame of something that stands on the street: x along it, leaning with its slope, turned by `yaw` (rad).
    pub fn frame(&self, x: f64, t: f64, h: f64, yaw: f64) -> Isometry3<f64> {
        let rotation = Rotation3::from_axis_angle(&Vector3::z_axis(), self.heading(x))
            * Rotation3::from_axis_angle(&Vector3::y_axis(), -self.slope(x))
            * Rotation3::from_axis_angle(&Vector3::z_axis(), yaw);
        Isometry3::from_parts(Translation3::from(self.point(x, t, h)), UnitQuaternion::from_rotation_matrix(&rotation))
    }
    /// As [`Street::frame`], but upright: trees, poles and people do not lean with the road.
    pub fn upright(&self, x: f64, t: f64, h: f64, yaw: f64) -> Isometry3<f64> {
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), self.heading(x) + yaw);
        Isometry3::from_parts(Translation3::from(self.point(x, t, h)), rotation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heading_and_slope_are_those_of_the_center_line() {
        let street = Street::new(300.0, 0.7);
        for i in 0..60 {
            let x = f64::from(i) * 5.0;
            let step = (street.center(x + 1e-4) - street.center(x - 1e-4)).normalize();
            let forward = street.frame(x, 0.0, 0.0, 0.0) * Vector3::x();
            assert!((forward - step).norm() < 1e-6, "x = {x}: {forward} against {step}");
        }
    }

    #[test]
    fn t_is_to_the_left_and_h_is_up() {
        let street = Street::new(300.0, 0.0);
        let side = street.point(40.0, 2.0, 0.5) - street.center(40.0);
        let local = street.upright(40.0, 0.0, 0.0, 0.0).inverse() * side;
        assert!((local - Vector3::new(0.0, 2.0, 0.5)).norm() < 1e-9);
    }
}
