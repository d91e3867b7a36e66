//! The bounding volume hierarchy over primitives, and queries of single rays.

use crate::binary_tree::Item;
use crate::flat::{Flat, Flat4};
use crate::ray::{Ray, Vec3};
use crate::shape::Primitive;
use crate::wide_tree::{Leaf, Tree};
use rayon::prelude::*;

/// A bounding volume hierarchy with its primitives.
#[derive(Clone, Debug, Default)]
pub struct Bvh {
    pub(crate) tree: Tree,
    pub(crate) packs: Vec<Flat4>,
    /// Primitives in the order of the leaves.
    primitives: Vec<Primitive>,
}

impl Bvh {
    /// Builds the hierarchy.
    pub fn new(primitives: Vec<Primitive>) -> Self {
        let mut items: Vec<Item> = primitives
            .par_iter()
            .enumerate()
            .map(|(index, primitive)| {
                let [low, high] = primitive.shape.bounds();
                Item { low, high, index: index as u32, is_flat: Flat::from_shape(&primitive.shape).is_some() }
            })
            .collect();
        let mut leaves = Vec::new();
        let tree = Tree::over(&mut items, |first, count| leaves.push(first..first + count));
        let ordered: Vec<Primitive> = items.par_iter().map(|item| primitives[item.index as usize]).collect();
        drop(primitives);
        let packs = leaves
            .into_par_iter()
            .map(|leaf| {
                let first = leaf.start as u32;
                Flat4::new(first, ordered[leaf].iter().filter_map(|primitive| Flat::from_shape(&primitive.shape)))
            })
            .collect();
        Self { tree, packs, primitives: ordered }
    }

    /// Number of primitives.
    pub const fn len(&self) -> usize {
        self.primitives.len()
    }

    /// Whether it has no primitives.
    pub const fn is_empty(&self) -> bool {
        self.primitives.is_empty()
    }

    /// Memory in bytes.
    pub fn bytes(&self) -> usize {
        size_of_val(&*self.packs) + size_of_val(&*self.primitives) + self.tree.bytes()
    }

    /// The primitives, in the order of the tree's leaves.
    pub fn primitives(&self) -> &[Primitive] {
        &self.primitives
    }

    /// Smallest and largest coordinates; `None` for an empty tree.
    pub fn bounds(&self) -> Option<[Vec3; 2]> {
        self.tree.bounds()
    }

    /// The first hit before `max_m`: its range and the primitive.
    pub fn nearest(&self, ray: &Ray, max_m: f32) -> Option<(f32, &Primitive)> {
        let mut best = None;
        self.tree.walk(ray, max_m, |leaf, limit| {
            if let Some((range, place)) = self.hit(ray, leaf, *limit) {
                *limit = range;
                best = Some((range, place));
            }
            false
        });
        best.map(|(range, place)| (range, &self.primitives[place as usize]))
    }

    /// Whether the ray hits anything before `max_m`.
    pub fn any(&self, ray: &Ray, max_m: f32) -> bool {
        let mut is_hit = false;
        self.tree.walk(ray, max_m, |leaf, limit| {
            is_hit = self.hit(ray, leaf, *limit).is_some();
            is_hit
        });
        is_hit
    }

    /// Range and index of the first hit in a leaf.
    #[inline(always)]
    pub(crate) fn hit(&self, ray: &Ray, leaf: Leaf, limit: f32) -> Option<(f32, u32)> {
        match leaf {
            Leaf::Flats(pack) => {
                let pack = &self.packs[pack as usize];
                pack.nearest(ray, limit).map(|(lane, range)| (range, pack.first + lane as u32))
            }
            Leaf::Single(place) => self.primitives[place as usize].shape.range(ray, limit).map(|range| (range, place)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shape::Shape;
    use random::Random;

    fn random_scene(n: u32) -> Vec<Primitive> {
        let mut random = Random::for_hashed_stream(5, 0);
        let point = |random: &mut Random, size: f32| {
            Vec3::new(random.range(-size, size), random.range(-size, size), random.range(-size, size))
        };
        (0..n)
            .map(|surface| {
                let center = point(&mut random, 30.0);
                let shape = match surface % 3 {
                    0 => Shape::triangle(center, center + point(&mut random, 3.0), center + point(&mut random, 3.0)),
                    1 => Shape::cylinder(center, center + point(&mut random, 3.0), 0.4),
                    _ => Shape::Sphere { center, radius: 0.8 },
                };
                Primitive { shape, surface }
            })
            .collect()
    }

    #[test]
    fn tree_hit_equals_exhaustive_search() {
        let all = random_scene(900);
        let tree = Bvh::new(all.clone());
        let mut random = Random::for_hashed_stream(6, 0);
        let mut hits = 0;
        for _ in 0..3000 {
            let origin = Vec3::new(random.range(-40.0, 40.0), random.range(-40.0, 40.0), random.range(-40.0, 40.0));
            let direction =
                (-origin + Vec3::new(random.range(-20.0, 20.0), random.range(-20.0, 20.0), 0.0)).normalize();
            let ray = Ray { origin, direction, seed: 0 };
            let expected = all
                .iter()
                .filter_map(|p| p.shape.range(&ray, 100.0).map(|range| (range, p.surface)))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            let found = tree.nearest(&ray, 100.0).map(|(range, p)| (range, p.surface));
            assert_eq!(found, expected);
            assert_eq!(tree.any(&ray, 100.0), expected.is_some());
            hits += usize::from(expected.is_some());
        }
        assert!(hits > 1000, "{hits}");
    }

    #[test]
    fn axis_aligned_rays_and_equal_centers_are_handled() {
        let same =
            vec![Primitive { shape: Shape::Sphere { center: Vec3::new(3.0, 0.0, 0.0), radius: 1.0 }, surface: 1 }; 300];
        let tree = Bvh::new(same);
        let ray = Ray { origin: Vec3::zeros(), direction: Vec3::x(), seed: 0 };
        let (range, _) = tree.nearest(&ray, 10.0).expect("hit");
        assert!((range - 2.0).abs() < 1e-5);
        assert!(Bvh::new(Vec::new()).nearest(&ray, 10.0).is_none());
    }
}
