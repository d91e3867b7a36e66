//! Many things in motion: a tree over where they are at one time, above their own trees.

use super::build::Item;
use super::tree::{Leaf, Tree};
use super::{Ray, Vec3};
use nalgebra::{Isometry3, Point3};

/// One thing at one time.
#[derive(Clone, Copy, Debug)]
pub struct Placed {
    /// Its number among all things.
    pub number: usize,
    /// Which of its models it shows.
    pub phase: usize,
    /// Where it is, m.
    pub world_from_object: Isometry3<f32>,
    /// Middle of the ball that holds it, in the world, m.
    pub center: Vec3,
    /// Radius of that ball, m.
    pub radius: f32,
}

/// Things at one time.
#[derive(Clone, Debug, Default)]
pub struct Swarm {
    placed: Vec<Placed>,
    pub(super) tree: Tree,
}

impl Swarm {
    /// The tree over the things.
    pub fn new(placed: &[Placed]) -> Self {
        let mut items: Vec<Item> = placed
            .iter()
            .enumerate()
            .map(|(index, thing)| Item {
                low: thing.center.add_scalar(-thing.radius),
                high: thing.center.add_scalar(thing.radius),
                index: index as u32,
                is_flat: false,
            })
            .collect();
        let tree = Tree::over(&mut items, |_, _| ());
        Self { placed: items.iter().map(|item| placed[item.index as usize]).collect(), tree }
    }

    /// Calls `test` for the things that the ray may meet before the limit, near ones first, until it says stop. `test` gets
    /// the ray in the thing's own frame, where ranges are the same, and may lower the limit.
    #[inline]
    pub fn visit(&self, ray: &Ray, max_m: f32, mut test: impl FnMut(&Placed, &Ray, &mut f32) -> bool) {
        self.tree.walk(ray, max_m, |leaf, limit| {
            let (Leaf::Single(place) | Leaf::Flats(place)) = leaf;
            let thing = &self.placed[place as usize];
            thing.is_near(ray, *limit) && test(thing, &thing.local(ray), limit)
        });
    }
}

impl Placed {
    /// Whether the ray meets the ball around the thing before `max_m`.
    fn is_near(&self, ray: &Ray, max_m: f32) -> bool {
        let to_center = self.center - ray.origin;
        let along = to_center.dot(&ray.direction);
        let off2 = (to_center - ray.direction * along).norm_squared();
        off2 < self.radius * self.radius && along > -self.radius && along < max_m + self.radius
    }
    fn local(&self, ray: &Ray) -> Ray {
        Ray {
            origin: self.world_from_object.inverse_transform_point(&Point3::from(ray.origin)).coords,
            direction: self.world_from_object.inverse_transform_vector(&ray.direction),
            seed: ray.seed,
        }
    }
}
