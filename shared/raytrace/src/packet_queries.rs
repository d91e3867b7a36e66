//! Queries for many rays, packet by packet. Results equal the results of single rays to the last bit: if two hits are
//! so close that the order of tests may decide, the ray is traced again alone.

use crate::bvh::Bvh;
use crate::objects::ObjectTree;
use crate::packet::{Found, Lanes, NOWHERE, PACKET_SIZE, Packet};
use crate::ray::Ray;
use crate::shape::Primitive;
use crate::wide_tree::Leaf;
use pulp::{Arch, Simd, WithSimd};

/// Largest number of active rays that are tested one by one, each against four flat primitives at once.
const FEW: u32 = 4;

impl Bvh {
    /// [`Bvh::nearest`] of each ray. About three times as fast if neighboring rays are coherent.
    pub fn nearest_of(&self, rays: &[Ray], max_m: f32) -> Vec<Option<(f32, &Primitive)>> {
        let hit = |found: &Found, rays: &[Ray], lane: usize| match found.places[lane] {
            _ if found.is_ambiguous(lane) => self.nearest(&rays[lane], max_m),
            NOWHERE => None,
            place => Some((found.ranges[lane], &self.primitives()[place as usize])),
        };
        let mut hits = Vec::with_capacity(rays.len());
        for rays in rays.chunks(PACKET_SIZE) {
            match self.found(rays, max_m, false) {
                Some(found) => hits.extend((0..rays.len()).map(|lane| hit(&found, rays, lane))),
                None => hits.extend(rays.iter().map(|ray| self.nearest(ray, max_m))),
            }
        }
        hits
    }

    /// [`Bvh::any`] of each ray, in packets.
    pub fn any_of(&self, rays: &[Ray], max_m: f32) -> Vec<bool> {
        let mut hits = Vec::with_capacity(rays.len());
        for rays in rays.chunks(PACKET_SIZE) {
            match self.found(rays, max_m, true) {
                Some(found) => hits.extend(found.places[..rays.len()].iter().map(|place| *place != NOWHERE)),
                None => hits.extend(rays.iter().map(|ray| self.any(ray, max_m))),
            }
        }
        hits
    }

    /// The packet query; `None` if the rays do not form a packet.
    fn found(&self, rays: &[Ray], max_m: f32, any: bool) -> Option<Found> {
        let bundle = Packet::new(rays)?;
        Some(Arch::new().dispatch(Hits { bvh: self, rays, bundle: &bundle, max_m, any }))
    }
}

impl ObjectTree {
    /// Whether [`ObjectTree::visit`] may find an object for each ray; `limit(i)` is the limit of ray i.
    pub fn may_meet(&self, rays: &[Ray], limit: impl Fn(usize) -> f32) -> Vec<bool> {
        let mut near = Vec::with_capacity(rays.len());
        for (chunk, rays) in rays.chunks(PACKET_SIZE).enumerate() {
            let met = Packet::new(rays).map_or(u32::MAX, |bundle| {
                let limits = limits(rays.len(), |lane| limit(chunk * PACKET_SIZE + lane));
                Arch::new().dispatch(Near { swarm: self, bundle: &bundle, limits })
            });
            near.extend((0..rays.len()).map(|lane| met >> lane & 1 == 1));
        }
        near
    }
}

/// Limits of the rays; unused lanes meet nothing.
fn limits(n_rays: usize, limit: impl Fn(usize) -> f32) -> Lanes {
    std::array::from_fn(|lane| if lane < n_rays { limit(lane) } else { -1.0 })
}

/// Query of a packet in a tree, compiled for each SIMD width.
struct Hits<'a> {
    bvh: &'a Bvh,
    rays: &'a [Ray],
    bundle: &'a Packet,
    max_m: f32,
    /// Whether any hit suffices.
    any: bool,
}

impl WithSimd for Hits<'_> {
    type Output = Found;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Found {
        let Self { bvh, rays, bundle, max_m, any } = self;
        let mut found = Found::nothing(max_m);
        let mut limits = limits(rays.len(), |lane| found.limit(lane));
        bundle.walk(
            &bvh.tree,
            &mut limits,
            // Without this attribute the closure is compiled for the narrowest registers.
            #[inline(always)]
            |leaf, mut some, limits| {
                match leaf {
                    Leaf::Flats(pack) if some.count_ones() > FEW => {
                        bundle.hit_flats(&bvh.packs[pack as usize], &mut found);
                    }
                    _ => {
                        while some != 0 {
                            let lane = some.trailing_zeros() as usize % PACKET_SIZE;
                            some &= some - 1;
                            if let Some((range, place)) = bvh.hit(&rays[lane], leaf, found.limit(lane)) {
                                found.add(lane, range, place);
                            }
                        }
                    }
                }
                for (lane, limit) in limits.iter_mut().enumerate() {
                    let is_done = *limit < 0.0 || (any && found.places[lane] != NOWHERE);
                    *limit = if is_done { -1.0 } else { found.limit(lane) };
                }
            },
        );
        found
    }
}

/// Query for the rays of a packet that pass near an object.
struct Near<'a> {
    swarm: &'a ObjectTree,
    bundle: &'a Packet,
    limits: Lanes,
}

impl WithSimd for Near<'_> {
    type Output = u32;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> u32 {
        let Self { swarm, bundle, mut limits } = self;
        let mut near = 0;
        bundle.walk(&swarm.tree, &mut limits, |_, some, _| near |= some);
        near
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ray::Vec3;
    use crate::shape::Shape;
    use random::Random;

    /// Uneven ground of triangles, half of them twice so that ranges tie, and primitives of all kinds on it.
    fn yard() -> Bvh {
        let mut random = Random::for_hashed_stream(3, 0);
        let mut heights = || [0; 41 * 41].map(|_| random.range(-0.1, 0.1));
        let heights = heights();
        let corner = |i: usize, k: usize| Vec3::new(i as f32 - 20.0, k as f32 - 20.0, heights[i * 41 + k]);
        let mut shapes = Vec::new();
        for i in 0..40 {
            for k in 0..40 {
                let piece = Shape::triangle(corner(i, k), corner(i + 1, k), corner(i, k + 1));
                shapes.extend([piece, piece]);
                shapes.push(Shape::triangle(corner(i + 1, k + 1), corner(i + 1, k), corner(i, k + 1)));
            }
        }
        for kind in 0..240 {
            let at = Vec3::new(random.range(-19.0, 19.0), random.range(-19.0, 19.0), random.range(0.0, 3.0));
            let to = at + Vec3::new(random.range(-1.0, 1.0), random.range(-1.0, 1.0), random.range(0.5, 2.0));
            shapes.push(match kind % 4 {
                0 => Shape::cylinder(at, to, 0.1),
                1 => Shape::Porous { center: at, radius: 0.7, free_path: 0.8 },
                2 => Shape::Panel { corner: at, edge1: to - at, edge2: Vec3::new(0.4, 0.1, 0.0), fill: 0.4 },
                _ => Shape::Panel { corner: at, edge1: to - at, edge2: Vec3::new(0.4, 0.1, 0.0), fill: 1.0 },
            });
        }
        let primitive = |(surface, shape)| Primitive { shape, surface: surface as u32 };
        Bvh::new(shapes.into_iter().enumerate().map(primitive).collect())
    }

    /// A fan of coherent rays, and rays in random directions.
    fn rays() -> Vec<Ray> {
        let mut random = Random::for_hashed_stream(4, 0);
        let fan = (0..12_000_u64).map(|i| {
            let azimuth = (i % 1200) as f32 * 5.2e-3;
            let elevation = (i / 1200) as f32 * 0.03 - 0.25;
            let direction = Vec3::new(azimuth.cos(), azimuth.sin(), elevation).normalize();
            Ray { origin: Vec3::new(0.3, 0.2, 2.0), direction, seed: i }
        });
        let mut rays: Vec<Ray> = fan.collect();
        for seed in 0..4000 {
            let mut part = || random.range(-1.0, 1.0);
            let direction = Vec3::new(part(), part(), part()).normalize();
            rays.push(Ray { origin: Vec3::new(9.0 * part(), 9.0 * part(), 1.0 + part()), direction, seed });
        }
        rays
    }

    #[test]
    fn packet_hits_equal_single_ray_hits() {
        let yard = yard();
        let rays = rays();
        let alone: Vec<Option<(f32, u32)>> =
            rays.iter().map(|ray| yard.nearest(ray, 25.0).map(|(range, p)| (range, p.surface))).collect();
        let together: Vec<Option<(f32, u32)>> =
            yard.nearest_of(&rays, 25.0).into_iter().map(|hit| hit.map(|(range, p)| (range, p.surface))).collect();
        assert_eq!(together, alone);
        let n_hits = alone.iter().flatten().count();
        assert!((4000..14_000).contains(&n_hits), "{n_hits}");
        assert_eq!(yard.any_of(&rays, 25.0), alone.iter().map(Option::is_some).collect::<Vec<_>>());
        // The packets differ, the results do not.
        assert_eq!(yard.nearest_of(&rays[5..], 25.0).len(), rays.len() - 5);
        for n in 1..=PACKET_SIZE + 1 {
            let some: Vec<Option<f32>> =
                yard.nearest_of(&rays[700..700 + n], 25.0).iter().map(|hit| hit.map(|(range, _)| range)).collect();
            assert_eq!(some, alone[700..700 + n].iter().map(|hit| hit.map(|(range, _)| range)).collect::<Vec<_>>());
        }
    }

    #[test]
    fn coherent_rays_form_packets_and_ties_are_retraced() {
        let yard = yard();
        let rays = rays();
        let found: Vec<Option<Found>> = rays.chunks(PACKET_SIZE).map(|rays| yard.found(rays, 25.0, false)).collect();
        // 750 from a fan whose rows change the octant five times each, 250 from random rays that never share an octant.
        let n_bundles = found.iter().flatten().count();
        assert!((600..=750).contains(&n_bundles), "{n_bundles}");
        let ambiguous =
            found.iter().flatten().flat_map(|found| (0..PACKET_SIZE).filter(|lane| found.is_ambiguous(*lane))).count();
        assert!(ambiguous > 1000, "half of the ground is there twice: {ambiguous}");
    }

    #[test]
    fn empty_tree_or_no_rays_give_no_hits() {
        let rays = rays();
        assert!(Bvh::default().nearest_of(&rays[..20], 25.0).iter().all(Option::is_none));
        assert!(yard().nearest_of(&[], 25.0).is_empty());
        assert_eq!(ObjectTree::default().may_meet(&rays[..20], |_| 25.0), vec![false; 20]);
    }
}
