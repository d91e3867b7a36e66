//! A second-level hierarchy over moving objects at one time; each object has its own hierarchy.

use crate::binary_tree::Item;
use crate::ray::{Ray, Vec3};
use crate::wide_tree::{Leaf, Tree};
use nalgebra::{Isometry3, Point3};

/// An object at its pose.
#[derive(Clone, Copy, Debug)]
pub struct PlacedObject {
    /// Index of the object.
    pub number: usize,
    /// Index of its current model.
    pub phase: usize,
    /// Pose, m.
    pub world_from_object: Isometry3<f32>,
    /// Center of its bounding sphere in the world, m.
    pub center: Vec3,
    /// Radius of its bounding sphere, m.
    pub radius: f32,
}

/// A hierarchy over objects at one time.
#[derive(Clone, Debug, Default)]
pub struct ObjectTree {
    placed: Vec<PlacedObject>,
    pub(crate) tree: Tree,
}

impl ObjectTree {
    /// Builds the hierarchy.
    pub fn new(placed: &[PlacedObject]) -> Self {
        let mut items: Vec<Item> = placed
            .iter()
            .enumerate()
            .map(|(index, object)| Item {
                low: object.center.add_scalar(-object.radius),
                high: object.center.add_scalar(object.radius),
                index: index as u32,
                is_flat: false,
            })
            .collect();
        let tree = Tree::over(&mut items, |_, _| ());
        Self { placed: items.iter().map(|item| placed[item.index as usize]).collect(), tree }
    }

    /// Calls `test` for the objects that the ray may hit before the limit, near objects first, until `test` returns true.
    /// `test` receives the ray in the object's frame, where ranges are the same, and may lower the limit.
    #[inline]
    pub fn visit(&self, ray: &Ray, max_m: f32, mut test: impl FnMut(&PlacedObject, &Ray, &mut f32) -> bool) {
        self.tree.walk(ray, max_m, |leaf, limit| {
            let (Leaf::Single(place) | Leaf::Flats(place)) = leaf;
            let object = &self.placed[place as usize];
            object.is_near(ray, *limit) && test(object, &object.local(ray), limit)
        });
    }
}

impl PlacedObject {
    /// Whether the ray meets the bounding sphere before `max_m`.
    #[inline]
    fn is_near(&self, ray: &Ray, max_m: f32) -> bool {
        let to_center = self.center - ray.origin;
        let along = to_center.dot(&ray.direction);
        let off2 = (to_center - ray.direction * along).norm_squared();
        off2 < self.radius * self.radius && along > -self.radius && along < max_m + self.radius
    }
    #[inline]
    fn local(&self, ray: &Ray) -> Ray {
        Ray {
            origin: self.world_from_object.inverse_transform_point(&Point3::from(ray.origin)).coords,
            direction: self.world_from_object.inverse_transform_vector(&ray.direction),
            seed: ray.seed,
        }
    }
}
