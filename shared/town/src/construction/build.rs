//! Builds a town: street map and route first, then the ground, then all objects on it.

use crate::construction::block_use::BlockUse;
use crate::construction::reach::{DETAIL_RADIUS_M, Reach};
use crate::construction::tour::Tour;
use crate::construction::town_builder::{Instances, TownBuilder};
use crate::construction::{ground, junction};
use crate::kind::{Town, Traffic};
use crate::path::GroundPath;
use crate::scene::Scene;
use crate::scene_builder::SceneBuilder;
use crate::speed_profile::{Driver, SpeedProfile, Stop};
use crate::streets::country::{self, Stretch};
use crate::streets::grid::{self, GridStyle};
use crate::streets::lane::{self, Lane};
use crate::streets::motorway;
use crate::streets::network::Network;
use crate::streets::paving::Pavings;
use random::{Random, hash};
use raytrace::Bvh;
use std::sync::Arc;

/// Distance from the start of the first street's own pavement to the ego vehicle at second 0, m.
const START_M: f64 = 8.0;
/// Leg of the round that passes under a footbridge.
const BRIDGED_LEG: usize = 1;
/// One in this many junctions with traffic lights is red.
const RED_EVERY: usize = 4;
/// Distance of the waiting ego vehicle to the stop line, m.
const STOP_BEFORE_M: f64 = 3.5;

/// A town and the drive of the ego vehicle through it.
#[derive(Debug)]
pub struct Drive {
    /// The town.
    pub scene: Scene,
    /// Path of the ego vehicle.
    pub path: Arc<GroundPath>,
    /// Distance along the path over time.
    pub speed: Arc<SpeedProfile>,
}

/// Builds the town of a kind and seed, and a drive of `seconds` through it. Only the surroundings of the driven path are
/// built. All passes have the same town, but their own traffic: 0 is the first drive, odd passes drive back in the opposite
/// lane, even ones follow the first.
pub fn build(kind: Town, seed: u64, seconds: f64, traffic: Traffic, pass: u64) -> Drive {
    let mut random = Random::for_hashed_stream(seed, 0x00c1_7100);
    let (mut town, mut tour) = plan(kind, seed, seconds, &mut random);
    town.traffic = traffic;
    town.pave();
    town.fill(&mut random);
    if pass > 0 {
        random = Random::for_hashed_stream(hash(seed, pass), 0x00c1_7100);
        if pass % 2 == 1 {
            tour = town.turn_around(&tour);
        }
    }
    let movers = town.traffic(&tour, &mut random);
    let TownBuilder { builder, .. } = town;
    let scene = Scene::new(Bvh::new(builder.primitives), movers, builder.surfaces);
    Drive { scene, path: tour.path, speed: tour.speed }
}

/// The street map and the route; nothing is built yet.
fn plan(kind: Town, seed: u64, seconds: f64, random: &mut Random) -> (TownBuilder, Tour) {
    let stretches = country::stretches(match kind {
        Town::Field => Some(Stretch::Field),
        Town::Tunnel => Some(Stretch::Tunnel),
        _ => None,
    });
    let mut network = match kind {
        Town::Urban => grid::build(seed, &GridStyle::URBAN),
        Town::Suburban => grid::build(seed, &GridStyle::SUBURBAN),
        Town::Rural | Town::Field | Town::Tunnel => country::build(seed, stretches),
        Town::Motorway => motorway::build(seed),
    };
    start_at_stretch(&mut network, kind, &stretches);
    let Some(Lane { path, legs }) = lane::around(&network, &network.round, -network.lanes_t()[0]) else {
        unreachable!("every street map has a round");
    };
    let path = Arc::new(path);
    let driver = Driver {
        cruise_mps: kind.cruise_mps(),
        phase: f64::from(random.range(0.0, std::f32::consts::TAU)),
        stops: stops(&network, &legs, path.length_m(), random),
    };
    let speed = Arc::new(SpeedProfile::from_rest(&path, &driver, legs[0][0] + START_M, seconds));
    // The recording may last slightly longer than the drive.
    let reach = Reach::new(&path, speed.distance_m(0.0), speed.distance_m(seconds + 0.2));
    let mut builder = SceneBuilder::default();
    let pavings = Pavings::new(&mut builder);
    let uses = BlockUse::per_block(&network, kind, random);
    let traffic = Traffic::Normal;
    let town = TownBuilder {
        kind,
        traffic,
        builder,
        network,
        reach,
        pavings,
        stretches,
        uses,
        instances: Instances::default(),
    };
    (town, Tour { path, legs, driver, speed, seconds })
}

/// Rotates the round so that field and tunnel drives start at their stretch and rural drives at the end of the village.
fn start_at_stretch(network: &mut Network, kind: Town, stretches: &[Stretch]) {
    let wanted = match kind {
        Town::Urban | Town::Suburban | Town::Motorway => return,
        Town::Rural => Stretch::Village,
        Town::Field => Stretch::Field,
        Town::Tunnel => Stretch::Tunnel,
    };
    let is_last_wanted = |k: usize| {
        let n = network.round.len();
        let at = |k: usize| stretches[network.round[k % n].street] == wanted;
        if wanted == Stretch::Village { at(k) && !at(k + 1) } else { at(k) && !at(k + n - 1) }
    };
    let first = (0..network.round.len()).find(|k| is_last_wanted(*k)).unwrap_or(0);
    network.round.rotate_left(first);
}

/// Red lights as (distance along the path, waiting time), for the number of rounds of the longest drive.
fn stops(network: &Network, legs: &[[f64; 2]], round_m: f64, random: &mut Random) -> Vec<Stop> {
    const MAX_ROUNDS: usize = 6;
    let mut stops = Vec::new();
    for round in 0..MAX_ROUNDS {
        for (k, leg) in network.round.iter().enumerate() {
            if network.nodes[network.node_after(*leg)].has_lights && k % RED_EVERY == 2 {
                let at_m = round as f64 * round_m + legs[k][1] - ground::STOP_LINE[1] - STOP_BEFORE_M;
                stops.push(Stop { at_m, seconds: f64::from(random.range(9.0, 15.0)) });
            }
        }
    }
    stops
}

impl TownBuilder {
    /// The drive back from the end of a tour to its start. Traffic is built for this direction from now on.
    fn turn_around(&mut self, tour: &Tour) -> Tour {
        self.network.round = self.network.round.iter().rev().map(|leg| leg.reversed()).collect();
        let Some(Lane { path, legs }) = lane::around(&self.network, &self.network.round, -self.network.lanes_t()[0])
        else {
            unreachable!("every street map has a round");
        };
        let [first, last] = [0.0, tour.seconds].map(|seconds| tour.path.point(tour.speed.distance_m(seconds)));
        let start_m = path.nearest_m(&last);
        let driven_m = (path.nearest_m(&first) - start_m).rem_euclid(path.length_m());
        let path = Arc::new(path);
        // Nothing is built beyond the start of the first drive.
        let end = Stop { at_m: start_m + driven_m, seconds: tour.seconds };
        let driver = Driver { stops: vec![end], ..tour.driver.clone() };
        let speed = Arc::new(SpeedProfile::from_rest(&path, &driver, start_m, tour.seconds));
        Tour { path, legs, driver, speed, seconds: tour.seconds }
    }

    /// Builds the ground.
    pub fn pave(&mut self) {
        for street in self.built_streets() {
            ground::street(self, street);
        }
        for node in 0..self.network.nodes.len() {
            if self.is_node_on_round(node) && self.reach.is_near(&self.network.nodes[node].at, DETAIL_RADIUS_M) {
                junction::pave(self, node);
            }
        }
        ground::bed(self);
    }

    fn fill(&mut self, random: &mut Random) {
        // One street of an urban town passes under a footbridge between houses.
        let bridged = self.network.round[BRIDGED_LEG % self.network.round.len()].street;
        for street in self.built_streets() {
            match self.kind {
                Town::Urban => self.urban_street(street, random),
                Town::Suburban => self.suburban_street(street, random),
                Town::Rural | Town::Field | Town::Tunnel => self.rural_street(street, random),
                Town::Motorway => self.motorway_street(street, random),
            }
            if self.kind == Town::Urban && street == bridged {
                self.footbridge(street, random);
            }
            self.park_cars(street, random);
            self.waiting_cars(street, random);
        }
        self.open_blocks(random);
    }

    fn urban_street(&mut self, street: usize, random: &mut Random) {
        for side in [-1.0, 1.0] {
            self.row_of_houses(street, side, random);
            self.kerbside(street, side, random);
        }
        self.lights(street, random);
        self.closures(street, random);
    }

    fn suburban_street(&mut self, street: usize, random: &mut Random) {
        for side in [-1.0, 1.0] {
            self.gardens(street, side, random);
            self.quiet_kerbside(street, side, random);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use messages::ClassId;
    use nalgebra::Vector2;
    use raytrace::{Primitive, Ray, Vec3};

    /// The bare ground of a town.
    fn ground(kind: Town, seed: u64) -> (TownBuilder, Bvh) {
        let (mut town, _) = plan(kind, seed, 25.0, &mut Random::for_hashed_stream(seed, 1));
        town.pave();
        let primitives: Vec<Primitive> = std::mem::take(&mut town.builder.primitives);
        (town, Bvh::new(primitives))
    }

    /// Class of the ground below a position, and its height above the terrain, m.
    fn below(town: &TownBuilder, ground: &Bvh, p: &Vector2<f64>) -> Option<(ClassId, f64)> {
        let height = town.network.terrain.height(p);
        let origin = Vec3::new(p.x as f32, p.y as f32, (height + 2.0) as f32);
        let ray = Ray { origin, direction: -Vec3::z(), seed: 0 };
        let (range, primitive) = ground.nearest(&ray, 50.0)?;
        Some((town.builder.surfaces[primitive.surface as usize].class, 2.0 - f64::from(range)))
    }

    #[test]
    fn passes_share_the_town_and_the_drive_back_returns() {
        for (kind, seed) in [(Town::Urban, 1), (Town::Suburban, 2), (Town::Rural, 3)] {
            let [first, back, again] = [0, 1, 2].map(|pass| build(kind, seed, 20.0, Traffic::Normal, pass));
            assert_eq!(first.scene.statics().len(), back.scene.statics().len());
            let at = |drive: &Drive, seconds: f64| drive.path.point(drive.speed.distance_m(seconds));
            let off = (at(&first, 20.0) - at(&back, 0.0)).norm();
            assert!((2.0..8.0).contains(&off), "{kind:?}: the drive back starts {off} m away");
            let off = (at(&first, 0.0) - at(&back, 20.0)).norm();
            assert!(off < 30.0, "{kind:?}: the drive back ends {off} m away");
            assert_eq!(at(&first, 13.0), at(&again, 13.0));
        }
    }

    #[test]
    fn street_surface_follows_profile_without_gaps() {
        for (kind, seed) in [(Town::Urban, 1), (Town::Suburban, 2), (Town::Rural, 3), (Town::Motorway, 4)] {
            let (town, ground) = ground(kind, seed);
            let mut checked = 0;
            for number in town.built_streets() {
                let street = &town.network.streets[number];
                let profile = street.profile;
                let [begin, end] = town.network.mouths(number);
                let mut s = begin + 0.1131;
                while s < end - 0.1 {
                    for i in -40..=40 {
                        let t = profile.outer_t * (f64::from(i) / 40.3 + 0.001);
                        if !town.reach.is_near(&street.plan(s, 0.0), DETAIL_RADIUS_M - 3.0)
                            || (t.abs() - profile.kerb_t).abs() < 0.02
                        {
                            continue;
                        }
                        let (class, height) = below(&town, &ground, &street.plan(s, t)).expect("ground");
                        checked += 1;
                        let is_road = matches!(class, ClassId::Road | ClassId::RoadLine);
                        assert_eq!(
                            is_road,
                            profile.is_road(t),
                            "{kind:?} street {number}, s {s}, t {t}: {class:?} at {height} m"
                        );
                        // Grass strips of country roads end below the meadows.
                        let expected = profile.height(t).max(-0.16);
                        assert!((height - expected).abs() < 0.035, "{kind:?} {number}, s {s}, t {t}: {height} m");
                    }
                    s += 1.3717;
                }
            }
            assert!(checked > 10_000, "{checked}");
        }
    }

    #[test]
    fn junction_surface_has_no_gaps_or_steps() {
        for (kind, seed) in [(Town::Urban, 1), (Town::Urban, 4), (Town::Suburban, 2), (Town::Rural, 3)] {
            let (town, ground) = ground(kind, seed);
            let mut checked = 0;
            for (number, node) in town.network.nodes.iter().enumerate() {
                if !town.is_node_on_round(number) || !town.reach.is_near(&node.at, 0.8 * DETAIL_RADIUS_M) {
                    continue;
                }
                for arm in &node.arms {
                    // Straight to the middle of each mouth, across the whole width of the road.
                    let street = &town.network.streets[arm.street];
                    for across in -4..=4 {
                        let t = (0.24 * f64::from(across) + 0.013) * street.profile.kerb_t;
                        let (s, t) = street.at_node(arm.end, arm.mouth_m + 0.4, t);
                        let mouth = street.plan(s, t);
                        let mut last = None;
                        for i in 1..=60 {
                            let p = node.at.lerp(&mouth, f64::from(i) / 60.0);
                            let (class, height) = below(&town, &ground, &p).expect("ground");
                            assert!(
                                matches!(class, ClassId::Road | ClassId::RoadLine),
                                "{kind:?} node {number}: {class:?} at {height} m, {p}"
                            );
                            let step = last.map_or(0.0, |last: f64| (height - last).abs());
                            assert!(step < 0.03, "{kind:?} node {number}: a step of {step} m");
                            last = Some(height);
                            checked += 1;
                        }
                    }
                }
            }
            assert!(checked > 1000, "{checked}");
        }
    }

    #[test]
    fn ground_within_detail_radius_has_no_holes() {
        for (kind, seed) in [(Town::Urban, 5), (Town::Suburban, 6), (Town::Rural, 7), (Town::Motorway, 8)] {
            let (town, ground) = ground(kind, seed);
            let [low, high] = town.reach.bounds(DETAIL_RADIUS_M);
            let n = ((high - low) / 2.317).map(|v| v as usize);
            for (i, j) in (0..n.x).flat_map(|i| (0..n.y).map(move |j| (i, j))) {
                let p = low + Vector2::new(i as f64 + 0.37, j as f64 + 0.41) * 2.317;
                let is_canal = town.canals().iter().any(|canal| canal.covers(&p));
                if town.reach.is_near(&p, DETAIL_RADIUS_M) && !is_canal {
                    assert!(below(&town, &ground, &p).is_some(), "{kind:?}: a hole at {p}");
                }
            }
        }
    }
}
