//! Builds an object in its own frame: on the ground, x along the street or forward, y left, z up, m.

use crate::material::Material;
use crate::scene_builder::{SceneBuilder, SurfaceId};
use messages::ClassId;
use nalgebra::{Isometry3, Point3, Rotation3, UnitQuaternion};
use raytrace::{Primitive, Shape, Vec3};

/// A position or a corner in the frame, m.
pub type At = [f32; 3];

/// Frame of one object under construction.
pub struct Frame<'a> {
    builder: &'a mut SceneBuilder,
    pose: Isometry3<f32>,
    instance: u16,
    first: usize,
}

impl<'a> Frame<'a> {
    /// Frame of a static object at a pose.
    pub fn new(builder: &'a mut SceneBuilder, pose: &Isometry3<f32>) -> Self {
        let first = builder.primitives.len();
        Self { builder, pose: *pose, instance: 0, first }
    }
    /// Frame of a movable object. Its primitives get the instance, and [`Frame::model`] removes them from the builder.
    pub fn for_instance(builder: &'a mut SceneBuilder, instance: u16) -> Self {
        let first = builder.primitives.len();
        Self { builder, pose: Isometry3::identity(), instance, first }
    }
    /// Removes and returns the primitives of the object.
    pub fn model(self) -> Vec<Primitive> {
        self.builder.take_since(self.first)
    }
    /// A part with its own frame, rotated to the left by `yaw` (rad).
    pub fn part(&mut self, at: At, yaw: f32) -> Frame<'_> {
        let pose = self.pose * Isometry3::new(Vec3::from(at), Vec3::z() * yaw);
        let first = self.builder.primitives.len();
        Frame { builder: self.builder, pose, instance: self.instance, first }
    }
    /// The builder, for geometry in the world frame.
    pub fn builder(&mut self) -> &mut SceneBuilder {
        self.builder
    }
    /// A point in the builder's frame.
    pub fn at(&self, at: At) -> Vec3 {
        (self.pose * Point3::from(at)).coords
    }
    pub fn surface(&mut self, class: ClassId, material: Material) -> SurfaceId {
        self.builder.surface(class, self.instance, material)
    }
    pub fn add(&mut self, shape: Shape, surface: SurfaceId) {
        self.builder.add(shape, surface);
    }
    pub fn tube(&mut self, from: At, to: At, radius: f32, surface: SurfaceId) {
        self.add(Shape::cylinder(self.at(from), self.at(to), radius), surface);
    }
    pub fn cone(&mut self, from: At, to: At, radii: [f32; 2], surface: SurfaceId) {
        self.add(Shape::cone(self.at(from), self.at(to), radii), surface);
    }
    pub fn ball(&mut self, center: At, radius: f32, surface: SurfaceId) {
        self.add(Shape::Sphere { center: self.at(center), radius }, surface);
    }
    /// A cluster of leaves; `free_path` is the mean penetration depth of rays.
    pub fn leaves(&mut self, center: At, radius: f32, free_path: f32, surface: SurfaceId) {
        self.add(Shape::Porous { center: self.at(center), radius, free_path }, surface);
    }
    pub fn cuboid(&mut self, low: At, high: At, surface: SurfaceId) {
        self.builder.cuboid(&self.pose, low, high, surface);
    }
    /// A squared timber between two distinct points, `width` across and `height` at right angles to it.
    pub fn beam(&mut self, from: At, to: At, [width, height]: [f32; 2], surface: SurfaceId) {
        let from = self.at(from);
        let to = self.at(to);
        self.add(beam(&from, &to, [width, height]), surface);
    }
    pub fn quad(&mut self, corners: [At; 4], surface: SurfaceId) {
        self.builder.quad(corners.map(|corner| self.at(corner)), surface);
    }
    pub fn triangle(&mut self, corners: [At; 3], surface: SurfaceId) {
        self.builder.triangle(corners.map(|corner| self.at(corner)), surface);
    }
    /// A flat mesh in the plane of three corners that lets `1 - fill` of the rays through.
    pub fn mesh(&mut self, [corner, second, fourth]: [At; 3], fill: f32, surface: SurfaceId) {
        let [corner, second, fourth] = [corner, second, fourth].map(|at| self.at(at));
        self.add(Shape::Panel { corner, edge1: second - corner, edge2: fourth - corner, fill }, surface);
    }
}

/// A squared timber between two distinct points; the `width` of a horizontal one is horizontal.
pub fn beam(from: &Vec3, to: &Vec3, [width, height]: [f32; 2]) -> Shape {
    let along = to - from;
    let up = if along.xy().norm_squared() > 1e-6 * along.norm_squared() { Vec3::z() } else { Vec3::x() };
    // `face_towards` puts z along the timber and y as close as possible to `up`.
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::face_towards(&along, &up));
    let half = Vec3::new(width, height, along.norm()) * 0.5;
    Shape::Cuboid { center: (from + to) * 0.5, half, rotation }
}
