//! Every model once, with its expected properties: the tests check the models against this list, and the catalogue
//! pictures show them.

use super::style::Style;
use super::{
    barrier, bridge, clutter, fence, furniture, house, person, pole, sign, structure, track, tree, two_wheeler,
    vehicle, water,
};
use crate::scene_builder::SceneBuilder;
use messages::ClassId::{
    self, Bridge, Building, Dynamic, Fence, Ground, GuardRail, Other, Pedestrian, Pole, RailTrack, Static, Terrain,
    TrafficLight, TrafficSign, Vegetation, Vehicles, Wall, Water,
};
use nalgebra::Isometry3;
use random::Random;
use raytrace::Vec3;

/// One model.
pub struct Entry {
    pub name: &'static str,
    /// Its classes; all of them occur.
    pub classes: &'static [ClassId],
    /// Its largest size along x, y and z, m.
    pub largest: [f32; 3],
    /// Least height of its top above the ground, m.
    pub least_height: f32,
    /// Builds it at the origin, on the ground.
    pub build: fn(&mut SceneBuilder, &mut Random),
}

/// A model that is built at a pose.
macro_rules! fixed {
    ($function:path, $classes:expr, $largest:expr, $least_height:expr) => {
        Entry {
            name: stringify!($function),
            classes: &$classes,
            largest: $largest,
            least_height: $least_height,
            build: |b, random| $function(b, &Isometry3::identity(), random),
        }
    };
}

/// A model that can move.
macro_rules! mover {
    ($function:path, $classes:expr, $largest:expr, $least_height:expr) => {
        Entry {
            name: stringify!($function),
            classes: &$classes,
            largest: $largest,
            least_height: $least_height,
            build: |b, random| {
                let model = $function(b, INSTANCE, random);
                b.place(&model, &Isometry3::identity());
            },
        }
    };
}

/// A model along a foot line: a bent line of 12 m.
macro_rules! line {
    ($name:expr, $classes:expr, $largest:expr, $least_height:expr, $build:expr) => {
        Entry { name: $name, classes: &$classes, largest: $largest, least_height: $least_height, build: $build }
    };
}

/// A house of 15 by 11 m between two others.
macro_rules! row {
    ($name:expr, $style:path, $floors:expr, $gate:expr) => {
        Entry {
            name: $name,
            classes: if $gate { &[Building, Ground] } else { &[Building] },
            largest: [16.5, 14.5, 33.0],
            least_height: 10.0,
            build: |b, random| {
                let plan = |u: f32, z: f32, out: f32| Vec3::new(u - 7.5, -5.5 - out, z);
                let lot = house::Lot { width: 15.0, depth: 11.0, floors: $floors, open: [true, false], gate: $gate };
                house::row_house(b, &plan, &lot, &$style(random), random);
            },
        }
    };
}

/// Instance of models that can move.
pub const INSTANCE: u16 = 7;

fn feet() -> [Vec3; 4] {
    [[-6.0, -1.0, 0.0], [-2.0, 0.3, 0.0], [2.0, 0.3, 0.0], [6.0, -1.0, 0.0]].map(Vec3::from)
}

fn straight(half_m: f32) -> [Vec3; 2] {
    [Vec3::new(-half_m, 0.0, 0.0), Vec3::new(half_m, 0.0, 0.0)]
}

const OVERPASS: bridge::Overpass = bridge::Overpass { span_m: 16.0, width_m: 9.0, clearance_m: 4.6 };

/// All models.
pub const ENTRIES: &[Entry] = &[
    row!("house::row_house haussmann", Style::haussmann, 6, false),
    row!("house::row_house faubourg", Style::faubourg, 4, false),
    row!("house::row_house brick", Style::brick, 4, false),
    row!("house::row_house modern", Style::modern, 6, false),
    row!("house::row_house office", Style::office, 7, false),
    row!("house::row_house with a gate", Style::urban, 5, true),
    line!("house::detached", [Building], [17.5, 12.5, 13.5], 3.0, |b, random| {
        house::detached(b, &Isometry3::identity(), 11.0, 8.0, random);
    }),
    line!("house::apartments", [Building], [25.5, 16.0, 24.0], 14.0, |b, random| {
        house::apartments(b, &Isometry3::identity(), 22.0, 12.0, 6, random);
    }),
    fixed!(house::barn, [Building], [22.0, 14.0, 14.0], 5.0),
    fixed!(house::church, [Building], [30.0, 14.0, 31.0], 29.0),
    fixed!(tree::deciduous, [Vegetation], [7.0, 7.0, 12.0], 6.0),
    fixed!(tree::plane_tree, [Vegetation], [11.0, 11.0, 17.0], 9.0),
    fixed!(tree::sapling, [Vegetation, Pole], [3.0, 3.0, 6.5], 3.0),
    fixed!(tree::poplar, [Vegetation], [5.0, 5.0, 17.0], 9.0),
    fixed!(tree::conifer, [Vegetation], [9.0, 9.0, 15.0], 6.0),
    fixed!(tree::bush, [Vegetation], [3.0, 3.0, 2.6], 0.5),
    fixed!(tree::tuft, [Vegetation], [1.4, 1.4, 1.0], 0.1),
    fixed!(tree::flower_bed, [Vegetation, Static, Terrain], [2.3, 1.3, 1.0], 0.2),
    fixed!(tree::flower_pot, [Vegetation, Static], [1.0, 1.0, 1.7], 1.0),
    line!("tree::hedge", [Vegetation], [13.5, 3.0, 2.2], 1.2, |b, random| tree::hedge(b, &feet(), 1.5, random)),
    fixed!(pole::lamp_post, [Pole], [1.2, 4.0, 11.0], 3.0),
    line!("pole::traffic_light", [Pole, TrafficLight], [0.8, 0.6, 4.0], 3.2, |b, _| {
        pole::traffic_light(b, &Isometry3::identity());
    }),
    line!("pole::traffic_light_arm", [Pole, TrafficLight], [0.9, 5.5, 7.0], 6.0, |b, _| {
        pole::traffic_light_arm(b, &Isometry3::identity(), 4.5);
    }),
    fixed!(pole::bollard, [Pole], [0.4, 0.4, 1.6], 0.6),
    line!("pole::delineator", [Pole], [0.1, 0.2, 1.4], 1.0, |b, _| pole::delineator(b, &Isometry3::identity())),
    line!("pole::utility_line", [Pole], [72.0, 3.0, 8.5], 7.0, |b, random| {
        pole::utility_line(b, &[-35.0, 0.0, 35.0].map(|x| Vec3::new(x, 0.0, 0.0)), random);
    }),
    fixed!(sign::sign, [Pole, TrafficSign], [0.4, 0.9, 3.5], 2.7),
    fixed!(sign::direction_sign, [Pole, TrafficSign], [0.4, 3.2, 4.0], 3.0),
    line!("sign::gantry", [Pole, TrafficSign], [0.6, 12.6, 8.3], 6.4, |b, random| {
        sign::gantry(b, &Isometry3::identity(), 12.0, random);
    }),
    fixed!(furniture::bench, [Static], [2.0, 0.8, 1.2], 0.8),
    fixed!(furniture::bus_shelter, [Static], [4.6, 1.8, 3.0], 2.3),
    fixed!(furniture::advertising_column, [Static], [2.0, 2.0, 4.8], 4.0),
    fixed!(furniture::kiosk, [Static], [3.8, 3.2, 3.6], 2.8),
    fixed!(furniture::mailbox, [Static], [0.7, 0.6, 1.8], 1.3),
    fixed!(furniture::hydrant, [Static], [0.6, 0.6, 1.0], 0.7),
    fixed!(furniture::fountain, [Static, Water], [7.8, 7.8, 3.0], 2.2),
    fixed!(furniture::bicycle_rack, [Static], [4.2, 0.9, 1.1], 0.7),
    fixed!(furniture::cabinet, [Static], [2.0, 0.6, 2.0], 1.1),
    fixed!(furniture::statue, [Static], [2.0, 2.0, 4.6], 3.6),
    fixed!(clutter::bin, [Dynamic], [0.9, 0.8, 1.2], 0.9),
    fixed!(clutter::container, [Dynamic], [1.5, 1.0, 1.7], 1.2),
    fixed!(clutter::bags, [Dynamic], [1.8, 1.4, 0.9], 0.3),
    fixed!(clutter::cone, [Dynamic], [0.4, 0.4, 0.8], 0.6),
    fixed!(clutter::cafe_table, [Dynamic], [2.6, 2.6, 2.6], 0.7),
    fixed!(clutter::crates, [Dynamic], [2.0, 0.6, 1.2], 0.2),
    fixed!(clutter::sandwich_board, [Dynamic], [0.7, 0.8, 1.2], 0.9),
    fixed!(clutter::barrier, [Dynamic], [2.2, 0.8, 1.2], 0.9),
    line!("structure::scaffolding", [Other], [8.4, 1.2, 8.0], 7.0, |b, _| {
        structure::scaffolding(b, &Isometry3::identity(), 8.0);
    }),
    fixed!(structure::market_stall, [Other], [3.6, 2.8, 3.0], 2.4),
    fixed!(structure::tent, [Other], [3.4, 3.4, 3.5], 3.0),
    fixed!(structure::skip, [Other], [3.2, 1.9, 1.6], 1.2),
    line!("fence::railing", [Fence], [12.4, 2.0, 1.5], 1.0, |b, _| fence::railing(b, &feet())),
    line!("fence::bar_fence", [Fence, Wall], [12.6, 2.0, 2.7], 2.0, |b, _| fence::bar_fence(b, &feet())),
    line!("fence::mesh_fence", [Fence], [12.4, 2.0, 2.4], 1.7, |b, _| fence::mesh_fence(b, &feet())),
    line!("fence::wooden_fence", [Fence], [12.4, 2.0, 2.1], 1.4, |b, random| fence::wooden_fence(b, &feet(), random)),
    line!("fence::pasture_fence", [Fence], [12.6, 2.0, 1.8], 1.1, |b, random| fence::pasture_fence(b, &feet(), random)),
    line!("barrier::wall", [Wall], [13.0, 2.6, 3.3], 1.6, |b, random| barrier::wall(b, &feet(), random)),
    line!("barrier::parapet", [Bridge], [13.0, 2.6, 1.9], 1.0, |b, random| {
        barrier::parapet(b, &feet(), Bridge, random);
    }),
    line!("barrier::guard_rail", [GuardRail], [12.6, 2.0, 1.4], 0.7, |b, _| barrier::guard_rail(b, &feet())),
    line!("barrier::concrete_barrier", [GuardRail], [12.8, 2.4, 1.0], 0.8, |b, _| {
        barrier::concrete_barrier(b, &feet());
    }),
    line!("barrier::noise_wall", [Wall], [13.0, 2.6, 5.4], 2.5, |b, random| barrier::noise_wall(b, &feet(), random)),
    line!("barrier::chain", [Fence], [12.4, 2.0, 1.0], 0.6, |b, _| barrier::chain(b, &feet())),
    line!("track::railway", [RailTrack], [14.0, 5.5, 1.0], 0.5, |b, random| track::railway(b, &feet(), random)),
    line!("track::tramway", [RailTrack], [13.0, 4.0, 0.1], 0.01, |b, _| track::tramway(b, &feet())),
    fixed!(track::buffer_stop, [RailTrack], [1.8, 2.6, 1.6], 1.2),
    line!("water::canal", [Water, Wall, Ground], [15.5, 11.0, 2.2], 0.05, |b, random| {
        water::canal(b, &feet(), 8.0, random);
    }),
    line!("water::pond", [Water, Static, Terrain], [8.6, 8.6, 1.0], 0.15, |b, random| {
        water::pond(b, &Isometry3::identity(), 3.0, random);
    }),
    line!("bridge::Overpass", [Bridge], [10.2, 19.6, 8.2], 6.0, |b, random| {
        OVERPASS.build(b, &Isometry3::identity(), random);
    }),
    line!("bridge::tunnel", [Bridge, Wall], [40.5, 12.5, 7.5], 5.0, |b, random| {
        bridge::tunnel(b, &straight(20.0), 6.0, random);
    }),
    mover!(person::model, [Pedestrian], [2.0, 1.0, 2.3], 0.95),
    mover!(person::standing, [Pedestrian], [1.6, 1.0, 2.3], 0.95),
    mover!(person::sitting, [Pedestrian], [1.2, 1.0, 1.7], 1.0),
    line!("person::with_buggy", [Pedestrian, Dynamic], [2.6, 1.0, 2.3], 0.95, |b, random| {
        let appearance = person::PersonAppearance::random(random);
        let model = person::with_buggy(b, INSTANCE, 0.3, &appearance);
        b.place(&model, &Isometry3::identity());
    }),
    line!("person::group", [Pedestrian], [3.2, 3.2, 2.3], 0.95, |b, random| {
        person::group(b, &Isometry3::identity(), &mut || INSTANCE, random);
    }),
    mover!(vehicle::car, [Vehicles], [4.8, 2.2, 1.9], 1.4),
    mover!(vehicle::taxi, [Vehicles], [4.8, 2.2, 1.8], 1.5),
    mover!(vehicle::van_model, [Vehicles], [5.6, 2.4, 2.5], 2.2),
    mover!(vehicle::minibus, [Vehicles], [5.6, 2.4, 2.3], 1.9),
    mover!(vehicle::random_model, [Vehicles], [5.6, 2.4, 2.5], 1.4),
    mover!(vehicle::bus, [Vehicles], [12.3, 3.0, 3.3], 2.9),
    mover!(vehicle::truck, [Vehicles], [7.6, 3.0, 3.6], 3.4),
    mover!(vehicle::tram, [Vehicles], [24.3, 2.9, 4.9], 4.2),
    mover!(vehicle::tractor, [Vehicles], [8.6, 2.5, 3.0], 2.5),
    mover!(two_wheeler::bicycle, [Vehicles], [1.9, 0.8, 1.2], 0.9),
    mover!(two_wheeler::scooter, [Vehicles], [2.0, 0.9, 1.4], 1.1),
    mover!(two_wheeler::motorcycle, [Vehicles], [2.1, 1.0, 1.4], 1.1),
    line!("two_wheeler::cyclist", [Vehicles, Pedestrian], [1.9, 0.9, 2.0], 1.5, |b, random| {
        let model = two_wheeler::cyclist(b, INSTANCE, 0.1, random);
        b.place(&model, &Isometry3::identity());
    }),
    mover!(two_wheeler::scooter_rider, [Vehicles, Pedestrian], [2.0, 0.9, 2.0], 1.4),
    mover!(two_wheeler::motorcyclist, [Vehicles, Pedestrian], [2.1, 1.0, 2.0], 1.4),
];

#[cfg(test)]
mod tests {
    use super::*;
    use raytrace::Shape;

    /// Largest depth of foundations in the ground, m; a canal is deeper.
    const DEEPEST_M: f32 = -1.7;

    fn built(entry: &Entry, seed: u64) -> SceneBuilder {
        let mut b = SceneBuilder::default();
        (entry.build)(&mut b, &mut Random::for_hashed_stream(seed, 1));
        b
    }

    fn extent(b: &SceneBuilder) -> [Vec3; 2] {
        b.primitives
            .iter()
            .map(|p| p.shape.bounds())
            .fold([Vec3::repeat(f32::INFINITY), Vec3::repeat(f32::NEG_INFINITY)], |[low, high], [a, c]| {
                [low.inf(&a), high.sup(&c)]
            })
    }

    #[test]
    fn every_model_has_its_size_and_stands_on_ground() {
        for entry in ENTRIES {
            for seed in 0..12 {
                let b = built(entry, seed);
                let [low, high] = extent(&b);
                let above = Vec3::new(high.x - low.x, high.y - low.y, high.z);
                for axis in 0..3 {
                    let is = above[axis];
                    let at_most = entry.largest[axis];
                    assert!(
                        is <= at_most,
                        "{} of seed {seed}: {is} m along axis {axis}, {at_most} allowed",
                        entry.name
                    );
                }
                assert!(high.z >= entry.least_height, "{} of seed {seed} is only {} m high", entry.name, high.z);
                assert!(low.z >= DEEPEST_M && low.z <= 0.05, "{} of seed {seed} begins at {} m", entry.name, low.z);
            }
        }
    }

    #[test]
    fn every_model_has_exactly_its_classes() {
        for entry in ENTRIES {
            let mut found: Vec<ClassId> = (0..12)
                .flat_map(|seed| {
                    let b = built(entry, seed);
                    b.primitives.iter().map(|p| b.surfaces[p.surface as usize].class).collect::<Vec<_>>()
                })
                .collect();
            found.sort();
            found.dedup();
            let mut expected = entry.classes.to_vec();
            expected.sort();
            assert_eq!(found, expected, "{}", entry.name);
        }
    }

    #[test]
    fn movable_models_have_an_instance_and_static_models_none() {
        for entry in ENTRIES {
            let b = built(entry, 3);
            for p in &b.primitives {
                let surface = b.surfaces[p.surface as usize];
                let moves = matches!(surface.class, Vehicles | Pedestrian) || entry.classes.contains(&Pedestrian);
                assert_eq!(surface.instance, if moves { INSTANCE } else { 0 }, "{}", entry.name);
            }
        }
    }

    #[test]
    fn no_primitive_is_degenerate() {
        for entry in ENTRIES {
            for p in built(entry, 5).primitives {
                let [low, high] = p.shape.bounds();
                assert!(low.iter().chain(high.iter()).all(|v| v.is_finite()), "{}: {p:?}", entry.name);
                let size = match p.shape {
                    Shape::Triangle { edge1, edge2, .. } => edge1.cross(&edge2).norm(),
                    Shape::Panel { edge1, edge2, fill, .. } => edge1.cross(&edge2).norm().min(fill),
                    Shape::Cuboid { half, .. } => half.min(),
                    Shape::Cone { length, radii, .. } => length.min(radii[0].max(radii[1])),
                    Shape::Cylinder { length, radius, .. } => length.min(radius),
                    Shape::Sphere { radius, .. } | Shape::Porous { radius, .. } => radius,
                };
                assert!(size > 1e-6, "{}: {p:?}", entry.name);
            }
        }
    }

    #[test]
    fn model_depends_on_seed_only() {
        let described = |b: &SceneBuilder| format!("{:?} {:?}", b.primitives, b.surfaces);
        let mut n_varied = 0;
        for entry in ENTRIES {
            assert_eq!(described(&built(entry, 1)), described(&built(entry, 1)), "{}", entry.name);
            n_varied += usize::from(described(&built(entry, 1)) != described(&built(entry, 2)));
        }
        // A few (traffic lights, cones, fences of bars) have only one size.
        assert!(2 * n_varied > ENTRIES.len(), "{n_varied} of {}", ENTRIES.len());
    }
}
