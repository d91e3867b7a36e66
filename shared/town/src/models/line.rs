//! A foot line on the ground and profiles drawn along it: walls, rails, beds.

use crate::scene_builder::{SceneBuilder, SurfaceId};
use raytrace::Vec3;

/// A position in the cross section: m to the left of the line (in its direction) and m up from its foot.
pub type Section = [f32; 2];

/// A foot line with the direction to the left at every foot. Up is the up axis of the world.
pub struct Line {
    feet: Vec<Vec3>,
    left: Vec<Vec3>,
}

impl Line {
    /// A line through the given feet, at most `step_m` apart: longer sections are divided evenly. Equal neighbors count
    /// once.
    pub fn new(corners: &[Vec3], step_m: f32) -> Self {
        let mut feet: Vec<Vec3> = corners.first().copied().into_iter().collect();
        for pair in corners.windows(2) {
            let length = (pair[1] - pair[0]).norm();
            if length < 1e-4 {
                continue;
            }
            let n = (length / step_m).ceil().max(1.0) as usize;
            feet.extend((1..=n).map(|i| pair[0].lerp(&pair[1], i as f32 / n as f32)));
        }
        let left = (0..feet.len())
            .map(|i| {
                let before = feet[i.saturating_sub(1)];
                let after = feet[(i + 1).min(feet.len() - 1)];
                let along = (after - before).xy().try_normalize(1e-6).unwrap_or_else(nalgebra::Vector2::x);
                Vec3::new(-along.y, along.x, 0.0)
            })
            .collect();
        Self { feet, left }
    }
    /// Number of feet.
    pub const fn len(&self) -> usize {
        self.feet.len()
    }
    /// A point of the cross section at a foot.
    pub fn point(&self, foot: usize, [left, up]: Section) -> Vec3 {
        self.feet[foot] + self.left[foot] * left + Vec3::z() * up
    }
    /// Lengths along the line to each foot, m.
    pub fn lengths(&self) -> Vec<f32> {
        let mut length = 0.0;
        let mut lengths = vec![0.0];
        for pair in self.feet.windows(2) {
            length += (pair[1] - pair[0]).norm();
            lengths.push(length);
        }
        lengths
    }
    /// Draws a profile, an open polygon, along the whole line.
    pub fn extrude(&self, b: &mut SceneBuilder, profile: &[Section], surface: SurfaceId) {
        self.extrude_uneven(b, profile, surface, &|_, _| 0.0);
    }
    /// Draws a profile as in [`Line::extrude`], with corners displaced left and up by `uneven(foot, corner)` in m.
    pub fn extrude_uneven(
        &self,
        b: &mut SceneBuilder,
        profile: &[Section],
        surface: SurfaceId,
        uneven: &dyn Fn(usize, usize) -> f32,
    ) {
        let point = |foot: usize, corner: usize| {
            let [left, up] = profile[corner];
            let off = uneven(foot, corner);
            // Foot and head of a profile keep their heights; otherwise there would be visible gaps to the ground.
            let is_end = corner == 0 || corner + 1 == profile.len();
            self.point(foot, [left + off, if is_end { up } else { up + 0.5 * off }])
        };
        for foot in 1..self.len() {
            for corner in 1..profile.len() {
                let quad = [
                    point(foot - 1, corner - 1),
                    point(foot, corner - 1),
                    point(foot, corner),
                    point(foot - 1, corner),
                ];
                b.quad(quad, surface);
            }
        }
    }
    /// Closes both ends of a convex profile with fans.
    pub fn close(&self, b: &mut SceneBuilder, profile: &[Section], surface: SurfaceId) {
        for foot in [0, self.len().saturating_sub(1)] {
            for corner in 2..profile.len() {
                let fan = [profile[0], profile[corner - 1], profile[corner]];
                b.triangle(fan.map(|section| self.point(foot, section)), surface);
            }
        }
    }
}
