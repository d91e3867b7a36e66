//! A street: a smooth center line between two nodes of the network, and coordinates along it.
//!
//! `s` runs along the center line from its first node to its second, `t` to the left of it, `h` up from the terrain, all in
//! m. Positions before 0 and past the length lie on the tangents.

use crate::streets::profile::Profile;
use crate::terrain::Terrain;
use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, Vector2, Vector3};
use raytrace::Vec3;

/// A street, as long as its center line.
#[derive(Clone, Debug)]
pub struct Street {
    /// Its cross-section.
    pub profile: Profile,
    /// The nodes where it starts and ends.
    pub nodes: [usize; 2],
    /// Length between the nodes, m.
    pub length_m: f64,
    terrain: Terrain,
    /// Points of the center line, evenly spaced from node to node.
    line: Vec<Vector2<f64>>,
    /// Unit directions at these points.
    directions: Vec<Vector2<f64>>,
}

/// Approximate spacing of the points of a center line, m.
const STEP_M: f64 = 1.0;

impl Street {
    /// A street from `from` to `to` that leaves and arrives in the given directions (a cubic Bezier curve with handles of a
    /// third of the distance).
    pub fn new(
        profile: Profile,
        nodes: [usize; 2],
        ends: [Vector2<f64>; 2],
        directions: [Vector2<f64>; 2],
        terrain: Terrain,
    ) -> Self {
        let handle = (ends[1] - ends[0]).norm() / 3.0;
        let controls = [
            ends[0],
            ends[0] + directions[0].normalize() * handle,
            ends[1] - directions[1].normalize() * handle,
            ends[1],
        ];
        let fine: Vec<Vector2<f64>> = (0..=512).map(|i| bezier(&controls, f64::from(i) / 512.0)).collect();
        let length_m: f64 = fine.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
        let line = resample(&fine, (length_m / STEP_M).ceil() as usize);
        let directions = (0..line.len())
            .map(|i| (line[(i + 1).min(line.len() - 1)] - line[i.saturating_sub(1)]).normalize())
            .collect();
        Self { profile, nodes, length_m, terrain, line, directions }
    }
    /// The center line at `s`, and the unit direction of the street.
    pub fn center(&self, s: f64) -> (Vector2<f64>, Vector2<f64>) {
        let last = self.line.len() - 1;
        let u = s / self.length_m * last as f64;
        let i = (u.floor().max(0.0) as usize).min(last - 1);
        let share = (u - i as f64).clamp(0.0, 1.0);
        let direction = self.directions[i].lerp(&self.directions[i + 1], share).normalize();
        let over = s - s.clamp(0.0, self.length_m);
        (self.line[i].lerp(&self.line[i + 1], share) + direction * over, direction)
    }
    /// A position in the plane.
    pub fn plan(&self, s: f64, t: f64) -> Vector2<f64> {
        let (center, direction) = self.center(s);
        center + Vector2::new(-direction.y, direction.x) * t
    }
    /// World coordinates of a point `h` above the terrain.
    pub fn point(&self, s: f64, t: f64, h: f64) -> Vector3<f64> {
        let p = self.plan(s, t);
        Vector3::new(p.x, p.y, self.terrain.height(&p) + h)
    }
    /// Coordinates of a point `h` above the terrain, in f32 for the ray tracer.
    pub fn vertex(&self, s: f64, t: f64, h: f64) -> Vec3 {
        self.point(s, t, h).cast()
    }
    /// Direction of the street, rad from east, counterclockwise.
    pub fn heading(&self, s: f64) -> f64 {
        let (_, direction) = self.center(s);
        direction.y.atan2(direction.x)
    }
    /// The frame of an upright object on the ground `h` above the terrain: x along the street, rotated by `yaw` (rad).
    pub fn upright(&self, s: f64, t: f64, h: f64, yaw: f64) -> Isometry3<f32> {
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), self.heading(s) + yaw);
        Isometry3::from_parts(Translation3::from(self.point(s, t, h)), rotation).cast()
    }
    /// The frame of a vehicle: as in [`Street::upright`], but tilted with the ground.
    pub fn leaning(&self, s: f64, t: f64, h: f64, yaw: f64) -> Isometry3<f32> {
        let gradient = self.terrain.gradient(&self.plan(s, t));
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), self.heading(s) + yaw);
        let up = Vector3::new(-gradient.x, -gradient.y, 1.0).normalize();
        let lean = UnitQuaternion::rotation_between(&Vector3::z(), &up).unwrap_or_else(UnitQuaternion::identity);
        let rotation = lean * UnitQuaternion::from_rotation_matrix(&turn);
        Isometry3::from_parts(Translation3::from(self.point(s, t, h)), rotation).cast()
    }
    /// Street coordinates of the position `s` m from the node at an end (0 or 1), `t` to the left when facing away from
    /// it.
    pub const fn at_node(&self, end: usize, s: f64, t: f64) -> (f64, f64) {
        if end == 0 { (s, t) } else { (self.length_m - s, -t) }
    }
    /// Distance of a position from the center line between the nodes, m.
    pub fn distance(&self, p: &Vector2<f64>) -> f64 {
        let nearest = (0..self.line.len())
            .min_by(|a, b| (self.line[*a] - p).norm_squared().total_cmp(&(self.line[*b] - p).norm_squared()));
        let Some(i) = nearest else { return f64::INFINITY };
        let to = p - self.line[i];
        let along = to.dot(&self.directions[i]);
        let is_beyond = (i == 0 && along < 0.0) || (i + 1 == self.line.len() && along > 0.0);
        if is_beyond { to.norm() } else { to.perp(&self.directions[i]).abs() }
    }
}

/// A point of the cubic Bezier curve with four control points, `u` from 0 to 1.
pub fn bezier(c: &[Vector2<f64>; 4], u: f64) -> Vector2<f64> {
    let v = 1.0 - u;
    c[0] * (v * v * v) + c[1] * (3.0 * v * v * u) + c[2] * (3.0 * v * u * u) + c[3] * (u * u * u)
}

/// `n` + 1 evenly spaced points on a polyline of at least two points, including its ends.
pub fn resample(line: &[Vector2<f64>], n: usize) -> Vec<Vector2<f64>> {
    let total: f64 = line.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
    let n = n.max(1);
    let mut segment = 0;
    let mut before = 0.0;
    (0..=n)
        .map(|i| {
            let target = total * i as f64 / n as f64;
            loop {
                let length = (line[segment + 1] - line[segment]).norm();
                if before + length >= target || segment + 2 == line.len() {
                    let share = ((target - before) / length.max(1e-12)).clamp(0.0, 1.0);
                    return line[segment].lerp(&line[segment + 1], share);
                }
                before += length;
                segment += 1;
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn street() -> Street {
        let ends = [Vector2::new(10.0, 5.0), Vector2::new(120.0, 60.0)];
        let directions = [Vector2::new(1.0, 0.0), Vector2::new(0.6, 0.8)];
        Street::new(Profile::residential(), [0, 1], ends, directions, Terrain::new(2))
    }

    #[test]
    fn street_s_is_arc_length_and_t_is_left() {
        let street = street();
        for i in 1..60 {
            let s = f64::from(i) * 2.0;
            let step = street.center(s + 0.5).0 - street.center(s - 0.5).0;
            assert!((step.norm() - 1.0).abs() < 2e-3);
            let left = street.plan(s, 3.0) - street.center(s).0;
            assert!((left.norm() - 3.0).abs() < 1e-9 && step.perp(&left) > 2.9);
            assert!((street.distance(&street.plan(s, -4.0)) - 4.0).abs() < 0.02);
        }
    }

    #[test]
    fn street_coordinates_agree_from_both_ends() {
        let street = street();
        let (s, t) = street.at_node(1, 7.0, 2.0);
        let p = street.plan(s, t);
        let (end, direction) = street.center(street.length_m);
        let away = p - end;
        assert!(direction.dot(&away) < -6.0, "seven metres back");
        assert!((-direction).perp(&away) > 1.5, "left when facing away from the node");
    }

    #[test]
    fn leaning_frame_follows_ground_and_upright_frame_does_not() {
        let street = street();
        let leaning = street.leaning(50.0, 2.0, 0.0, 0.3);
        let upright = street.upright(50.0, 2.0, 0.0, 0.3);
        let gradient = street.terrain.gradient(&street.plan(50.0, 2.0));
        let up = Vector3::new(-gradient.x, -gradient.y, 1.0).normalize();
        assert!(((leaning.rotation * Vec3::z()).cast::<f64>() - up).norm() < 1e-5);
        assert!((upright.rotation * Vec3::z() - Vec3::z()).norm() < 1e-6);
        assert!((leaning.rotation * Vec3::x() - upright.rotation * Vec3::x()).norm() < 0.1);
    }
}
